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

from gaia_uwb._shared import Array, Bool, ConfigError, some_of
from gaia_uwb.alignment import align, calibrate, log_problems
from gaia_uwb.config import PipelineConfig
from gaia_uwb.denoised import DenoisedRanges
from gaia_uwb.denoisers import Denoiser, make_denoiser
from gaia_uwb.episode import ClockOffset, DriveErrors, Episode
from gaia_uwb.estimate import (
    AnchorFix,
    AnchorStatus,
    Reason,
    ReasonKind,
)
from gaia_uwb.locate import (
    CLOCK_KNOWN,
    Fused,
    Hypotheses,
    ZonePlaces,
    contradicted_values,
    find_places,
    fuse,
    in_one_frame,
    join_windows,
    known_clock,
    locate,
    mark_moved,
    with_anchor_ranges,
    with_anchors,
    with_clock,
    with_run_errors,
)
from gaia_uwb.reconstruction import Reconstruction, ReconstructionStatus
from gaia_uwb.roadside import road_edge
from gaia_uwb.scene import Scene
from gaia_uwb.zone import (
    Decision,
    KnownFacts,
    decide_sides,
    decide_zone,
    dispose,
    make_boundary,
    widened,
)

_FEWEST_CONES = 2  # that have an edge
_OVER_M = 0.5  # from the path of a vehicle's middle: no cone stands so near and is left standing
_MISFIT_M = 1.0  # ranges of a working radio on a known path err by less
_BIAS_SIGMA = 4.0  # no radio has a range bias this many prior standard deviations from 0
_GROWTH_SIGMA = 2.0  # no radio's bias grows with distance by this many of them
_MOST_NAMED = 5
_MOST_PATTERN_M = 0.15  # nor does a tag err by more with the direction from the vehicle
_CAUSES = (ReasonKind.MISFIT, ReasonKind.CLOCK, ReasonKind.RANGE_BIAS)  # of what fits no place


def prepare(scene: Scene, config: PipelineConfig = PipelineConfig()) -> Episode:
    """Bring a log onto one timeline and free its ranges of the radios' common bias.

    Parameters
    ----------
    scene
        The log. Its truth is carried over for scores, but nothing is decided by it.
    config
        ``alignment``, ``calibration``, ``solver`` and ``vehicles`` are used.

    Raises
    ------
    InputError
        If the clocks do not overlap or no range is usable.
    ConfigError
        If a road's edge is given, but not where the local frame is on the Earth.
    """
    return _prepare(scene, config, alone=True)


def prepare_pass(scene: Scene, config: PipelineConfig = PipelineConfig()) -> Episode:
    """Prepare a log like :func:`prepare`, as one of several of a zone.

    Parameters
    ----------
    scene
        The log, of one tag.
    config
        As in :func:`prepare`.

    Returns
    -------
    Episode
        With the readings of cones of which it has few: other passes may have more of them.
    """
    return _prepare(scene, config, alone=False)


def as_only_pass(episode: Episode, config: PipelineConfig = PipelineConfig()) -> Episode:
    """Return what :func:`prepare` gives, from what :func:`prepare_pass` gave.

    Parameters
    ----------
    episode
        A prepared log.
    config
        That it was prepared with.
    """
    return _without_hardly_heard(episode, config, alone=True)


def _prepare(scene: Scene, config: PipelineConfig, *, alone: bool) -> Episode:
    """Prepare a log; where it is not ``alone``, its errors are found with those of the others."""
    road_edge(config.boundary, scene.frame)  # before any work
    aligned = align(scene, config.alignment, clock=_known_clock(scene, config))
    episode = _without_hardly_heard(aligned, config, alone=alone)
    places = find_places([[episode]], config)[0]
    apart = tuple(contradicted_values([episode], places.errors, config))
    before_s = _applied_s(episode)
    episode = with_run_errors(episode, places, config)
    if _applied_s(episode) != before_s:
        clock, errors = episode.clock, episode.errors
        episode = _without_hardly_heard(
            align(scene, config.alignment, clock=clock), config, alone=alone
        )
        episode = replace(episode, errors=errors)
    if config.calibration.range_bias == "auto":
        episode = calibrate(episode, config.calibration, config.solver)
    offset_s = _applied_s(episode)
    gap_s = config.alignment.max_pose_gap_s
    problems = log_problems(
        scene, offset_s, max_gap_s=gap_s, unexplained=_unexplained(places, config)
    )
    contradictions = _contradictions(places) if alone else ()
    return replace(episode, problems=(*problems, *apart, *contradictions, *episode.problems))


