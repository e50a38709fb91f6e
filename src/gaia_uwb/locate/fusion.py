"""Fuse several passes of one zone: the best places of every anchor, and whether the passes agree.

Each anchor that several passes heard gets the places that their fused likelihood peaks at
(``joint_fit.py``); passes in two lanes reflect an anchor to two different places, and only its true
one fits both. An anchor that one pass heard keeps what that pass says, to the last bit.

*Do the passes agree?* Each pass alone gives a place with a covariance (``hypotheses.py``). The sum
over K passes of the squared distances, in standard errors, from these places to the fused one is
chi-squared with 2 (K - 1) degrees of freedom if the covariances are right. Two things follow:

- The anchors of a zone tell together how far the passes' errors exceed what the passes think of
  them: the median over the anchors of this sum, against that of chi-squared, scales variances and
  log odds if it is above 1 (as particle physicists scale averages that scatter too much), and
  each anchor's own sum moves its scale a little. A single pass cannot know this of itself.
- An anchor whose sum is far beyond that of the others was moved between the passes.

*What independence is assumed.* Each log is a drive of its own (``passes.py`` sees to it): its
clock error, the noise and the slow errors of its ranges have nothing to do with another drive's. An
anchor's own bias, the share of the radios' bias that comes from its prior, and the floor of the
position do not shrink with the number of passes. Errors of the frame are common to all passes of
one receiver and base station and in no covariance here: see the report's note.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from gaia_uwb._shared import Array, Float64
from gaia_uwb.config import PipelineConfig, SolverConfig
from gaia_uwb.estimate import AnchorFix, AnchorStatus, Reason, ReasonKind
from gaia_uwb.locate.hypotheses import Hypotheses
from gaia_uwb.locate.joint_fit import Heard, JointFit, LocatedPass, TwoPlaces, hear
from gaia_uwb.locate.passes import all_anchors

_MOVED_SIGMA = 5.0  # the level of the test for moved anchors, as a one-sided normal quantile
_MOVED_M = 0.5  # passes that place an anchor nearer to each other than this agree
_NOT_ONE_FRAME = 6.0  # a scale of the errors that no radio explains
_MOST_NAMED = 5
_LEAST_ANCHORS = 3  # fewer do not tell how far errors exceed what the passes think of them
_OWN_DEGREES = 8.0  # the scale of all anchors counts like so many degrees of freedom of one


@dataclass(frozen=True)
class Disagreement:
    """An anchor whose position differs between the passes, so that it was probably moved.

    Parameters
    ----------
    anchor_id
        Which anchor.
    pass_name
        The pass whose own place is farthest, in standard errors, from the fused one.
    distance_m
        How far from that place another pass puts the anchor, in metres.
    """

    anchor_id: str
    pass_name: str
    distance_m: float


@dataclass(frozen=True)
class Fused:
    """What the passes of a zone say together.

    Parameters
    ----------
    anchor_ids
        All anchors of the zone.
    hypotheses
        The best two places of each.
    disagreements
        The anchors that the passes place apart.
    error_scale
        How many times larger the passes' errors are than each thinks of its own; at least 1.
    """

    anchor_ids: tuple[str, ...]
    hypotheses: Hypotheses
    disagreements: tuple[Disagreement, ...]
    error_scale: float

    def reasons(self) -> Iterator[Reason]:
        """Say where the passes disagree."""
        for apart in self.disagreements[:_MOST_NAMED]:
            text = (
                f"{apart.anchor_id}: its position from {apart.pass_name} alone is "
                f"{apart.distance_m:.2f} m from that of another pass"
            )
            yield Reason(
                ReasonKind.PASSES_APART,
                text,
                cones=(apart.anchor_id,),
                passes=(apart.pass_name,),
                numbers={"distance_m": apart.distance_m},
            )
        if self.error_scale > _NOT_ONE_FRAME:
            text = (
                f"the passes differ by {self.error_scale:.0f} times their standard errors for "
                "most cones: check that they are of one zone, in one frame and with the same ids"
            )
            numbers = {"error_scale": self.error_scale}
            yield Reason(ReasonKind.NOT_ONE_ZONE, text, numbers=numbers)


def fuse(passes: Sequence[LocatedPass], config: PipelineConfig = PipelineConfig()) -> Fused:
    """Fuse the passes of one zone, all in one frame, each with readings of its own.

    Parameters
    ----------
    passes
        At least one.
    config
        ``solver``, and the priors of ``calibration`` and ``alignment``.

    Returns
    -------
    Fused
        The better-fitting place of each anchor comes first.
    """
    ids = all_anchors([each.episode for each in passes])
    found = [_Found.of(passes, anchor_id, config) for anchor_id in ids]
    scatter = [each.scatter for each in found if each.scatter is not None]
    scale2 = _scale2(scatter)
    moved = [s.disagreement for s in scatter if s.is_too_much(scale2)]
    rows = [each.scaled(scale2, config.solver) for each in found]
    return Fused(ids, _stacked(rows), tuple(moved), scale2**0.5)


def mark_moved(anchors: Sequence[AnchorFix], fused: Fused) -> tuple[AnchorFix, ...]:
    """Give anchors whose position differs between passes the status that says so.

    Parameters
    ----------
    anchors
        Their fixes.
    fused
        Names the anchors.
    """
    moved = {apart.anchor_id for apart in fused.disagreements}
    return tuple(
        replace(fix, status=AnchorStatus.MOVED) if fix.anchor_id in moved else fix
        for fix in anchors
    )


@dataclass(frozen=True)
class _Scatter:
    """How far the passes' own places of an anchor scatter about the fused one."""

    misfit: float
    degrees: int
    disagreement: Disagreement

    @classmethod
    def of(
        cls, heard: Sequence[Heard], place_m: Array, anchor_id: str, config: PipelineConfig
    ) -> _Scatter:
        misfit, own_m = _off(heard, place_m)
        degrees = 2 * (len(heard) - 1)
        if misfit.sum() > degrees:
            # A pass that sees an anchor from one direction only has no Gaussian place; then the
            # drop of its likelihood says better how far off it is.
            loss = [JointFit([each], config).loss(place_m) for each in heard]
            misfit = np.minimum(misfit, loss)
        worst = int(np.argmax(misfit))
        distance_m = float(np.hypot(*(own_m - own_m[worst]).T).max())
        apart = Disagreement(anchor_id, heard[worst].name, distance_m)
        return cls(float(misfit.sum()), degrees, apart)

    def is_too_much(self, scale2: float) -> bool:
        limit = _chi_square(self.degrees, _MOVED_SIGMA)
        return self.misfit > limit * scale2 and self.disagreement.distance_m > _MOVED_M


