"""Why ranges may not fit the path: a unit, a clock, an antenna delay, swapped coordinates.

Each usual mistake is undone in turn, and the anchors are located anew. The one after which the
ranges fit is the likely cause; where none helps, nothing is said.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from gaia_uwb._shared import Array, Float64, metres
from gaia_uwb.alignment.readings import Readings, fit_anchors, gather_readings
from gaia_uwb.estimate import Reason, ReasonKind
from gaia_uwb.scene import Scene

_MISFIT_M = 0.7  # half of the ranges of working radios on a known path err by less
_FITS_M, _BETTER = 0.4, 0.25  # what is left once the cause is taken away, and its share
_MOST_READINGS = 2_000
_FEWEST_READINGS = 8  # of an anchor
_HEARD = 0.6  # of the readings have a pose under another clock offset as well
_UNITS = ((0.01, "centimetres"), (0.001, "millimetres"), (0.1, "decimetres"), (0.3048, "feet"))
_CLOCK_S, _CLOCK_STEP_S = 40.0, 1.0
_LEAP_SECONDS = 18.0  # GPS time minus UTC since 2017
_MOST_GAPS, _LONG_GAP, _LEAST_STEP_S = 3, 5.0, 0.5
_MOST_BACK_S, _NEAR_STEP_S, _STEPS = 10.0, 0.1, 40
_BIASES = 40
_OWN_BIASES_M = np.arange(-1.0, 3.01, 0.2)
_DRIFTS = (-0.05, -0.02, -0.01, -0.005, -0.0025, 0.0025, 0.005, 0.01, 0.02, 0.05)
_LEAST_DRIFT_M, _DRIFT_BETTER = 0.1, 0.6
_FEWEST_ANCHORS = 3
_LEAST_BIAS_M = 0.35  # radios and obstacles differ by less all the time
_LEAST_OWN_M, _STANDS_OUT, _OWN_BETTER = 0.1, 3.0, 0.4  # half of an anchor's errors exceed


@dataclass(frozen=True)
class _Case:
    """A log as it would be without a mistake."""

    scene: Scene
    readings: tuple[Readings, ...]
    offset_s: float
    max_gap_s: float

    @classmethod
    def of(cls, scene: Scene, offset_s: float, max_gap_s: float) -> _Case:
        every = len(scene.ranges) // _MOST_READINGS + 1
        readings = tuple(gather_readings(scene, every=every))
        return cls(scene, readings, offset_s, max_gap_s).with_ranges()

    def errors_m(self) -> dict[int, Float64[Array, "K"]]:
        """Return how far off the readings of each anchor are that has enough of them."""
        found = {}
        for block in self.readings:
            fit = fit_anchors(self.scene, block, self.offset_s, self.max_gap_s)
            for n, left_m in zip(block.anchors, np.abs(fit.residual_m), strict=True):
                used_m = left_m[np.isfinite(left_m)]
                if len(used_m) >= _FEWEST_READINGS:
                    found[n] = used_m
        return found

    def half_m(self) -> tuple[float, int]:
        """Return the size that half of the errors exceed, and how many readings were used."""
        errors_m = np.concatenate([*self.errors_m().values(), np.zeros(0)])
        return (float(np.median(errors_m)) if errors_m.size else np.inf), len(errors_m)

    def halves_m(self) -> Float64[Array, "N"]:
        """Return the size that half of each anchor's errors exceed; NaN where there are few."""
        halves_m = np.full(self.scene.n_anchors, np.nan)
        for n, errors_m in self.errors_m().items():
            halves_m[n] = np.median(errors_m)
        return halves_m

    def with_ranges(self, scale: float = 1.0, bias_m: float = 0.0) -> _Case:
        return replace(
            self,
            readings=tuple(
                replace(block, range_m=_positive(block.range_m * scale - bias_m))
                for block in self.readings
            ),
        )


def _positive(range_m: Float64[Array, "n R"]) -> Float64[Array, "n R"]:
    return np.where(range_m > 0.0, range_m, np.nan)


def likely_cause(scene: Scene, offset_s: float = 0.0, max_gap_s: float = 1.0) -> Reason | None:
    """Return why the ranges do not fit the path, if one of the usual mistakes explains it.

    Parameters
    ----------
    scene
        The log, of a vehicle that moves; its truth is not used.
    offset_s
        A reading stamped t belongs to the trajectory at ``t - offset_s``.
    max_gap_s
        Longest gap of the trajectory that is interpolated, in seconds.

    Examples
    --------
    >>> from gaia_uwb.simulate import PRESETS, simulate_pass
    >>> scene = simulate_pass(PRESETS["lane-closure"], seed=0)
    >>> likely_cause(scene) is None
    True
    >>> log = replace(scene.ranges, range_m=100.0 * scene.ranges.range_m)
    >>> print(likely_cause(replace(scene, ranges=log)).text[-42:])
    if they were centimetres: then scale: 0.01
    """
    case = _Case.of(scene, offset_s, max_gap_s)
    half_m, _ = case.half_m()
    if not _MISFIT_M < half_m < np.inf:
        return None
    best: tuple[float, str] = (min(_FITS_M, _BETTER * half_m), "")
    for said, other in _undone(case):
        left_m, _ = other.half_m()
        if left_m < best[0]:
            best = left_m, said
    if not best[1]:
        return None
    text = (
        f"the ranges do not fit the path: half of them are off by more than {metres(half_m)}; they "
        f"would fit within {metres(best[0])} if {best[1]}"
    )
    return Reason(ReasonKind.MISFIT, text, numbers={"half_beyond_m": half_m})


