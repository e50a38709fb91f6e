"""What ``gaia-set`` is trained on: simulated scenes, ever new ones, as many as it takes.

A *portion* is what a training goes through between two looks at the validation data. Its episodes
depend on nothing but its number, so a training that was stopped goes on with the same ones. A
portion mixes, in the shares of :data:`MIX`,

- ``wild``: work zones as engineers lay them out, everything varies;
- ``roaming``: any path past any group of anchors (``simulate/roaming.py``);
- ``stress``: the paper's stress test, hardly a range in sight.

All draw from the training part of the layouts; the test's have never been in a portion. Half of all
batches get what an alignment does to a log: ranges of neighbouring readings blended, short gaps
closed (``timeline.py``). Half are freed of the radios' common bias and say so, like a log that
was calibrated (``calibration.py``).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from gaia_uwb._shared import Array, Float64, Int64
from gaia_uwb.episode import bias_basis
from gaia_uwb.models import ZoneInputs, ZoneReadings, make_zone_inputs
from gaia_uwb.simulate import EpisodeBlock, find_preset, simulate_blocks, simulate_roaming

__all__ = ["MIX", "ZoneBatch", "training_portion", "validation_portion"]

MIX = {"wild": 0.45, "roaming": 0.4, "stress": 0.15}
"""Shares of the kinds of scenes."""

_LENGTHS, _LENGTH_SHARES = (64, 32, 128, 256), (0.7, 0.1, 0.1, 0.1)
"""Numbers of steps of an episode, and how often each is drawn."""
_AVERAGED, _AVERAGED_SHARES = (1, 3, 8, 18), (0.5, 0.2, 0.15, 0.15)
"""How many raw ranges a radio averages, and how often."""
_PARTS = 3  # of the episodes of a kind: each has its own length and radio
_STEPS_OF_A_BATCH = 32 * 64
_ALIGNED_SHARE, _CALIBRATED_SHARE = 0.5, 0.5  # of the batches
_CALIBRATION_SIGMA_M = 0.03  # by which a calibration errs, at 10 m and per factor of ten
_CALIBRATION_PRIOR = (1.0, 1.0)  # information on either number, in ranges with line of sight
_LONGEST_GAP_S = 1.0  # that an alignment closes
_TRAINING_SEED, _VALIDATION_SEED = 2_000_001, 2_000_002  # no test has such seeds


@dataclass(frozen=True)
class ZoneBatch:
    """Episodes of one number of steps and of anchors, with their truth in the path's frame.

    Parameters
    ----------
    inputs
        Of the network.
    anchor_m : (B, N, 2)
        True places, along and left in metres.
    range_m, nlos : (B, N, T)
        True slant ranges in metres, and whether there was no line of sight.
    """

    inputs: ZoneInputs
    anchor_m: Float64[Array, "B N 2"]
    range_m: Float64[Array, "B N T"]
    nlos: Float64[Array, "B N T"]

    @property
    def n_episodes(self) -> int:
        """Number of episodes."""
        return len(self.anchor_m)


def training_portion(seed: int, number: int, n_episodes: int) -> list[ZoneBatch]:
    """Return the batches of a portion, in the order in which they are trained on.

    Parameters
    ----------
    seed
        Of the training: another seed, other scenes.
    number
        Of the portion, from 0.
    n_episodes
        How many episodes, about.

    Examples
    --------
    >>> batches = training_portion(0, 0, 30)
    >>> sum(batch.n_episodes for batch in batches)
    30
    """
    rng = np.random.default_rng([_TRAINING_SEED, seed, number])
    batches: list[ZoneBatch] = []
    for kind, share in MIX.items():
        count = max(1, round(share * n_episodes))
        first = number * count
        lengths = rng.choice(_LENGTHS, size=_PARTS, p=_LENGTH_SHARES)
        parts = np.array_split(np.arange(first, first + count), _PARTS)
        for part, n_steps in zip(parts, lengths, strict=True):
            averaged = int(rng.choice(_AVERAGED, p=_AVERAGED_SHARES))
            if not len(part):
                continue
            numbers = [int(k) for k in part]
            for block in _blocks(kind, _TRAINING_SEED + 10 * seed, numbers, int(n_steps), averaged):
                batches += _batches(block, rng)
    return [batches[k] for k in rng.permutation(len(batches))]


def validation_portion(kind: str, n_episodes: int, n_steps: int = 64) -> list[ZoneBatch]:
    """Return batches to validate on: training layouts, but other scenes.

    Parameters
    ----------
    kind
        Of :data:`MIX`.
    n_episodes, n_steps
        How many episodes, of how many steps.
    """
    batches: list[ZoneBatch] = []
    for block in _blocks(kind, _VALIDATION_SEED, list(range(n_episodes)), n_steps, 1):
        batches += _batches(block, None)
    return batches


def _blocks(
    kind: str, seed: int, numbers: list[int], n_steps: int, averaged: int
) -> list[EpisodeBlock]:
    if kind == "roaming":
        return [simulate_roaming(seed, numbers, n_steps, averaged=averaged)]
    config = find_preset(f"{kind}-training")
    duration_s = n_steps / config.drive.rate_hz
    changes = {
        "drive": config.drive.model_copy(update={"duration_s": duration_s}),
        "ranging": config.ranging.model_copy(update={"averaged": averaged}),
    }
    return simulate_blocks(config.model_copy(update=changes), seed, numbers)


def _batches(block: EpisodeBlock, rng: np.random.Generator | None) -> Iterator[ZoneBatch]:
    """Cut a block into batches of episodes with one number of anchors."""
    counts = np.array(block.anchors)
    first_row = np.cumsum(counts) - counts
    size = max(4, _STEPS_OF_A_BATCH // block.t_s.shape[1])
    for n in np.unique(counts):
        same = np.flatnonzero(counts == n)
        for start in range(0, len(same), size):
            own = same[start : start + size]
            rows = first_row[own][:, None] + np.arange(n)
            range_m = block.range_m[rows]
            calibrated = rng is not None and rng.random() < _CALIBRATED_SHARE
            if rng is not None and calibrated:
                range_m = range_m - _common_bias_m(block, rows, rng)
            if rng is not None and rng.random() < _ALIGNED_SHARE:
                range_m = _as_aligned(range_m, block.t_s[own], rng)
            yield _batch(block, own, rows, range_m, calibrated=calibrated)


def _batch(
    block: EpisodeBlock,
    own: Array,
    rows: Array,
    range_m: Float64[Array, "B N T"],
    *,
    calibrated: bool,
) -> ZoneBatch:
    readings = ZoneReadings(
        t_s=block.t_s[own],
        position_m=block.position_m[own],
        range_m=range_m,
        tag_up_m=block.tag_up_m[own],
        anchor_up_m=block.anchor_up_m[rows],
        calibrated=np.full(len(own), float(calibrated)),
    )
    inputs, frame = make_zone_inputs(readings)
    return ZoneBatch(
        inputs=inputs,
        anchor_m=frame.enter(block.anchor_m[rows]),
        range_m=block.true_range_m[rows],
        nlos=block.nlos[rows].astype(np.float64),
    )


def _common_bias_m(
    block: EpisodeBlock, rows: Int64[Array, "B N"], rng: np.random.Generator
) -> Float64[Array, "B N T"]:
    """Return what a calibration would take off the ranges: their common bias, roughly.

    As in ``calibration.py``, b0 + b1 log10(d / 10 m) with a prior, here fitted to the true biases
    of ranges with line of sight, and off by as much as a calibration errs.
    """
    basis = bias_basis(block.true_range_m[rows])  # (B, N, T, 2)
    weight = (block.valid & ~block.nlos)[rows].astype(np.float64)
    normal = np.einsum("bnti,bntj,bnt->bij", basis, basis, weight)
    normal += np.diag(_CALIBRATION_PRIOR)
    right = np.einsum("bnti,bnt->bi", basis, weight * block.bias_m[rows])
    found = np.linalg.solve(normal, right[..., None])[..., 0]
    found += _CALIBRATION_SIGMA_M * rng.standard_normal(found.shape)
    return np.asarray(np.einsum("bnti,bi->bnt", basis, found))


def _as_aligned(
    range_m: Float64[Array, "B N T"], t_s: Float64[Array, "B T"], rng: np.random.Generator
) -> Float64[Array, "B N T"]:
    """Close gaps of up to a second by straight lines, and blend every range with its neighbours.

    An alignment interpolates two readings wherever the step is between them; where in between
    differs from anchor to anchor, and the blend is what it leaves of the noise.
    """
    aligned = range_m.copy()
    shares = rng.uniform(0.0, 0.5, range_m.shape[:2])
    for b, n in np.ndindex(*range_m.shape[:2]):
        there = np.flatnonzero(np.isfinite(range_m[b, n]))
        if len(there) < 2:
            continue
        time_s, value_m = t_s[b], range_m[b, n]
        whole_m = np.interp(time_s, time_s[there], value_m[there])
        next_one = np.searchsorted(there, np.arange(len(time_s)))
        before = there[np.clip(next_one - 1, 0, len(there) - 1)]
        after = there[np.clip(next_one, 0, len(there) - 1)]
        near = (time_s[after] - time_s[before] <= _LONGEST_GAP_S) & (
            after >= np.arange(len(time_s))
        )
        near &= np.arange(len(time_s)) >= there[0]
        share = shares[b, n]
        # Second differences, halved: what a straight line between neighbours makes of a range.
        bent_m = np.zeros_like(whole_m)
        bent_m[1:-1] = 0.5 * (whole_m[2:] - 2 * whole_m[1:-1] + whole_m[:-2])
        aligned[b, n] = np.where(near | np.isfinite(value_m), whole_m + share * bent_m, np.nan)
    return aligned
