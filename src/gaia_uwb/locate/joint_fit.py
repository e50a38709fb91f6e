r"""One anchor in several passes: its fused likelihood, and the places that it peaks at.

The range of pass k at step t to an anchor at ``a``, freed of what the calibration of its log found,
is modelled as::

    d_kt = |a - p_kt + v_kt tau_k| + b + beta_k0 + beta_k1 log10(d_kt / 10 m) + s_k sigma_kt e_kt

with e Student-t (Gaussian for ``wls``). ``tau_k`` and ``beta_k`` are what the pass's clock offset
and range bias may still be off, and ``b`` is the anchor's own bias. With theta for all of these
and Lambda for the inverse of their covariance, the place minimises::

    N(a) = min over theta of  sum_k 1/kappa_k sum_t rho(e_kt)  +  theta' Lambda theta / 2

where kappa_k is how many ranges of the pass are worth an independent one (``hypotheses.py``; more
for an anchor whose errors are worse than its log's, ``honest_errors.py``) and s_k what the pass
alone left of its noise. So the evidence of passes adds up, and nothing is averaged: a pass whose
clock is unknown hardly counts along the road and fully across it.

What passes have in common (Lambda):

- Errors of the clock and of the ranges are independent from pass to pass and common within one.
- An anchor's own bias (its antenna delay) is one number for all passes; drives on one side of it
  would otherwise average it away.
- The range bias is the radios': what its prior contributed to the calibrations of two passes, they
  have in common. With prior covariance P and posterior C_k, an estimate errs by
  ``C_k inv(P) beta`` because of the prior, which makes ``C_k inv(P) C_j`` between passes.
- Clock and bias of a pass were found with the very ranges of this anchor; what its share of the
  pass's ranges told is taken out of their precision, so that nothing counts twice.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gaia_uwb._shared import Array, Float64
from gaia_uwb.config import PipelineConfig
from gaia_uwb.denoised import DenoisedRanges
from gaia_uwb.episode import Episode, bias_basis
from gaia_uwb.locate.hypotheses import Hypotheses
from gaia_uwb.solver import fisher_share, velocity

_APART_M = 0.3  # starts nearer to each other than this lead to the same place
_SAME_M = 0.05  # two results nearer than this, or than a standard error, are one
_SCREENED, _KEPT = 4, 6  # steps after which only so many of the starts go on
_STEPS, _HALVINGS = 60, 12
_TOLERANCE = 0.02  # converged when a step is shorter than this many standard errors
_HELD2 = 1e-10  # variance of what is known exactly


@dataclass(frozen=True)
class LocatedPass:
    """One pass of a zone after ``locate``.

    Parameters
    ----------
    episode
        The pass, calibrated.
    ranges
        What a denoiser made of it.
    hypotheses
        Both places of each of its anchors, from its ranges alone.
    """

    episode: Episode
    ranges: DenoisedRanges
    hypotheses: Hypotheses


@dataclass(frozen=True)
class TwoPlaces:
    """The best two places of one anchor, like a row of :class:`~gaia_uwb.locate.Hypotheses`."""

    position_m: Float64[Array, "2 2"]
    covariance_m2: Float64[Array, "2 2 2"]
    log_odds: float
    own_bias_m: float
    n_ranges: int
    converged: bool
    inflation: float
    centre_m: Float64[Array, "2"]


@dataclass(frozen=True)
class Heard:
    """One pass's R ranges of one anchor, both places that they alone give it, and the errors.

    ``sigma2_m2`` is the variance of each range, ``kappa`` how many are worth an independent one;
    ``bias_covariance`` and ``clock_variance_s2`` are what the pass's range bias and clock offset
    may still be off.
    """

    name: str
    place_m: Float64[Array, "2 2"]
    covariance_m2: Float64[Array, "2 2 2"]
    position_m: Float64[Array, "R 2"]
    velocity_mps: Float64[Array, "R 2"]
    gap2_m2: Float64[Array, "R"]
    range_m: Float64[Array, "R"]
    basis: Float64[Array, "R 2"]
    sigma2_m2: Float64[Array, "R"]
    kappa: float
    bias_covariance: Float64[Array, "2 2"]
    clock_variance_s2: float
    centre_m: Float64[Array, "2"]


def hear(each: LocatedPass, anchor_id: str, config: PipelineConfig) -> Heard:
    """Collect what one pass knows of one of its anchors.

    Parameters
    ----------
    each
        The pass, which located the anchor.
    anchor_id
        Which anchor.
    config
        ``solver``, and the priors of ``calibration`` and ``alignment``.
    """
    episode, own = each.episode, each.hypotheses
    n = episode.anchor_ids.index(anchor_id)
    use = np.flatnonzero(each.ranges.valid[:, n])
    range_m = each.ranges.range_m[use, n]
    sigma_m = each.ranges.sigma_m[use, n] if config.solver.kind == "robust" else np.ones(len(use))
    scale, kappa = 1.0, 1.0
    if own.errors is not None:
        scale, kappa = float(own.errors.scale[n]), float(own.errors.steps_worth_one[n])
    inflation = float(own.factor()[n, 0, 0])
    if (found := episode.calibration) is not None:
        # What the log's errors are worth here, and by how much this anchor's are worse.
        seen = max(found.sigma_m / max(scale * float(sigma_m.mean()), 1e-9), 1.0)
        kappa = max(kappa, inflation * found.correlation * seen**2)
    others = 1.0 - float(own.n_ranges[n]) / max(float(own.n_ranges.sum()), 1.0)
    return Heard(
        name=episode.name,
        place_m=own.position_m[n],
        covariance_m2=inflation * own.covariance_m2[n],
        position_m=episode.position_m[use],
        velocity_mps=velocity(episode)[use],
        gap2_m2=episode.height_gap_m(slice(n, n + 1))[use, 0] ** 2,
        range_m=range_m,
        basis=bias_basis(range_m),
        sigma2_m2=(scale * sigma_m) ** 2,
        kappa=kappa,
        bias_covariance=_bias_covariance(episode, others, config),
        clock_variance_s2=_clock_variance(episode, others, config),
        centre_m=own.position_m[n].mean(axis=0) if own.centre_m is None else own.centre_m[n],
    )


def _bias_prior(config: PipelineConfig) -> Float64[Array, "2 2"]:
    sigma = (config.calibration.bias_sigma_m, config.calibration.bias_slope_sigma_m)
    return np.diag(np.maximum(np.square(sigma), _HELD2))


def _bias_covariance(
    episode: Episode, others: float, config: PipelineConfig
) -> Float64[Array, "2 2"]:
    """Return what a pass's range bias may still be off, as its other anchors tell it."""
    if episode.calibration is None:
        return np.zeros((2, 2))
    prior = np.linalg.inv(_bias_prior(config))
    known = np.linalg.inv(episode.calibration.covariance + 1e-3 * _HELD2 * np.eye(2))
    return np.asarray(np.linalg.inv(prior + others * (known - prior)))


