"""What another drive, or other knowledge, would give for this zone: how to improve, in numbers.

Each proposal is simulated with errors as large as the log showed them (``drives_again.py``), and
located by the estimator that located the cones. So is the drive as it was, for comparison. Nothing
but the ranges and what was stated has a say: a network that knows work zones is not asked.

>>> from gaia_uwb.pipeline import reconstruct
>>> from gaia_uwb.simulate import PRESETS, simulate_pass
>>> result = reconstruct(simulate_pass(PRESETS["straight"], seed=3))
>>> found = improvements(result)
>>> [each.name for each in found][:2]
['this drive again', 'weave once while passing']
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from gaia_uwb._shared import Array, Float64, InputError, Int64
from gaia_uwb.config import Known, KnownAnchor, PipelineConfig, TagPrior, VehiclePrior
from gaia_uwb.episode import Episode, RangeReadings
from gaia_uwb.estimate import AnchorFix, AnchorStatus, Reason, ReasonKind
from gaia_uwb.evaluate.drives_again import Cones, Drive, driven
from gaia_uwb.locate import find_places, known_clock
from gaia_uwb.reconstruction import Reconstruction
from gaia_uwb.scene import Tag, Trajectory, antenna_path
from gaia_uwb.zone import KnownFacts, decide_sides

LANE_M, APART_M = 3.5, 1.6
"""How far the next lane is, and a second tag from the first, across the vehicle."""

_HELPED = frozenset({ReasonKind.AMBIGUOUS, ReasonKind.ILL_CONDITIONED, ReasonKind.CLOCK})
_SPOILT = frozenset(
    {ReasonKind.LOG, ReasonKind.MISFIT, ReasonKind.NOT_ONE_ZONE, ReasonKind.RANGE_BIAS}
)
_MOST_CONES, _MOST_READINGS = 40, 60_000
_CLOCK_S, _BIAS_M, _SURVEY_M = 0.001, 0.01, 0.05  # as a calibration, and as a survey knows them
_SEED = 20261130


@dataclass(frozen=True)
class Improvement:
    """What something that can be done would give.

    Parameters
    ----------
    name
        What is done.
    n_cones
        How many cones it was computed for.
    n_open
        How many of their sides stay open.
    n_ok
        How many are located without any doubt.
    radius_90_m
        Median of the longer semi-axes of their 90 % ellipses, in metres, given the side.
    """

    name: str
    n_cones: int
    n_open: int
    n_ok: int
    radius_90_m: float


def improvements(reconstruction: Reconstruction) -> tuple[Improvement, ...]:
    """Compute what could be done would give, the cheapest first.

    Parameters
    ----------
    reconstruction
        What is to be improved.

    Returns
    -------
    tuple of Improvement
        The first is the drive as it was. Empty where sides, places and clocks are known well
        enough, or where the log has to be mended first.
    """
    if not _is_helped(reconstruction.reasons):
        return ()
    zone = _Zone.of(reconstruction)
    if zone is None:
        return ()
    try:
        return tuple(_computed(zone))
    except InputError:  # the vehicle stood, so that nothing is beside it
        return ()


def _is_helped(reasons: Sequence[Reason]) -> bool:
    kinds = {reason.kind for reason in reasons}
    return bool(kinds & _HELPED) and not kinds & _SPOILT


def _computed(zone: _Zone) -> Iterator[Improvement]:
    """Yield what each proposal gives; those that are drives, of one number of passes at once."""
    as_it_was, config = list(zone.drives), zone.config
    yield from zone.given(
        [("this drive again", as_it_was), ("weave once while passing", zone.weave())]
    )
    yield from zone.given(
        [
            ("drive past once more, in the next lane", [*as_it_was, zone.next_lane()]),
            ("drive past once more, in the other direction", [*as_it_was, zone.other_direction()]),
        ]
    )
    surveyed = zone.surveyed()
    if surveyed is not None:
        name = f"survey one cone ({surveyed.anchor_id})"
        known = (*config.prior.known_anchors, surveyed)
        prior = config.prior.model_copy(update={"known_anchors": known})
        yield from zone.given([(name, as_it_was)], config.model_copy(update={"prior": prior}))
    known_of = config.vehicles | zone.calibrated()
    calibrated = config.model_copy(update={"vehicles": known_of})
    if not zone.clock_is_known:
        yield from zone.given([("calibrate the vehicle", as_it_was)], calibrated)
    if len({drive.tag for drive in as_it_was}) == 1:
        name = f"mount a second tag, {APART_M:g} m beside the first"
        yield from zone.given([(name, zone.two_tags())])
        if not zone.clock_is_known:
            yield from zone.given([(f"{name}, and calibrate", zone.two_tags())], calibrated)


@dataclass(frozen=True)
class _Zone:
    """Cones, and the drives past them that a proposal changes or adds to."""

    cones: Cones
    drives: tuple[Drive, ...]
    open_ids: tuple[str, ...]
    config: PipelineConfig

    @classmethod
    def of(cls, reconstruction: Reconstruction) -> _Zone | None:
        """Return some of the located cones, and their readings; None where there is no log."""
        passes = [episode for episode, _ in reconstruction.passes]
        first = passes[0].errors
        chosen = _chosen(reconstruction.anchors)
        heard = [e.own_times for e in passes if e.own_times is not None and e.errors is not None]
        if first is None or not chosen or len(heard) < len(passes):
            return None
        ids = tuple(fix.anchor_id for fix in chosen)
        rows = [passes[0].anchor_ids.index(name) for name in ids]
        up_m = passes[0].anchor_up_m
        cones = Cones.draw(
            ids,
            np.stack([fix.position_m for fix in chosen]),
            None if up_m is None else up_m[rows],
            first.sizes,
            np.random.default_rng(_SEED),
        )
        drives = tuple(
            Drive.of(episode, _readings(readings, episode, ids))
            for episode, readings in zip(passes, heard, strict=True)
        )
        open_ids = tuple(fix.anchor_id for fix in chosen if fix.side_is_open)
        return cls(cones, drives, open_ids, _about(reconstruction.config, ids))

    def given(
        self, proposals: Sequence[tuple[str, Sequence[Drive]]], config: PipelineConfig | None = None
    ) -> Iterator[Improvement]:
        """Yield what proposals of the same number of passes give."""
        config = self.config if config is None else config
        zones = [
            [driven(d, self.cones, np.random.default_rng([_SEED, k])) for k, d in enumerate(drives)]
            for _, drives in proposals
        ]
        found = find_places(zones, config)
        for (name, _), passes, places in zip(proposals, zones, found, strict=True):
            settings = (config.sides, config.solver, KnownFacts.of(config.prior, passes[0]))
            path_m = passes[0].position_m
            fixes = decide_sides(places.anchor_ids, places.hypotheses, path_m, *settings).anchors
            yield _summary(name, fixes)

    @property
    def last(self) -> Drive:
        """The drive that a proposal changes."""
        return self.drives[-1]

    @cached_property
    def _away(self) -> float:
        """1 where most cones are to the right of the last drive, so that the other lane is left."""
        path = self.last.path
        off_m = self.cones.place_m[:, None] - path.position_m[:: len(path) // 300 + 1]
        nearest = np.argmin(np.hypot(off_m[..., 0], off_m[..., 1]), axis=1)
        left = _left(path)[:: len(path) // 300 + 1][nearest]
        beside_m = (off_m[np.arange(len(nearest)), nearest] * left).sum(axis=1)
        return 1.0 if np.median(beside_m) <= 0.0 else -1.0

    def weave(self) -> list[Drive]:
        """Return the drives, the last of which leaves its lane beside the cones and comes back."""
        t_s, path = self.last.t_s, self.last.path
        step_m = np.hypot(*np.diff(path.position_m, axis=0).T)
        driven_m = np.append(0.0, np.cumsum(step_m))  # so that it stands while it stands
        heard_m = np.interp(t_s, path.t_s, driven_m) if len(t_s) else driven_m
        start_m, stop_m = heard_m.min() + np.array([0.25, 0.75]) * np.ptp(heard_m)
        share = np.clip((driven_m - start_m) / max(stop_m - start_m, 1e-9), 0.0, 1.0)
        aside_m = 0.5 * LANE_M * (1.0 - np.cos(2.0 * np.pi * share))
        return [*self.drives[:-1], replace(self.last, path=self._aside(aside_m))]

    def next_lane(self) -> Drive:
        """Return one more drive, a lane further from the cones."""
        path = self._aside(np.full(len(self.last.path), LANE_M))
        return replace(self.last, path=path, name=_another(self.drives), drive="")

    def other_direction(self) -> Drive:
        """Return one more drive, back, a lane further from the cones."""
        lane = self.next_lane()
        path, ends_s = lane.path, lane.path.t_s[0] + lane.path.t_s[-1]
        offset_s = 0.0 if self.last.like.errors is None else float(self.last.like.errors.mean[2])
        t_s = ends_s + 2.0 * offset_s - lane.t_s
        order = np.argsort(t_s, kind="stable")
        back = Trajectory(
            ends_s - path.t_s[::-1],
            path.position_m[::-1],
            None if path.up_m is None else path.up_m[::-1],
        )
        return replace(lane, path=back, t_s=t_s[order], anchor=lane.anchor[order])

    def two_tags(self) -> list[Drive]:
        """Return the drives, each with two tags instead of the one."""
        drives = []
        for each in self.drives:
            tag = each.tag or Tag("first")
            name = each.drive or each.name
            for k, left_m in enumerate((0.5 * APART_M, -0.5 * APART_M)):
                mounted = replace(tag, tag_id=f"{tag.tag_id} {k}", left_m=tag.left_m + left_m)
                drives.append(
                    replace(
                        each,
                        path=antenna_path(_bare(each.path), 0.0, left_m, 0.0),
                        name=f"{each.name} {k}",
                        tag=mounted,
                        drive=name,
                        is_new_tag=k > 0,
                    )
                )
        return drives

    def surveyed(self) -> KnownAnchor | None:
        """Return a cone to survey: the middle one of those whose sides are open, or of all."""
        known = {each.anchor_id for each in self.config.prior.known_anchors}
        ids = [name for name in self.open_ids or self.cones.ids if name not in known]
        if not ids:
            return None
        name = ids[len(ids) // 2]
        east_m, north_m = self.cones.place_m[self.cones.ids.index(name)].tolist()
        return KnownAnchor(anchor_id=name, east_m=east_m, north_m=north_m, sigma_m=_SURVEY_M)

    @property
    def clock_is_known(self) -> bool:
        """Whether the clock offset of every drive was known before."""
        if self.config.alignment.clock_offset == "off":
            return True
        return all(known_clock(drive.like, self.config) is not None for drive in self.drives)

    def calibrated(self) -> dict[str, VehiclePrior]:
        """Return what a calibration would say of the vehicles."""
        known: dict[str, VehiclePrior] = {}
        for drive in self.drives:
            like, errors = drive.like, drive.like.errors
            if errors is None or like.vehicle in known:
                continue
            applied_s = 0.0 if like.clock is None else like.clock.applied_s
            tags = self.config.vehicles.get(like.vehicle, VehiclePrior()).tags
            tag_m = Known(value=float(errors.mean[3]), sigma=_BIAS_M)
            own = "" if like.tag is None else like.tag.tag_id
            known[like.vehicle] = VehiclePrior(
                clock_offset_s=Known(value=applied_s + float(errors.mean[2]), sigma=_CLOCK_S),
                range_bias_m=Known(value=float(errors.mean[0]), sigma=_BIAS_M),
                tags=tags | ({own: TagPrior(delay_m=tag_m)} if own else {}),
            )
        return known

    def _aside(self, aside_m: Float64[Array, "T"]) -> Trajectory:
        path = self.last.path
        position_m = path.position_m + self._away * aside_m[:, None] * _left(path)
        return replace(path, position_m=position_m)


def _bare(path: Trajectory) -> Trajectory:
    return replace(path, lever_m=None)


def _left(path: Trajectory) -> Float64[Array, "T 2"]:
    """Return where the left side is, all along a path."""
    return antenna_path(_bare(path), 0.0, 1.0, 0.0).position_m - path.position_m


def _chosen(anchors: Sequence[AnchorFix]) -> list[AnchorFix]:
    """Return the located cones, or as many of them, evenly chosen, as take little time."""
    located = [fix for fix in anchors if fix.status.has_position]
    if len(located) <= _MOST_CONES:
        return located
    rows = np.linspace(0, len(located) - 1, _MOST_CONES).round().astype(int)
    return [located[k] for k in rows]


def _readings(readings: RangeReadings, episode: Episode, ids: Sequence[str]) -> RangeReadings:
    """Return readings of some cones, numbered anew; every k-th where they are many."""
    number = np.full(episode.n_anchors, -1, dtype=np.int64)
    for k, name in enumerate(ids):
        if name in episode.anchor_ids:
            number[episode.anchor_ids.index(name)] = k
    kept = np.flatnonzero(number[readings.anchor] >= 0)
    kept = kept[:: len(kept) // _MOST_READINGS + 1]
    readings = readings.rows(kept)
    anchor: Int64[Array, "R"] = number[readings.anchor]
    return replace(readings, anchor=anchor)


def _about(config: PipelineConfig, ids: Sequence[str]) -> PipelineConfig:
    """Return settings without what is known of other cones."""
    known = tuple(each for each in config.prior.known_anchors if each.anchor_id in ids)
    prior = config.prior.model_copy(update={"known_anchors": known})
    return config.model_copy(update={"prior": prior})


def _another(drives: Sequence[Drive]) -> str:
    """Return a name that no drive has."""
    return max(drive.name for drive in drives) + " again"


def _summary(name: str, fixes: Sequence[AnchorFix]) -> Improvement:
    radius_m = [fix.semi_axes_90_m[0] for fix in fixes if fix.status.has_position]
    return Improvement(
        name=name,
        n_cones=len(fixes),
        n_open=sum(fix.side_is_open for fix in fixes),
        n_ok=sum(fix.status is AnchorStatus.OK for fix in fixes),
        radius_90_m=float(np.nanmedian(radius_m)) if radius_m else np.nan,
    )
