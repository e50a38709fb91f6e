"""What a log holds: Trajectory, RangeLog, Truth, and the Scene made of them.

All are frozen and checked when built, so code that receives one need not check it again. Positions
are (east, north) in metres in the scene's local frame; a :class:`LocalFrame` ties that frame to
WGS84 where it is known. What is known of the truth (surveyed anchors, NLOS labels, true ranges)
lives in :class:`Truth`, which only simulators, loaders and scores touch.

>>> import numpy as np
>>> from gaia_uwb.scene import RangeLog, Scene, Trajectory
>>> drive = Trajectory(t_s=np.array([0.0, 1.0]), position_m=np.array([[0.0, 0.0], [10.0, 0.0]]))
>>> log = RangeLog(t_s=np.array([0.2, 0.4]), anchor=np.array([0, 0]),
...                range_m=np.array([12.0, 10.5]))
>>> Scene(name="pass", trajectory=drive, ranges=log, anchor_ids=("cone-1",)).n_anchors
1
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from gaia_uwb._shared import (
    Array,
    Bool,
    Float64,
    InputError,
    Int64,
    check_finite,
    check_heights,
    check_ids,
    check_increasing,
    check_shape,
    freeze,
)

_BLOCK = 1 << 20  # readings checked together, which bounds the memory


@dataclass(frozen=True)
class LocalFrame:
    """Where the local frame's origin lies on Earth: its axes point east, north and up there.

    Parameters
    ----------
    lat_deg, lon_deg
        WGS84 latitude and longitude of the origin, in degrees.
    alt_m
        Ellipsoidal height of the origin, in metres.

    Raises
    ------
    InputError
        If a number is not finite or lies outside [-90, 90] (latitude), [-180, 180] (longitude) or
        [-1e5, 1e5] (height).
    """

    lat_deg: float
    lon_deg: float
    alt_m: float = 0.0

    def __post_init__(self) -> None:
        for name, bound in (("lat_deg", 90.0), ("lon_deg", 180.0), ("alt_m", 1e5)):
            value = getattr(self, name)
            if not (np.isfinite(value) and abs(value) <= bound):
                raise InputError(
                    f"expected a number between {-bound:g} and {bound:g}, got {value}", column=name
                )


@dataclass(frozen=True)
class Trajectory:
    """The tag antenna's known path.

    Parameters
    ----------
    t_s : (T,)
        Strictly increasing time of the trajectory's clock, in seconds.
    position_m : (T, 2)
        East and north of the tag's antenna, in metres.
    up_m : (T,), optional
        Height of the tag's antenna in the local frame, in metres; ``None`` where heights are
        unknown (then every distance is taken as horizontal).

    Raises
    ------
    InputError
        If shapes disagree, a number is not finite, time does not increase, or there are fewer
        than 2 samples.
    """

    t_s: Float64[Array, "T"]
    position_m: Float64[Array, "T 2"]
    up_m: Float64[Array, "T"] | None = None

    def __post_init__(self) -> None:
        t_s = freeze(self, "t_s", self.t_s, np.float64)
        position = freeze(self, "position_m", self.position_m, np.float64)
        if t_s.ndim != 1 or len(t_s) < 2:
            raise InputError(f"expected at least 2 samples, got {t_s.size}", column="t_s")
        check_shape("position_m", position, (len(t_s), 2))
        check_finite("t_s", t_s)
        check_finite("position_m", position)
        check_increasing("t_s", t_s, strictly=True)
        if self.up_m is not None:
            up = freeze(self, "up_m", self.up_m, np.float64)
            check_shape("up_m", up, t_s.shape)
            check_finite("up_m", up)

    def __len__(self) -> int:
        return len(self.t_s)

    @property
    def position_noise_m(self) -> float:
        """White noise of the positions along each axis, in metres, by how they bend."""
        bend_m = np.diff(self.position_m, n=2, axis=0)  # of white noise: 6 times its variance
        return 1.4826 * float(np.median(np.abs(bend_m))) / np.sqrt(6.0) if len(bend_m) else 0.0

    @property
    def path_length_m(self) -> float:
        """Length of the path, in metres."""
        return float(np.hypot(*np.diff(self.position_m, axis=0).T).sum())


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

    Raises
    ------
    InputError
        If shapes disagree, a time or range is not finite, time decreases, an anchor has two
        readings at one time, or there are no readings.
    """

    t_s: Float64[Array, "R"]
    anchor: Int64[Array, "R"]
    range_m: Float64[Array, "R"]
    rssi_dbm: Float64[Array, "R"] | None = None
    rssi_fp_dbm: Float64[Array, "R"] | None = None

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
        if anchor.min() < 0:
            raise InputError(f"expected indices from 0, got {anchor.min()}", column="anchor")
        row = _first_repeat(t_s, anchor)
        if row is not None:
            problem = f"anchor {anchor[row]} has two readings at {t_s[row]:.6f} s"
            raise InputError(problem, row=row + 1, column="t_s")
        for name in ("rssi_dbm", "rssi_fp_dbm"):
            if getattr(self, name) is not None:
                check_shape(name, freeze(self, name, getattr(self, name), np.float64), t_s.shape)

    def __len__(self) -> int:
        return len(self.t_s)