def _contradictions(places: ZonePlaces) -> Iterator[Reason]:
    """Name ranges between cones that contradict all others."""
    for one, other, measured_m, expected_m in places.contradictions[:_MOST_NAMED]:
        text = (
            f"{one} and {other} measured {measured_m:.2f} m between them, but the other ranges put "
            f"them {expected_m:.2f} m apart: was one of them moved, or is its id there twice?"
        )
        numbers = {"measured_m": measured_m, "expected_m": expected_m}
        yield Reason(ReasonKind.DOES_NOT_FIT, text, cones=(one, other), numbers=numbers)


def _known_clock(scene: Scene, config: PipelineConfig) -> ClockOffset | None:
    """Return the clock offset that is known of a vehicle, so that none has to be sought."""
    known = known_clock(scene, config)
    if known is None or config.alignment.clock_offset == "off":
        return None
    return ClockOffset(known.value, known.sigma, True, CLOCK_KNOWN)


def _applied_s(episode: Episode) -> float:
    return 0.0 if episode.clock is None else episode.clock.applied_s


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


def _without_hardly_heard(episode: Episode, config: PipelineConfig, *, alone: bool) -> Episode:
    """Take the ranges of anchors that cannot be located for what they are: none.

    Readings that are too few in one pass may be enough with those of others, or with ranges between
    cones.
    """
    few = hardly_heard(episode, config)
    if not few.any():
        return episode
    valid = episode.valid & ~few
    heard = episode.own_times
    if alone and heard is not None and episode.cone_ranges is None:
        heard = heard.without(few)
    range_m = np.where(valid, episode.range_m, np.nan)
    return replace(episode, valid=valid, range_m=range_m, own_times=heard)


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
    scenes = in_one_frame([scene] if isinstance(scene, Scene) else scene)
    blind = [each.without_truth() for each in scenes]
    return reconstruct_passes(
        [_prepare(each, config, alone=len(blind) == 1) for each in blind], config
    )


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
    fused = fuse(_evidence(denoiser, passes, denoised), config)
    apart = tuple(contradicted_values(passes, fused.places.errors, config))
    return _concluded(passes, denoised, denoiser, fused, apart, config)


def conclude(
    passes: Sequence[Episode], fused: Fused, config: PipelineConfig = PipelineConfig()
) -> Reconstruction:
    """Decide the sides and draw the boundary where all cones have been located already.

    Parameters
    ----------
    passes
        Prepared passes to show with the result, in the order of ``fused.places.errors``.
    fused
        What is known of the cones: of these passes, and maybe of others.
    config
        All settings.
    """
    blind = [episode.without_truth() for episode in passes]
    denoiser = make_denoiser(config.denoiser)
    denoised = _denoise(denoiser, blind, config.denoiser)
    return _concluded(blind, denoised, denoiser, fused, (), config)


