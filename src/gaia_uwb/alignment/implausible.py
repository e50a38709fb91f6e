"""What spoils every result of a log, before anything is reconstructed: heights, jumps, mixtures.

None of it needs the truth. ``gaia data check`` prints it, and a reconstruction takes it as a reason
to be unreliable.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping

import numpy as np

from gaia_uwb._shared import Array, Float64, counted, metres, percent
from gaia_uwb.alignment.causes import biased_anchors, drifting_clock, likely_cause
from gaia_uwb.alignment.contradictions import contradicted_anchors, rows_of_anchors
from gaia_uwb.episode import ReadingCounts
from gaia_uwb.estimate import Reason, ReasonKind
from gaia_uwb.scene import Scene, Trajectory

_HIGHEST_GAP_M = 30.0  # cones stand on the road that the vehicle drives on
_SLACK_M = 1.0
_GAP_S = 1.0
_FEWEST_READINGS = 8
_STEEPEST, _LEAST_CLIMB_M = 0.25, 5.0  # the steepest streets rise by a third of their length
_JUMP_M, _MOST_MPS2 = 2.0, 10.0  # no vehicle accelerates more
_MOST_BAD = 1 / 3  # of an anchor's readings; of a working radio, a few in a hundred are
_NEIGHBOURS = 3  # steps before and after a step that tell how fast the vehicle is
_BLOCK = 1 << 16


def log_problems(
    scene: Scene,
    offset_s: float = 0.0,
    *,
    max_gap_s: float = 1.0,
    unexplained: Collection[str] | None = None,
) -> Iterator[Reason]:
    """Yield what makes every result of a log unreliable.

    Parameters
    ----------
    scene
        The log, of a vehicle that moves; its truth is not used.
    offset_s
        A reading stamped t belongs to the trajectory at ``t - offset_s``.
    max_gap_s
        Longest gap of the trajectory that is interpolated, in seconds.
    unexplained
        The anchors whose ranges no place explains: causes are sought for these. All by default.

    Examples
    --------
    >>> from dataclasses import replace
    >>> from gaia_uwb.simulate import PRESETS, simulate_pass
    >>> scene = simulate_pass(PRESETS["lane-closure"], seed=0)
    >>> high = replace(scene, anchor_up_m=np.full(scene.n_anchors, 520.0))
    >>> print(next(log_problems(high)).text[:50])
    the anchors lie 518 m above the tag: up_m counts f
    """
    for problem in (
        *scene.problems,
        *_height_gap(scene),
        *_climb(scene.trajectory),
        *_jumps(scene.trajectory),
        *_negative(scene),
    ):
        yield Reason(ReasonKind.LOG, problem)
    if unexplained is not None and not unexplained:
        return
    cause = likely_cause(scene, offset_s, max_gap_s)
    if cause is not None:
        yield cause
        return
    # A clock is every anchor's, so it explains what befalls most of them.
    most = unexplained is None or len(unexplained) > 0.5 * scene.n_anchors
    for reason in (
        *contradicted_anchors(scene, offset_s, max_gap_s=max_gap_s),
        *(drifting_clock(scene, offset_s, max_gap_s) if most else ()),
        *biased_anchors(scene, offset_s, max_gap_s),
    ):
        if unexplained is None or not reason.cones or set(reason.cones) & set(unexplained):
            yield reason


def spike_problems(readings: Mapping[str, ReadingCounts]) -> Iterator[Reason]:
    """Yield a reason for each anchor that lost too many of its readings as spikes.

    Spikes are few. Where they are many, a second radio answers with the same id, or what is called
    a spike is right and the rest is wrong.

    Parameters
    ----------
    readings
        What became of the readings, by anchor id.

    Examples
    --------
    >>> for reason in spike_problems({"cone-1": ReadingCounts(100, 30, 70, 0, 0, n_steps=60)}):
    ...     print(reason.text[:53])
    cone-1: 70 of its 100 readings along the path were dr
    """
    for anchor_id, counts in readings.items():
        along_path = counts.in_log - counts.outside
        share = counts.spikes / max(along_path, 1)
        if share > _MOST_BAD:
            text = (
                f"{anchor_id}: {counts.spikes} of its {along_path} readings along the path were "
                f"dropped as spikes ({percent(share)}): do two radios have this id, or is its line "
                "of sight blocked?"
            )
            yield Reason(ReasonKind.LOG, text, cones=(anchor_id,), numbers={"share": share})


def log_notes(scene: Scene, readings: Mapping[str, ReadingCounts] | None = None) -> Iterator[str]:
    """Yield what is worth knowing of a log, the reader's notes first.

    Parameters
    ----------
    scene
        The log; its truth is not used.
    readings
        What became of its readings, by anchor id, if it was aligned.
    """
    yield from scene.notes
    drive = scene.trajectory
    longest_s = float(np.diff(drive.t_s).max())
    if longest_s > _GAP_S:
        yield f"the trajectory has a gap of {longest_s:.1f} s"
    n_outside = sum(counts.outside for counts in (readings or {}).values())
    if n_outside:
        yield (
            f"{n_outside} of {len(scene.ranges)} readings are outside the trajectory's time, or in "
            "its gaps"
        )
    if drive.up_m is None or scene.anchor_up_m is None or np.isnan(scene.anchor_up_m).any():
        yield "not all heights are known: ranges are treated as horizontal where one is missing"
    if scene.frame is None:
        yield "no geographic reference: results are in local metres, and no feed can be written"


def _height_gap(scene: Scene) -> Iterator[str]:
    """Say where heights cannot belong together: no range is shorter than the height gap."""
    tag_up_m, anchor_up_m = scene.trajectory.up_m, scene.anchor_up_m
    if tag_up_m is None or anchor_up_m is None or not np.isfinite(anchor_up_m).any():
        return
    gap_m = anchor_up_m - float(np.median(tag_up_m))
    impossible = np.zeros(scene.n_anchors, np.bool_)
    for n, rows in enumerate(rows_of_anchors(scene)):
        if len(rows) >= _FEWEST_READINGS:
            nearest_m = np.quantile(scene.ranges.range_m[rows], 0.05)
            impossible[n] = abs(gap_m[n]) > nearest_m + _SLACK_M
    usual_m = float(np.nanmedian(gap_m))
    if abs(usual_m) > _HIGHEST_GAP_M or impossible.mean() > 0.5:
        where = "above" if usual_m > 0 else "below"
        yield (
            f"the anchors lie {metres(abs(usual_m))} {where} the tag: up_m counts from the local "
            "frame's origin, the first position of the trajectory unless a frame is given; heights "
            "above the ellipsoid are alt_m"
        )


def _climb(drive: Trajectory) -> Iterator[str]:
    if drive.up_m is None:
        return
    low_m, high_m = np.quantile(drive.up_m, [0.02, 0.98])
    climb_m, length_m = float(high_m - low_m), drive.path_length_m
    if climb_m > max(_LEAST_CLIMB_M, _STEEPEST * length_m):
        yield (
            f"the tag's height changes by {metres(climb_m)} over {metres(length_m)} of path: "
            "are the heights in another unit than metres?"
        )


def _negative(scene: Scene) -> Iterator[str]:
    """Say which anchors have many ranges below 0, which a bias alone makes of few."""
    for anchor_id, rows in zip(scene.anchor_ids, rows_of_anchors(scene), strict=True):
        n_negative = int((scene.ranges.range_m[rows] < 0.0).sum())
        if n_negative > _MOST_BAD * len(rows):
            yield (
                f"{anchor_id}: {n_negative} of its {len(rows)} ranges are below 0: does a number "
                "stand for no range?"
            )


def _jumps(drive: Trajectory) -> Iterator[str]:
    """Say where the path jumps: further than a vehicle gets beyond its speed before and after."""
    step_s = np.diff(drive.t_s)
    step_m = np.diff(drive.position_m, axis=0)
    if len(step_s) < 2 * _NEIGHBOURS + 1:
        return
    off_m = np.zeros(len(step_s))
    velocity_mps = step_m / step_s[:, None]
    window = np.delete(np.arange(-_NEIGHBOURS, _NEIGHBOURS + 1), _NEIGHBOURS)
    for start in range(0, len(step_s), _BLOCK):
        rows = np.arange(start, min(start + _BLOCK, len(step_s)))
        near = np.clip(rows[:, None] + window, 0, len(step_s) - 1)
        usual_mps = np.median(velocity_mps[near], axis=1)
        off_m[rows] = np.hypot(*(step_m[rows] - usual_mps * step_s[rows, None]).T)
    jumps = np.flatnonzero(off_m > _JUMP_M + _MOST_MPS2 * step_s**2)
    if jumps.size:
        first = int(jumps[0])
        others = counted(len(jumps) - 1, "more place")
        yield (
            f"the path jumps by {metres(float(off_m[first]))} within {step_s[first]:.2g} s at "
            f"{_time(drive.t_s, first + 1)}{f', and at {others}' if len(jumps) > 1 else ''}: was "
            "the fix lost?"
        )


def _time(t_s: Float64[Array, "T"], index: int) -> str:
    """Return a sample's time; where clocks count from 1970, the time since the first one."""
    since = " after its start" if t_s[0] > 1e8 else ""
    return f"{t_s[index] - (t_s[0] if since else 0.0):.1f} s{since}"
