"""What a log contains, how much of it is kept, and what stands in the way, in plain words.

A log is checked with what a reconstruction does before it locates anything: it is aligned and
calibrated (:func:`gaia_uwb.pipeline.prepare`), and the same function says what makes every result
of it unreliable (:func:`gaia_uwb.pipeline.log_reasons`). So the two cannot contradict each other: a
problem here is a reason there. No truth is used. What the geometry allows is in
``observability.py``; it gives notes, for what comes of it shows only where cones are located.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from gaia_uwb._shared import Array, Bool, InputError, in_a_line, problem_of
from gaia_uwb.alignment import log_notes, usual_interval_s
from gaia_uwb.config import PipelineConfig
from gaia_uwb.episode import Episode, ReadingCounts
from gaia_uwb.evaluate.log_evidence import evidence_of
from gaia_uwb.evaluate.observability import Observability, observe
from gaia_uwb.pipeline import hardly_heard, log_reasons, prepare
from gaia_uwb.scene import Scene, Trajectory, tag_scenes

GAP_S = 0.3
"""Two readings of an anchor further apart than this, and than 2.5 usual steps, have a gap between
them."""

STRAIGHT_BELOW = 0.02
"""A path whose width is a smaller share of its length than this is straight."""

_LEAST_CONES = 3
_NONE = ReadingCounts(0, 0, 0, 0, 0, n_steps=0)


@dataclass(frozen=True)
class DriveCheck:
    """The trajectory in numbers.

    Parameters
    ----------
    n_samples, duration_s, rate_hz, longest_step_s
        Size and timing; the rate is that of the usual step (``usual_interval_s``).
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
        Name, number, and the rate of the usual step (NaN below 2 readings).
    n_gaps, longest_gap_s
        Gaps longer than :data:`GAP_S`, and the longest time between two readings.
    n_kept, n_spikes, n_in_gaps, n_outside
        What a reconstruction keeps of them, and what it drops: as spikes, because no other reading
        is near enough in time, and because the pose at their time is unknown. All are 0 where the
        log cannot be aligned.
    negative_share, repeat_share
        Readings below 0, and equal to the previous one.
    rssi_share
        Readings that come with a received power.
    """

    anchor_id: str
    n_readings: int
    rate_hz: float
    n_gaps: int
    longest_gap_s: float
    n_kept: int
    n_spikes: int
    n_in_gaps: int
    n_outside: int
    negative_share: float
    repeat_share: float
    rssi_share: float


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
        What the log can support; ``None`` where it cannot be aligned.
    problems
        What will spoil a reconstruction, or why the log cannot be read.
    notes
        What is worth knowing.
    readable
        Whether the log could be read at all.
    traceback
        Of the fault of the program because of which it was not checked, if there is one.
    evidence
        What the log holds besides the ranges of one tag, and what that decides, a sentence each.
    tags
        What was found of each tag, where there are several; then the report on the log has no
        table of its own, and the problems of all of them.
    """

    name: str
    drive: DriveCheck | None = None
    anchors: tuple[AnchorCheck, ...] = ()
    observability: Observability | None = None
    problems: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    readable: bool = True
    traceback: str = ""
    evidence: tuple[str, ...] = ()
    tags: tuple[CheckReport, ...] = ()

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
        lines += [f"  evidence: {each}" for each in self.evidence]
        if self.tags:
            of_tags = [line for tag in self.tags for line in tag.lines()]
            return [in_a_line(line, _LONGEST_LINE) for line in lines] + of_tags
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
        for report in (content, *content["tags"]):
            report.pop("traceback")
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
    "  cone          readings     Hz   gaps  longest     kept   spikes  in gaps  outside  negative"
    "  repeats   RSSI"
)


def _anchor_line(a: AnchorCheck) -> str:
    return (
        f"  {a.anchor_id:<12}{a.n_readings:>10}{a.rate_hz:>7.1f}{a.n_gaps:>7}"
        f"{a.longest_gap_s:>7.1f} s{a.n_kept:>9}{a.n_spikes:>9}{a.n_in_gaps:>9}{a.n_outside:>9}"
        f"{a.negative_share:>10.2%}{a.repeat_share:>9.1%}{a.rssi_share:>7.0%}"
    )