def _concluded(
    passes: Sequence[Episode],
    denoised: Sequence[DenoisedRanges],
    denoiser: Denoiser,
    fused: Fused,
    apart: tuple[Reason, ...],
    config: PipelineConfig,
) -> Reconstruction:
    """Decide the sides of cones that several passes have located, and draw the boundary."""
    ids = fused.places.anchor_ids
    passes = [
        _as_fused(episode, errors, fused.places, config)
        for episode, errors in zip(passes, fused.places.errors, strict=True)
    ]
    first, *more = [
        (with_anchors(episode, ids), with_anchor_ranges(ranges, episode, ids))
        for episode, ranges in zip(passes, denoised, strict=True)
    ]
    facts = KnownFacts.of(config.prior, first[0])
    settings = (config.sides, config.solver, facts)
    decision = decide_sides(ids, fused.hypotheses, first[0].position_m, *settings)
    with_all = [episode for episode, _ in (first, *more)]
    anchors = counted_in_readings(mark_moved(decision.anchors, fused), with_all, config)
    boundary = make_boundary(np.stack([anchor.position_m for anchor in anchors]))
    reasons = (
        *_pass_reasons(passes, denoiser, config),
        *apart,
        *fused.reasons(),
        *_contradictions(fused.places),
        *decision.reasons,
        *_reasons(anchors, with_all),
    )
    reasons = _but_for_surveys(reasons, anchors, config)
    status = ReconstructionStatus.UNRELIABLE if reasons else ReconstructionStatus.OK
    possible = (decision.hypotheses, decision.combinations)
    return Reconstruction(*first, anchors, boundary, status, reasons, config, possible, tuple(more))


def reconstruct_episodes(
    episodes: Sequence[Episode],
    config: PipelineConfig = PipelineConfig(),
    *,
    denoiser: Denoiser | None = None,
    true_nlos: Sequence[Bool[Array, "_ _"]] | None = None,
) -> list[Reconstruction]:
    """Reconstruct prepared episodes, batched; each result is what the episode alone would give.

    Parameters
    ----------
    episodes
        Whole runs or windows of them; their truth is not used.
    config
        ``denoiser``, ``solver``, ``sides`` and ``prior`` are used.
    denoiser
        By default the one that ``config`` names.
    true_nlos
        True NLOS labels, for the paper's labelled setting of the ``wls`` solver only.

    Raises
    ------
    ConfigError
        If the denoiser's name is unknown.
    """
    blind = [episode.without_truth() for episode in episodes]
    denoiser = make_denoiser(config.denoiser) if denoiser is None else denoiser
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
            *_reasons(anchors, [episode]),
        )
        reasons = _but_for_surveys(reasons, anchors, config)
        status = ReconstructionStatus.UNRELIABLE if reasons else ReconstructionStatus.OK
        possible = (decision.hypotheses, decision.combinations)
        results.append(
            Reconstruction(episode, ranges, anchors, boundary, status, reasons, config, possible)
        )
    return results


def _unexplained(places: ZonePlaces, config: PipelineConfig) -> tuple[str, ...]:
    """Return the cones whose ranges no position of working radios explains.

    That is all of them where the ranges grow with the distance as those of no radio do: a clock
    that drifts is taken up by such a growth.
    """
    growth_m = abs(float(places.errors[0].mean[1]))
    if growth_m > _GROWTH_SIGMA * max(config.calibration.bias_slope_sigma_m, 1e-9):
        return places.anchor_ids
    return places.unexplained()


def _as_fused(
    episode: Episode, errors: DriveErrors, places: ZonePlaces, config: PipelineConfig
) -> Episode:
    """Return a pass with what all passes together say of its clock, its errors and its problems."""
    unexplained = set(_unexplained(places, config))
    most = len(unexplained) > 0.5 * len(places.anchor_ids)
    problems = tuple(
        problem
        for problem in episode.problems
        if problem.kind is not ReasonKind.VEHICLE  # all passes together tell that better
        and (
            problem.kind not in _CAUSES
            or (most if not problem.cones else unexplained & {*problem.cones})
        )
    )
    known = with_clock(episode, errors, config)
    return replace(known, errors=errors, problems=problems)


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
    """Say what is wrong with single passes; what all tags of a drive share is said once."""
    found: dict[tuple[str, str], tuple[Reason, list[str]]] = {}
    for episode in passes:
        drive = episode.drive or episode.name
        for reason in (*log_reasons(episode, config), *denoiser.notes(episode)):
            found.setdefault((drive, reason.text), (reason, []))[1].append(episode.name)
    for (drive, _), (reason, names) in found.items():
        tags = [episode.name for episode in passes if (episode.drive or episode.name) == drive]
        where = drive if names == tags else ", ".join(names)
        yield replace(reason, text=f"{where}: {reason}", passes=tuple(names))


