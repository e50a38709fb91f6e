"""What a log can show at best: clocks, coverage, and the geometry of the path around each anchor.

Anchors are located roughly from the raw readings, with both positions that a straight path allows.
Three things then follow before anything is reconstructed:

- *DOP* (dilution of precision): metres of position error per metre of range error that lasts some
  seconds. Ranges within a stretch of :data:`STRETCH_S` seconds have similar errors (an obstacle,
  multipath), so a stretch counts as one range, however many readings it has. Seen once from two
  directions at right angles, an anchor has a DOP of 1.4; seen from one direction only, it is
  infinite, and no number of readings helps.
- *View*: the angle under which the anchor sees the stretch of path where it was heard.
- *Side*: whether its own ranges distinguish the anchor from its mirror position across the path.
  Again, a stretch counts as one range. A reconstruction uses more (the zone as a whole,
  ``sides.py``), so a side that is ambiguous here may still be resolved there.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from math import inf, log

import numpy as np

from gaia_uwb._shared import SIGMAS_90, Array, Bool, Float64
from gaia_uwb.alignment import (
    Pose,
    Readings,
    anchor_heights,
    estimate_clock_offset,
    gather_readings,
    pose_at,
)
from gaia_uwb.config import PipelineConfig
from gaia_uwb.episode import ClockOffset
from gaia_uwb.scene import Scene
from gaia_uwb.solver import Solutions, solve

POOR_DOP = 5.0
"""Above this, a range error of 20 cm moves an anchor by more than a metre."""

_SETTINGS = PipelineConfig()
STRETCH_S = 0.5 * _SETTINGS.alignment.error_correlation_s
"""Errors fade over twice this time, so that readings within it are worth one."""

_MOST_READINGS = 40_000
_SIGMA_M = 0.1  # a unit only: the solver estimates the scale
_MUCH = 99  # larger DOPs are not distinguished
_ONE_PLACE_M = 0.3
_WIDE_M = 1.0
_FEW_STRETCHES = 3  # in fewer, an error that lasts bends the place to the path unseen
_TOLD = log(1 / _SETTINGS.sides.ambiguous_above - 1)


@dataclass(frozen=True)
class AnchorView:
    """One anchor, roughly located, and the path as it sees it.

    Parameters
    ----------
    anchor_id
        Its name.
    nearest_m
        Shortest horizontal distance to the path.
    view_deg
        Angle under which it sees the path where it was heard, from 0 to 360.
    dop
        Metres of error per metre of lasting range error; infinite where the path, as seen from the
        anchor, is a point.
    side_log_odds
        Log odds of its place against its mirror image across the path, by its own ranges.
    """

    anchor_id: str
    nearest_m: float
    view_deg: float
    dop: float
    side_log_odds: float

    @property
    def side_told(self) -> bool:
        """Whether its ranges alone determine its side of the path.

        Seen from too few directions an anchor may be anywhere on a circle, whatever the odds.
        """
        return self.side_log_odds > _TOLD and self.dop <= POOR_DOP


@dataclass(frozen=True)
class Observability:
    """What one log can show.

    Parameters
    ----------
    clock
        Offset between the radio's clock and the trajectory's.
    any_share, three_share
        Share of the drive's seconds in which at least one, and at least three anchors were heard.
    anchors
        The anchors that could be located roughly.
    """

    clock: ClockOffset
    any_share: float
    three_share: float
    anchors: tuple[AnchorView, ...]

    def lines(self) -> list[str]:
        """Return the numbers as lines of text."""
        lines = [
            f"  clock offset: {self._clock()}",
            f"  in range: at least one cone for {self.any_share:.0%} of the drive, at least three "
            f"for {self.three_share:.0%}",
        ]
        if self.anchors:
            lines.append("  cone           nearest   view     DOP   side of the path")
        for a in self.anchors:
            side = "clear" if a.side_told else "ambiguous"
            dop = f"{a.dop:.1f}" if a.dop < _MUCH else f">{_MUCH}"
            lines.append(
                f"  {a.anchor_id:<12}{a.nearest_m:>8.1f} m{a.view_deg:>6.0f}°{dop:>8}   {side}"
            )
        if self.anchors:
            lines.append(
                "  DOP: metres of position error per metre of lasting range error; 2 is good, "
                f"above {POOR_DOP:g} is poor"
            )
        return lines

    def _clock(self) -> str:
        clock, sure_s = self.clock, SIGMAS_90 * self.clock.sigma_s
        if clock.applied:
            word = "ahead" if clock.applied_s > 0 else "behind"
            offset = f"radio {word} by {abs(clock.applied_s):.3f} s ± {sure_s:.3f} s (90 %)"
            return f"{offset}, corrected"
        return f"0 s ± {sure_s:.3f} s (90 %), not corrected: {clock.reason}"

    def notes(self, *, sides_told: bool = False) -> Iterator[str]:
        """Yield what may keep anchors from being located well, and what to do about it.

        Whether it does shows only where they are located: errors may be small enough, and the zone
        as a whole may tell the sides. So none of this is a problem of the log.

        Parameters
        ----------
        sides_told
            Whether the log holds other evidence that tells the sides.
        """
        poor = [a for a in self.anchors if a.dop > POOR_DOP]
        if poor:
            yield (
                f"{_names(poor)}: seen from too few directions (DOP above {POOR_DOP:g}), so range "
                "errors are multiplied in the position; drive all the way past, or around"
            )
        open_ = [a for a in self.anchors if not a.side_told]
        if open_ and not sides_told:
            yield f"{_names(open_)}: {_OPEN}"
        if self.three_share < 0.5 and len(self.anchors) >= 3:
            share = f"{self.three_share:.0%}"
            yield f"three cones were in range at once for only {share} of the drive"


_OPEN = (
    "the ranges alone do not determine the side of the path; the zone as a whole may, and a bend, "
    "weaving once or a second pass in another lane will"
)


def _names(anchors: list[AnchorView]) -> str:
    ids = [a.anchor_id for a in anchors]
    more = f" and {len(ids) - 5} more" if len(ids) > 5 else ""
    return f"{', '.join(ids[:5])}{more}"


def observe(scene: Scene, clock: ClockOffset | None = None) -> Observability:
    """Say what a log can show.

    Parameters
    ----------
    scene
        The log, of a vehicle that moves; its truth is not used.
    clock
        The offset between its clocks; estimated by default.

    Returns
    -------
    Observability
        Clock, coverage, and the anchors that have enough ranges to be located at all.

    Examples
    --------
    >>> from gaia_uwb.simulate import PRESETS, simulate_pass
    >>> found = observe(simulate_pass(PRESETS["straight"], seed=0))
    >>> found.anchors[0].view_deg > 90, found.anchors[0].side_told
    (True, False)
    """
    if clock is None:
        clock = estimate_clock_offset(scene, _SETTINGS.alignment)
    every = max(1, len(scene.ranges) // _MOST_READINGS)
    anchors: list[AnchorView] = []
    for readings in gather_readings(scene, every=every):
        anchors += _views(scene, readings, clock.applied_s)
    any_share, three_share = _coverage(scene, clock.applied_s)
    return Observability(clock, any_share, three_share, tuple(anchors))


def _coverage(scene: Scene, offset_s: float) -> tuple[float, float]:
    """Return the shares of the drive's seconds in which 1 and 3 anchors were heard."""
    first_s = float(scene.trajectory.t_s[0])
    n_seconds = max(int(np.ceil(scene.trajectory.t_s[-1] - first_s)), 1)
    second = np.floor(scene.ranges.t_s - offset_s - first_s)
    inside = (second >= 0) & (second < n_seconds)
    pairs = second[inside].astype(np.int64) * scene.n_anchors + scene.ranges.anchor[inside]
    heard = np.unique(np.unique(pairs) // scene.n_anchors, return_counts=True)[1]
    return len(heard) / n_seconds, float((heard >= 3).sum()) / n_seconds


def _views(scene: Scene, readings: Readings, offset_s: float) -> Iterator[AnchorView]:
    """Yield how some anchors see the path."""
    pose = pose_at(scene.trajectory, readings.t_s - offset_s, _SETTINGS.alignment.max_pose_gap_s)
    range_m = np.where(pose.known & (readings.range_m > 0), readings.range_m, np.nan)
    in_stretch = _readings_in_stretch(readings)
    up_m = anchor_heights(scene)[readings.anchors.start : readings.anchors.stop, None]
    found = solve(
        pose.position_m,
        range_m[:, None],
        _SIGMA_M,
        height_m=(pose.up_m, up_m),
        # The likelihood treats the readings as independent, so the prior must keep pace.
        bias_sigma_m=_SETTINGS.calibration.bias_sigma_m / np.sqrt(in_stretch),
    )
    for row, n in enumerate(readings.anchors):
        use = np.isfinite(range_m[row])
        if np.isfinite(found.position_m[row, 0]).all():
            yield _view(scene.anchor_ids[n], _Seen(pose, readings, use, row), found)


def _readings_in_stretch(readings: Readings) -> float:
    """Return how many readings of an anchor share one error, at least 1."""
    step_s = np.diff(readings.t_s)
    step_s = step_s[step_s > 0]
    return max(STRETCH_S / float(np.median(step_s)), 1.0) if step_s.size else 1.0


@dataclass(frozen=True)
class _Seen:
    """The readings of one anchor: a row of a block's poses and readings."""

    pose: Pose
    readings: Readings
    use: Bool[Array, "R"]
    row: int


def _view(anchor_id: str, seen: _Seen, found: Solutions) -> AnchorView:
    row, use = seen.row, seen.use
    cost = found.negative_log_likelihood[row, 0]
    places_m = found.position_m[row, 0]
    from_m = seen.pose.position_m[row, use] - places_m[int(np.argmin(cost))]
    horizontal_m = np.hypot(*from_m.T)
    toward = from_m / np.maximum(horizontal_m, 1e-3)[:, None]
    view_deg = _view_deg(toward)
    stretch = (seen.readings.t_s[row, use] // STRETCH_S).astype(np.int64)
    n_stretches = len(np.unique(stretch))
    odds = float(np.ptp(cost)) * n_stretches / len(stretch)
    if float(np.hypot(*(places_m[1] - places_m[0]))) < _ONE_PLACE_M:
        # No mirror image fits; unless the place lies on the path's line, where the two meet.
        width_m = _rms_across_m(seen.pose.position_m[row, use])
        odds = inf if width_m > _WIDE_M and n_stretches >= _FEW_STRETCHES else 0.0
    return AnchorView(
        anchor_id=anchor_id,
        nearest_m=float(horizontal_m.min()),
        view_deg=view_deg,
        dop=_dop(toward, stretch),
        side_log_odds=odds,
    )


def _rms_across_m(position_m: Float64[Array, "R 2"]) -> float:
    """Return how far a path strays from the straight line that fits it best."""
    centred_m = position_m - position_m.mean(axis=0)
    return float(np.linalg.svd(centred_m, compute_uv=False)[-1] / np.sqrt(len(centred_m)))


def _view_deg(toward: Float64[Array, "R 2"]) -> float:
    """Return the circle less the largest gap between neighbouring directions."""
    angle = np.sort(np.degrees(np.arctan2(toward[:, 1], toward[:, 0])))
    gaps = np.diff(np.append(angle, angle[0] + 360.0))
    return float(360.0 - gaps.max())


def _dop(toward: Float64[Array, "R 2"], stretch: Array) -> float:
    """Return the dilution of precision, each stretch of time counting as one range."""
    _, index, count = np.unique(stretch, return_inverse=True, return_counts=True)
    weighted = toward / count[index, None]
    normal = weighted.T @ toward
    least, most = np.linalg.eigvalsh(normal)
    return float(np.sqrt(1 / least + 1 / most)) if least > 1e-9 else inf
