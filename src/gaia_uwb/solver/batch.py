"""Episodes of one shape, laid out for the solver, and the sums that a solution's errors need.

Axes: B episodes of the same N anchors and T steps; n of the anchors at a time, so that the memory
has a bound; 3 is (east, north, own bias) of an anchor.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from gaia_uwb._shared import Array, Bool, Float64, Int64
from gaia_uwb.episode import Episode, bias_basis
from gaia_uwb.solver.multilateration import Solutions, SolverOptions, fisher_share, solve

_CHUNK = 1 << 18  # ranges laid out at a time


@dataclass(frozen=True)
class Chunk:
    """Some anchors of a batch, laid out for the solver."""

    position_m: Float64[Array, "B T 2"]
    velocity_mps: Float64[Array, "B T 2"]
    range_m: Float64[Array, "B n T"]
    sigma_m: Float64[Array, "B n T"]
    tag_up_m: Float64[Array, "B T"]
    anchor_up_m: Float64[Array, "B n"]

    def solve(
        self,
        options: SolverOptions,
        bias_sigma_m: Float64[Array, "B"],
        shared_bias: Float64[Array, "B 2"] | None = None,
    ) -> Solutions:
        """Locate the chunk's anchors, from ranges freed of a bias that they share."""
        return solve(
            self.position_m,
            self.corrected(shared_bias),
            self.sigma_m,
            bias_sigma_m=np.broadcast_to(bias_sigma_m[:, None], self.anchor_up_m.shape),
            height_m=(self.tag_up_m, self.anchor_up_m),
            options=options,
        )

    def corrected(self, shared_bias: Float64[Array, "B 2"] | None) -> Float64[Array, "B n T"]:
        """Return the ranges freed of a shared bias ``b0 + b1 log10(d / 10 m)``."""
        if shared_bias is None:
            return self.range_m
        bias = (bias_basis(self.range_m) @ shared_bias[:, None, :, None])[..., 0]
        return np.asarray(self.range_m - bias)