def check_scene(
    scene: Scene,
    config: PipelineConfig = PipelineConfig(),
    *,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> CheckReport:
    """Check a scene's raw log.

    Parameters
    ----------
    scene
        The log, with the notes of its reader.
    config
        What is known of vehicles counts, and how the log is prepared.
    progress
        Called with the number of anchors that are checked, and of all anchors.

    Returns
    -------
    CheckReport
        The numbers, and what is wrong in words; of each tag, where there are several.

    Examples
    --------
    >>> import numpy as np
    >>> from gaia_uwb.scene import RangeLog, Scene, Trajectory
    >>> t_s = np.arange(20.0)
    >>> drive = Trajectory(t_s, np.column_stack([t_s, 0 * t_s]))
    >>> log = RangeLog(t_s, np.zeros(20, dtype=np.int64), 25.0 - t_s)
    >>> check_scene(Scene("pass", drive, log, ("cone-1",))).problems[-1]
    'a boundary needs 3 cones, and this log can give 1'
    """
    evidence = evidence_of(scene)
    known = tuple(each.text for each in evidence)
    told = any(each.tells_sides for each in evidence)
    try:
        scenes = tag_scenes(scene)
    except InputError as error:  # the vehicle stands, and where its tags are is unknown
        drive = _check_drive(scene.trajectory)
        return CheckReport(scene.name, drive, problems=(str(error),), evidence=known)
    checked = []
    total = scene.n_anchors * len(scenes)
    for k, one in enumerate(scenes):

        def of_all(done: int, _: int, before: int = scene.n_anchors * k) -> None:
            progress(before + done, total)

        checked.append(_check_tag(one, config, told, of_all))
    if len(checked) == 1:
        return replace(checked[0], name=scene.name, evidence=known)
    return CheckReport(
        name=scene.name,
        drive=_check_drive(scene.trajectory),
        problems=tuple(dict.fromkeys(problem for tag in checked for problem in tag.problems)),
        notes=tuple(dict.fromkeys(note for tag in checked for note in tag.notes)),
        evidence=known,
        tags=tuple(checked),
    )


def _check_tag(
    scene: Scene,
    config: PipelineConfig,
    sides_told: bool,
    progress: Callable[[int, int], None],
) -> CheckReport:
    """Check the readings of one tag."""
    drive = _check_drive(scene.trajectory)
    episode, refused = _prepared(scene, config)
    readings = {} if episode is None else episode.readings
    anchors = []
    for index in range(scene.n_anchors):
        progress(index, scene.n_anchors)
        anchors.append(_check_anchor(scene, index, readings.get(scene.anchor_ids[index], _NONE)))
    unscored = () if scene.truth else ("no surveyed cones: nothing to score against",)
    if episode is None:
        return CheckReport(
            name=scene.name,
            drive=drive,
            anchors=tuple(anchors),
            problems=(*scene.problems, refused),
            notes=(*log_notes(scene), *unscored),
        )
    found = observe(scene.without_truth(), episode.clock)
    sides = () if sides_told else _unknown_sides(drive)
    return CheckReport(
        name=scene.name,
        drive=drive,
        anchors=tuple(anchors),
        observability=found,
        problems=(
            *map(str, log_reasons(episode, config)),
            *_lost_cones(episode, anchors, config),
        ),
        notes=(*episode.notes, *unscored, *sides, *found.notes(sides_told=sides_told)),
    )


def _prepared(scene: Scene, config: PipelineConfig) -> tuple[Episode | None, str]:
    """Return what a reconstruction locates cones from, or why it refuses the log."""
    try:
        return prepare(scene.without_truth(), config), ""
    except InputError as error:
        return None, str(error)


def _lost_cones(
    episode: Episode, anchors: Sequence[AnchorCheck], config: PipelineConfig
) -> Iterator[str]:
    """Say which cones a reconstruction cannot locate, and whether too few are left."""
    lost = hardly_heard(episode, config)
    for anchor in (anchors[n] for n in np.flatnonzero(lost).tolist()):
        if not anchor.n_readings:
            yield f"{anchor.anchor_id}: no readings"
        else:
            yield (
                f"{anchor.anchor_id}: {anchor.n_kept} of its {anchor.n_readings} readings can be "
                "used, too few to locate it"
            )
    n_left = int((~lost).sum())
    if n_left < _LEAST_CONES:
        yield f"a boundary needs {_LEAST_CONES} cones, and this log can give {n_left}"


def _unknown_sides(drive: DriveCheck) -> Iterator[str]:
    if drive.straightness < STRAIGHT_BELOW:
        yield "the path is straight: each cone and its mirror position fit equally well"


def _check_drive(drive: Trajectory) -> DriveCheck:
    centred_m = drive.position_m - drive.position_m.mean(axis=0)
    major, minor = np.linalg.svd(centred_m, compute_uv=False)
    return DriveCheck(
        n_samples=len(drive),
        duration_s=float(drive.t_s[-1] - drive.t_s[0]),
        rate_hz=1.0 / usual_interval_s(drive.t_s),
        longest_step_s=float(np.diff(drive.t_s).max()),
        path_length_m=drive.path_length_m,
        extent_m=float(np.hypot(*np.ptp(drive.position_m, axis=0))),
        straightness=float(minor / major) if major > 0 else 0.0,
    )


def _check_anchor(scene: Scene, index: int, counts: ReadingCounts) -> AnchorCheck:
    log = scene.ranges
    mine = log.anchor == index
    t_s, range_m = log.t_s[mine], log.range_m[mine]
    step_s = np.diff(t_s)
    usual_s = usual_interval_s(t_s)
    repeat = np.append(False, np.diff(range_m) == 0)[: len(range_m)]
    rssi = np.zeros(len(t_s)) * np.nan if log.rssi_dbm is None else log.rssi_dbm[mine]
    return AnchorCheck(
        anchor_id=scene.anchor_ids[index],
        n_readings=len(t_s),
        rate_hz=1.0 / usual_s,
        n_gaps=int((step_s > np.fmax(GAP_S, 2.5 * usual_s)).sum()),
        longest_gap_s=float(step_s.max(initial=0.0)),
        n_kept=counts.kept,
        n_spikes=counts.spikes,
        n_in_gaps=counts.in_gaps,
        n_outside=counts.outside,
        negative_share=_share(range_m < 0),
        repeat_share=_share(repeat),
        rssi_share=_share(np.isfinite(rssi)),
    )


def _share(found: Bool[Array, "R"]) -> float:
    return float(found.mean()) if found.size else 0.0