def _first_repeat(t_s: Float64[Array, "R"], anchor: Int64[Array, "R"]) -> int | None:
    """Return the first row whose anchor was read before at that very time; time is in order."""
    start = 0
    while start < len(t_s):
        last_s = t_s[min(start + _BLOCK, len(t_s)) - 1]
        stop = int(np.searchsorted(t_s, last_s, side="right"))  # readings of one time stay together
        time, who = t_s[start:stop], anchor[start:stop]
        order = np.lexsort((who, time))
        same = (np.diff(time[order]) == 0) & (np.diff(who[order]) == 0)
        if same.any():
            return start + int(order[int(np.argmax(same)) + 1])
        start = stop
    return None


@dataclass(frozen=True)
class Truth:
    """What a survey or a simulator knows of a scene; scores read it, reconstructions never do.

    Parameters
    ----------
    anchor_m : (N, 2)
        True east and north of the anchors, in metres.
    nlos : (R,), optional
        True where a reading had no line of sight.
    range_m : (R,), optional
        True slant range of each reading, where a simulator knows it.
    clock_offset_s : float, optional
        True offset: a reading stamped t belongs to the trajectory at t minus this.
    outlier : (R,), optional
        True where a spike's offset is in a reading.
    bias_m : (R,), optional
        The systematic part of each reading's error, in metres: what is neither noise nor a spike.

    Raises
    ------
    InputError
        If ``anchor_m`` is not of shape (N, 2), or a number is not finite.
    """

    anchor_m: Float64[Array, "N 2"]
    nlos: Bool[Array, "R"] | None = None
    range_m: Float64[Array, "R"] | None = None
    clock_offset_s: float | None = None
    outlier: Bool[Array, "R"] | None = None
    bias_m: Float64[Array, "R"] | None = None

    def __post_init__(self) -> None:
        anchor_m = freeze(self, "anchor_m", self.anchor_m, np.float64)
        if anchor_m.ndim != 2 or anchor_m.shape[1] != 2:
            raise InputError(f"expected shape (N, 2), got {anchor_m.shape}", column="anchor_m")
        check_finite("anchor_m", anchor_m)
        for name in ("nlos", "outlier"):
            if getattr(self, name) is not None:
                freeze(self, name, getattr(self, name), np.bool_)
        for name in ("range_m", "bias_m"):
            if getattr(self, name) is not None:
                check_finite(name, freeze(self, name, getattr(self, name), np.float64))


@dataclass(frozen=True)
class Scene:
    """One drive past a work zone: the path, the ranges, and what is known beforehand.

    Parameters
    ----------
    name
        What to call it in messages and results.
    trajectory, ranges
        The path of the tag's antenna and the readings.
    anchor_ids
        Unique names of the anchors; ``ranges.anchor`` points into them.
    anchor_up_m : (N,), optional
        Antenna heights of the anchors in the local frame, in metres; NaN where unknown.
    frame
        Ties the local frame to WGS84, where known.
    truth
        The survey or the simulator's truth, for scores only.
    notes
        What the reader took, guessed and left out, a sentence each; they stay with the log up to
        its result.
    problems
        What the reader found that will spoil a result, a sentence each: no result of this log is
        reliable.

    Raises
    ------
    InputError
        If ids are empty or not unique, a reading points outside them, or shapes disagree.
    """

    name: str
    trajectory: Trajectory
    ranges: RangeLog
    anchor_ids: tuple[str, ...]
    anchor_up_m: Float64[Array, "N"] | None = None
    frame: LocalFrame | None = None
    truth: Truth | None = field(default=None, repr=False)
    notes: tuple[str, ...] = ()
    problems: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        check_ids(self.anchor_ids, source=self.name)
        n, last = len(self.anchor_ids), int(self.ranges.anchor.max())
        if last >= n:
            raise InputError(
                f"a reading refers to anchor {last}, but there are {n} anchors, numbered from 0",
                source=self.name,
                column="anchor",
            )
        if self.anchor_up_m is not None:
            up = freeze(self, "anchor_up_m", self.anchor_up_m, np.float64)
            check_heights("anchor_up_m", up, n, source=self.name)
        if self.truth is not None:
            check_shape("truth.anchor_m", self.truth.anchor_m, (n, 2), source=self.name)
            for name in ("nlos", "range_m", "outlier", "bias_m"):
                values = getattr(self.truth, name)
                if values is not None:
                    check_shape(f"truth.{name}", values, (len(self.ranges),), source=self.name)

    @property
    def n_anchors(self) -> int:
        """Number of anchors."""
        return len(self.anchor_ids)

    def without_truth(self) -> Scene:
        """Return the same scene with nothing of the truth in it."""
        return replace(self, truth=None)

    def _repr_html_(self) -> str:
        """Return what a notebook shows: what the log holds, without the truth."""
        from gaia_uwb._shared import sketch, summary

        drive, log = self.trajectory, self.ranges
        facts = [
            f"path: {len(drive)} samples in {drive.t_s[-1] - drive.t_s[0]:.1f} s, "
            f"{drive.path_length_m:.1f} m long",
            f"{len(log)} readings of {self.n_anchors} cones, "
            f"{'tied to WGS84' if self.frame else 'in local metres'}",
            *self.problems,
            *(f"note: {note}" for note in self.notes),
        ]
        rows = []
        for n, anchor_id in enumerate(self.anchor_ids):
            range_m = log.range_m[log.anchor == n]
            span = f"{range_m.min():.2f} to {range_m.max():.2f}" if len(range_m) else ""
            rows.append([anchor_id, str(len(range_m)), span])
        head = ("cone", "readings", "range (m)")
        return summary(self.name, facts, sketch(drive.position_m), head=head, rows=rows)
