"""What a trained model is, in words and numbers: its kind, sizes, normalisation, data and scores.

Nothing here needs PyTorch: who runs a model reads this, and so does who trains one.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, PositiveFloat, PositiveInt, model_validator

from gaia_uwb._shared import InputError
from gaia_uwb.config import Settings
from gaia_uwb.episode import Episode

SCHEMA = 1
"""Version of the files that hold a model."""

_STRANGE_SHARE = 0.1  # of a path outside what a model has seen

_Width = Annotated[int, Field(ge=1, le=4096)]


class MlpOptions(Settings):
    """Sizes of ``mlp``."""

    kind: Literal["mlp"] = "mlp"
    hidden: _Width = 128


class PoseMlpOptions(Settings):
    """Sizes of ``pose-mlp``."""

    kind: Literal["pose-mlp"] = "pose-mlp"
    hidden: _Width = 128


class GaiaOptions(Settings):
    """Sizes and variants of ``gaia``."""

    kind: Literal["gaia"] = "gaia"
    base_hidden: _Width = 128
    """Of the PoseMLP Base."""
    gru_hidden: _Width = 80
    """H of each direction of the Temporal Refinement."""
    layout_hidden: _Width = 128
    head_hidden: _Width = 128
    """Of the Prediction Head."""
    dropout: float = Field(default=0.0, ge=0, lt=1)
    """Share of the Layout Head's inputs that are left out at random in training: the layout then
    errs in training about as it does later, and the gate learns when to trust it."""
    layout_head: bool = True
    """The paper's ablation "w/o Layout Head" has none, hence no layout to be trained on."""
    geo_dist: bool = True
    """The paper's ablation "w/o GeoDist" trains the layout, but no distance follows from it."""
    train_base: bool = False
    """The paper's ablation "Unfreeze PoseMLP Base" trains the base along with the rest."""
    causal: bool = False
    """Look at the past, and at no more than ``look_ahead_steps`` of the future."""
    look_ahead_steps: int = Field(default=0, ge=0, le=1000)

    @model_validator(mode="after")
    def _looks_ahead_only_if_causal(self) -> GaiaOptions:
        if self.look_ahead_steps and not self.causal:
            raise ValueError("look_ahead_steps is for causal networks only: the others see it all")
        return self


NetworkOptions = MlpOptions | PoseMlpOptions | GaiaOptions


class GaiaSetOptions(Settings):
    """Sizes of ``gaia-set``."""

    kind: Literal["gaia-set"] = "gaia-set"
    channels: _Width = 24
    """C of the temporal encoder."""
    width: int = Field(default=64, ge=4, le=4096, multiple_of=4)
    """D of a token."""
    layers: int = Field(default=2, ge=0, le=16)
    """Of attention, in each round; without, every anchor is on its own."""
    rounds: int = Field(default=2, ge=1, le=8)


SET_LONGEST_STEPS = 4096
"""Steps that ``gaia-set`` takes at a time."""
SET_FARTHEST_M = 400.0
"""How far from the middle of the path ``gaia-set`` knows its way."""
SET_MOST_ANCHORS = 200
"""Anchors that ``gaia-set`` takes at a time."""


class Normalisation(Settings):
    """How lengths become numbers about 1: one scale for all of them, so that geometry holds."""

    origin_east_m: float
    origin_north_m: float
    scale_m: float = Field(gt=0)

    @classmethod
    def fit(cls, episodes: Sequence[Episode]) -> Normalisation:
        """Centre the paths, and scale by the root mean square of the ranges.

        Parameters
        ----------
        episodes
            Those that a model is trained on.

        Raises
        ------
        InputError
            If there is no range in them.
        """
        position_m = np.concatenate([episode.position_m for episode in episodes])
        range_m = np.concatenate([episode.range_m[episode.valid] for episode in episodes])
        if not len(range_m):
            raise InputError("expected episodes with ranges to train on, got none")
        east_m, north_m = position_m.mean(axis=0)
        return cls(
            origin_east_m=round(float(east_m), 3),
            origin_north_m=round(float(north_m), 3),
            scale_m=round(float(np.sqrt(np.mean(range_m**2))), 3),
        )