def chunks(
    episodes: Sequence[Episode],
    range_m: Sequence[Float64[Array, "T N"]],
    sigma_m: Sequence[Float64[Array, "T N"]],
) -> Iterator[Chunk]:
    """Yield the anchors of episodes of one shape, as many at a time as the memory's bound allows.

    Parameters
    ----------
    episodes
        Paths and heights; all have the same numbers of steps and anchors.
    range_m, sigma_m
        Ranges and their standard deviations of each episode; NaN is ignored.
    """
    first = episodes[0]
    position_m = np.stack([e.position_m for e in episodes])
    velocity_mps = np.stack([velocity(e) for e in episodes])
    tag_up_m = np.stack(
        [np.zeros(e.n_steps) if e.tag_up_m is None else e.tag_up_m for e in episodes]
    )
    size = max(1, _CHUNK // (len(episodes) * first.n_steps))
    for start in range(0, first.n_anchors, size):
        part = slice(start, start + size)
        steps = _heard([r[:, part] for r in range_m])
        yield Chunk(
            position_m=position_m[:, steps],
            velocity_mps=velocity_mps[:, steps],
            tag_up_m=tag_up_m[:, steps],
            range_m=np.stack([np.ascontiguousarray(r[steps, part].T) for r in range_m]),
            sigma_m=np.stack([np.ascontiguousarray(s[steps, part].T) for s in sigma_m]),
            anchor_up_m=np.stack([_heights(e)[part] for e in episodes]),
        )


def _heard(range_m: Sequence[Float64[Array, "T n"]]) -> slice:
    """Return the steps from the first to the last range: on a long road few of them all."""
    steps = np.flatnonzero(np.any([np.isfinite(r).any(axis=1) for r in range_m], axis=0))
    return slice(int(steps[0]), int(steps[-1]) + 1) if len(steps) else slice(None)


def velocity(episode: Episode) -> Float64[Array, "T 2"]:
    """Return the tag's velocity at every step, in metres per second.

    Parameters
    ----------
    episode
        Gives the path.
    """
    if episode.n_steps < 2:
        return np.zeros((episode.n_steps, 2))
    return np.gradient(episode.position_m, episode.t_s, axis=0)


def _heights(episode: Episode) -> Float64[Array, "N"]:
    """Return the anchors' heights, NaN where a height gap cannot be known."""
    if episode.anchor_up_m is None or episode.tag_up_m is None:
        return np.full(episode.n_anchors, np.nan)
    return episode.anchor_up_m


def correlation_lag(episode: Episode, correlation_s: float) -> int:
    """Return over how many steps errors may be correlated, at most a quarter of the episode.

    Parameters
    ----------
    episode
        Gives the time step.
    correlation_s
        Errors further apart than this count as independent, in seconds.
    """
    if episode.n_steps < 2:
        return 1
    step_s = float(np.median(np.diff(episode.t_s)))
    return int(np.clip(round(correlation_s / step_s), 1, max(episode.n_steps // 4, 1)))


def better_side(solutions: Solutions) -> Int64[Array, "B n"]:
    """Return the better-fitting hypothesis of each anchor; 0 where it was not located."""
    cost = np.nan_to_num(solutions.negative_log_likelihood, nan=np.inf)
    return np.asarray(np.argmin(cost, axis=-1), dtype=np.int64)


def at_side(values: Float64[Array, "B n 2 *rest"], side: Int64[Array, "B n"]) -> Array:
    """Return one hypothesis's values per anchor."""
    rows, columns = np.indices(side.shape)
    return np.asarray(values[rows, columns, side])


@dataclass(frozen=True)
class NormalSums:
    """Fisher information and gradient, summed over the ranges at one solution per anchor.

    J holds the predicted range's derivatives by (east, north, own bias), X those by what all
    anchors share: (b0, b1, clock offset); r is predicted minus measured.
    """

    jj: Float64[Array, "B n 3 3"]
    jx: Float64[Array, "B n 3 3"]
    xx: Float64[Array, "B n 3 3"]
    jr: Float64[Array, "B n 3"]
    xr: Float64[Array, "B n 3"]


def normal_sums(
    chunk: Chunk,
    solutions: Solutions,
    side: Int64[Array, "B n"],
    dof: float,
    shared_bias: Float64[Array, "B 2"] | None = None,
) -> NormalSums:
    """Sum up one hypothesis per anchor.

    Parameters
    ----------
    chunk, solutions
        The anchors and their solutions from ranges freed of ``shared_bias``.
    side
        Which hypothesis.
    dof
        Degrees of freedom of the Student-t errors; 0 for Gaussian.
    shared_bias
        The bias that was subtracted.
    """
    delta = at_side(solutions.position_m, side)[:, :, None] - chunk.position_m[:, None]
    gap = np.nan_to_num(chunk.tag_up_m[:, None] - chunk.anchor_up_m[:, :, None], nan=0.0)
    slant = np.sqrt((delta**2).sum(axis=-1) + gap**2 + 1e-12)
    unit = delta / slant[..., None]
    rate = (unit * chunk.velocity_mps[:, None]).sum(axis=-1)
    own = at_side(solutions.bias_m, side)[..., None]
    residual = slant + own - chunk.corrected(shared_bias)
    sigma = at_side(solutions.scale, side)[..., None] * chunk.sigma_m
    u2 = (residual / sigma) ** 2
    use: Bool[Array, "B n T"] = np.isfinite(u2)
    robust = (dof + 1.0) / (dof + u2) if dof > 0 else np.ones_like(u2)
    weight = np.nan_to_num(np.where(use, robust / sigma**2, 0.0))[..., None]
    curvature = fisher_share(dof) * weight
    jacobian = np.nan_to_num(np.concatenate([unit, np.ones_like(unit[..., :1])], axis=-1))
    shared = np.nan_to_num(np.concatenate([bias_basis(chunk.range_m), rate[..., None]], axis=-1))
    across = np.swapaxes(jacobian, -1, -2)
    column = np.where(use, residual, 0.0)[..., None]
    return NormalSums(
        jj=across @ (curvature * jacobian),
        jx=across @ (curvature * shared),
        xx=np.swapaxes(shared, -1, -2) @ (curvature * shared),
        jr=(across @ (weight * column))[..., 0],
        xr=(np.swapaxes(shared, -1, -2) @ (weight * column))[..., 0],
    )


def with_prior(
    jj: Float64[Array, "B n 3 3"], precision: Float64[Array, "B"]
) -> Float64[Array, "B n 3 3"]:
    """Add the own bias's prior to normal matrices, or hold the bias where its precision is 0.

    A degenerate anchor gets a ridge, so that its matrix can be inverted along with the others.
    """
    out = jj.copy()
    held = precision <= 0
    out[..., 2, 2] += precision[:, None]
    out[held, :, 2, :2] = out[held, :, :2, 2] = 0.0
    out[held, :, 2, 2] = 1e30
    trace = out[..., 0, 0] + out[..., 1, 1]
    out[..., [0, 1], [0, 1]] += np.where(trace > 0, 1e-9 * trace, 1.0)[..., None]
    return out
