"""Do the passes of one zone agree? What each of them says alone, beside what all say together.

All passes are located together (``zone_places.py``). Then each is located alone, near
those places and elsewhere, with the clocks, the bias and the sizes of the errors that all of them
together gave. The sum over K passes of the
squared distances, in standard errors, from their own places to their mean is chi-squared with
2 (K - 1) degrees of freedom if the covariances are right. Two things follow:

- The anchors of a zone show together how far the passes' errors exceed what the passes think of
  them: the median over the anchors of this sum, against that of chi-squared, scales variances and
  log odds if it is above 1 (as particle physicists scale averages that scatter too much), and
  each anchor's own sum moves its scale a little. A single pass cannot know this of itself.
- An anchor whose sum is far beyond that of the others was moved between the passes.

Errors of the frame are common to all passes of one receiver and base station and in no covariance
here: see the report's note.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from gaia_uwb.config import PipelineConfig
from gaia_uwb.episode import DriveErrors, Episode
from gaia_uwb.estimate import AnchorFix, AnchorStatus, Reason, ReasonKind
from gaia_uwb.locate.hypotheses import Hypotheses
from gaia_uwb.locate.zone_places import ZonePlaces, find_places

_MOVED_SIGMA = 5.0  # the level of the test for moved anchors, as a one-sided normal quantile
_MOVED_M = 0.5  # passes that place an anchor nearer to each other than this agree
_NOT_ONE_FRAME = 6.0  # a scale of the errors that no radio explains
_MOST_NAMED = 5
_RULED_OUT = 12.0  # log odds against a place
_CERTAIN = 1e-6  # standard deviation, in metres and seconds, of what is taken as known
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
    places
        What all readings together say.
    hypotheses
        The best two places of each anchor, with errors as large as the passes' scatter.
    disagreements
        The anchors that the passes place apart.
    error_scale
        How many times larger the passes' errors are than each thinks of its own; at least 1.
    """

    places: ZonePlaces
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


def fuse(passes: Sequence[Episode], config: PipelineConfig = PipelineConfig()) -> Fused:
    """Locate the anchors of one zone from all passes together, and see whether the passes agree.

    Parameters
    ----------
    passes
        At least one, all in one frame, each with readings of its own.
    config
        ``solver``, and the priors of ``calibration`` and ``alignment``.

    Returns
    -------
    Fused
        The better-fitting place of each anchor comes first.
    """
    together = find_places([passes], config)[0]
    if len(_by_drive(passes)) < 2:  # tags of one drive: nothing to compare
        return Fused(together, together.hypotheses, (), 1.0)
    given = [
        replace(episode, run_errors=for_certain(errors))
        for episode, errors in zip(passes, together.errors, strict=True)
    ]
    near = dict(zip(together.anchor_ids, together.hypotheses.position_m[:, 0], strict=True))
    drives = _by_drive(given)
    alone = find_places(list(drives.values()), config, near=[near] * len(drives))
    names = list(drives)
    scatter = [Scatter.of(names, alone, together, n) for n in range(len(together.anchor_ids))]
    known = [each for each in scatter if each is not None]
    scale2 = error_scale2(known)
    moved = [each.disagreement for each in known if each.is_too_much(scale2)]
    return Fused(
        together, with_scatter(together.hypotheses, scatter, scale2), tuple(moved), scale2**0.5
    )


def _by_drive(passes: Sequence[Episode]) -> dict[str, list[Episode]]:
    """Return the passes by drive: no cone moves between two tags of one drive."""
    drives: dict[str, list[Episode]] = {}
    for episode in passes:
        drives.setdefault(episode.drive or episode.name, []).append(episode)
    return drives


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


def for_certain(errors: DriveErrors) -> DriveErrors:
    """Return the errors as if they were known: what passes share cannot make them disagree.

    Parameters
    ----------
    errors
        As they were estimated.
    """
    return replace(errors, covariance=_CERTAIN**2 * np.eye(len(errors.mean)))


