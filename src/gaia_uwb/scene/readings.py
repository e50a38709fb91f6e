"""What the radios measured: the RangeLog of the tags, and ConeRanges among the cones."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gaia_uwb._shared import (
    Array,
    Float64,
    InputError,
    Int64,
    check_finite,
    check_increasing,
    check_shape,
    freeze,
)
from gaia_uwb.scene._unknown import freeze_known

_BLOCK = 1 << 20  # readings checked together, which bounds the memory


@dataclass(frozen=True)
class RangeLog:
    """UWB readings in the order of their time: one row per reading.

    Parameters
    ----------
    t_s : (R,)
        Time of each reading in the radio's clock, in seconds, not decreasing.
    anchor : (R,)
        Index of the anchor into the scene's ``anchor_ids``.
    range_m : (R,)
        Measured slant range, in metres. May be negative: radios report that for a spike.
    rssi_dbm, rssi_fp_dbm : (R,), optional
        Received power, and that of the first path, in dBm; NaN where a radio gave none.
    tag : (R,), optional
        Index into the scene's ``tags`` of the tag that took the reading.
    azimuth_rad : (R,), optional
        Angle of arrival: the direction of the anchor in the vehicle's frame, counter-clockwise from
        forward; NaN where there is none.
    azimuth_sigma_rad : (R,), optional
        Its standard deviation, above 0; NaN where unknown.

    Raises
    ------
    InputError
        If shapes disagree, a time or range is not finite, time decreases, a tag has two readings of
        an anchor at one time, or there are no readings.
    """

    t_s: Float64[Array, "R"]
    anchor: Int64[Array, "R"]
    range_m: Float64[Array, "R"]
    rssi_dbm: Float64[Array, "R"] | None = None
    rssi_fp_dbm: Float64[Array, "R"] | None = None
    tag: Int64[Array, "R"] | None = None
    azimuth_rad: Float64[Array, "R"] | None = None
    azimuth_sigma_rad: Float64[Array, "R"] | None = None

    def __post_init__(self) -> None:
        t_s = freeze(self, "t_s", self.t_s, np.float64)
        anchor = freeze(self, "anchor", self.anchor, np.int64)
        range_m = freeze(self, "range_m", self.range_m, np.float64)
        if t_s.ndim != 1 or not len(t_s):
            raise InputError("expected at least one range, got none", column="t_s")
        for name, array in (("anchor", anchor), ("range_m", range_m)):
            check_shape(name, array, t_s.shape)
        check_finite("t_s", t_s)
        check_finite("range_m", range_m)
        check_increasing("t_s", t_s, strictly=False)
        _check_indices("anchor", anchor)
        tag = None
        if self.tag is not None:
            tag = freeze(self, "tag", self.tag, np.int64)
            check_shape("tag", tag, t_s.shape)
            _check_indices("tag", tag)
        row = _first_repeat(t_s, anchor, tag)
        if row is not None:
            by = "" if tag is None else f" by tag {tag[row]}"
            problem = f"anchor {anchor[row]} has two readings{by} at {t_s[row]:.6f} s"
            raise InputError(problem, row=row + 1, column="t_s")
        for name in ("rssi_dbm", "rssi_fp_dbm"):
            if getattr(self, name) is not None:
                check_shape(name, freeze(self, name, getattr(self, name), np.float64), t_s.shape)
        freeze_known(self, "azimuth_rad", t_s.shape)
        sigma = freeze_known(self, "azimuth_sigma_rad", t_s.shape)
        if sigma is not None and self.azimuth_rad is None:
            raise InputError("needs azimuth_rad beside it", column="azimuth_sigma_rad")
        if sigma is not None and (sigma <= 0).any():
            row = int(np.argmax(sigma <= 0))
            problem = f"expected a number above 0 (NaN where unknown), got {sigma[row]:g}"
            raise InputError(problem, row=row + 1, column="azimuth_sigma_rad")

    def __len__(self) -> int:
        return len(self.t_s)


def _first_repeat(
    t_s: Float64[Array, "R"], anchor: Int64[Array, "R"], tag: Int64[Array, "R"] | None
) -> int | None:
    """Return the first row whose tag read its anchor before at that very time; time is in order."""
    start = 0
    while start < len(t_s):
        last_s = t_s[min(start + _BLOCK, len(t_s)) - 1]
        stop = int(np.searchsorted(t_s, last_s, side="right"))  # readings of one time stay together
        time, who = t_s[start:stop], anchor[start:stop]
        keys = (who, time) if tag is None else (tag[start:stop], who, time)
        order = np.lexsort(keys)
        same = np.logical_and.reduce([np.diff(key[order]) == 0 for key in keys])
        if same.any():
            return start + int(order[int(np.argmax(same)) + 1])
        start = stop
    return None


@dataclass(frozen=True)
class ConeRanges:
    """Ranges that the radios on the cones measured among themselves, in any order.

    Parameters
    ----------
    anchor_a, anchor_b : (M,)
        Indices of the two anchors into the scene's ``anchor_ids``.
    range_m : (M,)
        Measured slant range between them, in metres.
    t_s : (M,), optional
        Time of each range, in seconds, in the clock of the radios.

    Raises
    ------
    InputError
        If shapes disagree, a number is not finite, an anchor is ranged to itself, or there are no
        ranges.

    Examples
    --------
    >>> import numpy as np
    >>> len(ConeRanges(np.array([0, 1]), np.array([1, 2]), np.array([6.1, 5.9])))
    2
    """

    anchor_a: Int64[Array, "M"]
    anchor_b: Int64[Array, "M"]
    range_m: Float64[Array, "M"]
    t_s: Float64[Array, "M"] | None = None

    def __post_init__(self) -> None:
        range_m = freeze(self, "range_m", self.range_m, np.float64)
        if range_m.ndim != 1 or not len(range_m):
            raise InputError("expected at least one range, got none", column="range_m")
        check_finite("range_m", range_m)
        for name in ("anchor_a", "anchor_b"):
            indices = freeze(self, name, getattr(self, name), np.int64)
            check_shape(name, indices, range_m.shape)
            _check_indices(name, indices)
        same = self.anchor_a == self.anchor_b
        if same.any():
            row = int(np.argmax(same))
            problem = f"expected two anchors, got {self.anchor_a[row]} twice"
            raise InputError(problem, row=row + 1, column="anchor_b")
        if self.t_s is not None:
            t_s = freeze(self, "t_s", self.t_s, np.float64)
            check_shape("t_s", t_s, range_m.shape)
            check_finite("t_s", t_s)

    def __len__(self) -> int:
        return len(self.range_m)


def _check_indices(name: str, indices: Int64[Array, "R"]) -> None:
    if indices.min() < 0:
        raise InputError(f"expected indices from 0, got {indices.min()}", column=name)
