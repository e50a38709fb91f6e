"""From a Scene to a work-zone boundary: the main job, step by step.

:func:`reconstruct` is the list; each step is one module. The command line, the evaluation and any
service call it; none of them has a second copy.

>>> from gaia_uwb.pipeline import reconstruct
>>> from gaia_uwb.simulate import PRESETS, simulate_pass
>>> result = reconstruct(simulate_pass(PRESETS["lane-closure"], seed=0))
>>> len(result.anchors), result.boundary.status.value
(8, 'ok')
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from gaia_uwb._shared import Array, Bool, ConfigError
from gaia_uwb.alignment import align, calibrate
from gaia_uwb.config import PipelineConfig
from gaia_uwb.denoised import DenoisedRanges
from gaia_uwb.denoisers import Denoiser, make_denoiser
from gaia_uwb.episode import Episode
from gaia_uwb.estimate import (
    AnchorFix,
    AnchorStatus,
    Boundary,
    BoundaryStatus,
    Reason,
    ReasonKind,
)
from gaia_uwb.locate import (
    LocatedPass,
    fuse,
    in_one_frame,
    join_windows,
    locate,
    mark_moved,
    with_anchor_ranges,
    with_anchors,
)
from gaia_uwb.reconstruction import Reconstruction, ReconstructionStatus
from gaia_uwb.scene import Scene
from gaia_uwb.zone import Decision, KnownFacts, decide_sides, decide_zone, make_boundary, widened

_MISFIT_M = 1.0  # ranges of a working radio on a known path err by less
_BIAS_SIGMA = 4.0  # no radio has a range bias this many prior standard deviations from 0


def prepare(scene: Scene, config: PipelineConfig = PipelineConfig()) -> Episode:
    """Bring a log onto one timeline and free its ranges of the radios' common bias.

    Parameters
    ----------
    scene
        The log. Its truth is carried over for scores, but nothing is decided by it.
    config
        ``alignment``, ``calibration`` and ``solver`` are used.

    Raises
    ------
    InputError
        If the clocks do not overlap or no range is usable.
    """
    episode = _without_hardly_heard(align(scene, config.alignment), config)
    if config.calibration.range_bias == "auto":
        episode = calibrate(episode, config.calibration, config.solver)
    return episode


def hardly_heard(episode: Episode, config: PipelineConfig = PipelineConfig()) -> Bool[Array, "N"]:
    """Return which anchors have too few readings, or steps with a range, to be located.

    Parameters
    ----------
    episode
        A whole aligned log.
    config
        ``solver.min_ranges`` is used.
    """
    n_valid = np.count_nonzero(episode.valid, axis=0)
    return np.asarray(np.minimum(episode.n_readings, n_valid) < config.solver.min_ranges)


def _without_hardly_heard(episode: Episode, config: PipelineConfig) -> Episode:
    """Take the ranges of anchors that cannot be located for what they are: none."""
    few = hardly_heard(episode, config)
    if not few.any():
        return episode
    valid = episode.valid & ~few
    return replace(episode, valid=valid, range_m=np.where(valid, episode.range_m, np.nan))


def reconstruct(
    scene: Scene | Sequence[Scene], config: PipelineConfig = PipelineConfig()
) -> Reconstruction:
    """Reconstruct a work zone from the log of one drive, or from those of several past one zone.

    Parameters
    ----------
    scene
        The log, or the logs of several passes of one zone; their truth is not used.
    config
        All settings.

    Returns
    -------
    Reconstruction
        Ranges, anchors and boundary; of several passes in the order of their names and in the
        frame of the first.

    Raises
    ------
    ConfigError
        If the denoiser's name is unknown.
    InputError
        If the clocks do not overlap or no range is usable, or passes have no frame in common or
        hold the same drive.

    Examples
    --------
    A straight lane leaves the sides open; a second lane resolves them:

    >>> from gaia_uwb.simulate import PRESETS, simulate_zone
    >>> near, far = simulate_zone(PRESETS["straight"], seed=3)
    >>> max(fix.mirror_probability for fix in reconstruct(near).anchors) > 0.05
    True
    >>> max(fix.mirror_probability for fix in reconstruct([near, far]).anchors) < 0.001
    True
    """
    scenes = [scene] if isinstance(scene, Scene) else in_one_frame(scene)
    return reconstruct_passes([prepare(each.without_truth(), config) for each in scenes], config)


def reconstruct_passes(
    episodes: Sequence[Episode], config: PipelineConfig = PipelineConfig()
) -> Reconstruction:
    """Reconstruct a work zone from prepared passes, or from windows of them, in one frame.

    Parameters
    ----------
    episodes
        At least one; their truth is not used. Windows that were cut from one run are joined, so
        that nothing counts twice where they overlap.
    config
        All settings; ``alignment`` and ``calibration`` say what was known before the passes.

    Returns
    -------
    Reconstruction
        The passes in the order of their names.

    Raises
    ------
    ConfigError
        If the denoiser's name is unknown.
    """
    passes = sorted((e.without_truth() for e in join_windows(episodes)), key=lambda e: e.name)
    if len(passes) == 1:
        return reconstruct_episodes(passes, config)[0]
    denoiser = make_denoiser(config.denoiser)
    denoised = _denoise(denoiser, passes, config.denoiser)
    evidence = _evidence(denoiser, passes, denoised, config)
    hypotheses = locate(passes, evidence, config.solver)
    fused = fuse(list(map(LocatedPass, passes, evidence, hypotheses)), config)
    ids = fused.anchor_ids
    first, *more = [
        (with_anchors(episode, ids), with_anchor_ranges(ranges, episode, ids))
        for episode, ranges in zip(passes, denoised, strict=True)
    ]
    facts = KnownFacts.of(config.prior, first[0])
    decision = decide_sides(ids, fused.hypotheses, config.sides, config.solver, facts)
    with_all = [episode for episode, _ in (first, *more)]
    anchors = counted_in_readings(mark_moved(decision.anchors, fused), with_all, config)
    boundary = make_boundary(np.stack([anchor.position_m for anchor in anchors]))
    reasons = (
        *_pass_reasons(passes, denoiser, config),
        *fused.reasons(),
        *decision.reasons,
        *_reasons(anchors, boundary),
    )
    status = ReconstructionStatus.UNRELIABLE if reasons else ReconstructionStatus.OK
    possible = (decision.hypotheses, decision.combinations)
    return Reconstruction(*first, anchors, boundary, status, reasons, config, possible, tuple(more))


def reconstruct_episodes(
    episodes: Sequence[Episode],
    config: PipelineConfig = PipelineConfig(),
    *,
    true_nlos: Sequence[Bool[Array, "_ _"]] | None = None,
) -> list[Reconstruction]:
    """Reconstruct prepared episodes, batched; each result is what the episode alone would give.

    Parameters
    ----------
    episodes
        Whole runs or windows of them; their truth is not used.
    config
        ``denoiser``, ``solver``, ``sides`` and ``prior`` are used.
    true_nlos
        True NLOS labels, for the paper's labelled setting of the ``wls`` solver only.

    Raises
    ------
    ConfigError
        If the denoiser's name is unknown.
    """
    blind = [episode.without_truth() for episode in episodes]
    denoiser = make_denoiser(config.denoiser)
    denoised = _denoise(denoiser, blind, config.denoiser)
    decisions = _decide(blind, denoiser, denoised, config, true_nlos)
    results = []
    for episode, ranges, decision in zip(blind, denoised, decisions, strict=True):
        anchors = counted_in_readings(decision.anchors, [episode], config)
        boundary = make_boundary(np.stack([anchor.position_m for anchor in anchors]))
        reasons = (
            *log_reasons(episode, config),
            *denoiser.notes(episode),
            *decision.reasons,
            *_reasons(anchors, boundary),
        )
        status = ReconstructionStatus.UNRELIABLE if reasons else ReconstructionStatus.OK
        possible = (decision.hypotheses, decision.combinations)
        results.append(
            Reconstruction(episode, ranges, anchors, boundary, status, reasons, config, possible)
        )
    return results


def _denoise(
    denoiser: Denoiser, episodes: Sequence[Episode], name: str
) -> Sequence[DenoisedRanges]:
    """Denoise episodes, and check the shapes that a third-party denoiser returns."""
    denoised = denoiser(episodes)
    wanted = [episode.range_m.shape for episode in episodes]
    got = [ranges.range_m.shape for ranges in denoised]
    if got != wanted:
        raise ConfigError(f"denoiser {name!r}: expected ranges of shapes {wanted}, got {got}")
    return denoised


def _pass_reasons(
    passes: Sequence[Episode], denoiser: Denoiser, config: PipelineConfig
) -> Iterator[Reason]:
    """Say what is wrong with single passes."""
    for episode in passes:
        for reason in (*log_reasons(episode, config), *denoiser.notes(episode)):
            yield replace(reason, text=f"{episode.name}: {reason}", passes=(episode.name,))


def _evidence(
    denoiser: Denoiser,
    episodes: Sequence[Episode],
    denoised: Sequence[DenoisedRanges],
    config: PipelineConfig,
) -> Sequence[DenoisedRanges]:
    """Return the ranges that the solver uses; the paper's solver takes what it is given."""
    if denoiser.locates and config.solver.kind == "robust":
        return make_denoiser("raw")(episodes)
    return denoised


