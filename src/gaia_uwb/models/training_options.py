"""How networks of either family are trained: every setting of the two trainings."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from gaia_uwb.config import Settings


class WindowTrainingOptions(Settings):
    """How a model is trained (``learn/window_training.py``)."""

    seed: int = Field(default=0, ge=0)
    """Of the weights at the start, of the batches' order and of the pose noise."""
    epochs: int = Field(default=60, ge=1, le=100_000)
    """At most; the learning rate falls to zero over them along a half cosine."""
    patience: int = Field(default=15, ge=1)
    """Stop after so many epochs without a better validation loss."""
    batch_size: int = Field(default=128, ge=1)
    learning_rate: float = Field(default=2e-3, gt=0, le=1)
    weight_decay: float = Field(default=1e-4, ge=0, le=1)
    gradient_norm: float = Field(default=1.0, gt=0)
    """Longer gradients are shortened to this."""
    position_noise_m: float = Field(default=0.0, ge=0, le=10)
    """White noise added to the positions of the training batches."""
    range_noise_m: float = Field(default=0.0, ge=0, le=10)
    """White noise added to the ranges of the training batches."""
    drop_share: float = Field(default=0.0, ge=0, lt=1)
    """Of each training episode, a share of the ranges between 0 and this is left out."""
    outlier_share: float = Field(default=0.0, ge=0, lt=1)
    """A share of the ranges of the training batches is replaced by any between 0 and the batch's
    longest."""
    reverse: bool = False
    """Drive every other training episode backwards, which is a drive as well."""
    huber_delta_m: float = Field(default=1.0, gt=0)
    """Range errors beyond this count linearly."""
    nlos_weight: float = Field(default=1.0, ge=0)
    """Weight of ranges without line of sight in the masked loss; with line of sight it is 1."""
    layout_weight: float = Field(default=0.02, ge=0)
    """lambda 1, per m^2."""
    consistency_weight: float = Field(default=0.1, ge=0)
    """lambda 2, per m^2."""
    anchor_weight: float = Field(default=0.05, ge=0)
    """lambda 3, per m^2."""
    anchor_stride: int = Field(default=4, ge=1)
    """The anchor-level loss takes every n-th step."""
    anchor_huber_m: float = Field(default=5.0, gt=0)
    """Errors of multilaterated anchors beyond this count linearly."""
    anchor_nlos_weight: float = Field(default=0.2, ge=0)
    """Weight of ranges without line of sight in the anchor-level loss (the paper's solver)."""
    gauss_newton_rounds: int = Field(default=4, ge=1, le=100)


def base_training(training: WindowTrainingOptions) -> WindowTrainingOptions:
    """Return how ``mlp`` and ``pose-mlp`` are trained where ``gaia`` is trained like this.

    The same in all but two: on the masked loss alone, as in the paper, and twice as long, for their
    epochs take a tenth of the time.

    Parameters
    ----------
    training
        Of ``gaia``.
    """
    return training.model_copy(update={"anchor_weight": 0.0, "epochs": 2 * training.epochs})


class ZoneTrainingOptions(Settings):
    """How ``gaia-set`` is trained (``learn/zone_training.py``)."""

    seed: int = Field(default=0, ge=0)
    """Of the weights at the start and of the scenes."""
    portions: int = Field(default=160, ge=1, le=1_000_000)
    """Portions of new scenes; the learning rate falls to zero over them along a half cosine."""
    portion_episodes: int = Field(default=2048, ge=8, le=1_000_000)
    validation_episodes: int = Field(default=256, ge=8, le=100_000)
    """Of each kind of scene."""
    learning_rate: float = Field(default=2e-3, gt=0, le=1)
    matrix_optimiser: Literal["muon", "adamw"] = "muon"
    """Of the weights that are matrices between layers."""
    matrix_learning_rate: float = Field(default=4e-3, gt=0, le=1)
    """Of these weights under Muon; under AdamW all have the same."""
    warm_up_steps: int = Field(default=100, ge=0)
    """Over which the learning rates grow from zero."""
    weight_decay: float = Field(default=1e-4, ge=0, le=1)
    gradient_norm: float = Field(default=1.0, gt=0)
    """Longer gradients are shortened to this."""
