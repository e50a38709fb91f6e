"""What a log holds: the Scene made of a path and of readings, its LocalFrame and its Truth.

All parts are frozen and checked when built, so code that receives one need not check it again.
Positions are (east, north) in metres in the scene's local frame; a :class:`LocalFrame` ties that
frame to WGS84 where it is known. What is known of the truth (surveyed anchors, NLOS labels, true
ranges) lives in :class:`Truth`, which only simulators, loaders and scores touch.

>>> import numpy as np
>>> from gaia_uwb.scene import RangeLog, Scene, Trajectory
>>> drive = Trajectory(t_s=np.array([0.0, 1.0]), position_m=np.array([[0.0, 0.0], [10.0, 0.0]]))
>>> log = RangeLog(t_s=np.array([0.2, 0.4]), anchor=np.array([0, 0]),
...                range_m=np.array([12.0, 10.5]))
>>> Scene(name="pass", trajectory=drive, ranges=log, anchor_ids=("cone-1",)).n_anchors
1
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from gaia_uwb._shared import (
    Array,
    Bool,
    Float64,
    InputError,
    Int64,
    check_finite,
    check_heights,
    check_ids,
    check_shape,
    freeze,
)
from gaia_uwb.scene.readings import ConeRanges, RangeLog
from gaia_uwb.scene.vehicle import Tag, Trajectory


@dataclass(frozen=True)
class LocalFrame:
    """Where the local frame's origin lies on Earth: its axes point east, north and up there.

    Parameters
    ----------
    lat_deg, lon_deg
        WGS84 latitude and longitude of the origin, in degrees.
    alt_m
        Ellipsoidal height of the origin, in metres.

    Raises
    ------
    InputError
        If a number is not finite or lies outside [-90, 90] (latitude), [-180, 180] (longitude) or
        [-1e5, 1e5] (height).
    """

    lat_deg: float
    lon_deg: float
    alt_m: float = 0.0

    def __post_init__(self) -> None:
        for name, bound in (("lat_deg", 90.0), ("lon_deg", 180.0), ("alt_m", 1e5)):
            value = getattr(self, name)
            if not (np.isfinite(value) and abs(value) <= bound):
                raise InputError(
                    f"expected a number between {-bound:g} and {bound:g}, got {value}", column=name
                )


@dataclass(frozen=True)
class Truth:
    """What a survey or a simulator knows of a scene; scores read it, reconstructions never do.

    Parameters
    ----------
    anchor_m : (N, 2)
        True east and north of the anchors, in metres.
    nlos : (R,), optional
        True where a reading had no line of sight.
    range_m : (R,), optional
        True slant range of each reading, where a simulator knows it.
    clock_offset_s : float, optional
        True offset: a reading stamped t belongs to the trajectory at t minus this.
    outlier : (R,), optional
        True where a spike's offset is in a reading.
    bias_m : (R,), optional
        The systematic part of each reading's error, in metres: what is neither noise nor a spike.

    Raises
    ------
    InputError
        If ``anchor_m`` is not of shape (N, 2), or a number is not finite.
    """

    anchor_m: Float64[Array, "N 2"]
    nlos: Bool[Array, "R"] | None = None
    range_m: Float64[Array, "R"] | None = None
    clock_offset_s: float | None = None
    outlier: Bool[Array, "R"] | None = None
    bias_m: Float64[Array, "R"] | None = None

    def __post_init__(self) -> None:
        anchor_m = freeze(self, "anchor_m", self.anchor_m, np.float64)
        if anchor_m.ndim != 2 or anchor_m.shape[1] != 2:
            raise InputError(f"expected shape (N, 2), got {anchor_m.shape}", column="anchor_m")
        check_finite("anchor_m", anchor_m)
        for name in ("nlos", "outlier"):
            if getattr(self, name) is not None:
                freeze(self, name, getattr(self, name), np.bool_)
        for name in ("range_m", "bias_m"):
            if getattr(self, name) is not None:
                check_finite(name, freeze(self, name, getattr(self, name), np.float64))


@dataclass(frozen=True)
class Scene:
    """One drive past a work zone: the path, the ranges, and what is known beforehand.

    Parameters
    ----------
    name
        What to call it in messages and results.
    trajectory, ranges
        The path of the tag's antenna (of the vehicle's reference point, if there are ``tags``) and
        the readings.
    anchor_ids
        Unique names of the anchors; ``ranges.anchor`` points into them.
    anchor_up_m : (N,), optional
        Antenna heights of the anchors in the local frame, in metres; NaN where unknown.
    frame
        Ties the local frame to WGS84, where known.
    truth
        The survey or the simulator's truth, for scores only.
    notes
        What the reader took, guessed and left out, a sentence each; they stay with the log up to
        its result.
    problems
        What the reader found that will spoil a result, a sentence each: no result of this log is
        reliable.
    tags
        The tags on the vehicle; ``ranges.tag`` points into them. Empty: one tag, whose antenna is
        at the trajectory.
    cone_ranges
        Ranges among the cones, if there are any.

    drive
        The drive whose readings of one tag these are; empty where the scene is a whole drive.
    vehicle
        Who drove. Drives of one vehicle share radios and clocks; so do those that do not say.

    Raises
    ------
    InputError
        If ids are empty or not unique, a reading points outside them, there are several tags and
        ``ranges.tag`` does not say which took what, or shapes disagree.
    """

    name: str
    trajectory: Trajectory
    ranges: RangeLog
    anchor_ids: tuple[str, ...]
    anchor_up_m: Float64[Array, "N"] | None = None
    frame: LocalFrame | None = None
    truth: Truth | None = field(default=None, repr=False)
    notes: tuple[str, ...] = ()
    problems: tuple[str, ...] = ()
    tags: tuple[Tag, ...] = ()
    cone_ranges: ConeRanges | None = None
    drive: str = ""
    vehicle: str = ""

    def __post_init__(self) -> None:
        check_ids(self.anchor_ids, source=self.name)
        n = len(self.anchor_ids)
        self._check_within("anchor", self.ranges.anchor, n)
        self._check_tags()
        if self.cone_ranges is not None:
            for name in ("anchor_a", "anchor_b"):
                indices = getattr(self.cone_ranges, name)
                self._check_within("anchor", indices, n, f"cone_ranges.{name}")
        if self.anchor_up_m is not None:
            up = freeze(self, "anchor_up_m", self.anchor_up_m, np.float64)
            check_heights("anchor_up_m", up, n, source=self.name)
        if self.truth is not None:
            check_shape("truth.anchor_m", self.truth.anchor_m, (n, 2), source=self.name)
            for name in ("nlos", "range_m", "outlier", "bias_m"):
                values = getattr(self.truth, name)
                if values is not None:
                    check_shape(f"truth.{name}", values, (len(self.ranges),), source=self.name)

    def _check_within(
        self, what: str, indices: Int64[Array, "R"], n: int, column: str | None = None
    ) -> None:
        """Refuse an index beyond the ``n`` anchors or tags that there are."""
        last = int(indices.max())
        if last >= n:
            problem = f"a reading refers to {what} {last}, but there are {n} {what}s"
            problem += ", numbered from 0" if n else ""
            raise InputError(problem, source=self.name, column=column or what)

    def _check_tags(self) -> None:
        tag_ids = [tag.tag_id for tag in self.tags]
        for tag_id in tag_ids:
            if tag_ids.count(tag_id) > 1:
                problem = f"tag ids must be unique, got {tag_id!r} twice"
                raise InputError(problem, source=self.name, column="tag_id")
        if self.ranges.tag is not None:
            self._check_within("tag", self.ranges.tag, len(self.tags))
        elif len(self.tags) > 1:
            problem = f"there are {len(self.tags)} tags: ranges.tag must say which took what"
            raise InputError(problem, source=self.name, column="tag")

    @property
    def n_anchors(self) -> int:
        """Number of anchors."""
        return len(self.anchor_ids)

    def without_truth(self) -> Scene:
        """Return the same scene with nothing of the truth in it."""
        return replace(self, truth=None)

    def _repr_html_(self) -> str:
        """Return what a notebook shows: what the log holds, without the truth."""
        from gaia_uwb._shared import sketch, summary

        drive, log = self.trajectory, self.ranges
        facts = [
            f"path: {len(drive)} samples in {drive.t_s[-1] - drive.t_s[0]:.1f} s, "
            f"{drive.path_length_m:.1f} m long",
            f"{len(log)} readings of {self.n_anchors} cones, "
            f"{'tied to WGS84' if self.frame else 'in local metres'}",
            *self._facts_of_tags(),
            *self.problems,
            *(f"note: {note}" for note in self.notes),
        ]
        rows = []
        for n, anchor_id in enumerate(self.anchor_ids):
            range_m = log.range_m[log.anchor == n]
            span = f"{range_m.min():.2f} to {range_m.max():.2f}" if len(range_m) else ""
            rows.append([anchor_id, str(len(range_m)), span])
        head = ("cone", "readings", "range (m)")
        return summary(self.name, facts, sketch(drive.position_m), head=head, rows=rows)

    def _facts_of_tags(self) -> list[str]:
        """Return what a notebook shows of tags and cone-to-cone ranges, where there are any."""
        facts = []
        if self.tags:
            places = (
                f"{tag.tag_id} ({tag.forward_m:g}, {tag.left_m:g}, {tag.up_m:g})"
                for tag in self.tags
            )
            facts.append(f"tags (m forward, left, up): {', '.join(places)}")
        if self.cone_ranges is not None:
            facts.append(f"{len(self.cone_ranges)} ranges between cones")
        return facts