def biased_anchors(scene: Scene, offset_s: float = 0.0, max_gap_s: float = 1.0) -> Iterator[Reason]:
    """Yield a reason for each anchor whose ranges fit a place only with a bias of their own.

    Where other anchors are located without one, it is the radio's (antenna delay) or an obstacle's
    along the whole drive; the place that its ranges give as they are is wrong by about as much.

    Parameters
    ----------
    scene, offset_s, max_gap_s
        As for :func:`likely_cause`.
    """
    case = _Case.of(scene, offset_s, max_gap_s)
    plain_m = case.halves_m()
    known = np.isfinite(plain_m)
    if known.sum() < _FEWEST_ANCHORS:
        return
    # A bias that all have in common hides the difference in part, so this first look is lenient.
    if np.nanmax(plain_m) < max(_LEAST_OWN_M, 0.5 * _STANDS_OUT * float(np.nanmedian(plain_m))):
        return
    halves_m = np.stack([case.with_ranges(bias_m=bias).halves_m() for bias in _OWN_BIASES_M])
    halves_m = np.where(np.isfinite(halves_m), halves_m, np.inf)
    common = int(np.argmin(np.median(halves_m[:, known], axis=1)))
    usual_m = float(np.median(halves_m[common, known]))
    for n in np.flatnonzero(known):
        own = int(np.argmin(halves_m[:, n]))
        as_others_m, alone_m = float(halves_m[common, n]), float(halves_m[own, n])
        more_m = float(_OWN_BIASES_M[own] - _OWN_BIASES_M[common])
        stands_out = as_others_m > max(_LEAST_OWN_M, _STANDS_OUT * usual_m)
        known_well = 0 < own < len(_OWN_BIASES_M) - 1 and abs(more_m) > _LEAST_BIAS_M
        if stands_out and known_well and alone_m < _OWN_BETTER * as_others_m:
            way = "long" if more_m > 0 else "short"
            text = (
                f"{scene.anchor_ids[n]}: the ranges fit one place only if they are about "
                f"{metres(abs(more_m))} too {way}, unlike those of the other cones: is its antenna "
                "delay set, and its line of sight free?"
            )
            yield Reason(
                ReasonKind.RANGE_BIAS,
                text,
                cones=(scene.anchor_ids[n],),
                numbers={"bias_m": more_m},
            )


def drifting_clock(scene: Scene, offset_s: float = 0.0, max_gap_s: float = 1.0) -> Iterator[Reason]:
    """Yield a reason if the ranges fit much better with a radio clock that is fast or slow.

    Parameters
    ----------
    scene, offset_s, max_gap_s
        As for :func:`likely_cause`.
    """
    case = _Case.of(scene, offset_s, max_gap_s)
    plain_m, _ = case.half_m()
    if not _LEAST_DRIFT_M < plain_m < np.inf:
        return
    middle_s = float(np.median(scene.ranges.t_s))

    def half_m(rate: float) -> float:
        blocks = (
            replace(block, t_s=middle_s + (block.t_s - middle_s) / (1.0 + rate))
            for block in case.readings
        )
        return replace(case, readings=tuple(blocks)).half_m()[0]

    left_m, rate = min((half_m(rate), rate) for rate in _DRIFTS)
    if left_m < _DRIFT_BETTER * plain_m:
        near = np.linspace(0.5 * rate, 1.5 * rate, 11).tolist()
        left_m, rate = min((half_m(rate), rate) for rate in near)
        way = "fast" if rate > 0 else "slow"
        text = (
            f"the radio's clock runs about {100.0 * abs(rate):.1f} % {way}: with that, half of the "
            f"ranges fit within {metres(left_m)} instead of {metres(plain_m)}; it is not corrected"
        )
        yield Reason(ReasonKind.CLOCK, text, numbers={"drift": rate})


def _undone(case: _Case) -> Iterator[tuple[str, _Case]]:
    """Yield each usual mistake, and the log without it."""
    for scale, unit in _UNITS:
        yield f"they were {unit}: then scale: {scale:g}", case.with_ranges(scale=scale)
    yield from _swapped(case)
    yield from _heights(case)
    yield from _clocks(case)
    yield from _set_in_a_gap(case)
    yield from _biases(case)


