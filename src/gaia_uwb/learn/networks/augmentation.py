"""Training episodes that nobody recorded, but might have: noise, gaps, wrong ranges, reversals."""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor

from gaia_uwb.learn.networks.window_losses import WindowBatch
from gaia_uwb.models import WindowTrainingOptions


def varied(
    batch: WindowBatch, rng: np.random.Generator, scale_m: float, options: WindowTrainingOptions
) -> WindowBatch:
    """Return a training batch with the noise, gaps, wrong ranges and reversals that are asked for.

    Parameters
    ----------
    batch
        Of episodes; their truth is reversed with them, and stays as it is otherwise.
    rng
        Source of randomness.
    scale_m
        Of the normalisation.
    options
        ``position_noise_m``, ``range_noise_m``, ``drop_share``, ``outlier_share``, ``reverse`` are
        used.
    """
    if options.position_noise_m:
        noise = _normal(rng, batch.position, options.position_noise_m / scale_m)
        batch = batch._replace(position=batch.position + noise)
    if options.range_noise_m:
        noise = _normal(rng, batch.distance, options.range_noise_m / scale_m)
        distance = (batch.distance + noise).clamp_min(0.0) * batch.mask
        batch = batch._replace(distance=distance)
    if options.drop_share:
        share = options.drop_share * rng.random((len(batch.mask), 1, 1))
        kept = torch.from_numpy(rng.random(tuple(batch.mask.shape)) >= share).to(batch.mask)
        batch = batch._replace(mask=batch.mask * kept, distance=batch.distance * kept)
    if options.outlier_share:
        shape = tuple(batch.mask.shape)
        wrong = torch.from_numpy(rng.random(shape) < options.outlier_share).to(batch.mask.device)
        anywhere = torch.from_numpy(rng.random(shape)).to(batch.distance) * batch.distance.max()
        distance = torch.where(wrong, anywhere, batch.distance) * batch.mask
        batch = batch._replace(distance=distance)
    if options.reverse:
        back = torch.from_numpy(rng.random(len(batch.mask)) < 0.5).to(batch.mask.device)
        turned = {
            name: torch.where(back[:, None, None], part.flip(1), part)
            for name, part in batch._asdict().items()
            if name != "anchor"
        }
        batch = batch._replace(**turned)
    return batch


def _normal(rng: np.random.Generator, like: Tensor, sigma: float) -> Tensor:
    return torch.from_numpy(rng.normal(scale=sigma, size=tuple(like.shape))).to(like)
