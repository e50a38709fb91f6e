"""What came out of a reconstruction; whatever shows a result needs to know only this."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from enum import StrEnum
from functools import cached_property

import numpy as np

from gaia_uwb.config import PipelineConfig
from gaia_uwb.denoised import DenoisedRanges
from gaia_uwb.episode import Episode, ReadingCounts
from gaia_uwb.estimate import (
    AnchorFix,
    AnchorStatus,
    Boundary,
    BoundaryStatus,
    Reason,
    ReasonKind,
)
from gaia_uwb.locate import Hypotheses
from gaia_uwb.roadside import Drive, RoadBoundary, find_zones
from gaia_uwb.zone import (
    BoundaryUncertainty,
    Combinations,
    Levels,
    boundary_uncertainty,
    said_words,
    sample_scenes,
)

_NOT_TO_GO_BY = (AnchorStatus.DOES_NOT_FIT, AnchorStatus.MOVED)


class ReconstructionStatus(StrEnum):
    """Whether the boundary can be relied upon; the value is what people see."""

    OK = "ok"
    UNRELIABLE = "unreliable"


@dataclass(frozen=True)
class Reconstruction:
    """The result of one reconstruction.

    Parameters
    ----------
    episode
        The aligned and calibrated ranges, with nothing of the truth in them; of the first pass, if
        there are several. It has all anchors of the zone.
    denoised
        What the denoiser made of them.
    anchors
        One fix per anchor, in the order of ``episode.anchor_ids``.
    boundary
        The boundary through the located anchors.
    status
        ``unreliable`` where a reader must not take the boundary for granted.
    reasons
        Why it is unreliable; empty if it is not.
    config
        The settings that made it.
    possible
        Both positions of each anchor and the possible combinations of sides, where known.
    more_passes
        The other passes that were fused, each with all anchors of the zone, and what the denoiser
        made of them.
    """

    episode: Episode
    denoised: DenoisedRanges
    anchors: tuple[AnchorFix, ...]
    boundary: Boundary
    status: ReconstructionStatus
    reasons: tuple[Reason, ...]
    config: PipelineConfig
    possible: tuple[Hypotheses, Combinations] | None = None
    more_passes: tuple[tuple[Episode, DenoisedRanges], ...] = ()

    @cached_property
    def boundary_uncertainty(self) -> BoundaryUncertainty | None:
        """What the boundary may be instead, computed on first use.

        None where it is unknown, or fewer than 3 anchors were located.
        """
        if self.possible is None or len(self.possible[1].located) < 3:
            return None
        scenes = sample_scenes(*self.possible)
        levels = Levels.of(learned=self.possible[1].learned)
        return boundary_uncertainty(scenes.place_m, scenes.combination, levels)

    @cached_property
    def road_boundary(self) -> RoadBoundary | None:
        """What a driver sees of the zone, computed on first use.

        A cone whose ranges fit no position, or that has moved, shapes no edge while others do.
        None where possible places are unknown, no anchor was located, or no vehicle moved by 10 m.
        """
        if self.possible is None or not len(self.possible[1].located):
            return None
        passes = {e.drive or e.name: e for e, _ in self.passes}  # one of the tags of a drive
        drives = [Drive(name, each.t_s, each.vehicle_m) for name, each in passes.items()]
        located = self.possible[1].located
        doubtful = [self.anchors[k].status in _NOT_TO_GO_BY for k in located]
        kept = np.flatnonzero(~np.array(doubtful))
        if not len(kept):
            kept = np.arange(len(located))
        place_m = np.full((len(self.anchors), 2), np.nan)
        place_m[located[kept]] = [self.anchors[k].position_m for k in located[kept]]
        scene_m = sample_scenes(*self.possible).place_m[:, kept]
        ids = [anchor.anchor_id for anchor in self.anchors]
        return find_zones(drives, ids, place_m, scene_m, self.config.boundary, self.episode.frame)

    @property
    def passes(self) -> tuple[tuple[Episode, DenoisedRanges], ...]:
        """Every pass that went in, and what the denoiser made of it."""
        return ((self.episode, self.denoised), *self.more_passes)

    @property
    def notes(self) -> tuple[str, ...]:
        """What the readers of the logs took, guessed and left out, and what these do not tell.

        A note on some of several passes has their names.
        """
        of_passes = [(episode.name, note) for episode, _ in self.passes for note in episode.notes]
        said = Counter(note for _, note in of_passes)
        n_passes = len(self.passes)
        words = (note if said[note] == n_passes else f"{name}: {note}" for name, note in of_passes)
        return tuple(dict.fromkeys(words))

    @property
    def readings(self) -> dict[str, ReadingCounts]:
        """What became of the readings of each anchor, by its id, in all passes together.

        Empty where no pass is from a log.
        """
        found: dict[str, ReadingCounts] = {}
        for episode, _ in self.passes:
            for anchor_id, counts in episode.readings.items():
                found[anchor_id] = found[anchor_id] + counts if anchor_id in found else counts
        return found

    @property
    def boundary_words(self) -> str:
        """The boundary in a few words for people, which never contradict the verdict."""
        good = self.status is ReconstructionStatus.OK
        enclosed = self.boundary.status is BoundaryStatus.OK
        state = self.status.value if enclosed and not good else self.boundary.status.value
        return f"{state}, {self.boundary.area_m2:.1f} m²"

    @property
    def stated(self) -> tuple[str, ...]:
        """What was stated about the zone beforehand and used in the result, in words."""
        words = said_words(self.config.prior)
        for fix in self.anchors:
            if not fix.status.has_position:
                words.pop(f"known_anchors.{fix.anchor_id}", None)
        for reason in self.reasons:
            if reason.kind is ReasonKind.STATEMENT:
                for setting in reason.statements:
                    words.pop(setting, None)
        return tuple(words.values())

    @property
    def name(self) -> str:
        """What to call the result: the name of the pass, or of the first and how many more."""
        drives = dict.fromkeys(episode.drive or episode.name for episode, _ in self.passes)
        first, *more = drives
        return f"{first} and {len(more)} more" if more else first

    def _repr_html_(self) -> str:
        """Return what a notebook shows: the verdict, a top view and the anchors."""
        from gaia_uwb._shared import Mark, sketch, summary

        located = [anchor for anchor in self.anchors if anchor.status.has_position]
        zones = () if self.road_boundary is None else self.road_boundary.zones
        is_hull = self.road_boundary is None or self.road_boundary.hull_is_zone
        area_m = self.boundary.hull_m if is_hull else None
        rows_seen = "; ".join(f"{zone.form.message}, {zone.length_m:.0f} m long" for zone in zones)
        seen = f"boundary {self.boundary_words}" if is_hull else rows_seen
        facts = [
            f"{self.status.value}: {len(located)} of {len(self.anchors)} cones located, {seen}",
            *map(str, self.reasons),
            *(f"note: {note}" for note in self.notes),
        ]
        marks = [
            Mark(a.anchor_id, a.position_m, a.covariance_m2, good=a.status is AnchorStatus.OK)
            for a in located
        ]
        paths_m = [episode.position_m for episode, _ in self.passes]
        picture = sketch(*paths_m, area_m=area_m, marks=marks)
        head = ("cone", "status", "east (m)", "north (m)", "± m (90 %)", "other side", "ranges")
        rows = [_html_row(anchor) for anchor in self.anchors]
        return summary(self.name, facts, picture, head=head, rows=rows)


def _html_row(anchor: AnchorFix) -> list[str]:
    numbers = (*anchor.position_m, anchor.semi_axes_90_m[0])
    east_m, north_m, within_m = (f"{n:.2f}" if np.isfinite(n) else "" for n in numbers)
    share = f"{anchor.mirror_probability:.1%}" if anchor.status.has_position else ""
    return [anchor.anchor_id, anchor.status.value, east_m, north_m, within_m, share,
            str(anchor.n_ranges)]  # fmt: skip
