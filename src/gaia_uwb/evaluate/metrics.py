"""Score a reconstruction against the truth: the paper's six metrics, and nine that explain them.

:func:`score_episode` scores one episode; :func:`aggregate` forms means over episodes with their
bootstrap intervals and says how. A metric that has nothing to count is absent.

=========================== ==== =================================================================
name                        unit what, and what its ``n`` counts
=========================== ==== =================================================================
distance_mse_overall        m^2  mean squared range error; ranges that were measured and kept
distance_mse_los            m^2  the same over those with line of sight
distance_mse_nlos           m^2  the same over those without
anchor_mae                  m    mean distance to the true place; located anchors
polygon_iou                      hull of the located anchors against that of all observed; 1
polygon_hausdorff           m    between the boundaries of these two hulls; 1
located_share                    anchors with a position; observed anchors
anchor_mae_right_side       m    ``anchor_mae`` of the better of the two mirror hypotheses
wrong_side_share                 the mirror hypothesis is nearer to the truth; anchors whose two
                                 hypotheses are apart by more than 0.1 m and 3 standard deviations
open_share                       the mirror place keeps more than 10 %; located anchors
ellipse_coverage_90              the 90 % ellipse holds the true place; anchors with an ellipse
region_coverage_90               that ellipse or, where the side is open, the mirror place's one
                                 holds the true place; anchors with an ellipse
anchor_mae_aligned          m    ``anchor_mae`` after rigid alignment to the truth
ellipse_coverage_90_aligned      ``ellipse_coverage_90`` after the same alignment
region_coverage_90_aligned       ``region_coverage_90`` after the same alignment
=========================== ==== =================================================================

The first six are the paper's ("Evaluation metrics"); its set of anchors I is called *observed*
here: those with at least one measured range. An observed anchor that was not located has no error
to average, so ``anchor_mae`` has to be read with ``located_share``; the IoU and the Hausdorff
distance count it by its absence. A hull without area has IoU 0.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from gaia_uwb._shared import CHI_SQUARE_90, Array, Bool, Float64, InputError, Symmetric
from gaia_uwb.denoised import DenoisedRanges
from gaia_uwb.episode import Episode, EpisodeTruth
from gaia_uwb.estimate import AnchorFix
from gaia_uwb.evaluate.bootstrap import bootstrap_mean
from gaia_uwb.evaluate.rigid_alignment import rigid_align, rotation_matrix
from gaia_uwb.zone import hausdorff, polygon_iou

_OPEN_ABOVE = 0.1  # the probability of a mirror place beyond which a side counts as open
_LEAST_SEPARATION_M = 0.1
_LEAST_SEPARATION_SIGMA = 3.0
_POOLED = {"distance_mse_overall", "distance_mse_los", "distance_mse_nlos"}


@dataclass(frozen=True)
class Metric:
    """One score of one episode.

    Parameters
    ----------
    name
        Its name, as in results.
    value
        A finite number.
    unit
        Unit of ``value``; empty for shares and ratios.
    n
        How many things it counts or averages, at least 1.

    Raises
    ------
    InputError
        If ``value`` is not finite or ``n`` is below 1.
    """

    name: str
    value: float
    unit: str
    n: int

    def __post_init__(self) -> None:
        if not (np.isfinite(self.value) and self.n >= 1):
            raise InputError(
                f"expected a finite value over at least one item, got {self.value} over {self.n}",
                column=self.name,
            )


@dataclass(frozen=True)
class Aggregate:
    """A metric over many episodes; ``dataclasses.asdict`` makes it ready for JSON.

    Parameters
    ----------
    value
        The mean over episodes, or the pooled mean over all ranges of all episodes.
    ci95
        95 % bootstrap interval over groups; ``None`` with a single group.
    n
        Number of episodes, or of ranges, in ``value``.
    unit
        Unit of ``value``; empty for shares and ratios.
    how
        How the mean was formed: ``mean_over_episodes`` or ``pooled``.
    left_out
        Number of episodes in which the metric had nothing to count.
    """

    value: float
    ci95: tuple[float, float] | None
    n: int
    unit: str
    how: Literal["mean_over_episodes", "pooled"]
    left_out: int


def score_episode(
    episode: Episode, denoised: DenoisedRanges, anchors: Sequence[AnchorFix]
) -> dict[str, Metric]:
    """Score the ranges, the anchors and the boundary of one episode.

    Parameters
    ----------
    episode
        The episode with its truth. ``valid`` says which ranges were measured.
    denoised
        What the denoiser made of it; a range that it rejected is not scored.
    anchors
        One fix per anchor, in the order of ``episode.anchor_ids``.

    Returns
    -------
    dict
        The metrics of the module's table by name, in its order, without those that have nothing
        to count.

    Raises
    ------
    InputError
        If the episode has no truth, or ``denoised`` or ``anchors`` belong to another episode.
    """
    truth = episode.truth
    if truth is None:
        raise InputError("expected an episode with its truth, got none", source=episode.name)
    if denoised.valid.shape != episode.valid.shape:
        raise InputError(
            f"expected denoised ranges of shape {episode.valid.shape}, got {denoised.valid.shape}",
            source=episode.name,
        )
    if (ids := tuple(fix.anchor_id for fix in anchors)) != episode.anchor_ids:
        raise InputError(f"expected fixes for {episode.anchor_ids}, got {ids}", source=episode.name)
    observed = episode.valid.any(axis=0)
    has_position = observed & np.array([fix.status.has_position for fix in anchors])
    located = _Located.of(anchors, truth.anchor_m, has_position)
    scores = [
        *_range_scores(truth, denoised, episode.valid & denoised.valid),
        *_mean("anchor_mae", "m", located.error_m),
        *_polygon_scores(located.position_m, truth.anchor_m[observed]),
        *_mean("located_share", "", has_position[observed]),
        *_mean("anchor_mae_right_side", "m", np.fmin(located.error_m, located.mirror_error_m)),
        *_wrong_side_share(located),
        *_mean("open_share", "", located.is_open),
        *_coverage(located),
    ]
    # One anchor always aligns perfectly: that would say nothing.
    if len(located.position_m) > 1:
        aligned = located.aligned()
        scores += _mean("anchor_mae_aligned", "m", aligned.error_m)
        scores += _coverage(aligned, "_aligned")
    return {score.name: score for score in scores}


@dataclass(frozen=True)
class _Located:
    """The located anchors' estimates as arrays, with their true positions."""

    position_m: Float64[Array, "L 2"]
    covariance_m2: Float64[Array, "L 2 2"]
    mirror_m: Float64[Array, "L 2"]  # NaN where there is no other hypothesis
    mirror_covariance_m2: Float64[Array, "L 2 2"]
    is_open: Bool[Array, "L"]
    true_m: Float64[Array, "L 2"]

    @classmethod
    def of(
        cls, anchors: Sequence[AnchorFix], true_m: Float64[Array, "N 2"], which: Bool[Array, "N"]
    ) -> _Located:
        return cls(
            position_m=np.stack([fix.position_m for fix in anchors])[which],
            covariance_m2=np.stack([fix.covariance_m2 for fix in anchors])[which],
            mirror_m=np.stack([fix.mirror_position_m for fix in anchors])[which],
            mirror_covariance_m2=np.stack([fix.mirror_covariance_m2 for fix in anchors])[which],
            is_open=np.array([fix.mirror_probability > _OPEN_ABOVE for fix in anchors])[which],
            true_m=true_m[which],
        )

    @property
    def error_m(self) -> Float64[Array, "L"]:
        return np.asarray(np.hypot(*(self.position_m - self.true_m).T))

    @property
    def mirror_error_m(self) -> Float64[Array, "L"]:
        return np.asarray(np.hypot(*(self.mirror_m - self.true_m).T))

    def aligned(self) -> _Located:
        """Return the estimates after the rigid move that brings them nearest to the truth."""
        alignment = rigid_align(self.position_m, self.true_m)
        turn = rotation_matrix(alignment.rotation_rad)
        with np.errstate(invalid="ignore"):  # infinite variances: no ellipse, before and after
            covariance_m2 = turn @ self.covariance_m2 @ turn.T
            mirror_covariance_m2 = turn @ self.mirror_covariance_m2 @ turn.T
        return replace(
            self,
            position_m=alignment.points_m,
            covariance_m2=covariance_m2,
            mirror_m=self.mirror_m @ turn.T + alignment.translation_m,
            mirror_covariance_m2=mirror_covariance_m2,
        )