def _decide(
    episodes: Sequence[Episode],
    denoiser: Denoiser,
    denoised: Sequence[DenoisedRanges],
    config: PipelineConfig,
    true_nlos: Sequence[Bool[Array, "_ _"]] | None,
) -> list[Decision]:
    """Decide the sides: by what the denoiser knows of work zones, or by the ranges and a prior.

    The paper's solver and sides that are decided one by one are asked for to see what they give:
    then the denoiser has no say.
    """
    ours = config.solver.kind == "robust" and config.sides.joint
    decisions: dict[int, Decision] = {}
    for k, (episode, ranges) in enumerate(zip(episodes, denoised, strict=True)):
        if ranges.zone is not None and ours:
            facts = KnownFacts.of(config.prior, episode)
            n_ranges = np.count_nonzero(ranges.valid, axis=0)
            zone = widened(ranges.zone, episode, config.solver)
            decisions[k] = decide_zone(
                episode.anchor_ids, zone, n_ranges, config.sides, config.solver, facts
            )
    rest = [k for k in range(len(episodes)) if k not in decisions]
    labels = None if true_nlos is None else [true_nlos[k] for k in rest]
    own = [episodes[k] for k in rest]
    evidence = _evidence(denoiser, own, [denoised[k] for k in rest], config)
    found = locate(own, evidence, config.solver, nlos=labels)
    for k, episode, places in zip(rest, own, found, strict=True):
        facts = KnownFacts.of(config.prior, episode)
        decisions[k] = decide_sides(episode.anchor_ids, places, config.sides, config.solver, facts)
    return [decisions[k] for k in range(len(episodes))]