def _evidence(
    denoiser: Denoiser, episodes: Sequence[Episode], denoised: Sequence[DenoisedRanges]
) -> list[Episode]:
    """Return the episodes with the ranges that anchors are located from.

    That is what was measured, where a denoiser has used the path: its ranges agree with a place
    that it has in mind. Other denoisers' ranges are used, with noise as large as what they removed:
    they err alike from step to step.
    """
    if denoiser.keeps_ranges or denoiser.uses_pose:
        return list(episodes)
    return [
        replace(
            episode,
            range_m=ranges.range_m,
            valid=ranges.valid,
            own_times=None,
            least_noise_m=_removed_m(episode, ranges),
        )
        for episode, ranges in zip(episodes, denoised, strict=True)
    ]


def _removed_m(episode: Episode, ranges: DenoisedRanges) -> float:
    """Return the standard deviation of what a denoiser took away."""
    both = episode.valid & ranges.valid
    if not both.any():
        return 0.0
    removed_m = np.abs(episode.range_m[both] - ranges.range_m[both])
    return float(1.4826 * np.median(removed_m))


def _decide(
    episodes: Sequence[Episode],
    denoiser: Denoiser,
    denoised: Sequence[DenoisedRanges],
    config: PipelineConfig,
    true_nlos: Sequence[Bool[Array, "_ _"]] | None,
) -> list[Decision]:
    """Decide where every anchor stands: by the ranges, and what is known of work zones.

    Sides that are decided one by one are asked for to see what they give: then what the denoiser
    knows of zones has no say.
    """
    decisions = []
    located = _found(episodes, denoiser, denoised, config, true_nlos)
    for k, (episode, (places, rough)) in enumerate(zip(episodes, located, strict=True)):
        zone = denoised[k].zone
        facts = KnownFacts.of(config.prior, episode)
        settings = (config.sides, config.solver, facts)
        if zone is None or config.solver.kind != "robust" or not config.sides.joint:
            path_m = episode.position_m
            decisions.append(decide_sides(episode.anchor_ids, places, path_m, *settings))
            continue
        known = (places.n_ranges, *settings)
        if rough:
            zone = widened(zone, episode, config.solver)
            decisions.append(decide_zone(episode.anchor_ids, zone, *known))
            continue
        found = dispose(zone, places)
        decision = decide_zone(episode.anchor_ids, found.zone, *known, found.by_ranges)
        reasons = (*found.reasons(episode.anchor_ids), *decision.reasons)
        decisions.append(replace(decision, reasons=reasons))
    return decisions


def _found(
    episodes: Sequence[Episode],
    denoiser: Denoiser,
    denoised: Sequence[DenoisedRanges],
    config: PipelineConfig,
    true_nlos: Sequence[Bool[Array, "_ _"]] | None,
) -> list[tuple[Hypotheses, bool]]:
    """Return both places of every anchor of every episode, by its ranges.

    With them comes whether a scene without a log behind it has rougher errors than the estimator's
    model: so short a time does not tell how large they are, and a network that was trained on such
    scenes knows better.
    """
    if true_nlos is not None and config.solver.kind == "robust":
        raise ValueError("the robust solver takes no NLOS labels")
    if config.solver.kind == "wls":
        places = locate(episodes, denoised, config.solver, nlos=true_nlos)
        return [(each, False) for each in places]
    evidence = _evidence(denoiser, episodes, denoised)
    found = find_places([[e] for e in evidence], config)
    return [
        (each.hypotheses, each.rough and episode.clock is None)
        for episode, each in zip(episodes, found, strict=True)
    ]