def _mean(name: str, unit: str, values: Float64[Array, "K"] | Bool[Array, "K"]) -> list[Metric]:
    """Return the mean as a metric, or nothing where there is nothing to count."""
    return [Metric(name, float(values.mean()), unit, len(values))] if len(values) else []


def _range_scores(
    truth: EpisodeTruth, denoised: DenoisedRanges, counted: Bool[Array, "T N"]
) -> list[Metric]:
    squared_m2 = (denoised.range_m - truth.range_m) ** 2
    return [
        *_mean("distance_mse_overall", "m^2", squared_m2[counted]),
        *_mean("distance_mse_los", "m^2", squared_m2[counted & ~truth.nlos]),
        *_mean("distance_mse_nlos", "m^2", squared_m2[counted & truth.nlos]),
    ]


def _polygon_scores(
    located_m: Float64[Array, "L 2"], observed_true_m: Float64[Array, "K 2"]
) -> list[Metric]:
    if not len(observed_true_m):
        return []
    scores = [Metric("polygon_iou", polygon_iou(located_m, observed_true_m), "", 1)]
    if len(located_m):
        distance_m = hausdorff(located_m, observed_true_m)
        scores.append(Metric("polygon_hausdorff", distance_m, "m", 1))
    return scores


def _wrong_side_share(located: _Located) -> list[Metric]:
    """Score the choice of the side where there was one: both hypotheses are clearly apart."""
    apart_m = located.position_m - located.mirror_m
    distance_m = np.hypot(*apart_m.T)
    with np.errstate(invalid="ignore"):  # infinite variances: the two cannot be told apart
        variance_m4 = np.einsum("li,lij,lj->l", apart_m, located.covariance_m2, apart_m)
        # The standard deviation along the line through both is sqrt(variance_m4) / distance_m.
        clear = distance_m**2 > _LEAST_SEPARATION_SIGMA * np.sqrt(variance_m4)
    clear &= distance_m > _LEAST_SEPARATION_M
    return _mean("wrong_side_share", "", (located.mirror_error_m < located.error_m)[clear])