def _clock_variance(episode: Episode, others: float, config: PipelineConfig) -> float:
    """Return what a pass's clock offset may still be off, as its other anchors tell it."""
    if episode.clock is None or episode.clock.sigma_s == 0.0:
        return 0.0
    prior = config.alignment.clock_offset_sigma_s**-2
    known = max(episode.clock.sigma_s**-2 - prior, 0.0)
    return float(1.0 / (prior + others * known)) if known else episode.clock.sigma_s**2


@dataclass(frozen=True)
class _Minimum:
    """A local minimum of N: the place, then b, then (beta_0, beta_1, tau) of every pass."""

    state: Float64[Array, "S"]
    cost: float
    hessian: Float64[Array, "S S"]
    converged: bool

    @property
    def place_m(self) -> Float64[Array, "2"]:
        return self.state[:2]


class JointFit:
    """The fused likelihood of one anchor in some passes.

    Parameters
    ----------
    heard
        What each of the passes knows of the anchor, at least one.
    config
        ``solver``, and the priors of ``calibration``.
    """

    def __init__(self, heard: Sequence[Heard], config: PipelineConfig) -> None:
        robust = config.solver.kind == "robust"
        self._heard = heard
        self._dof = config.solver.student_t_dof if robust else 0.0
        self._precision = _prior_precision(heard, config)

    def best_two(self) -> TwoPlaces:
        """Refine the places of all passes and return the best two that differ."""
        minima = self.minima(np.concatenate([h.place_m for h in self._heard]))
        best = minima[0]
        other = next((m for m in minima[1:] if not _one_place(best, m)), best)
        covariance = [np.linalg.inv(m.hessian)[:2, :2] for m in (best, other)]
        return TwoPlaces(
            position_m=np.stack([best.place_m, other.place_m]),
            covariance_m2=np.stack([0.5 * (c + c.T) for c in covariance]),
            log_odds=other.cost - best.cost,
            own_bias_m=float(best.state[2]),
            n_ranges=sum(len(h.range_m) for h in self._heard),
            converged=best.converged and other.converged,
            inflation=1.0,
            centre_m=np.mean([h.centre_m for h in self._heard], axis=0),
        )

    def minima(self, starts_m: Float64[Array, "K 2"]) -> list[_Minimum]:
        """Return the minima that starts lead to, the best first."""
        found: list[_Minimum] = []
        for start in _distinct(starts_m):
            state = np.zeros(len(self._precision) + 2)
            state[:2] = start
            found.append(self._refine(state, _SCREENED))
        found.sort(key=lambda m: m.cost)
        refined = [self._refine(m.state, _STEPS) for m in found[:_KEPT]]
        return sorted(refined, key=lambda m: m.cost)

    def loss(self, place_m: Float64[Array, "2"]) -> float:
        """Return twice what the likelihood loses at another place than its best."""
        best = self.minima(np.concatenate([h.place_m for h in self._heard]))[0]
        state = np.concatenate([place_m, best.state[2:]])
        return max(2.0 * (self._refine(state, _STEPS, held=True).cost - best.cost), 0.0)

    def _refine(self, state: Array, steps: int, *, held: bool = False) -> _Minimum:
        """Descend by Fisher scoring, each step halved until it descends; ``held``: the place."""
        free = slice(2, None) if held else slice(None)
        cost, gradient, hessian = self._evaluate(state)
        for _ in range(steps):
            step = np.zeros_like(state)
            step[free] = -np.linalg.solve(hessian[free, free], gradient[free])
            if float(step @ hessian @ step) < _TOLERANCE**2:
                return _Minimum(state, cost, hessian, True)
            for _ in range(_HALVINGS):
                trial = self._evaluate(state + step)
                if trial[0] < cost:
                    break
                step *= 0.5
            else:
                return _Minimum(state, cost, hessian, False)
            state = state + step
            cost, gradient, hessian = trial
        return _Minimum(state, cost, hessian, False)

    def _evaluate(self, state: Array) -> tuple[float, Array, Array]:
        """Return N before its minimum over theta, its gradient and its Fisher information."""
        theta, dof = state[2:], self._dof
        gradient, hessian = np.zeros_like(state), np.zeros((len(state), len(state)))
        gradient[2:] = self._precision @ theta
        hessian[2:, 2:] = self._precision
        cost = 0.5 * float(theta @ gradient[2:])
        for k, heard in enumerate(self._heard):
            own = np.array([0, 1, 2, 3 + 3 * k, 4 + 3 * k, 5 + 3 * k])
            residual, jacobian = _residuals(heard, state[own])
            u2 = residual**2 / heard.sigma2_m2
            weight = 1.0 / (heard.sigma2_m2 * heard.kappa)
            if dof > 0:
                cost += 0.5 * (dof + 1.0) / heard.kappa * float(np.log1p(u2 / dof).sum())
                weight *= (dof + 1.0) / (dof + u2)
            else:
                cost += 0.5 / heard.kappa * float(u2.sum())
            weighted = jacobian * weight[:, None]
            gradient[own] += residual @ weighted
            hessian[np.ix_(own, own)] += fisher_share(dof) * (jacobian.T @ weighted)
        # An anchor right on a straight path has no direction across it.
        hessian[[0, 1], [0, 1]] += 1e-9 * (hessian[0, 0] + hessian[1, 1]) + 1e-12
        return cost, gradient, hessian


