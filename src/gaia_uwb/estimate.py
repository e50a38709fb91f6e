"""What comes out of a reconstruction: anchors, the zone's boundary, and reasons to doubt them.

>>> from gaia_uwb.estimate import AnchorStatus
>>> AnchorStatus.TOO_FEW_RANGES.message
'too few usable ranges'
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum

import numpy as np

from gaia_uwb._shared import CHI_SQUARE_90, Array, Float64, InputError, check_shape, freeze


class AnchorStatus(StrEnum):
    """How far an anchor's estimate can be trusted; the value is what people see."""

    OK = "ok"
    AMBIGUOUS = "ambiguous"
    ILL_CONDITIONED = "ill-conditioned"
    NOT_CONVERGED = "not-converged"
    DOES_NOT_FIT = "does-not-fit"
    MOVED = "moved"
    TOO_FEW_RANGES = "too-few-ranges"

    @property
    def message(self) -> str:
        """The status in one sentence."""
        return _MESSAGES[self]

    @property
    def reason_kind(self) -> ReasonKind:
        """The kind of reason that an anchor with this status gives; none if it is located."""
        return ReasonKind(self.value)

    @property
    def has_position(self) -> bool:
        """Whether an estimate with this status carries a position at all."""
        return self is not AnchorStatus.TOO_FEW_RANGES


_MESSAGES = {
    AnchorStatus.OK: "located",
    AnchorStatus.AMBIGUOUS: "side ambiguous: the mirror position fits almost as well",
    AnchorStatus.ILL_CONDITIONED: "position poorly determined in at least one direction",
    AnchorStatus.NOT_CONVERGED: "the solver stopped before converging",
    AnchorStatus.DOES_NOT_FIT: "the ranges do not fit one position",
    AnchorStatus.MOVED: "position differs between passes; probably moved",
    AnchorStatus.TOO_FEW_RANGES: "too few usable ranges",
}


class SideSource(StrEnum):
    """What decides on which side of the path an anchor stands; the value is what people see."""

    RANGES = "ranges"
    LAYOUT = "layout"
    STATEMENT = "statement"
    OPEN = "open"

    @property
    def message(self) -> str:
        """The source in a few words."""
        return _SOURCES[self]


_SOURCES = {
    SideSource.RANGES: "the cone's own ranges",
    SideSource.LAYOUT: "what is known of work zones and of the other cones",
    SideSource.STATEMENT: "what was stated about the zone",
    SideSource.OPEN: "nothing: the side is open",
}


class ReasonKind(StrEnum):
    """What may make a result unreliable, or limit it; programs use this, never the text."""

    LOG = "log"
    CLOCK = "clock"
    MISFIT = "misfit"
    RANGE_BIAS = "range-bias"
    VEHICLE = "vehicle"
    OUTSIDE_TRAINING = "outside-training"
    NOT_ONE_ZONE = "not-one-zone"
    PASSES_APART = "passes-apart"
    UNLIKE_ZONES = "unlike-zones"
    STATEMENT = "statement"
    EXCEPTION = "exception"
    AMBIGUOUS = "ambiguous"
    ILL_CONDITIONED = "ill-conditioned"
    NOT_CONVERGED = "not-converged"
    DOES_NOT_FIT = "does-not-fit"
    MOVED = "moved"
    TOO_FEW_RANGES = "too-few-ranges"
    TOO_FEW_CONES = "too-few-cones"
    COLLINEAR = "collinear"
    SHORT_PATH = "short-path"
    FEW_RANGES = "few-ranges"
    GAPS = "gaps"
    BLOCKED = "blocked"
    HEIGHTS = "heights"

    @property
    def is_anchor_status(self) -> bool:
        """Whether it repeats what the statuses of single anchors say."""
        return self in _STATUS_KINDS

    @property
    def concerns_all_places(self) -> bool:
        """Whether it casts doubt on every position, not only on single anchors or the area."""
        return not (
            self.is_anchor_status or self in (ReasonKind.TOO_FEW_CONES, ReasonKind.COLLINEAR)
        )


_STATUS_KINDS = frozenset(
    status.reason_kind for status in AnchorStatus if status is not AnchorStatus.OK
)


@dataclass(frozen=True)
class Reason:
    """One reason why a result must not be taken for granted.

    Parameters
    ----------
    kind
        What is wrong.
    text
        The same in words, with numbers: for people only.
    cones
        Ids of the anchors that it is about; empty if it is about all of them.
    passes
        Names of the passes that it is about; empty if it is about all of them.
    statements
        The settings of :class:`gaia_uwb.config.PriorConfig` that it contradicts, such as ``side``;
        a surveyed anchor's is ``known_anchors.`` and its id.
    numbers
        The numbers in the text, by name and unit.

    Examples
    --------
    >>> str(Reason(ReasonKind.MOVED, "cone-3: probably moved", cones=("cone-3",)))
    'cone-3: probably moved'
    """

    kind: ReasonKind
    text: str
    cones: tuple[str, ...] = ()
    passes: tuple[str, ...] = ()
    statements: tuple[str, ...] = ()
    numbers: Mapping[str, float] = field(default_factory=dict, hash=False)

    def __str__(self) -> str:
        return self.text


