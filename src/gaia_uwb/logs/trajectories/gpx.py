"""GPX tracks (1.0 and 1.1) of phones, loggers and receivers.

Read as a stream by the standard library's expat and not by gpxpy, which keeps 20 bytes for each of
the file's and nothing of a track that was cut off.
"""

from __future__ import annotations

import math
from pathlib import Path
from xml.parsers import expat

from gaia_uwb._shared import InputError, counted, open_regular
from gaia_uwb.logs._dates import seconds_of
from gaia_uwb.logs._logs import LogRows, LogTable, check_file

_MAX_BYTES = 128 * 2**20
_MAX_DEPTH = 100
_CHUNK_BYTES = 2**16
_MAX_TEXT = 200
_CUT_OFF = frozenset(
    expat.errors.codes[text]
    for text in (
        expat.errors.XML_ERROR_NO_ELEMENTS,
        expat.errors.XML_ERROR_UNCLOSED_TOKEN,
        expat.errors.XML_ERROR_PARTIAL_CHAR,
        expat.errors.XML_ERROR_UNCLOSED_CDATA_SECTION,
    )
)


def read_gpx(path: Path) -> tuple[LogTable, list[str]]:
    """Read the tracks of a GPX file, all segments as one drive.

    Parameters
    ----------
    path
        The file; waypoints and routes are ignored.

    Returns
    -------
    LogTable
        ``t_s`` in seconds, ``lat`` and ``lon`` in degrees, and ``alt_m`` in metres where all points
        have it.
    list of str
        Notes on what was left out.

    Raises
    ------
    InputError
        If the file cannot be read, is no GPX, declares entities, or has no track point with a time.
    """
    check_file(path, _MAX_BYTES)
    track = _Track(path)
    cut_off = track.read()
    if not len(track.rows):
        raise track.nothing()
    table = track.rows.table()
    columns = dict(table.columns)
    notes = []
    if cut_off:
        notes.append(f"{path.name}: is cut off in line {cut_off}: read up to there")
    for number, problem in (
        (track.n_broken, "with a wrong time or place"),
        (track.n_no_time, "without time"),
    ):
        if number:
            notes.append(f"{path.name}: skipped {counted(number, 'track point')} {problem}")
    if track.n_no_height:
        points = counted(track.n_no_height, "track point")
        notes.append(f"{path.name}: heights ignored, as {points} had none")
        del columns["alt_m"]
    return LogTable(**{**vars(table), "columns": columns}), notes


class _Track:
    """What expat calls while it reads a file."""

    def __init__(self, path: Path) -> None:
        self.rows = LogRows(path, ("t_s", "lat", "lon", "alt_m"))
        self.n_broken = self.n_no_time = self.n_no_height = 0
        self._path = path
        self._open: list[str] = []
        self._point: dict[str, str] | None = None
        self._depth = self._line = self._first_point = 0
        self._text = ""
        self._parser = expat.ParserCreate()
        self._parser.buffer_text = True
        self._parser.StartElementHandler = self._start
        self._parser.EndElementHandler = self._end
        self._parser.CharacterDataHandler = self._characters
        self._parser.StartDoctypeDeclHandler = self._doctype

    def read(self) -> int:
        """Read the file; return the line in which it is cut off, 0 if it is whole."""
        try:
            with open_regular(self._path) as file:
                while chunk := file.read(_CHUNK_BYTES):
                    self._parser.Parse(chunk, False)
            self._parser.Parse(b"", True)
        except expat.ExpatError as error:
            if error.code in _CUT_OFF and len(self.rows):
                return error.lineno
            reason = expat.ErrorString(error.code)
            raise InputError(
                f"is no XML that can be read: {reason}", source=self._path, row=error.lineno
            ) from error
        except (LookupError, ValueError) as error:  # an encoding that is not known
            raise InputError(f"is no XML that can be read: {error}", source=self._path) from error
        except OSError as error:
            problem = f"cannot be read: {error.strerror or error}"
            raise InputError(problem, source=self._path) from error
        return 0

    def nothing(self) -> InputError:
        """Return why no point could be used."""
        if self.n_no_time:
            problem = "its track points have no <time>: a drive needs the time of each point"
        elif self.n_broken:
            problem = "all its track points are broken (lat, lon or time)"
        else:
            problem = "contains no track points (<trkpt>)"
        return InputError(problem, source=self._path, row=self._first_point or None)

    def _doctype(self, *_: object) -> None:
        problem = "declares a document type, which GPX has not and which may hide a bomb"
        raise InputError(problem, source=self._path, row=self._parser.CurrentLineNumber)

    def _start(self, name: str, attributes: dict[str, str]) -> None:
        name = name.rpartition(":")[2]
        if not self._open and name != "gpx":
            raise InputError(f"is no GPX: it starts with <{name[:40]}>", source=self._path, row=1)
        self._open.append(name)
        if len(self._open) > _MAX_DEPTH:
            raise InputError("is nested too deeply", source=self._path)
        if name == "trkpt":
            self._depth, self._line = len(self._open), self._parser.CurrentLineNumber
            self._first_point = self._first_point or self._line
            self._point = {key: attributes.get(key, "") for key in ("lat", "lon")}
        self._text = ""

    def _characters(self, text: str) -> None:
        if self._point is not None and len(self._text) < _MAX_TEXT:
            self._text += text[:_MAX_TEXT]

    def _end(self, name: str) -> None:
        depth, _ = len(self._open), self._open.pop()
        if self._point is None:
            return
        if depth == self._depth:
            self._add(self._point)
            self._point = None
        elif depth == self._depth + 1:
            self._point[name.rpartition(":")[2]] = self._text.strip()

    def _add(self, point: dict[str, str]) -> None:
        if "time" not in point:
            self.n_no_time += 1
            return
        t_s, lat, lon = seconds_of(point["time"]), _number(point["lat"]), _number(point["lon"])
        if t_s is None or not math.isfinite(lat + lon):
            self.n_broken += 1
            return
        alt_m = _number(point.get("ele", ""))
        self.n_no_height += not math.isfinite(alt_m)
        self.rows.add(self._line, (t_s, lat, lon, alt_m))


def _number(text: str) -> float:
    """Return a number, NaN if it is none."""
    try:
        return float(text) if "_" not in text else math.nan
    except ValueError:
        return math.nan