def _coverage(located: _Located, suffix: str = "") -> list[Metric]:
    """Score how often 90 % ellipses hold the true place, where there is an ellipse."""
    finite = np.isfinite(located.covariance_m2).all(axis=(1, 2))
    own = _inside(located.true_m - located.position_m, located.covariance_m2)
    mirror = _inside(located.true_m - located.mirror_m, located.mirror_covariance_m2)
    either = own | (located.is_open & mirror)
    return [
        *_mean(f"ellipse_coverage_90{suffix}", "", own[finite]),
        *_mean(f"region_coverage_90{suffix}", "", either[finite]),
    ]


def _inside(
    off_m: Float64[Array, "L 2"], covariance_m2: Float64[Array, "L 2 2"]
) -> Bool[Array, "L"]:
    """Return whether points lie within a 90 % ellipse; none does where there is no ellipse."""
    ellipse = Symmetric.of(covariance_m2)
    # e' C^-1 e <= chi2, multiplied by det C; an ellipse without area claims too much.
    with np.errstate(invalid="ignore"):
        determinant_m4 = ellipse.determinant()
        square_m4 = Symmetric(ellipse.yy, -ellipse.xy, ellipse.xx).square(*off_m.T)
        inside = (square_m4 <= CHI_SQUARE_90 * determinant_m4) & (determinant_m4 > 0)
    return np.asarray(inside & np.isfinite(covariance_m2).all(axis=(1, 2)))


def aggregate(
    per_episode: Sequence[Mapping[str, Metric]],
    groups: Sequence[str],
    *,
    n_resamples: int = 1000,
    seed: int = 0,
) -> dict[str, Aggregate]:
    """Form means over episodes with 95 % bootstrap intervals over groups.

    Parameters
    ----------
    per_episode
        What :func:`score_episode` returned, episode by episode.
    groups
        For each episode, the group that the bootstrap draws as a whole: the run that a window was
        cut from, or the episode's own name where episodes are independent.
    n_resamples, seed
        As in :func:`gaia_uwb.evaluate.bootstrap.bootstrap_mean`.

    Returns
    -------
    dict
        By name: each metric's mean over the episodes that have it, and for each range metric also
        ``pooled_...``, the mean over the ranges of all episodes.

    Raises
    ------
    InputError
        If there is no episode, or not one group for each.

    Examples
    --------
    >>> episodes = [{"polygon_iou": Metric("polygon_iou", iou, "", 1)} for iou in (0.5, 1.0)]
    >>> aggregate(episodes, ["run-1", "run-2"])["polygon_iou"]  # doctest: +NORMALIZE_WHITESPACE
    Aggregate(value=0.75, ci95=(0.5, 1.0), n=2, unit='', how='mean_over_episodes', left_out=0)
    """
    if not per_episode or len(groups) != len(per_episode):
        raise InputError(
            f"expected one group per episode, got {len(per_episode)} episodes and "
            f"{len(groups)} groups"
        )
    results = {}
    for name in dict.fromkeys(name for scores in per_episode for name in scores):
        having = [k for k, scores in enumerate(per_episode) if name in scores]
        scores = [per_episode[k][name] for k in having]
        values, counts = np.array([[s.value, s.n] for s in scores], dtype=np.float64).T
        blocks = [groups[k] for k in having]
        left_out = len(per_episode) - len(having)
        mean = bootstrap_mean(values, blocks, n_resamples=n_resamples, seed=seed)
        results[name] = Aggregate(
            mean.value, mean.interval, len(values), scores[0].unit, "mean_over_episodes", left_out
        )
        if name in _POOLED:
            mean = bootstrap_mean(
                values, blocks, weights=counts, n_resamples=n_resamples, seed=seed
            )
            results[f"pooled_{name}"] = Aggregate(
                mean.value, mean.interval, int(counts.sum()), scores[0].unit, "pooled", left_out
            )
    return results