@dataclass(frozen=True)
class _Found:
    """The places of one anchor, and the passes' scatter if several heard it."""

    places: TwoPlaces
    scatter: _Scatter | None

    @classmethod
    def of(cls, passes: Sequence[LocatedPass], anchor_id: str, config: PipelineConfig) -> _Found:
        heard = [hear(each, anchor_id, config) for each in passes if _locates(each, anchor_id)]
        if len(heard) < 2:
            return cls(_alone(passes, anchor_id), None)
        places = JointFit(heard, config).best_two()
        return cls(places, _Scatter.of(heard, places.position_m[0], anchor_id, config))

    def scaled(self, scale2: float, solver: SolverConfig) -> TwoPlaces:
        """Return the places with errors as large as the passes' scatter shows them."""
        if self.scatter is None:
            return self.places
        scatter = self.scatter
        own2 = (_OWN_DEGREES * scale2 + scatter.misfit) / (_OWN_DEGREES + scatter.degrees)
        own2 = max(own2, 1.0)
        floor = solver.position_floor_m**2 * np.eye(2)
        return TwoPlaces(
            position_m=self.places.position_m,
            covariance_m2=own2 * self.places.covariance_m2 + floor,
            log_odds=self.places.log_odds / own2,
            own_bias_m=self.places.own_bias_m,
            n_ranges=self.places.n_ranges,
            converged=self.places.converged,
            inflation=self.places.inflation,
            centre_m=self.places.centre_m,
        )


def _locates(each: LocatedPass, anchor_id: str) -> bool:
    """Tell whether a pass has enough ranges of an anchor to say anything about it."""
    if anchor_id not in each.episode.anchor_ids:
        return False
    n = each.episode.anchor_ids.index(anchor_id)
    return bool(np.isfinite(each.hypotheses.position_m[n]).all())


def _alone(passes: Sequence[LocatedPass], anchor_id: str) -> TwoPlaces:
    """Return what the one pass that located an anchor says, or the one that heard most of it."""
    having = [each for each in passes if anchor_id in each.episode.anchor_ids]
    index = [each.episode.anchor_ids.index(anchor_id) for each in having]
    counts = [int(e.hypotheses.n_ranges[n]) for e, n in zip(having, index, strict=True)]
    located = [_locates(each, anchor_id) for each in having]
    best = max(range(len(having)), key=lambda k: (located[k], counts[k]))
    own, n = having[best].hypotheses, index[best]
    return TwoPlaces(
        position_m=own.position_m[n],
        covariance_m2=own.covariance_m2[n],
        log_odds=float(own.log_odds[n]),
        own_bias_m=float(own.own_bias_m[n]),
        n_ranges=counts[best],
        converged=bool(own.converged[n]),
        inflation=float(own.factor()[n, 0, 0]),
        centre_m=own.position_m[n].mean(axis=0) if own.centre_m is None else own.centre_m[n],
    )


def _stacked(rows: Sequence[TwoPlaces]) -> Hypotheses:
    return Hypotheses(
        position_m=np.stack([row.position_m for row in rows]),
        covariance_m2=np.stack([row.covariance_m2 for row in rows]),
        log_odds=np.array([row.log_odds for row in rows]),
        own_bias_m=np.array([row.own_bias_m for row in rows]),
        n_ranges=np.array([row.n_ranges for row in rows], dtype=np.int64),
        converged=np.array([row.converged for row in rows], dtype=np.bool_),
        inflation=np.array([row.inflation for row in rows]),
        centre_m=np.stack([row.centre_m for row in rows]),
    )


def _off(
    heard: Sequence[Heard], place_m: Float64[Array, "2"]
) -> tuple[Float64[Array, "K"], Float64[Array, "K 2"]]:
    """Return how far a place is from the nearer one of each pass, in standard errors squared."""
    own_m = np.stack([each.place_m for each in heard])
    apart = own_m - place_m
    covariance = np.stack([each.covariance_m2 for each in heard])
    misfit = (apart * np.linalg.solve(covariance, apart[..., None])[..., 0]).sum(axis=2)
    rows, nearer = np.arange(len(heard)), misfit.argmin(axis=1)
    return misfit[rows, nearer], own_m[rows, nearer]


def _scale2(scatter: Sequence[_Scatter]) -> float:
    """Return how many times the passes' variances are too small, by the median anchor."""
    if len(scatter) < _LEAST_ANCHORS:
        return 1.0
    return max(1.0, float(np.median([s.misfit / _chi_square(s.degrees, 0.0) for s in scatter])))


def _chi_square(degrees: int, sigma: float) -> float:
    """Return chi-squared's quantile at a normal one (Wilson and Hilferty, 1931)."""
    part = 2.0 / (9.0 * degrees)
    return float(degrees * (1.0 - part + sigma * part**0.5) ** 3)
