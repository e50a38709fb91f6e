"""Settings of many passes at once, so that one formula computes all of them.

A setting that all passes share stays a number; one that varies is a column (R, 1) with one row per
pass, or per anchor after :meth:`PassRows.at`. Both work in the same formulas with arrays (R, P),
and a pass made alone has numbers only, like a :class:`~gaia_uwb.simulate.PassConfig`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any, TypeAlias

import numpy as np

from gaia_uwb._shared import Array, Int64
from gaia_uwb.simulate.settings import SECTIONS, Choice, PassConfig


class SectionRows(SimpleNamespace):
    """One section's settings, each by its name: a number, a text, a flag, or a column of them."""

    def at(self, rows: Int64[Array, "R"]) -> SectionRows:
        """Return the settings of these rows, which may repeat."""
        return SectionRows(**{
            name: _as_column(value[rows, 0]) if isinstance(value, np.ndarray) else value
            for name, value in vars(self).items()
        })  # fmt: skip


@dataclass(frozen=True)
class PassRows:
    """Settings of several passes.

    Parameters
    ----------
    road, closure, drive, ranging
        Their sections.

    Examples
    --------
    >>> config = PassConfig(vary={"drive.speed_mps": [5.0, 9.0]})
    >>> passes = PassRows.of(config, [{"drive.speed_mps": 6.0}, {"drive.speed_mps": 8.5}])
    >>> passes.drive.duration_s, passes.drive.speed_mps.tolist()
    (60.0, [[6.0], [8.5]])
    """

    road: SectionRows
    closure: SectionRows
    drive: SectionRows
    ranging: SectionRows

    @classmethod
    def of(cls, config: PassConfig, drawn: Sequence[Mapping[str, Choice]]) -> PassRows:
        """Return the settings of passes.

        Parameters
        ----------
        config
            Settings of the batch.
        drawn
            For each pass, what was drawn for the settings that vary: ``section.setting`` to value.
        """
        sections = {name: dict(vars(getattr(config, name))) for name in SECTIONS}
        for key in config.vary:
            section, _, setting = key.partition(".")
            sections[section][setting] = _as_column(np.array([values[key] for values in drawn]))
        return cls(**{name: SectionRows(**content) for name, content in sections.items()})

    def at(self, rows: Int64[Array, "R"]) -> PassRows:
        """Return the settings of these passes, which may repeat: of each anchor's, for example."""
        return PassRows(self.road.at(rows), self.closure.at(rows), self.drive.at(rows),
                        self.ranging.at(rows))  # fmt: skip


PassSettings: TypeAlias = PassConfig | PassRows
"""Settings of one pass, or of the pass of each row."""


def at(value: Any, rows: Int64[Array, "R"]) -> Any:
    """Return the values of some rows: of a column its own, of a number the number.

    Parameters
    ----------
    value
        A number, or a column (N, 1).
    rows : (R,)
        Which rows.
    """
    return value[rows, 0] if isinstance(value, np.ndarray) else value


def each(value: Any, n: int) -> Array:
    """Return a setting's values for n rows as an array (n,).

    Parameters
    ----------
    value
        A number, or a column (n, 1).
    n
        Number of rows.
    """
    return np.broadcast_to(value, (n, 1))[:, 0]


def _as_column(values: Array) -> Any:
    """Return values as a column, or as a number if they are all the same."""
    return values[0].item() if (values == values[0]).all() else values[:, None]