@dataclass(frozen=True)
class Scatter:
    """How far the passes' own places of an anchor scatter about their mean.

    Parameters
    ----------
    misfit, degrees
        Sum of the squared distances in standard errors, and of how many degrees of freedom.
    disagreement
        The pass that is farthest from the others.
    """

    misfit: float
    degrees: int
    disagreement: Disagreement

    @classmethod
    def of(
        cls,
        drives: Sequence[str],
        alone: Sequence[ZonePlaces],
        together: ZonePlaces,
        n: int,
    ) -> Scatter | None:
        """Compare the passes that located an anchor; None if fewer than two did."""
        name = together.anchor_ids[n]
        fused_m = together.hypotheses.position_m[n, 0]
        places, covariances, names = [], [], []
        for drive, each in zip(drives, alone, strict=True):
            if name not in each.anchor_ids or not np.isfinite(fused_m).all():
                continue
            k = each.anchor_ids.index(name)
            own_m, own_m2 = each.hypotheses.position_m[k], each.hypotheses.covariance_m2[k]
            if np.isfinite(own_m).all():
                off_m = own_m - fused_m
                near = (off_m * np.linalg.solve(own_m2, off_m[..., None])[..., 0]).sum(axis=1)
                # The place that all passes agree on counts unless this pass rules it out.
                side = int(near.argmin())
                if side == 1 and each.hypotheses.log_odds[k] > _RULED_OUT:
                    side = 0
                places.append(own_m[side])
                covariances.append(own_m2[side])
                names.append(drive)
        if len(places) < 2:
            return None
        place_m, precision = np.stack(places), np.linalg.inv(np.stack(covariances))
        mean_m = np.linalg.solve(
            precision.sum(axis=0), (precision @ place_m[..., None]).sum(axis=0)[:, 0]
        )
        off_m = place_m - mean_m
        misfit = (off_m * (precision @ off_m[..., None])[..., 0]).sum(axis=1)
        worst = int(np.argmax(misfit))
        distance_m = float(np.hypot(*(place_m - place_m[worst]).T).max())
        apart = Disagreement(name, names[worst], distance_m)
        return cls(float(misfit.sum()), 2 * (len(places) - 1), apart)

    def is_too_much(self, scale2: float) -> bool:
        """Tell whether the passes cannot have seen the anchor at one place."""
        limit = _chi_square(self.degrees, _MOVED_SIGMA)
        return self.misfit > limit * scale2 and self.disagreement.distance_m > _MOVED_M


def with_scatter(found: Hypotheses, scatter: Sequence[Scatter | None], scale2: float) -> Hypotheses:
    """Return the places with errors as large as the passes' scatter shows them.

    Parameters
    ----------
    found
        As the passes think of them.
    scatter
        Of each anchor; None where fewer than two passes located it.
    scale2
        Of :func:`error_scale2`.
    """
    own2 = np.ones(len(scatter))
    for n, each in enumerate(scatter):
        if each is not None:
            total = _OWN_DEGREES * scale2 + each.misfit
            own2[n] = max(total / (_OWN_DEGREES + each.degrees), 1.0)
    return replace(
        found,
        covariance_m2=own2[:, None, None, None] * found.covariance_m2,
        log_odds=found.log_odds / own2,
        shared_m=None
        if found.shared_m is None
        else found.shared_m * np.sqrt(own2)[:, None, None, None],
    )


def error_scale2(scatter: Sequence[Scatter]) -> float:
    """Return how many times the passes' variances are too small, by the median anchor.

    Parameters
    ----------
    scatter
        Of each anchor that two passes located, at least.
    """
    if len(scatter) < _LEAST_ANCHORS:
        return 1.0
    return max(1.0, float(np.median([s.misfit / _chi_square(s.degrees, 0.0) for s in scatter])))


def _chi_square(degrees: int, sigma: float) -> float:
    """Return chi-squared's quantile at a normal one (Wilson and Hilferty, 1931)."""
    part = 2.0 / (9.0 * degrees)
    return float(degrees * (1.0 - part + sigma * part**0.5) ** 3)
