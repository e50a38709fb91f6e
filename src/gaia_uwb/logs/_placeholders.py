"""Numbers that radios write where they have no range: 0, -1, 65.535 m and the like.

Nothing at or below 0 is a range. A number above 0 is a placeholder if it stands exactly in more
than 10 % of an anchor's readings and is no distance that the vehicle can have had: the readings
jump to it and from it further than the vehicle drives meanwhile, or it is the largest of all and
stays the same while the vehicle drives on. A parked vehicle repeats its ranges without jumps, and
so does a radio that counts in whole decimetres.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gaia_uwb._shared import Array, Bool, Float64, Int64, counted, percent
from gaia_uwb.logs._table import Table
from gaia_uwb.logs._tags import sources

_SHARE = 0.1  # of an anchor's readings
_FEWEST = 10
_SAMPLE = 50_000  # readings in which repeated numbers are looked for
_MOST_VALUES = 20
_JUMP_M, _SOON_S = 2.0, 5.0
_FAR_M = 20.0  # driven while a number stays the same
_LARGEST = 0.99  # of the other readings are shorter
_HURRY = 1.5  # the speed near a reading may be above the usual one


@dataclass(frozen=True)
class Drive:
    """Where the vehicle was."""

    t_s: Float64[Array, "T"]
    position_m: Float64[Array, "T 2"]

    def at(self, t_s: Float64[Array, "K"]) -> Float64[Array, "K 2"]:
        """Return where the vehicle was at these times."""
        return np.column_stack([np.interp(t_s, self.t_s, axis) for axis in self.position_m.T])


def no_ranges(ranges: Table, drive: Drive) -> tuple[Bool[Array, "R"], list[str]]:
    """Return which readings are no ranges, and say which numbers that are.

    Parameters
    ----------
    ranges
        With the columns ``t_s``, ``anchor_id`` and ``range_m``.
    drive
        The path of the tag's antenna.

    Raises
    ------
    InputError
        If no reading is a range.
    """
    range_m, file = ranges["range_m"], ranges.path.name
    none = np.asarray(range_m <= 0.0)
    notes = []
    if none.any():
        readings = counted(int(none.sum()), "reading")
        notes.append(f"{file}: skipped {readings} of 0 m or less, which mean no range")
    for value in _placeholders(ranges, drive):
        these = range_m == value
        notes.append(
            f"{file}: skipped {counted(int(these.sum()), 'reading')} of exactly {value:.10g} m "
            f"({percent(float(these.mean()))}), which means no range: the readings jump to it and "
            "from it, or it stays the same while the vehicle drives on"
        )
        none |= these
    if none.all():
        what = ", ".join(f"{value:.10g}" for value in np.unique(range_m)[:3])
        problem = f"none of the {len(ranges):,} readings is a range: they are {what}"
        raise ranges.error(problem, column="range_m")
    return none, notes


def _placeholders(ranges: Table, drive: Drive) -> list[float]:
    """Return the numbers above 0 that mean no range."""
    anchor, t_s, range_m = sources(ranges), ranges["t_s"], ranges["range_m"]
    values = [v for v in _repeated(anchor, range_m) if (range_m == v).sum() >= _FEWEST]
    if not values:
        return []
    order = np.lexsort((t_s, anchor))
    order = order[range_m[order] > 0.0]
    readings = _InOrder(anchor[order], t_s[order], range_m[order])
    usual_mps = _speed_mps(drive)
    return [v for v in values if readings.jump_to(v, usual_mps) or readings.stay_at(v, drive)]


def _speed_mps(drive: Drive) -> float:
    """Return about the highest speed of the drive."""
    step_m = np.hypot(*np.diff(drive.position_m, axis=0).T)
    return float(np.quantile(step_m / np.diff(drive.t_s), 0.95))


def _repeated(anchor: Int64[Array, "R"], range_m: Float64[Array, "R"]) -> Sequence[float]:
    """Return numbers above 0 that may stand in more than 10 % of an anchor's readings."""
    every = len(range_m) // _SAMPLE + 1
    anchor, range_m = anchor[::every], range_m[::every]
    anchor, range_m = anchor[range_m > 0.0], range_m[range_m > 0.0]
    if not len(range_m):
        return ()
    order = np.lexsort((range_m, anchor))
    new = np.append(True, (np.diff(range_m[order]) != 0) | (np.diff(anchor[order]) != 0))
    starts = np.flatnonzero(new)
    count = np.diff(np.append(starts, len(order)))
    of_anchor = np.bincount(anchor)
    often = count > _SHARE * of_anchor[anchor[order[starts]]]
    often &= count >= 2
    values, index = np.unique(range_m[order[starts[often]]], return_inverse=True)
    total = np.bincount(index, weights=count[often], minlength=len(values))
    return [float(value) for value in values[np.argsort(-total)][:_MOST_VALUES]]


@dataclass(frozen=True)
class _InOrder:
    """The readings, anchor by anchor in the order of time."""

    anchor: Int64[Array, "R"]
    t_s: Float64[Array, "R"]
    range_m: Float64[Array, "R"]

    def jump_to(self, value: float, usual_mps: float) -> bool:
        """Tell whether most changes to and from a number are faster than the vehicle drives."""
        same = self.range_m == value
        step_s = np.diff(self.t_s)
        change = (same[1:] != same[:-1]) & (np.diff(self.anchor) == 0) & (step_s <= _SOON_S)
        if change.sum() < 2:
            return False
        most_m = _JUMP_M + _HURRY * usual_mps * step_s[change]
        return bool((np.abs(np.diff(self.range_m))[change] > most_m).mean() > 0.5)

    def stay_at(self, value: float, drive: Drive) -> bool:
        """Tell whether a number is the largest, and the same while the vehicle drives on."""
        same = self.range_m == value
        others = self.range_m[~same]
        if others.size and np.mean(others < value) < _LARGEST:
            return False
        new = np.append(True, (np.diff(same.astype(np.int8)) != 0) | (np.diff(self.anchor) != 0))
        starts = np.flatnonzero(new)
        ends = np.append(starts[1:], len(same)) - 1
        starts, ends = starts[same[starts]], ends[same[starts]]
        first_m, last_m = (
            np.column_stack(
                [np.interp(self.t_s[at], drive.t_s, axis) for axis in drive.position_m.T]
            )
            for at in (starts, ends)
        )
        driven_m = np.hypot(*(last_m - first_m).T)
        held = ends - starts + 1
        return bool(held[driven_m > _FAR_M].sum() > 0.5 * same.sum())
