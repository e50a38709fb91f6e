"""One loop over the stamped lines of a serial log, whatever device wrote them."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from gaia_uwb._shared import InputError, counted, shown
from gaia_uwb.logs._lever_arm import TagInput
from gaia_uwb.logs._logs import LogRows, LogTable, read_lines
from gaia_uwb.logs._selection import Wanted, Where, is_missing
from gaia_uwb.logs._stamps import StampOptions, Stamps
from gaia_uwb.logs._tags import WHERE_THEY_ARE, TagPlaces, arms_wanted
from gaia_uwb.logs.serial.device import Device, SerialReading
from gaia_uwb.logs.serial.dwm1001 import Dwm1001
from gaia_uwb.logs.serial.dwm3001 import Dwm3001
from gaia_uwb.logs.serial.mauwb import MaUwb
from gaia_uwb.logs.serial.trek1000 import Trek1000

DEVICES: dict[str, type[Device]] = {
    device.name: device for device in (Dwm1001, Trek1000, MaUwb, Dwm3001)
}
"""The devices whose logs are read, by their names in ``gaia.yaml``."""

_GIVE_UP_LINES = 200_000
_ENOUGH_LINES = 1_000
_MOST_TAGS = 100
_ESCAPES = re.compile(r"\x1b\[[0-9;?]{0,20}[A-Za-z]", re.ASCII)  # a terminal's colours


@dataclass
class _Count:
    """Lines and readings that give nothing, and the first of each kind."""

    n_broken: int = 0
    first_broken: int = 0
    n_without_stamp: int = 0
    n_other_stamp: int = 0
    other_stamp: tuple[int, str] = (0, "")
    n_missing: int = 0
    n_left_out: int = 0
    tags: Counter[str] = field(default_factory=Counter)


def read_serial(  # each is a key of gaia.yaml
    path: Path,
    device: str | None = None,
    options: StampOptions | None = None,
    *,
    where: Where | None = None,
    missing: Sequence[float] = (),
    near_s: float | None = None,
    tags: Mapping[str, TagInput] | None = None,
) -> tuple[LogTable, list[str]]:
    """Read the ranges of a tag's serial log.

    Parameters
    ----------
    path
        Text file of stamped lines; lines without ranges are ignored.
    device
        A name in :data:`DEVICES`; ``None`` finds it by what the lines look like.
    options
        How to read the stamps.
    where
        Which tag's ranges count, where lines name the tag.
    missing
        Numbers that mean "no range", in the device's unit.
    near_s
        A time of the same drive, in seconds since 1970, for stamps without a date or a year.
    tags
        Tag's id -> where it is on the vehicle, if that is given.

    Returns
    -------
    LogTable
        ``t_s`` in seconds, ``anchor_id``, ``range_m`` in metres, ``rssi_dbm`` in dBm where the
        device reports it, and ``tag_id`` where its lines name the tag.
    list of str
        Notes: what was taken, and how many lines were left out.

    Raises
    ------
    InputError
        If the file cannot be read or contains no ranges, or those of several tags of which it is
        not given where they are.
    """
    kind = _find_device(path) if device is None else DEVICES[device]
    wanted = Wanted(where or {})
    for word in wanted.fields:
        if word not in kind.tag_words:
            known = " or ".join(kind.tag_words) or "nothing, as its lines name no tag"
            raise InputError(f"where: a {kind.name} log is chosen by {known}", source=path)
    log = _Log(path, kind(), Stamps(options, near_s), wanted, missing)
    rows, count = log.read()
    if not len(rows):
        raise _no_ranges(path, kind, count, log.stamps)
    if len(count.tags) > 1 and not tags:
        raise InputError(_several_tags(kind, count), source=path)
    log.stamps.check(path)
    notes = [f"{path.name}: {kind.name}, {log.taken}", *_notes(path, count, log.stamps)]
    table = rows.table()
    if np.isnan(table["rssi_dbm"]).all():
        kept = {name: values for name, values in table.columns.items() if name != "rssi_dbm"}
        table = replace(table, columns=kept)
    return table, notes


class _Log:
    """The lines of one log, in their order."""

    def __init__(
        self,
        path: Path,
        device: Device,
        stamps: Stamps,
        wanted: Wanted,
        missing: Sequence[float],
    ) -> None:
        self.stamps = stamps
        self._path = path
        self._device = device
        self._wanted = wanted
        self._missing = missing
        self._count = _Count()
        self._last_s: float | None = None
        names, tagged = ("t_s", "range_m", "rssi_dbm"), bool(device.tag_words)
        self._rows = {raw: LogRows(path, names, tagged=tagged) for raw in (False, True)}

    @property
    def taken(self) -> str:
        """What was taken of each line, for a note."""
        raw = self._device.taken + ", as measured (there are no corrected ones)"
        return self._device.taken if len(self._rows[False]) else raw

    def read(self) -> tuple[LogRows, _Count]:
        """Return the readings, and the counts of lines that give none."""
        for number, line in read_lines(self._path):
            text = _ESCAPES.sub("", line) if "\x1b" in line else line
            start = self._device.start.search(text)
            if start is not None:
                self._line(number, text[: start.start()], text[start.start() :])
            if number >= _GIVE_UP_LINES and not any(map(len, self._rows.values())):
                break
        corrected = self._rows[False]
        return corrected if len(corrected) else self._rows[True], self._count

    def _line(self, number: int, stamp: str, content: str) -> None:
        count, readings = self._count, self._device.read(content)
        if readings is None:
            count.n_broken += 1
            count.first_broken = count.first_broken or number
            return
        if stamp or not self._device.stamped_once:
            self._last_s = self.stamps.read(stamp) if stamp else None
            if self._last_s is None and stamp:
                count.n_other_stamp += 1
                count.other_stamp = count.other_stamp if count.other_stamp[0] else (number, stamp)
        if self._last_s is None:
            count.n_without_stamp += not stamp
            return
        for reading in readings:
            self._add(number, self._last_s, reading)

    def _add(self, number: int, t_s: float, reading: SerialReading) -> None:
        count = self._count
        if reading.tag_id is not None:
            if not all(self._wanted.accepts(w, reading.tag_id) for w in self._wanted.fields):
                count.n_left_out += 1
                return
            if not self._wanted.fields and (
                reading.tag_id in count.tags or len(count.tags) < _MOST_TAGS
            ):
                count.tags[reading.tag_id] += 1
        if self._missing and is_missing(reading.value, self._missing):
            count.n_missing += 1
            return
        values = (t_s, reading.value * self._device.metres, reading.rssi_dbm)
        self._rows[reading.raw].add(number, values, reading.anchor_id, reading.tag_id or "")


def _find_device(path: Path) -> type[Device]:
    """Return the device whose lines a log holds.

    Raises
    ------
    InputError
        If there are none, or those of several.
    """
    found = _devices_in(path)
    if len(found) > 1:
        names = " and ".join(device.name for device in found)
        raise InputError(f"has lines of {names}: name one as format", source=path)
    if not found:
        known = "; ".join(f"{device.name}: {device.lines}" for device in DEVICES.values())
        raise InputError(f"has no lines of a device that is read ({known})", source=path)
    return found[0]


def _devices_in(path: Path) -> list[type[Device]]:
    """Return the devices of which a log has whole lines with ranges."""
    devices, n_whole = {kind: kind() for kind in DEVICES.values()}, Counter[type[Device]]()
    for number, line in read_lines(path):
        text = _ESCAPES.sub("", line) if "\x1b" in line else line
        for kind, device in devices.items():
            start = kind.start.search(text)
            if start is not None and device.read(text[start.start() :]):
                n_whole[kind] += 1
        if number >= _GIVE_UP_LINES or n_whole.total() >= _ENOUGH_LINES:
            break
    return [kind for kind in devices if n_whole[kind]]


def _no_ranges(path: Path, kind: type[Device], count: _Count, stamps: Stamps) -> InputError:
    """Return the error that says why a log gave no range."""
    others = [device for device in _devices_in(path) if device is not kind]
    number, stamp = count.other_stamp
    if others:
        name = others[0].name
        problem = f"contains no {kind.lines}, but lines of {name}: set format: {name}"
        return InputError(problem, source=path)
    if number:
        problem = f"the stamps before its lines are in a form that is not read: {shown(stamp[:60])}"
        how = stamps.way_out(stamp) or " (docs/inputs.md lists the forms)"
        return InputError(f"{problem}{how}", source=path, row=number)
    if count.n_without_stamp:
        problem = "its lines have no host time: log them as 'SECONDS LINE', for example with ts %.s"
    elif count.n_broken:
        problem = "all lines with ranges are broken"
        return InputError(problem, source=path, row=count.first_broken)
    elif count.n_left_out:
        problem = f"none of its {count.n_left_out:,} readings is of the tag that where names"
    elif count.n_missing:
        problem = f"all of its {count.n_missing:,} readings are missing, as gaia.yaml says"
    else:
        problem = f"contains no {kind.lines}"
    return InputError(problem, source=path)


def _several_tags(kind: type[Device], count: _Count) -> str:
    word = kind.tag_words[0]
    tags = ", ".join(f"{tag} ({n:,} readings)" for tag, n in sorted(count.tags.items())[:10])
    first = min(count.tags, key=lambda tag: (-count.tags[tag], tag))
    return (
        f"has the ranges of several tags, {word} {tags}: {WHERE_THEY_ARE}{arms_wanted(first)}, "
        f"or take one by where: {{{word}: {first}}} in {TagPlaces({}).entry}"
    )


def _notes(path: Path, count: _Count, stamps: Stamps) -> list[str]:
    notes = []
    if stamps.first_day is not None:
        notes.append(f"{path.name}: first day {stamps.first_day}, from the trajectory")
    if count.n_broken or count.n_other_stamp:
        number, stamp = count.other_stamp
        first = min(filter(None, (count.first_broken, number)))
        broken = counted(count.n_broken + count.n_other_stamp, "broken line")
        form = f"; {count.n_other_stamp:,} after no stamp but {shown(stamp[:60])}" if stamp else ""
        notes.append(f"{path.name}: skipped {broken}, the first is line {first}{form}")
    if count.n_without_stamp:
        lines = counted(count.n_without_stamp, "line")
        notes.append(f"{path.name}: skipped {lines} without a stamp")
    if count.n_left_out:
        readings = counted(count.n_left_out, "reading")
        notes.append(f"{path.name}: skipped {readings} of other tags")
    if count.n_missing:
        readings = counted(count.n_missing, "reading")
        notes.append(f"{path.name}: skipped {readings} that are missing")
    return notes