def _swapped(case: _Case) -> Iterator[tuple[str, _Case]]:
    """Undo latitude and longitude in each other's place, which also stretches the path."""
    frame, drive = case.scene.frame, case.scene.trajectory
    if frame is None or abs(frame.lon_deg) > 90.0:
        return
    east_m = drive.position_m[:, 1] * np.cos(np.radians(frame.lon_deg))
    north_m = drive.position_m[:, 0] / max(np.cos(np.radians(frame.lat_deg)), 1e-3)
    moved = replace(drive, position_m=np.column_stack([east_m, north_m]))
    scene = replace(case.scene, trajectory=moved)
    yield "latitude and longitude stand in each other's place", replace(case, scene=scene)


def _heights(case: _Case) -> Iterator[tuple[str, _Case]]:
    drive = case.scene.trajectory
    if drive.up_m is None or case.scene.anchor_up_m is None:
        return
    scene = replace(case.scene, trajectory=replace(drive, up_m=None))
    yield "the heights were left out: then check them", replace(case, scene=scene)


def _clocks(case: _Case) -> Iterator[tuple[str, _Case]]:
    """Look for another clock offset, and for leap seconds first."""
    leaps = [sign * _LEAP_SECONDS for sign in (-1.0, 1.0)]
    coarse = np.arange(-_CLOCK_S, _CLOCK_S + 0.5, _CLOCK_STEP_S).tolist()
    shifts = {shift: replace(case, offset_s=shift).half_m() for shift in (*leaps, *coarse)}
    least = _HEARD * max(n for _, n in shifts.values())
    best = min((half_m, shift) for shift, (half_m, n) in shifts.items() if n >= least)[1]
    fine = np.linspace(best - 1.0, best + 1.0, 21).tolist()
    best = min((replace(case, offset_s=shift).half_m()[0], shift) for shift in fine)[1]
    way = "ahead of" if best > 0 else "behind"
    text = f"the radio's clock were {abs(best):.1f} s {way} the trajectory's"
    if abs(abs(best) - _LEAP_SECONDS) < 0.5:
        text += ", as GPS time and UTC are (18 leap seconds)"
    yield text, replace(case, offset_s=best)


def _set_in_a_gap(case: _Case) -> Iterator[tuple[str, _Case]]:
    """Undo a step of one of the clocks: forward leaves a gap, back may hide in one."""
    drive, log_s = case.scene.trajectory, case.scene.ranges.t_s

    def ranges_back(since_s: float, step_s: float) -> _Case:
        blocks = (
            replace(block, t_s=np.where(block.t_s >= since_s, block.t_s - step_s, block.t_s))
            for block in case.readings
        )
        return replace(case, readings=tuple(blocks))

    def path_back(since_s: float, step_s: float) -> _Case:
        t_s = np.where(drive.t_s >= since_s, drive.t_s - step_s, drive.t_s)
        return replace(case, scene=replace(case.scene, trajectory=replace(drive, t_s=t_s)))

    for times_s, whose, back in (
        (log_s, "the radio's", ranges_back),
        (drive.t_s, "the trajectory's", path_back),
    ):
        gap_s = np.diff(times_s)
        usual_s = float(np.median(gap_s[gap_s > 0])) if (gap_s > 0).any() else 0.0
        for k in np.argsort(gap_s)[-_MOST_GAPS:]:
            since_s, most_s = float(times_s[k + 1]), float(gap_s[k]) - 0.5 * usual_s
            if most_s < max(_LEAST_STEP_S, _LONG_GAP * usual_s):
                continue
            best_s, reach_s = 0.0, _MOST_BACK_S + most_s
            steps_s = np.linspace(-_MOST_BACK_S, most_s, _STEPS)
            while reach_s > _NEAR_STEP_S:
                best_s = min((back(since_s, float(s)).half_m()[0], float(s)) for s in steps_s)[1]
                reach_s *= 4.0 / _STEPS
                steps_s = np.linspace(best_s - reach_s / 2, best_s + reach_s / 2, _STEPS)
                steps_s = np.minimum(steps_s, most_s)
            way = "forward" if best_s > 0 else "back"
            at = f"{since_s - float(times_s[0]):.1f} s after its start"
            text = f"{whose} clock had not been set {way} by {abs(best_s):.1f} s, {at}"
            yield text, back(since_s, best_s)


def _biases(case: _Case) -> Iterator[tuple[str, _Case]]:
    """Look for a constant that all ranges are too long by."""
    lengths_m = np.concatenate(
        [block.range_m[np.isfinite(block.range_m)] for block in case.readings]
    )
    most_m = float(np.quantile(lengths_m[lengths_m > 0.0], 0.02)) if lengths_m.size else 0.0
    if most_m < 1.0:
        return
    step_m = most_m / _BIASES
    biases = [k * step_m for k in range(1, _BIASES + 1)]
    best = min((case.with_ranges(bias_m=bias).half_m()[0], bias) for bias in biases)[1]
    while step_m > 0.2:
        near = [best - step_m / 2, best, best + step_m / 2]
        best = min((case.with_ranges(bias_m=bias).half_m()[0], bias) for bias in near)[1]
        step_m /= 2
    yield (
        f"each were {metres(best)} shorter: is the radios' antenna delay set?",
        case.with_ranges(bias_m=best),
    )
