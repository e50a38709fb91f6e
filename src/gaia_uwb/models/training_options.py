"""How networks of either family are trained: every setting of the two trainings."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from gaia_uwb.config import Settings


class WindowTrainingOptions(Settings):
    """How a model is trained (``learn/window_training.py``)."""

    seed: int = Field(default=0, ge=0)
    """Random seed of the initial weights, the order of the batches and the pose noise."""
    epochs: int = Field(default=60, ge=1, le=100_000)
    """Most epochs; over them the learning rate falls to zero along a half cosine."""
    patience: int = Field(default=15, ge=1)
    """Stop after this many epochs without a better validation loss."""
    batch_size: int = Field(default=128, ge=1)
    learning_rate: float = Field(default=2e-3, gt=0, le=1)
    weight_decay: float = Field(default=1e-4, ge=0, le=1)
    gradient_norm: float = Field(default=1.0, gt=0)
    """Longer gradients are clipped to this norm."""
    position_noise_m: float = Field(default=0.0, ge=0, le=10)
    """White noise added to the positions of the training batches."""
    range_noise_m: float = Field(default=0.0, ge=0, le=10)
    """White noise added to the ranges of the training batches."""
    drop_share: float = Field(default=0.0, ge=0, lt=1)
    """In each training episode, a random share of the ranges, between 0 and this, is left out."""
    outlier_share: float = Field(default=0.0, ge=0, lt=1)
    """This share of the ranges of the training batches is replaced by random values between 0 and
    the batch's longest range."""
    reverse: bool = False
    """Reverse every other training episode in time: that is also a valid drive."""
    huber_delta_m: float = Field(default=1.0, gt=0)
    """Range errors beyond this count linearly."""
    nlos_weight: float = Field(default=1.0, ge=0)
    """Weight of ranges without line of sight in the masked loss; with line of sight it is 1."""
    layout_weight: float = Field(default=0.02, ge=0)
    """Weight lambda 1 of the layout loss, per m²."""
    consistency_weight: float = Field(default=0.1, ge=0)
    """Weight lambda 2 of the consistency loss, per m²."""
    anchor_weight: float = Field(default=0.05, ge=0)
    """Weight lambda 3 of the anchor-level loss, per m²."""
    anchor_stride: int = Field(default=4, ge=1)
    """The anchor-level loss takes every n-th step."""
    anchor_huber_m: float = Field(default=5.0, gt=0)
    """Errors of anchors located by multilateration count linearly beyond this."""
    anchor_nlos_weight: float = Field(default=0.2, ge=0)
    """Weight of ranges without line of sight in the anchor-level loss (as in the paper)."""
    gauss_newton_rounds: int = Field(default=4, ge=1, le=100)


def base_training(training: WindowTrainingOptions) -> WindowTrainingOptions:
    """Return the options for ``mlp`` and ``pose-mlp`` that go with those of ``gaia``.

    The same, with two exceptions: only the masked loss, as in the paper, and twice as many epochs,
    because theirs take a tenth of the time.

    Parameters
    ----------
    training
        Of ``gaia``.
    """
    return training.model_copy(update={"anchor_weight": 0.0, "epochs": 2 * training.epochs})


class ZoneTrainingOptions(Settings):
    """How ``gaia-set`` is trained (``learn/zone_training.py``)."""

    seed: int = Field(default=0, ge=0)
    """Random seed of the initial weights and of the scenes."""
    portions: int = Field(default=160, ge=1, le=1_000_000)
    """Portions of new scenes; over them the learning rate falls to zero along a half cosine."""
    portion_episodes: int = Field(default=2048, ge=8, le=1_000_000)
    validation_episodes: int = Field(default=256, ge=8, le=100_000)
    """Validation scenes of each kind."""
    learning_rate: float = Field(default=2e-3, gt=0, le=1)
    matrix_optimiser: Literal["muon", "adamw"] = "muon"
    """Optimiser of the weight matrices between layers."""
    matrix_learning_rate: float = Field(default=4e-3, gt=0, le=1)
    """Learning rate of these matrices under Muon; under AdamW all weights share one."""
    warm_up_steps: int = Field(default=100, ge=0)
    """Steps over which the learning rates grow from zero."""
    weight_decay: float = Field(default=1e-4, ge=0, le=1)
    gradient_norm: float = Field(default=1.0, gt=0)
    """Longer gradients are clipped to this norm."""
