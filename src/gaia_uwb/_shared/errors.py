"""Every error that GAIA raises on purpose; catch :class:`GaiaError` to catch them all."""

from __future__ import annotations

from pathlib import Path

from gaia_uwb._shared.text import in_a_line

_LONGEST_NAME = 400
_LONGEST_LINE = 1600


class GaiaError(Exception):
    r"""Base of all errors raised by GAIA; its text is one line written for the user.

    Parameters
    ----------
    text
        What is wrong and where. Unprintable characters are escaped, and the middle of a text that
        is too long for a line is left out: what it quotes may come from a corrupt file.

    Examples
    --------
    >>> from gaia_uwb import ConfigError
    >>> print(ConfigError("unknown setting 'a\nb'"), len(str(ConfigError("a" * 10_000))))
    unknown setting 'a\nb' 1603
    """

    __module__ = "gaia_uwb"

    def __init__(self, text: str) -> None:
        super().__init__(in_a_line(text, _LONGEST_LINE))


class ConfigError(GaiaError):
    """A setting is unknown, impossible, or contradicts another one."""

    __module__ = "gaia_uwb"


class SourceError(GaiaError):
    """A data source, data set or part of it was not found, or its name is not valid."""

    __module__ = "gaia_uwb"


class DownloadError(GaiaError):
    """A file could not be fetched, or its content is not what was expected."""

    __module__ = "gaia_uwb"


class InputError(GaiaError):
    """Data are wrong: the message says what was expected, what came, and where.

    Parameters
    ----------
    problem
        What is wrong, what was expected and what came.
    source
        The file (or a scene's name) that holds the bad value.
    row
        Line of a text file (the header is line 1) or row of a table (from 1).
    column
        The column's name.

    Examples
    --------
    >>> from gaia_uwb import InputError
    >>> print(InputError("expected a finite number, got 'abc'", source="ranges.csv", row=17,
    ...                  column="range_m"))
    ranges.csv, row 17, column range_m: expected a finite number, got 'abc'
    """

    __module__ = "gaia_uwb"

    def __init__(
        self,
        problem: str,
        *,
        source: str | Path | None = None,
        row: int | None = None,
        column: str | None = None,
    ) -> None:
        self.problem = problem
        self.source = source
        self.row = row
        self.column = column
        place = [] if source is None else [in_a_line(str(source), _LONGEST_NAME)]
        if row is not None:
            place.append(f"row {row}")
        if column is not None:
            place.append(f"column {in_a_line(column, _LONGEST_NAME)}")
        super().__init__(f"{', '.join(place)}: {problem}" if place else problem)
