"""What alignment makes of a Scene: an Episode on one timeline, and what a denoiser makes of it.

A reading that is missing, gated or too far from its neighbours is NaN and not ``valid``; every
other number is finite. ``Episode.window`` and ``Episode.windows`` cut a run into shorter episodes
without copying it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import astuple, dataclass, field, replace

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
from gaia_uwb.estimate import Reason
from gaia_uwb.scene import ConeRanges, LocalFrame, Tag, Trajectory

_END_S = 0.5  # of a path's end, from which it is continued


@dataclass(frozen=True)
class ClockOffset:
    """How far the radio's clock is off the trajectory's, and how well that is known.

    Parameters
    ----------
    offset_s
        A range stamped t belongs to the trajectory at ``t - offset_s``.
    sigma_s
        Standard deviation of what remains between the clocks: of the estimate where it is applied,
        of what was left uncorrected where it is not.
    applied
        Whether the ranges were shifted by it.
    reason
        Why it was or was not applied, in words.

    Raises
    ------
    InputError
        If a number is not finite, or ``sigma_s`` is negative.
    """

    offset_s: float
    sigma_s: float
    applied: bool
    reason: str

    def __post_init__(self) -> None:
        if not (np.isfinite(self.offset_s) and np.isfinite(self.sigma_s) and self.sigma_s >= 0):
            raise InputError(
                f"expected a finite offset and a sigma of at least 0, got {self.offset_s} and "
                f"{self.sigma_s}",
                column="clock",
            )

    @property
    def applied_s(self) -> float:
        """The shift that the ranges really got, in seconds."""
        return self.offset_s if self.applied else 0.0


@dataclass(frozen=True)
class RangeCalibration:
    """What a whole log shows about its radios' errors, without any truth (``calibration.py``).

    The bias (measured minus true) of a range d is ``b0 + b1 log10(d / 10 m)``.

    Parameters
    ----------
    bias : (2,)
        b0 in metres and b1 in metres per factor of ten.
    covariance : (2, 2)
        Covariance of ``bias``.
    sigma_m
        Robust standard deviation of the errors that are left.
    correlation
        How many neighbouring ranges are worth one: the errors' correlation summed over time, in
        steps of the timeline, at least 1.

    Raises
    ------
    InputError
        If shapes are wrong, a number is not finite, ``sigma_m`` is not above 0 or ``correlation``
        is below 1.
    """

    bias: Float64[Array, "2"]
    covariance: Float64[Array, "2 2"]
    sigma_m: float
    correlation: float

    def __post_init__(self) -> None:
        for name, shape in (("bias", (2,)), ("covariance", (2, 2))):
            array = freeze(self, name, getattr(self, name), np.float64)
            check_shape(name, array, shape)
            check_finite(name, array)
        if not (0 < self.sigma_m < np.inf and 1 <= self.correlation < np.inf):
            raise InputError(
                "expected sigma_m above 0 and correlation of at least 1, got "
                f"{self.sigma_m} and {self.correlation}",
                column="calibration",
            )

    def bias_m(self, range_m: Float64[Array, "*shape"]) -> Float64[Array, "*shape"]:
        """Return the bias of ranges of this length, in metres; NaN stays NaN."""
        bias_m = _decades(range_m)
        bias_m *= self.bias[1]
        bias_m += self.bias[0]
        return bias_m


def bias_basis(range_m: Float64[Array, "*shape"]) -> Float64[Array, "*shape 2"]:
    """Return (1, log10(d / 10 m)) of ranges in metres; below 0.5 m it stays as it is there."""
    decades = _decades(range_m)
    return np.stack([np.ones_like(decades), decades], axis=-1)


def _decades(range_m: Float64[Array, "*shape"]) -> Float64[Array, "*shape"]:
    """Return log10(d / 10 m) with little memory: the ranges of a long log are hundreds of MB."""
    decades = np.asarray(np.maximum(range_m, 0.5))
    decades /= 10.0
    return np.asarray(np.log10(decades, out=decades))


@dataclass(frozen=True)
class ReadingCounts:
    """What became of the readings of one anchor, or of several, when a log was aligned.

    Parameters
    ----------
    in_log
        Readings in the log: the sum of the next four.
    kept
        Those that the ranges of the episode come from.
    spikes
        Those dropped because they are far off their neighbours.
    in_gaps
        Those dropped because no other reading is near enough in time.
    outside
        Those dropped because the pose at their time is unknown.
    n_steps
        Steps of the timeline that got a range.

    Examples
    --------
    >>> str(ReadingCounts(100, 90, 4, 1, 5, n_steps=80))
    '100 readings in the log: 90 kept, 4 dropped as spikes, 1 in gaps, 5 outside the path'
    """

    in_log: int
    kept: int
    spikes: int
    in_gaps: int
    outside: int
    n_steps: int

    def __add__(self, other: ReadingCounts) -> ReadingCounts:
        pairs = zip(astuple(self), astuple(other), strict=True)
        return ReadingCounts(*(mine + theirs for mine, theirs in pairs))

    def __str__(self) -> str:
        return (
            f"{self.in_log} reading{'' if self.in_log == 1 else 's'} in the log: {self.kept} kept, "
            f"{self.spikes} dropped as spikes, {self.in_gaps} in gaps, {self.outside} outside the "
            "path"
        )


@dataclass(frozen=True)
class ErrorSizes:
    """How large the errors of a log's ranges are, by kind (``locate/zone_fit.py``).

    Parameters
    ----------
    noise_m
        Scale of the white noise, in metres.
    alike
        Correlation of this noise in readings of one cone that are 0.1 s apart.
    outlier_share
        Share of the readings that have no line of sight.
    field_m : (L,)
        Standard deviations of the slow errors of each length, in metres.
    delay_m, pattern_m
        Standard deviations of the cones' own delays and of their antennas'
        patterns, in metres.
    """

    noise_m: float
    alike: float
    outlier_share: float
    field_m: Float64[Array, "L"]
    delay_m: float
    pattern_m: float


@dataclass(frozen=True)
class DriveErrors:
    """What the readings of a whole run say of the errors that all of its cones share.

    Parameters
    ----------
    mean : (8,)
        Range bias at 10 m and its growth per factor of ten, clock offset that is left, bias of the
        tag, and the cosines and sines of two harmonics of its pattern; in metres and seconds.
    covariance : (8, 8)
        Covariance of these.
    sizes
        How large the errors are that each cone has by itself.
    """

    mean: Float64[Array, "8"]
    covariance: Float64[Array, "8 8"]
    sizes: ErrorSizes


@dataclass(frozen=True)
class RangeReadings:
    """The readings of one drive at their own times, and the path.

    Parameters
    ----------
    t_s : (R,)
        Time of each reading in the trajectory's clock, as far as the clock offset is known.
    anchor : (R,)
        Index of the anchor.
    range_m : (R,)
        Measured slant range, in metres.
    trajectory
        The path of the tag's antenna.
    azimuth_rad, azimuth_sigma_rad : (R,), optional
        Angle of arrival from the vehicle's front, counter-clockwise, and its standard deviation;
        NaN where there is none.

    Raises
    ------
    InputError
        If shapes disagree, or a time or range is not finite.
    """

    t_s: Float64[Array, "R"]
    anchor: Int64[Array, "R"]
    range_m: Float64[Array, "R"]
    trajectory: Trajectory
    azimuth_rad: Float64[Array, "R"] | None = None
    azimuth_sigma_rad: Float64[Array, "R"] | None = None

    def __post_init__(self) -> None:
        shape = np.shape(self.t_s)
        for name in ("t_s", "range_m"):
            check_shape(name, freeze(self, name, getattr(self, name), np.float64), shape)
            check_finite(name, getattr(self, name))
        check_shape("anchor", freeze(self, "anchor", self.anchor, np.int64), shape)
        for name in ("azimuth_rad", "azimuth_sigma_rad"):
            if getattr(self, name) is not None:
                check_shape(name, freeze(self, name, getattr(self, name), np.float64), shape)

    def position_at(self, t_s: Float64[Array, "r"]) -> Float64[Array, "r 2"]:
        """Return where the tag was, in metres; beyond the path's ends, where it would have been.

        Parameters
        ----------
        t_s : (r,)
            Times in the trajectory's clock.
        """
        path = self.trajectory
        # East and north as one complex number: one search serves both.
        place_m = np.ascontiguousarray(path.position_m).view(np.complex128)[:, 0]
        at_m = np.interp(t_s, path.t_s, place_m)
        position_m = at_m.view(np.float64).reshape(-1, 2)
        for end, inner in ((0, _inside(path.t_s, 0)), (-1, _inside(path.t_s, -1))):
            beyond_s = t_s - path.t_s[end]
            beyond = beyond_s < 0.0 if end == 0 else beyond_s > 0.0
            if not beyond.any():
                continue
            step_m = path.position_m[inner] - path.position_m[end]
            velocity_mps = step_m / (path.t_s[inner] - path.t_s[end])
            position_m[beyond] += beyond_s[beyond, None] * velocity_mps
        return position_m

    def between(self, start_s: float, stop_s: float) -> RangeReadings:
        """Return the readings from ``start_s`` to ``stop_s``, both included.

        Parameters
        ----------
        start_s, stop_s
            Times in the trajectory's clock.
        """
        return self.rows((self.t_s >= start_s) & (self.t_s <= stop_s))

    def without(self, anchors: Bool[Array, "N"]) -> RangeReadings:
        """Return the readings of the other anchors.

        Parameters
        ----------
        anchors : (N,)
            Which anchors to leave out.
        """
        return self.rows(~anchors[self.anchor])

    def rows(self, own: Bool[Array, "R"] | Int64[Array, "r"]) -> RangeReadings:
        """Return some readings.

        Parameters
        ----------
        own
            Which.
        """

        def of(values: Array | None) -> Array | None:
            return None if values is None else values[own]

        return replace(
            self,
            t_s=self.t_s[own],
            anchor=self.anchor[own],
            range_m=self.range_m[own],
            azimuth_rad=of(self.azimuth_rad),
            azimuth_sigma_rad=of(self.azimuth_sigma_rad),
        )


def _inside(t_s: Float64[Array, "T"], end: int) -> int:
    """Return the index of the sample half a second from an end of a path, or the one next to it."""
    if end == 0:
        return min(max(int(np.searchsorted(t_s, t_s[0] + _END_S)), 1), len(t_s) - 1)
    return max(min(int(np.searchsorted(t_s, t_s[-1] - _END_S, side="right")) - 1, len(t_s) - 2), 0)


@dataclass(frozen=True)
class EpisodeTruth:
    """The truth on an episode's timeline; scores read it, reconstructions never do.

    Parameters
    ----------
    anchor_m : (N, 2)
        True east and north of the anchors, in metres.
    range_m : (T, N)
        True slant range at every step, in metres.
    nlos : (T, N)
        True where there was no line of sight.
    outlier : (T, N), optional
        True where a spike's offset is in the measured range, where a simulator knows it.
    bias_m : (T, N), optional
        The systematic part of the measured range's error, in metres, where a simulator knows it.

    Raises
    ------
    InputError
        If shapes disagree or a number is not finite.
    """

    anchor_m: Float64[Array, "N 2"]
    range_m: Float64[Array, "T N"]
    nlos: Bool[Array, "T N"]
    outlier: Bool[Array, "T N"] | None = None
    bias_m: Float64[Array, "T N"] | None = None

    def __post_init__(self) -> None:
        anchor_m = freeze(self, "anchor_m", self.anchor_m, np.float64)
        range_m = freeze(self, "range_m", self.range_m, np.float64)
        if range_m.ndim != 2:
            raise InputError(f"expected shape (T, N), got {range_m.shape}", column="truth.range_m")
        check_shape("truth.anchor_m", anchor_m, (range_m.shape[1], 2))
        check_finite("truth.anchor_m", anchor_m)
        check_finite("truth.range_m", range_m)
        check_shape("truth.nlos", freeze(self, "nlos", self.nlos, np.bool_), range_m.shape)
        if self.outlier is not None:
            outlier = freeze(self, "outlier", self.outlier, np.bool_)
            check_shape("truth.outlier", outlier, range_m.shape)
        if self.bias_m is not None:
            bias_m = freeze(self, "bias_m", self.bias_m, np.float64)
            check_shape("truth.bias_m", bias_m, range_m.shape)
            check_finite("truth.bias_m", bias_m)

    def window(self, steps: slice) -> EpisodeTruth:
        """Return the truth of some steps.

        Parameters
        ----------
        steps
            Which.
        """
        return EpisodeTruth(
            anchor_m=self.anchor_m,
            range_m=self.range_m[steps],
            nlos=self.nlos[steps],
            outlier=None if self.outlier is None else self.outlier[steps],
            bias_m=None if self.bias_m is None else self.bias_m[steps],
        )


@dataclass(frozen=True)
class Episode:
    """Ranges to N anchors on one timeline of T steps, with the path of the tag's antenna.

    Parameters
    ----------
    name
        What to call it in messages and results.
    anchor_ids
        Unique names of the N anchors.
    t_s : (T,)
        Strictly increasing time of the trajectory's clock, in seconds.
    position_m : (T, 2)
        East and north of the tag's antenna, in metres.
    range_m : (T, N)
        Measured slant ranges, in metres; NaN where not valid.
    valid : (T, N)
        True where ``range_m`` may be used.
    tag_up_m : (T,), optional
        Height of the tag's antenna in the local frame, in metres.
    anchor_up_m : (N,), optional
        Heights of the anchors' antennas in the local frame, in metres; NaN where unknown.
    frame
        Ties the local frame to WGS84, where known.
    clock
        The clock offset that the alignment found.
    calibration
        What the calibration found of the radios' errors; its bias is subtracted from ``range_m``.
    truth
        The truth on this timeline, for scores only.
    notes
        What the log's reader took, guessed and left out.
    problems
        What makes every result of this log unreliable.
    readings
        What became of the readings of the whole log, by anchor id, also in a window of it; empty
        where there was no log, so that every range is a reading.
    own_times
        The readings at their own times, from which anchors are located; without them each valid
        range of the timeline counts as one.
    errors
        What a whole run says of the errors that its anchors share.
    run_errors
        The same of the run from which a window was cut.
    least_noise_m
        White noise that the ranges have at least, in metres; more than they seem to have where a
        denoiser smoothed them.
    tag
        The tag, where it has a name, and where it sits on its vehicle.
    cone_ranges
        Ranges between the cones, where these measured any.
    drive, vehicle
        The drive, if other episodes are of its other tags, and the vehicle, if it is named.

    Raises
    ------
    InputError
        If ids are empty or not unique, shapes disagree, time does not increase, a position or
        height is not finite, or ranges are not finite exactly where ``valid``.
    """

    name: str
    anchor_ids: tuple[str, ...]
    t_s: Float64[Array, "T"]
    position_m: Float64[Array, "T 2"]
    range_m: Float64[Array, "T N"]
    valid: Bool[Array, "T N"]
    tag_up_m: Float64[Array, "T"] | None = None
    anchor_up_m: Float64[Array, "N"] | None = None
    frame: LocalFrame | None = None
    clock: ClockOffset | None = None
    calibration: RangeCalibration | None = None
    truth: EpisodeTruth | None = field(default=None, repr=False)
    notes: tuple[str, ...] = ()
    problems: tuple[Reason, ...] = ()
    readings: Mapping[str, ReadingCounts] = field(default_factory=dict, repr=False)
    own_times: RangeReadings | None = field(default=None, repr=False)
    errors: DriveErrors | None = field(default=None, repr=False)
    run_errors: DriveErrors | None = field(default=None, repr=False)
    least_noise_m: float = 0.0
    tag: Tag | None = None
    cone_ranges: ConeRanges | None = field(default=None, repr=False)
    drive: str = ""
    vehicle: str = ""

    def __post_init__(self) -> None:
        where = self.name
        check_ids(self.anchor_ids, source=where)
        t_s = freeze(self, "t_s", self.t_s, np.float64)
        if t_s.ndim != 1 or not len(t_s):
            raise InputError("expected at least one step, got none", source=where, column="t_s")
        check_finite("t_s", t_s, source=where)
        check_increasing("t_s", t_s, strictly=True, source=where)
        shape = (len(t_s), len(self.anchor_ids))
        position_m = freeze(self, "position_m", self.position_m, np.float64)
        check_shape("position_m", position_m, (len(t_s), 2), source=where)
        check_finite("position_m", position_m, source=where)
        range_m = freeze(self, "range_m", self.range_m, np.float64)
        valid = freeze(self, "valid", self.valid, np.bool_)
        check_shape("range_m", range_m, shape, source=where)
        check_shape("valid", valid, shape, source=where)
        if not np.array_equal(np.isfinite(range_m), valid):
            problem = "expected finite ranges exactly where valid"
            raise InputError(problem, source=where, column="range_m")
        if self.tag_up_m is not None:
            tag_up_m = freeze(self, "tag_up_m", self.tag_up_m, np.float64)
            check_shape("tag_up_m", tag_up_m, t_s.shape, source=where)
            check_finite("tag_up_m", tag_up_m, source=where)
        if self.anchor_up_m is not None:
            up = freeze(self, "anchor_up_m", self.anchor_up_m, np.float64)
            check_heights("anchor_up_m", up, shape[1], source=where)
        if self.truth is not None:
            check_shape("truth.range_m", self.truth.range_m, shape, source=where)

    @property
    def n_steps(self) -> int:
        """Number of steps T."""
        return len(self.t_s)

    @property
    def n_anchors(self) -> int:
        """Number of anchors N."""
        return len(self.anchor_ids)

    @property
    def n_readings(self) -> Int64[Array, "N"]:
        """How many readings each anchor's ranges come from, shape (N,).

        Interpolated steps are no readings. A window has the share of the log's readings that it has
        of the log's ranges.
        """
        n_valid = np.count_nonzero(self.valid, axis=0)
        counts = [self.readings.get(anchor_id) for anchor_id in self.anchor_ids]
        share = [1.0 if each is None else each.kept / max(each.n_steps, 1) for each in counts]
        return np.asarray(np.rint(n_valid * np.array(share)), dtype=np.int64)

    @property
    def all_readings(self) -> ReadingCounts | None:
        """What became of the readings of all anchors together; None where there was no log."""
        counts = list(self.readings.values())
        return sum(counts[1:], start=counts[0]) if counts else None

    @property
    def vehicle_m(self) -> Float64[Array, "T 2"]:
        """East and north of the vehicle's reference point, in metres.

        That is the tag's antenna, but for its lever arm where that is known.
        """
        path = None if self.own_times is None else self.own_times.trajectory
        if path is None or path.lever_m is None:
            return self.position_m
        lever_m = np.stack([np.interp(self.t_s, path.t_s, arm) for arm in path.lever_m.T], axis=1)
        return np.asarray(self.position_m - lever_m)

    @property
    def usual_speed_mps(self) -> float:
        """Median speed over the steps at which a range came in, in metres per second."""
        heard = np.asarray(self.valid.any(axis=1))[1:]
        if not heard.any():
            return 0.0
        moved_m = np.diff(self.position_m, axis=0)
        speed_mps = np.hypot(moved_m[:, 0], moved_m[:, 1]) / np.diff(self.t_s)
        return float(np.median(speed_mps[heard]))

    def height_gap_m(self, anchors: slice = slice(None)) -> Float64[Array, "T n"]:
        """Return the tag antenna's height minus the anchors', in metres; 0 where unknown.

        Parameters
        ----------
        anchors
            Which anchors; all by default.
        """
        shape = (self.n_steps, len(range(*anchors.indices(self.n_anchors))))
        if self.tag_up_m is None or self.anchor_up_m is None:
            return np.zeros(shape)
        gap_m = self.tag_up_m[:, None] - self.anchor_up_m[anchors]
        return np.asarray(np.nan_to_num(gap_m, nan=0.0))

    def window(self, start: int, stop: int) -> Episode:
        """Return the steps from ``start`` to before ``stop`` as an episode of its own.

        Parameters
        ----------
        start, stop
            Step indices, ``0 <= start < stop <= n_steps``.

        Raises
        ------
        IndexError
            If the steps lie outside the episode or there are none.
        """
        if not 0 <= start < stop <= self.n_steps:
            raise IndexError(f"expected 0 <= start < stop <= {self.n_steps}, got {start}, {stop}")
        cut = slice(start, stop)
        return replace(
            self,
            name=f"{self.name}[{start}:{stop}]",
            t_s=self.t_s[cut],
            position_m=self.position_m[cut],
            range_m=self.range_m[cut],
            valid=self.valid[cut],
            tag_up_m=None if self.tag_up_m is None else self.tag_up_m[cut],
            truth=None if self.truth is None else self.truth.window(cut),
            own_times=None if self.own_times is None else self._readings_of(cut),
            errors=None,
            run_errors=self.run_errors if self.errors is None else self.errors,
        )

    def _readings_of(self, cut: slice) -> RangeReadings | None:
        """Return the readings from half a step before the first step to half a step after."""
        if self.own_times is None:
            return None
        own_s = self.t_s[cut]
        before = self.t_s[max(cut.start - 1, 0)]
        after = self.t_s[min(cut.stop, self.n_steps - 1)]
        return self.own_times.between(0.5 * (before + own_s[0]), 0.5 * (after + own_s[-1]))

    def windows(self, length: int, stride: int | None = None) -> list[Episode]:
        """Cut the episode into windows of ``length`` steps; an incomplete tail is dropped.

        Parameters
        ----------
        length
            Steps in a window, at least 1.
        stride
            Steps from one window's start to the next; ``length`` by default (no overlap).

        Raises
        ------
        ValueError
            If ``length`` or ``stride`` is below 1.
        """
        stride = length if stride is None else stride
        if length < 1 or stride < 1:
            raise ValueError(f"expected length and stride of at least 1, got {length}, {stride}")
        starts = range(0, self.n_steps - length + 1, stride)
        return [self.window(start, start + length) for start in starts]

    def without_truth(self) -> Episode:
        """Return the same episode with nothing of the truth in it."""
        return replace(self, truth=None)

    def _repr_html_(self) -> str:
        """Return what a notebook shows: what is on the timeline, without the truth."""
        from gaia_uwb._shared import sketch, summary

        facts = [f"{self.n_steps} steps in {self.t_s[-1] - self.t_s[0]:.1f} s"]
        if self.clock is not None:
            facts.append(f"clock offset {self.clock.applied_s:+.3f} s: {self.clock.reason}")
        rows = []
        for n, anchor_id in enumerate(self.anchor_ids):
            range_m = self.range_m[self.valid[:, n], n]
            span = f"{range_m.min():.2f} to {range_m.max():.2f}" if len(range_m) else ""
            n_readings = str(self.n_readings[n])
            rows.append([anchor_id, n_readings, f"{self.valid[:, n].mean():.0%}", span])
        head = ("cone", "ranges", "share of steps", "range (m)")
        return summary(self.name, facts, sketch(self.position_m), head=head, rows=rows)
