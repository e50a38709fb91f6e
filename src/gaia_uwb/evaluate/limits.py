"""What limited a reconstruction, and what to do about it: in plain words, each with its numbers.

Every check tests one thing in the log or the result, and says nothing where that is good enough.
All of it follows from the data; no truth is needed. What was done already is not advised again.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from gaia_uwb._shared import SIGMAS_90, Array, Bool, Float64, metres, percent, printable
from gaia_uwb.config import PipelineConfig
from gaia_uwb.episode import Episode
from gaia_uwb.estimate import AnchorFix, AnchorStatus, Reason, ReasonKind
from gaia_uwb.evaluate.advice import Advice
from gaia_uwb.evaluate.residuals import range_residual_m
from gaia_uwb.locate import known_clock

_CLOCK_SHIFT_M = 0.1  # a clock that is known worse than this moves the cones visibly
_FEW_RANGES = 30
_GAP_S, _GAP_SHARE = 2.0, 0.1  # of the time between a cone's first and last range
_STRAIGHT_BELOW = 0.02  # width of a path as a share of its length
_SHORT_BELOW = 0.5  # extent of the path as a share of the usual range
_BIAS_M = 0.4  # radios that were calibrated read better
_OWN_BIAS_M = 0.15
_BLOCKED_SHARE = 0.05  # of a cone's ranges that read too long
_BLOCKED_M = 0.3
_HEIGHT_M = 0.05  # a range that a height of a metre changes by more counts
_FAST_MPS = 5.0
_MISFIT_M = 1.0
_LANE_M = 2.0  # paths that are farther apart run in two lanes; one that strays more is no line
_BOTH_WAYS_SHARE = 0.2  # of the way, which is driven against the rest of it
_MOST_PLACES = 300  # of a path that are compared with another
_ADVICE = {
    ReasonKind.LOG: Advice.CHECK_LOG,
    ReasonKind.STATEMENT: Advice.CHECK_STATEMENT,
    ReasonKind.EXCEPTION: Advice.CHECK_STATEMENT,
    ReasonKind.NOT_ONE_ZONE: Advice.CHECK_PASSES,
    ReasonKind.VEHICLE: Advice.CHECK_VEHICLE,
}
"""What to do about the reasons that no check of the ranges below finds."""


@dataclass(frozen=True)
class Limit:
    """One thing that limited a reconstruction.

    Parameters
    ----------
    kind
        Which.
    text
        What was found, in one or two plain sentences with numbers.
    advice
        What to do about it.
    """

    kind: ReasonKind
    text: str
    advice: tuple[Advice, ...]


def find_limits(
    episode: Episode,
    anchors: Sequence[AnchorFix],
    config: PipelineConfig = PipelineConfig(),
    *,
    name: Callable[[str], str] = printable,
    passes: Sequence[Episode] = (),
) -> tuple[Limit, ...]:
    """Say what limited a reconstruction; nothing where every check is passed.

    Parameters
    ----------
    episode
        Its ranges, path and clocks.
    anchors
        One fix per anchor, in the order of ``episode.anchor_ids``.
    config
        The settings that it was made with.
    name
        How an anchor's id is written, so that a file's own marks can be escaped.
    passes
        All passes that were fused, in one frame; by default the episode alone.

    Examples
    --------
    >>> from gaia_uwb.pipeline import reconstruct
    >>> from gaia_uwb.simulate import PRESETS, simulate_pass
    >>> result = reconstruct(simulate_pass(PRESETS["straight"], seed=4))
    >>> [limit.kind.value for limit in find_limits(result.episode, result.anchors)][:2]
    ['ambiguous', 'gaps']
    """
    view = _View(episode, tuple(anchors), config, name, tuple(passes) or (episode,))
    checks: tuple[Callable[[_View], Iterable[Limit]], ...] = (
        _misfit, _clock, _short_path, _moved, _unknown_side, _poor_geometry, _not_settled,
        _unexplained, _lost, _few_ranges, _gaps, _blocked, _range_bias, _heights, _few_cones,
    )  # fmt: skip
    if not episode.valid.any():  # nothing of it was heard well enough
        checks = (_lost, _few_cones)
    done = _followed(view)
    return tuple(
        replace(limit, advice=tuple(advice for advice in limit.advice if advice not in done))
        for check in checks
        for limit in check(view)
    )


def limits_of_reasons(
    reasons: Sequence[Reason], *, name: Callable[[str], str] = printable
) -> tuple[Limit, ...]:
    """Say what limited a reconstruction besides its log: wrong statements, passes that disagree.

    Parameters
    ----------
    reasons
        Of the reconstruction.
    name
        How a text is written, so that a file's own marks can be escaped.
    """
    return tuple(
        Limit(reason.kind, f"{name(reason.text[:1].upper() + reason.text[1:])}.", (advice,))
        for reason in reasons
        if (advice := _ADVICE.get(reason.kind)) is not None
    )


@dataclass(frozen=True)
class _View:
    """A reconstruction, and what several checks need of it."""

    episode: Episode
    anchors: tuple[AnchorFix, ...]
    config: PipelineConfig
    name: Callable[[str], str]
    passes: tuple[Episode, ...]

    def cones(self, chosen: Sequence[AnchorFix]) -> str:
        """Name up to five cones, or say that it is all of them."""
        if len(chosen) == len(self.anchors) > 1:
            return "both cones" if len(chosen) == 2 else f"all {len(chosen)} cones"
        names = [f"{self.name(anchor.anchor_id)}" for anchor in chosen]
        if len(names) > 5:
            names = [*names[:5], f"{len(names) - 5} more"]
        return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"

    def of_status(self, status: AnchorStatus) -> list[AnchorFix]:
        return [anchor for anchor in self.anchors if anchor.status is status]

    @cached_property
    def residual_m(self) -> Float64[Array, "T N"]:
        return range_residual_m(self.episode, self.anchors)

    @property
    def heights_are_known(self) -> bool:
        up_m = self.episode.anchor_up_m
        known = up_m is not None and bool(np.isfinite(up_m).all())
        return known and self.episode.tag_up_m is not None

    @cached_property
    def strip_m(self) -> tuple[float, float]:
        """Length and width of the strip that holds the path on which ranges came in."""
        path_m = self.episode.position_m[self.episode.valid.any(axis=1)]
        centred_m = path_m - path_m.mean(axis=0)
        _, axes = np.linalg.eigh(centred_m.T @ centred_m)  # two, also where there is one step
        width_m, length_m = np.ptp(centred_m @ axes, axis=0)
        return float(length_m), float(width_m)


def _followed(view: _View) -> frozenset[Advice]:
    """Return the advice that was followed already, or is not for as many passes."""
    prior = view.config.prior
    surveyed = {known.anchor_id for known in prior.known_anchors}
    open_ids = {anchor.anchor_id for anchor in view.anchors if anchor.side_is_open}
    trusted = view.config.alignment.clock_offset == "off"
    several = len(view.passes) > 1
    followed = {
        Advice.SECOND_DRIVE: several,
        Advice.OTHER_LANE: not several or _in_two_lanes(view.passes),
        Advice.WEAVE: several or _strays(view),
        Advice.STATE_SIDE: prior.side is not None,
        Advice.SURVEY: not surveyed.isdisjoint(open_ids),
        Advice.SECOND_TAG: len({each.tag for each in view.passes}) > 1,
        Advice.BOTH_WAYS: trusted or _both_ways(view.passes),
        Advice.ONE_CLOCK: trusted,
        Advice.CALIBRATE_VEHICLE: trusted or _is_known(view),
        Advice.HEIGHTS: view.heights_are_known,
    }
    return frozenset(advice for advice, done in followed.items() if done)


def _is_known(view: _View) -> bool:
    """Whether the clock offset of every pass was known before."""
    return all(known_clock(episode, view.config) is not None for episode in view.passes)


def _strays(view: _View) -> bool:
    """Whether the path is no straight line where cones were heard."""
    if not view.episode.valid.any():
        return False
    length_m, width_m = view.strip_m
    return width_m > max(_LANE_M, _STRAIGHT_BELOW * length_m)


def _in_two_lanes(passes: Sequence[Episode]) -> bool:
    """Whether half of one pass is farther from another than a lane is wide."""
    paths_m = [each.position_m[:: each.n_steps // _MOST_PLACES + 1] for each in passes]
    for k, one_m in enumerate(paths_m):
        for other_m in paths_m[:k]:
            apart_m = np.hypot(*(one_m[:, None] - other_m).transpose(2, 0, 1)).min(axis=1)
            if float(np.median(apart_m)) > _LANE_M:
                return True
    return False


def _both_ways(passes: Sequence[Episode]) -> bool:
    """Whether much of the way, of all passes together, was driven against the rest of it."""
    step_m = np.concatenate([np.diff(each.position_m, axis=0) for each in passes])
    main = np.linalg.eigh(step_m.T @ step_m)[1][:, -1]
    along_m = step_m @ main
    back_m, forth_m = float(-along_m[along_m < 0].sum()), float(along_m[along_m > 0].sum())
    return min(back_m, forth_m) > _BOTH_WAYS_SHARE * (back_m + forth_m)


def _misfit(view: _View) -> Iterator[Limit]:
    found = view.episode.calibration
    if found is not None and found.sigma_m > _MISFIT_M:
        text = (
            f"The ranges do not fit the path: half of them are off by more than "
            f"{metres(0.67 * found.sigma_m)}, while UWB radios are accurate to a few tenths of a "
            "metre."
        )
        yield Limit(ReasonKind.MISFIT, text, (Advice.CHECK_LOG,))


def _clock(view: _View) -> Iterator[Limit]:
    clock = view.episode.clock
    sure_s = 0.0 if clock is None else SIGMAS_90 * clock.sigma_s
    shift_m = view.episode.usual_speed_mps * sure_s
    if shift_m <= _CLOCK_SHIFT_M:
        return
    text = (
        f"The offset between the clocks of ranges and positions is only known to ± {sure_s:.2f} s "
        f"(90 %). At the typical speed of {view.episode.usual_speed_mps:.1f} m/s, that shifts all "
        f"cones together by ± {metres(shift_m)} (90 %) along the road."
    )
    advice = (Advice.BOTH_WAYS, Advice.CALIBRATE_VEHICLE, Advice.ONE_CLOCK)
    yield Limit(ReasonKind.CLOCK, text, advice)


def _short_path(view: _View) -> Iterator[Limit]:
    length_m, _ = view.strip_m
    usual_m = float(np.nanmedian(view.episode.range_m))
    if length_m < _SHORT_BELOW * usual_m:
        text = (
            f"The vehicle only moved within {metres(length_m)} while in range of the cones, which "
            f"were {metres(usual_m)} away: from there, each is seen in nearly one direction."
        )
        yield Limit(ReasonKind.SHORT_PATH, text, (Advice.LONGER, Advice.SECOND_DRIVE))


def _unknown_side(view: _View) -> Iterator[Limit]:
    open_sides = [anchor for anchor in view.anchors if anchor.side_is_open]
    if not open_sides:
        return
    share = max(anchor.mirror_probability for anchor in open_sides)
    text = (
        f"The side of the path is uncertain for {view.cones(open_sides)}: the other side "
        f"has {'up to ' if len(open_sides) > 1 else ''}{percent(share)} probability."
    )
    length_m, width_m = view.strip_m
    if width_m < _STRAIGHT_BELOW * length_m:
        text += (
            f" The path was straight ({metres(length_m)} long within a strip of "
            f"{metres(width_m)}), and a straight path cannot distinguish its two sides."
        )
    advice = (
        Advice.SECOND_DRIVE, Advice.OTHER_LANE, Advice.WEAVE, Advice.STATE_SIDE, Advice.SURVEY,
        Advice.SECOND_TAG,
    )  # fmt: skip
    yield Limit(ReasonKind.AMBIGUOUS, text, advice)


def _poor_geometry(view: _View) -> Iterator[Limit]:
    poor = view.of_status(AnchorStatus.ILL_CONDITIONED)
    known = [anchor for anchor in poor if np.isfinite(anchor.semi_axes_90_m[0])]
    clock = view.episode.clock
    shift_m = 0.0 if clock is None else clock.sigma_s * view.episode.usual_speed_mps
    if not poor or shift_m > view.config.solver.ill_conditioned_above_m:  # the clock's fault
        return
    text = (
        f"The ranges determine the position of {view.cones(poor)} poorly in at least one direction"
    )
    if known:
        worst = max(known, key=lambda anchor: anchor.semi_axes_90_m[0])
        longer_m, shorter_m = worst.semi_axes_90_m
        text += (
            f"; the worst is {view.name(worst.anchor_id)}, ± {metres(longer_m)} in one direction "
            f"and ± {metres(shorter_m)} across it (90 %)"
        )
    advice = (Advice.SECOND_DRIVE, Advice.OTHER_LANE, Advice.LONGER)
    yield Limit(ReasonKind.ILL_CONDITIONED, f"{text}.", advice)


def _moved(view: _View) -> Iterator[Limit]:
    moved = view.of_status(AnchorStatus.MOVED)
    if moved:
        text = (
            f"The position of {view.cones(moved)} differs between passes by more than the errors "
            f"explain: {'it was' if len(moved) == 1 else 'they were'} probably moved."
        )
        yield Limit(ReasonKind.MOVED, text, (Advice.CHECK_CONES,))


def _not_settled(view: _View) -> Iterator[Limit]:
    stopped = view.of_status(AnchorStatus.NOT_CONVERGED)
    if stopped:
        text = f"The calculation for {view.cones(stopped)} did not reach a stable position."
        yield Limit(ReasonKind.NOT_CONVERGED, text, (Advice.CHECK_LOG, Advice.SECOND_DRIVE))


def _unexplained(view: _View) -> Iterator[Limit]:
    unexplained = view.of_status(AnchorStatus.DOES_NOT_FIT)
    if unexplained:
        text = f"The ranges to {view.cones(unexplained)} do not fit one position."
        yield Limit(ReasonKind.DOES_NOT_FIT, text, (Advice.CHECK_LOG, Advice.CHECK_RADIOS))


def _pace(view: _View) -> tuple[Advice, ...]:
    return (Advice.SLOWER,) if view.episode.usual_speed_mps > _FAST_MPS else ()


def _lost(view: _View) -> Iterator[Limit]:
    lost = view.of_status(AnchorStatus.TOO_FEW_RANGES)
    if not lost:
        return
    most = max(anchor.n_ranges for anchor in lost)
    text = (
        f"No position was found for {view.cones(lost)}: {'at most ' if len(lost) > 1 else ''}"
        f"{most} usable range{'' if most == 1 else 's'}, and {view.config.solver.min_ranges} are "
        "needed."
    )
    yield Limit(ReasonKind.TOO_FEW_RANGES, text, (Advice.CHECK_RADIOS, *_pace(view)))


def _few_ranges(view: _View) -> Iterator[Limit]:
    few = [a for a in view.anchors if a.status.has_position and a.n_ranges < _FEW_RANGES]
    if few:
        least = min(few, key=lambda anchor: anchor.n_ranges)
        whose = "" if len(few) == 1 else f", for {view.name(least.anchor_id)}"
        fewest = "" if len(few) == 1 else "as few as "
        text = f"There are few ranges to {view.cones(few)}: {fewest}{least.n_ranges}{whose}."
        yield Limit(ReasonKind.FEW_RANGES, text, (Advice.CHECK_RADIOS, *_pace(view)))


def _gaps(view: _View) -> Iterator[Limit]:
    t_s, valid = view.episode.t_s, view.episode.valid
    gaps = []
    for n, anchor in enumerate(view.anchors):
        heard_s = t_s[valid[:, n]]
        if len(heard_s) > 1:
            longest_s = float(np.diff(heard_s).max())
            if longest_s > max(_GAP_S, _GAP_SHARE * float(np.ptp(heard_s))):
                gaps.append((longest_s, anchor))
    if gaps:
        longest_s, worst = max(gaps, key=lambda gap: gap[0])
        cones = view.cones([anchor for _, anchor in gaps])
        if len(gaps) == 1:
            text = f"{cones} was out of range or blocked for {longest_s:.1f} s."
        else:
            text = (
                f"For a while, {cones} were out of range or blocked; the longest gap was "
                f"{longest_s:.1f} s ({view.name(worst.anchor_id)})."
            )
        yield Limit(ReasonKind.GAPS, text, (Advice.LINE_OF_SIGHT, *_pace(view)))


def _blocked(view: _View) -> Iterator[Limit]:
    found = view.episode.calibration
    beyond_m = max(_BLOCKED_M, 4.0 * found.sigma_m if found is not None else 0.0)
    long: Bool[Array, "T N"] = view.residual_m > beyond_m
    share = long.sum(axis=0) / np.maximum(np.isfinite(view.residual_m).sum(axis=0), 1)
    blocked = [
        (float(part), anchor)
        for part, anchor in zip(share, view.anchors, strict=True)
        # A range is too long by comparison with the position, so that must be a good one.
        if part > _BLOCKED_SHARE and anchor.status in (AnchorStatus.OK, AnchorStatus.AMBIGUOUS)
    ]
    if blocked:
        worst = max(part for part, _ in blocked)
        text = (
            f"Of the ranges to {view.cones([anchor for _, anchor in blocked])}, "
            f"{'up to ' if len(blocked) > 1 else ''}{percent(worst)} are too long by more than "
            f"{metres(beyond_m)}, as happens when the line of sight is blocked."
        )
        yield Limit(ReasonKind.BLOCKED, text, (Advice.LINE_OF_SIGHT, Advice.SECOND_DRIVE))


def _range_bias(view: _View) -> Iterator[Limit]:
    found = view.episode.calibration
    if found is not None and abs(found.bias[0]) > _BIAS_M:
        way = "long" if found.bias[0] > 0 else "short"
        text = (
            f"All ranges are {metres(abs(found.bias[0]))} too {way} at 10 m. This was corrected, "
            "but it is more than calibrated radios show."
        )
        yield Limit(ReasonKind.RANGE_BIAS, text, (Advice.CALIBRATE, Advice.HEIGHTS))
    own = [anchor for anchor in view.anchors
           if anchor.status.has_position and abs(anchor.range_bias_m) > _OWN_BIAS_M]  # fmt: skip
    if own:
        worst = max(own, key=lambda anchor: abs(anchor.range_bias_m))
        text = (
            f"The ranges to {view.cones(own)} have a bias of their own, "
            f"{'' if len(own) == 1 else 'up to '}{metres(abs(worst.range_bias_m))}"
            f"{'' if len(own) == 1 else f' ({view.name(worst.anchor_id)})'}. This was corrected."
        )
        yield Limit(ReasonKind.RANGE_BIAS, text, (Advice.CALIBRATE,))


def _heights(view: _View) -> Iterator[Limit]:
    if view.heights_are_known:
        return
    nearest_m = float(np.nanmin(np.where(view.episode.valid, view.episode.range_m, np.nan)))
    change_m = float(np.hypot(nearest_m, 1.0) - nearest_m)
    if change_m > _HEIGHT_M:
        text = (
            "Not all antenna heights are known, so ranges are treated as horizontal. At the "
            f"shortest range, {metres(nearest_m)}, a height difference of 1 m changes a range by "
            f"{metres(change_m)}."
        )
        yield Limit(ReasonKind.HEIGHTS, text, (Advice.HEIGHTS,))


def _few_cones(view: _View) -> Iterator[Limit]:
    if len(view.anchors) < 3:
        text = (
            f"The log has {len(view.anchors)} cone{'s' if len(view.anchors) > 1 else ''}; an area "
            "needs three."
        )
        yield Limit(ReasonKind.TOO_FEW_CONES, text, (Advice.MORE_CONES,))