def counted_in_readings(
    anchors: Sequence[AnchorFix], passes: Sequence[Episode], config: PipelineConfig
) -> tuple[AnchorFix, ...]:
    """Return fixes that count readings, not the steps that are interpolated between them.

    Parameters
    ----------
    anchors
        One fix per anchor; their ``n_ranges`` are steps of all passes.
    passes
        The passes that they are from, all with these anchors.
    config
        ``solver.min_ranges`` is used.
    """
    n_steps = np.sum([np.count_nonzero(episode.valid, axis=0) for episode in passes], axis=0)
    n_readings = np.sum([episode.n_readings for episode in passes], axis=0)
    counted = []
    for fix, steps, readings in zip(anchors, n_steps, n_readings, strict=True):
        if steps:
            n_ranges = min(round(fix.n_ranges * readings / steps), int(readings))
        else:
            few = [episode.readings.get(fix.anchor_id) for episode in passes]
            least = config.solver.min_ranges
            n_ranges = sum(counts.kept for counts in few if counts and counts.kept < least)
        counted.append(replace(fix, n_ranges=n_ranges))
    return tuple(counted)


def log_reasons(episode: Episode, config: PipelineConfig = PipelineConfig()) -> Iterator[Reason]:
    """Say what is wrong with the whole log, before any cone is located.

    Its reading, its clocks, and the size of its errors: a reconstruction has these reasons, and
    ``gaia data check`` calls them problems.

    Parameters
    ----------
    episode
        A whole log, as :func:`prepare` makes it.
    config
        The settings that it was prepared with.
    """
    yield from episode.problems
    clock, found = episode.clock, episode.calibration
    if clock is not None and (
        clock.sigma_s > config.alignment.clock_offset_sigma_s
        or clock.sigma_s * episode.usual_speed_mps > config.solver.ill_conditioned_above_m
    ):
        yield Reason(
            ReasonKind.CLOCK,
            f"clock offset uncertain: {clock.reason}",
            numbers={"sigma_s": clock.sigma_s},
        )
    if found is None:
        return
    explained = any(problem.kind is ReasonKind.MISFIT for problem in episode.problems)
    if found.sigma_m > _MISFIT_M and not explained:
        half_m = 0.67 * found.sigma_m
        text = (
            f"the ranges do not fit the path: half of them are off by more than {half_m:.1f} m; "
            "check units, clocks, heights and ids"
        )
        yield Reason(ReasonKind.MISFIT, text, numbers={"half_beyond_m": half_m})
    prior_m = np.array([config.calibration.bias_sigma_m, config.calibration.bias_slope_sigma_m])
    if float(np.hypot(*(found.bias / np.maximum(prior_m, 1e-9)))) > _BIAS_SIGMA:
        bias_m, growth_m = found.bias.tolist()
        text = (
            f"range bias of {bias_m:+.2f} m at 10 m and {growth_m:+.2f} m more for ten times the "
            f"distance, implausible for UWB radios (about ±{prior_m[0]:g} m and "
            f"±{prior_m[1]:g} m): check the unit and the zero offset of the ranges"
        )
        numbers = {"bias_m": bias_m, "growth_m": growth_m}
        yield Reason(ReasonKind.RANGE_BIAS, text, numbers=numbers)