class Domain(Settings):
    """What a model has seen in training; elsewhere it guesses."""

    east_m: tuple[float, float] = Field(strict=False)
    """Least and largest east of the path."""
    north_m: tuple[float, float] = Field(strict=False)
    range_m: tuple[float, float] = Field(strict=False)
    n_anchors: tuple[int, int] = Field(strict=False)

    @classmethod
    def of(cls, episodes: Sequence[Episode]) -> Domain:
        """Return the domain of some episodes.

        Parameters
        ----------
        episodes
            At least one, with ranges.
        """
        position_m = np.concatenate([episode.position_m for episode in episodes])
        range_m = np.concatenate([episode.range_m[episode.valid] for episode in episodes])
        counts = [episode.n_anchors for episode in episodes]
        return cls(
            east_m=_span(position_m[:, 0]),
            north_m=_span(position_m[:, 1]),
            range_m=_span(range_m),
            n_anchors=(min(counts), max(counts)),
        )

    def strange(self, episode: Episode) -> list[str]:
        """Say in words what of an episode a model has not seen; nothing if it has seen all.

        Parameters
        ----------
        episode
            Any.
        """
        reasons = []
        share = self.outside_share(episode)
        if share > _STRANGE_SHARE:
            reasons.append(f"{share:.0%} of the path lies outside the area of its training")
        low, high = self.n_anchors
        if not low <= episode.n_anchors <= high:
            seen = f"{low}" if low == high else f"{low} to {high}"
            reasons.append(f"it was trained with {seen} anchors, this log has {episode.n_anchors}")
        return reasons

    def outside_share(self, episode: Episode) -> float:
        """Return which share of an episode's path lies outside, give or take a tenth.

        Parameters
        ----------
        episode
            Any.
        """
        inside = np.ones(episode.n_steps, dtype=np.bool_)
        for axis, (low_m, high_m) in enumerate((self.east_m, self.north_m)):
            slack_m = 0.1 * (high_m - low_m)
            value_m = episode.position_m[:, axis]
            inside &= (value_m >= low_m - slack_m) & (value_m <= high_m + slack_m)
        return float(1.0 - inside.mean())


def _span(value: np.ndarray) -> tuple[float, float]:
    """Return the least and the largest value, rounded outwards to millimetres."""
    return float(np.floor(value.min() * 1e3) / 1e3), float(np.ceil(value.max() * 1e3) / 1e3)


class TrainingOptions(Settings):
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
    """The anchor-level loss takes every so-manieth step."""
    anchor_huber_m: float = Field(default=5.0, gt=0)
    """Errors of multilaterated anchors beyond this count linearly."""
    anchor_nlos_weight: float = Field(default=0.2, ge=0)
    """Weight of ranges without line of sight in the anchor-level loss (the paper's solver)."""
    gauss_newton_rounds: int = Field(default=4, ge=1, le=100)


def per_step(training: TrainingOptions) -> TrainingOptions:
    """Return how ``mlp`` and ``pose-mlp`` are trained where ``gaia`` is trained like this.

    The same in all but two: on the masked loss alone, as in the paper, and twice as long, for their
    epochs take a tenth of the time.

    Parameters
    ----------
    training
        Of ``gaia``.
    """
    return training.model_copy(update={"anchor_weight": 0.0, "epochs": 2 * training.epochs})


class ModelDescription(Settings):
    """All that is known of a trained model besides its weights: ``model.json``."""

    schema_version: Literal[1] = Field(default=1, alias="schema")
    network: Annotated[NetworkOptions, Field(discriminator="kind")]
    n_anchors: int = Field(ge=1)
    """Channels; a log may have fewer anchors."""
    window_steps: int = Field(ge=1)
    """Length of the windows that it was trained on."""
    normalisation: Normalisation
    domain: Domain
    sigma_m: float = Field(gt=0)
    """Root mean square range error on the validation data."""
    plausible_correction_m: float | None = Field(default=None, gt=0)
    """Networks with a layout: a window that is corrected farther (``plausible_correction.py``) was
    taken for one of another layout, and gets a running median instead."""
    data: dict[str, Any]
    """What it was trained on."""
    training: TrainingOptions
    metrics: dict[str, float]
    """Scores on the validation data."""
    version: str
    """Of the package that trained it."""
    sha256: dict[str, str] = Field(default_factory=dict)
    """Checksums of the files beside this one, and of all else in this one."""


class SetTrainingOptions(Settings):
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


class SetModelDescription(Settings):
    """All that is known of a trained ``gaia-set`` besides its weights: ``model.json``."""

    schema_version: Literal[1] = Field(default=1, alias="schema")
    network: GaiaSetOptions
    variance_scales: tuple[tuple[PositiveInt, PositiveFloat], ...] = Field(
        min_length=1, strict=False
    )
    """Numbers of steps, and what variances of places are multiplied by in scenes as long as that,
    so that on validation scenes 90 % of the 90 % ellipses hold the anchor (split conformal)."""
    data: dict[str, Any]
    """What it was trained on."""
    training: SetTrainingOptions
    metrics: dict[str, float]
    """Scores on the validation data."""
    version: str
    """Of the package that trained it."""
    sha256: dict[str, str] = Field(default_factory=dict)
    """Checksums of the files beside this one, and of all else in this one."""

    @model_validator(mode="after")
    def _lengths_grow(self) -> SetModelDescription:
        steps = [steps for steps, _ in self.variance_scales]
        if steps != sorted(set(steps)):
            raise ValueError(f"variance_scales: expected numbers of steps that grow, got {steps}")
        return self

    def variance_scale(self, n_steps: int) -> float:
        """Return what variances of places are multiplied by.

        Between known lengths in proportion, in logarithms; shorter and longer ones are scaled like
        the nearest.

        Parameters
        ----------
        n_steps
            Of a scene.
        """
        steps, scales = zip(*self.variance_scales, strict=True)
        return float(np.exp(np.interp(np.log(n_steps), np.log(steps), np.log(scales))))