def _residuals(heard: Heard, own: Float64[Array, "6"]) -> tuple[Array, Array]:
    """Return predicted minus measured ranges, and their derivatives by the pass's six unknowns."""
    delta = own[:2] - heard.position_m + heard.velocity_mps * own[5]
    slant = np.sqrt((delta**2).sum(axis=1) + heard.gap2_m2 + 1e-12)
    unit = delta / slant[:, None]
    rate = (unit * heard.velocity_mps).sum(axis=1)
    residual = slant + own[2] + heard.basis @ own[3:5] - heard.range_m
    ones = np.ones((len(slant), 1))
    return residual, np.concatenate([unit, ones, heard.basis, rate[:, None]], axis=1)


def _prior_precision(heard: Sequence[Heard], config: PipelineConfig) -> Float64[Array, "S S"]:
    """Return the inverse covariance of b and of (beta_0, beta_1, tau) of every pass."""
    covariance = np.zeros((1 + 3 * len(heard),) * 2)
    robust = config.solver.kind == "robust"
    covariance[0, 0] = config.solver.anchor_bias_sigma_m**2 if robust else 0.0
    prior = np.linalg.inv(_bias_prior(config))
    for k, one in enumerate(heard):
        covariance[3 + 3 * k, 3 + 3 * k] = one.clock_variance_s2
        for j, other in enumerate(heard):
            between = one.bias_covariance
            if j != k:
                between = one.bias_covariance @ prior @ other.bias_covariance
            covariance[1 + 3 * k : 3 + 3 * k, 1 + 3 * j : 3 + 3 * j] = between
    covariance += _HELD2 * np.eye(len(covariance))
    return np.asarray(np.linalg.inv(covariance))


def _distinct(starts_m: Float64[Array, "K 2"]) -> list[Float64[Array, "2"]]:
    """Return the starts that are not next to one that was there before."""
    kept: list[Array] = []
    for start in starts_m:
        if all(np.hypot(*(start - other)) > _APART_M for other in kept):
            kept.append(start)
    return kept


def _one_place(best: _Minimum, other: _Minimum) -> bool:
    """Tell whether two starts led to one place."""
    apart = other.place_m - best.place_m
    covariance = np.linalg.inv(best.hessian)[:2, :2]
    return bool(
        np.hypot(*apart) < _SAME_M or float(apart @ np.linalg.solve(covariance, apart)) < 1.0
    )
