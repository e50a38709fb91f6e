"""What a log contains, how much of it is usable, and what stands in the way, in plain words.

These checks use the raw log: nothing here is denoised or reconstructed, and no truth is used.
"Usable" excludes readings that cannot help whatever is done with them later: outside the
trajectory's time, negative, and spikes. What the geometry allows is in ``observability.py``.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from gaia_uwb._shared import Array, Bool, in_a_line, problem_of
from gaia_uwb.alignment import contradicting, log_notes, log_problems
from gaia_uwb.config import PipelineConfig
from gaia_uwb.evaluate.observability import Observability, observe
from gaia_uwb.scene import Scene, Trajectory

GAP_S = 0.3
"""Two readings of an anchor further apart than this, and than 2.5 typical steps, have a gap between
them."""

PARKED_BELOW_M = 1.0
"""A vehicle whose whole path spans less than this stood still."""

STRAIGHT_BELOW = 0.02
"""A path whose width is a smaller share of its length than this is straight."""

MIN_USABLE = 4
"""Fewer usable readings than this do not locate an anchor."""


@dataclass(frozen=True)
class DriveCheck:
    """The trajectory in numbers.

    Parameters
    ----------
    n_samples, duration_s, rate_hz, longest_step_s
        Size and timing; the rate is that of the median step.
    path_length_m
        Length of the path.
    extent_m
        Diagonal of the box around it.
    straightness
        Spread of the path along its minor principal axis, as a share of that along its major one:
        0 for a straight line, 1 for a circle.
    """

    n_samples: int
    duration_s: float
    rate_hz: float
    longest_step_s: float
    path_length_m: float
    extent_m: float
    straightness: float


@dataclass(frozen=True)
class AnchorCheck:
    """One anchor's readings in numbers; shares are of ``n_readings``, from 0 to 1.

    Parameters
    ----------
    anchor_id, n_readings, rate_hz
        Name, number, and the rate of the median step (NaN below 2 readings).
    n_gaps, longest_gap_s
        Gaps longer than :data:`GAP_S`, and the longest time between two readings.
    outside_share, negative_share, spike_share, repeat_share
        Readings outside the trajectory's time, below 0, in contradiction to most of those
        around them, and equal to the previous one.
    usable_share
        Readings that are none of these.
    rssi_share
        Readings that come with a received power.
    """

    anchor_id: str
    n_readings: int
    rate_hz: float
    n_gaps: int
    longest_gap_s: float
    outside_share: float
    negative_share: float
    spike_share: float
    repeat_share: float
    usable_share: float
    rssi_share: float

    @property
    def n_usable(self) -> int:
        """Number of usable readings."""
        return round(self.usable_share * self.n_readings)


@dataclass(frozen=True)
class CheckReport:
    """What was found in one log.

    Parameters
    ----------
    name
        The scene's or the source's name.
    drive, anchors
        The numbers; ``None`` and empty where the log could not be read.
    observability
        What the log can support; ``None`` where the vehicle is parked or no reading is usable.
    problems
        What will spoil a reconstruction, or why the log cannot be read.
    notes
        What is worth knowing.
    readable
        Whether the log could be read at all.
    traceback
        Of the fault of the program because of which it was not checked, if there is one.
    """

    name: str
    drive: DriveCheck | None = None
    anchors: tuple[AnchorCheck, ...] = ()
    observability: Observability | None = None
    problems: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    readable: bool = True
    traceback: str = ""

    @classmethod
    def of_failure(cls, name: str, error: Exception) -> CheckReport:
        """Return the report on a log that cannot be read or checked."""
        problem = problem_of(error)
        return cls(name, problems=(problem.text,), readable=False, traceback=problem.traceback)

    def lines(self) -> list[str]:
        """Return the report as lines of text that a screen can show."""
        lines = [self.name]
        if self.drive is not None:
            d = self.drive
            lines.append(
                f"  path: {d.n_samples} samples in {d.duration_s:.1f} s ({d.rate_hz:.1f} Hz), "
                f"{d.path_length_m:.1f} m long within {d.extent_m:.1f} m"
            )
        if self.anchors:
            lines.append(_HEADING)
            lines += [_anchor_line(anchor) for anchor in self.anchors]
        if self.observability is not None:
            lines += self.observability.lines()
        lines += [f"  note: {note}" for note in self.notes]
        lines += [f"  PROBLEM: {problem}" for problem in self.problems]
        if not self.problems:
            lines.append("  no problems found")
        return [in_a_line(line, _LONGEST_LINE) for line in lines]  # a name may hold anything

    def as_json(self) -> dict[str, Any]:
        """Return the report as plain values; a number that is not finite is None."""
        content: dict[str, Any] = _finite(asdict(self))
        content.pop("traceback")
        return content


def _finite(value: Any) -> Any:
    match value:
        case dict():
            return {key: _finite(inner) for key, inner in value.items()}
        case list() | tuple():
            return [_finite(inner) for inner in value]
        case float() if not np.isfinite(value):
            return None
    return value


_LONGEST_LINE = 1500
_HEADING = (
    "  cone          readings     Hz   gaps  longest   usable  outside  negative   spikes  repeats"
    "   RSSI"
)


def _anchor_line(a: AnchorCheck) -> str:
    return (
        f"  {a.anchor_id:<12}{a.n_readings:>10}{a.rate_hz:>7.1f}{a.n_gaps:>7}"
        f"{a.longest_gap_s:>7.1f} s{a.usable_share:>9.1%}{a.outside_share:>9.1%}"
        f"{a.negative_share:>10.2%}{a.spike_share:>9.2%}{a.repeat_share:>9.1%}{a.rssi_share:>7.0%}"
    )


def check_scene(
    scene: Scene, *, progress: Callable[[int, int], None] = lambda done, total: None
) -> CheckReport:
    """Check a scene's raw log.

    Parameters
    ----------
    scene
        The log, with the notes of its reader.
    progress
        Called with the number of anchors that are checked, and of all anchors.

    Returns
    -------
    CheckReport
        The numbers, and what is wrong in words.

    Examples
    --------
    >>> import numpy as np
    >>> from gaia_uwb.scene import RangeLog, Scene, Trajectory
    >>> t_s = np.arange(20.0)
    >>> drive = Trajectory(t_s, np.column_stack([t_s, 0 * t_s]))
    >>> log = RangeLog(t_s, np.zeros(20, dtype=np.int64), 25.0 - t_s)
    >>> check_scene(Scene("pass", drive, log, ("cone-1",))).problems[0]
    'the path is straight: each cone and its mirror position fit equally well'
    """
    drive = _check_drive(scene.trajectory)
    anchors = []
    for index in range(scene.n_anchors):
        progress(index, scene.n_anchors)
        anchors.append(_check_anchor(scene, index))
    moves = drive.extent_m >= PARKED_BELOW_M
    heard = any(anchor.usable_share > 0 for anchor in anchors)
    found = observe(scene.without_truth()) if moves and heard else None
    problems, more = ((), ()) if found is None else (tuple(found.problems()), tuple(found.notes()))
    unscored = () if scene.truth else ("no surveyed cones: nothing to score against",)
    return CheckReport(
        name=scene.name,
        drive=drive,
        anchors=tuple(anchors),
        observability=found,
        problems=(*_problems(drive, anchors), *_spoilt(scene, found), *problems),
        notes=(*log_notes(scene), *unscored, *more),
    )


def _spoilt(scene: Scene, found: Observability | None) -> Iterator[str]:
    """Yield what makes every result unreliable, as a reconstruction says it too."""
    if found is None:
        yield from scene.problems
    else:
        gap_s = PipelineConfig().alignment.max_pose_gap_s
        yield from map(str, log_problems(scene, found.clock.applied_s, max_gap_s=gap_s))


def _check_drive(drive: Trajectory) -> DriveCheck:
    step_s = np.diff(drive.t_s)
    centred_m = drive.position_m - drive.position_m.mean(axis=0)
    major, minor = np.linalg.svd(centred_m, compute_uv=False)
    return DriveCheck(
        n_samples=len(drive),
        duration_s=float(drive.t_s[-1] - drive.t_s[0]),
        rate_hz=float(1 / np.median(step_s)),
        longest_step_s=float(step_s.max()),
        path_length_m=drive.path_length_m,
        extent_m=float(np.hypot(*np.ptp(drive.position_m, axis=0))),
        straightness=float(minor / major) if major > 0 else 0.0,
    )


def _check_anchor(scene: Scene, index: int) -> AnchorCheck:
    log, drive = scene.ranges, scene.trajectory
    mine = log.anchor == index
    t_s, range_m = log.t_s[mine], log.range_m[mine]
    step_s = np.diff(t_s)
    usual_s = float(np.median(step_s)) if step_s.size else np.nan
    outside = (t_s < drive.t_s[0]) | (t_s > drive.t_s[-1])
    negative = range_m < 0
    spike = contradicting(t_s, range_m, drive)
    repeat = np.append(False, np.diff(range_m) == 0)[: len(range_m)]
    rssi = np.zeros(len(t_s)) * np.nan if log.rssi_dbm is None else log.rssi_dbm[mine]
    return AnchorCheck(
        anchor_id=scene.anchor_ids[index],
        n_readings=len(t_s),
        rate_hz=1 / usual_s if usual_s > 0 else np.nan,
        n_gaps=int((step_s > np.fmax(GAP_S, 2.5 * usual_s)).sum()),
        longest_gap_s=float(step_s.max(initial=0.0)),
        outside_share=_share(outside),
        negative_share=_share(negative),
        spike_share=_share(spike),
        repeat_share=_share(repeat),
        usable_share=_share(~(outside | negative | spike)),
        rssi_share=_share(np.isfinite(rssi)),
    )


def _share(found: Bool[Array, "R"]) -> float:
    return float(found.mean()) if found.size else 0.0


def _problems(drive: DriveCheck, anchors: Sequence[AnchorCheck]) -> Iterator[str]:
    if drive.extent_m < PARKED_BELOW_M:
        yield f"the vehicle is parked: its whole path spans {drive.extent_m:.2f} m"
    elif drive.straightness < STRAIGHT_BELOW:
        yield "the path is straight: each cone and its mirror position fit equally well"
    for anchor in anchors:
        if not anchor.n_readings:
            yield f"{anchor.anchor_id}: no readings"
        elif anchor.n_usable < MIN_USABLE:
            yield (
                f"{anchor.anchor_id}: only {anchor.n_usable} of {anchor.n_readings} readings are "
                "usable, too few to locate it"
            )
        elif anchor.usable_share < 0.5:
            share = f"{anchor.usable_share:.0%}"
            yield f"{anchor.anchor_id}: only {share} of the readings are usable"
    if len(anchors) < 3:
        yield f"a boundary needs 3 cones, but this log has {len(anchors)}"