def counted_in_readings(
    anchors: Sequence[AnchorFix], passes: Sequence[Episode], config: PipelineConfig
) -> tuple[AnchorFix, ...]:
    """Return fixes that count the readings that were kept, not the steps between them.

    Parameters
    ----------
    anchors
        One fix per anchor.
    passes
        The passes that they are from, all with these anchors.
    config
        ``solver.min_ranges`` is used.
    """
    n_steps = np.sum([np.count_nonzero(episode.valid, axis=0) for episode in passes], axis=0)
    n_readings = np.sum([episode.n_readings for episode in passes], axis=0)
    counted = []
    for fix, steps, readings in zip(anchors, n_steps, n_readings, strict=True):
        n_ranges = int(readings)
        if not steps:
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
    errors = episode.errors
    if errors is None or not episode.valid.any():
        return
    decades = np.log10(float(np.median(episode.range_m[episode.valid])) / 10.0)
    bias_m = float(errors.mean[0] + errors.mean[1] * decades + errors.mean[3])
    prior_m = config.calibration.bias_sigma_m
    if abs(bias_m) > _BIAS_SIGMA * max(prior_m, 1e-9):
        text = (
            f"range bias of {bias_m:+.2f} m, implausible for UWB radios (about ±{prior_m:g} m): "
            "check the unit and the zero offset of the ranges"
        )
        yield Reason(ReasonKind.RANGE_BIAS, text, numbers={"bias_m": bias_m})
    pattern_m = float(np.hypot(*errors.mean[4:6]))
    if pattern_m > _MOST_PATTERN_M:
        text = (
            f"the ranges fit the path only if they err by {pattern_m:.2f} m with the direction "
            "from the vehicle: is the path that of the tag's antenna, and was its fix never lost?"
        )
        yield Reason(ReasonKind.MISFIT, text, numbers={"pattern_m": pattern_m})


def _reasons(anchors: Sequence[AnchorFix], passes: Sequence[Episode]) -> Iterator[Reason]:
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
    located = [anchor for anchor in anchors if anchor.status.has_position]
    if len(located) < _FEWEST_CONES:
        text = "fewer than two cones were located, so there is no edge"
        yield Reason(ReasonKind.TOO_FEW_CONES, text)
    elif _in_one_place(located):
        text = "all located cones are in one place within their errors, so there is no edge"
        yield Reason(ReasonKind.COLLINEAR, text)
    elif _on_path(located, passes):
        text = "all located cones are on the driven path within their errors, so there is no edge"
        yield Reason(ReasonKind.COLLINEAR, text)


def _but_for_surveys(
    reasons: tuple[Reason, ...], anchors: Sequence[AnchorFix], config: PipelineConfig
) -> tuple[Reason, ...]:
    """Return the reasons without that of the clock, where surveyed cones tell where all stand."""
    located = [anchor for anchor in anchors if anchor.status.has_position]
    if not config.prior.known_anchors or any(x.status is not AnchorStatus.OK for x in located):
        return reasons
    return tuple(reason for reason in reasons if reason.kind is not ReasonKind.CLOCK)


def _on_path(located: Sequence[AnchorFix], passes: Sequence[Episode]) -> bool:
    """Whether a vehicle drove over every cone, as far as is known."""
    return all(
        min(np.hypot(*(fix.position_m - each.position_m).T).min() for each in passes)
        < max(fix.semi_axes_90_m[1], _OVER_M)
        for fix in located
    )


def _in_one_place(located: Sequence[AnchorFix]) -> bool:
    """Whether no cone stands farther from their middle than they are known."""
    place_m = np.array([anchor.position_m for anchor in located])
    off_m = np.hypot(*(place_m - place_m.mean(axis=0)).T)
    return bool(off_m.max() < max(anchor.semi_axes_90_m[0] for anchor in located))


def _listed(ids: Sequence[str], n_cones: int) -> str:
    """Name up to five cones, or say that it is all of them."""
    if len(ids) == n_cones > 1:
        return "both cones" if n_cones == 2 else f"all {n_cones} cones"
    return some_of(ids)