@dataclass(frozen=True)
class AnchorFix:
    """Where one anchor stands, and how certain that is.

    Parameters
    ----------
    anchor_id
        Name of the anchor.
    position_m : (2,)
        East and north, in metres; NaN with status ``too-few-ranges``.
    covariance_m2 : (2, 2)
        Covariance of ``position_m`` given that the side is right, in square metres.
    mirror_position_m : (2,)
        The other hypothesis: the best position on the other side of the path.
    mirror_probability
        Probability that the anchor stands at ``mirror_position_m`` instead.
    status
        Whether to trust it.
    n_ranges
        Number of ranges used.
    range_bias_m
        Estimated bias of this anchor's ranges (measured minus true), in metres; NaN where none was
        estimated.
    mirror_covariance_m2 : (2, 2), optional
        Covariance of ``mirror_position_m`` given that the anchor stands there, in square metres;
        NaN where it is unknown.
    mirror_probability_by_ranges
        The same by the anchor's own ranges alone, however the sides were decided; above 1/2 where
        they prefer the mirror position, NaN where it is unknown.
    side_source
        What brings ``mirror_probability`` below the level at which a side is open: the ranges
        alone, or only with the layout of work zones, or only with what a user stated; None where
        that is unknown.
    side_is_open
        Whether the mirror position is too probable to ignore: with status ``ambiguous``, and in
        addition to a status that says something worse.

    Raises
    ------
    InputError
        If shapes are wrong, a probability lies outside [0, 1], or the position is not
        finite exactly where the status says that there is one.
    """

    anchor_id: str
    position_m: Float64[Array, "2"]
    covariance_m2: Float64[Array, "2 2"]
    mirror_position_m: Float64[Array, "2"]
    mirror_probability: float
    status: AnchorStatus
    n_ranges: int
    range_bias_m: float = 0.0
    mirror_covariance_m2: Float64[Array, "2 2"] = field(
        default_factory=lambda: np.full((2, 2), np.nan)
    )
    mirror_probability_by_ranges: float = np.nan
    side_source: SideSource | None = None
    side_is_open: bool = False

    def __post_init__(self) -> None:
        if self.status is AnchorStatus.AMBIGUOUS:
            object.__setattr__(self, "side_is_open", True)
        shapes = {
            "position_m": (2,),
            "covariance_m2": (2, 2),
            "mirror_position_m": (2,),
            "mirror_covariance_m2": (2, 2),
        }
        for name, shape in shapes.items():
            check_shape(name, freeze(self, name, getattr(self, name), np.float64), shape)
        if bool(np.isfinite(self.position_m).all()) is not self.status.has_position:
            raise InputError(
                f"{self.anchor_id!r}: position {self.position_m} contradicts the status "
                f"{self.status.value!r}",
                column="position_m",
            )
        for name in ("mirror_probability", "mirror_probability_by_ranges"):
            value = getattr(self, name)
            unknown = name == "mirror_probability_by_ranges" and np.isnan(value)
            if not (unknown or 0.0 <= value <= 1.0):
                problem = f"{self.anchor_id!r}: expected a probability, got {value}"
                raise InputError(problem, column=name)

    @property
    def has_mirror(self) -> bool:
        """Whether there is a mirror position; on a winding path both positions may coincide."""
        return bool(
            np.isfinite(self.mirror_position_m).all()
            and (self.mirror_position_m != self.position_m).any()
        )

    @property
    def semi_axes_90_m(self) -> tuple[float, float]:
        """The longer and the shorter semi-axis of the 90 % ellipse, in metres; NaN if unknown."""
        if not np.isfinite(self.covariance_m2).all():
            return np.nan, np.nan
        variance_m2 = np.maximum(np.linalg.eigvalsh(self.covariance_m2), 0.0)
        shorter_m, longer_m = np.sqrt(CHI_SQUARE_90 * variance_m2)
        return float(longer_m), float(shorter_m)


class BoundaryStatus(StrEnum):
    """Whether a boundary encloses an area."""

    OK = "ok"
    TOO_FEW_ANCHORS = "too-few-anchors"
    COLLINEAR = "collinear"


@dataclass(frozen=True)
class Boundary:
    """The boundary of the work zone.

    Parameters
    ----------
    hull_m : (K, 2)
        Convex hull of the anchors, counter-clockwise, not closed, in metres. With a status other
        than ``ok`` it is the hull's 0, 1 or 2 extreme points.
    outline_m : (M, 2)
        The located anchors in the order in which an outline through all of them visits them.
    outline_index : tuple of int
        The anchors' indices in that order.
    area_m2
        Area of the hull, 0 unless the status is ``ok``.
    status
        Whether the hull encloses an area.

    Raises
    ------
    InputError
        If shapes are wrong, there is not one index per point of the outline, or the area is not
        above 0 exactly where the status is ``ok``.
    """

    hull_m: Float64[Array, "K 2"]
    outline_m: Float64[Array, "M 2"]
    outline_index: tuple[int, ...]
    area_m2: float
    status: BoundaryStatus

    def __post_init__(self) -> None:
        for name in ("hull_m", "outline_m"):
            points = freeze(self, name, getattr(self, name), np.float64)
            check_shape(name, points, (len(points), 2))
        if len(self.outline_index) != len(self.outline_m):
            raise InputError(
                f"expected {len(self.outline_m)} indices, got {len(self.outline_index)}",
                column="outline_index",
            )
        if bool(self.area_m2 > 0) is not (self.status is BoundaryStatus.OK):
            raise InputError(
                f"area {self.area_m2} m² contradicts the status {self.status.value!r}",
                column="area_m2",
            )