def _reasons(anchors: Sequence[AnchorFix], boundary: Boundary) -> Iterator[Reason]:
    """Say why the boundary cannot be relied upon."""
    for status in AnchorStatus:
        if status is not AnchorStatus.OK:
            ids = [
                anchor.anchor_id
                for anchor in anchors
                if anchor.status is status
                or (status is AnchorStatus.AMBIGUOUS and anchor.side_is_open)
            ]
            if ids:
                text = f"{_listed(ids, len(anchors))}: {status.message}"
                yield Reason(status.reason_kind, text, cones=tuple(ids))
    if boundary.status is BoundaryStatus.TOO_FEW_ANCHORS:
        text = "fewer than three cones were located, so there is no boundary"
        yield Reason(ReasonKind.TOO_FEW_CONES, text)
    elif boundary.status is BoundaryStatus.COLLINEAR:
        text = "all located cones are on one line, so the boundary encloses no area"
        yield Reason(ReasonKind.COLLINEAR, text)
    elif _in_one_place(anchors):
        text = "all located cones are in one place within their errors, so there is no boundary"
        yield Reason(ReasonKind.COLLINEAR, text)


def _in_one_place(anchors: Sequence[AnchorFix]) -> bool:
    """Whether no cone stands farther from their middle than they are known."""
    located = [anchor for anchor in anchors if anchor.status.has_position]
    place_m = np.array([anchor.position_m for anchor in located])
    off_m = np.hypot(*(place_m - place_m.mean(axis=0)).T)
    return bool(off_m.max() < max(anchor.semi_axes_90_m[0] for anchor in located))


def _listed(ids: Sequence[str], n_cones: int) -> str:
    """Name up to five cones, or say that it is all of them."""
    if len(ids) == n_cones > 1:
        return "both cones" if n_cones == 2 else f"all {n_cones} cones"
    more = f" and {len(ids) - 5} more" if len(ids) > 5 else ""
    return f"{', '.join(ids[:5])}{more}"
