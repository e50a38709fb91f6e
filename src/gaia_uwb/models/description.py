"""What a trained model is, in words and numbers: its kind, sizes, data and scores.

Nothing here needs PyTorch: both running and training a model read this.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, Any, Literal, TypeVar

import numpy as np
from pydantic import (
    Field,
    PositiveInt,
    model_serializer,
    model_validator,
)

from gaia_uwb.config import Settings
from gaia_uwb.models.domain import Domain, Normalisation
from gaia_uwb.models.training_options import WindowTrainingOptions, ZoneTrainingOptions

SCHEMA = 1
"""Version of the files that hold a model."""

_Width = Annotated[int, Field(ge=1, le=4096)]
_Scale = Annotated[float, Field(gt=0, le=1e6)]


class MlpArchitecture(Settings):
    """Sizes of ``mlp``."""

    kind: Literal["mlp"] = "mlp"
    hidden: _Width = 128


class PoseMlpArchitecture(Settings):
    """Sizes of ``pose-mlp``."""

    kind: Literal["pose-mlp"] = "pose-mlp"
    hidden: _Width = 128


class GaiaArchitecture(Settings):
    """Sizes and variants of ``gaia``."""

    kind: Literal["gaia"] = "gaia"
    base_hidden: _Width = 128
    """Width of the PoseMLP Base."""
    gru_hidden: _Width = 80
    """Width H of each direction of the Temporal Refinement."""
    layout_hidden: _Width = 128
    head_hidden: _Width = 128
    """Width of the Prediction Head."""
    dropout: float = Field(default=0.0, ge=0, lt=1)
    """Share of the Layout Head's inputs that are left out at random in training: the layout then
    has about the errors in training that it has later, and the gate learns when to trust it."""
    layout_head: bool = True
    """The paper's ablation "w/o Layout Head" has none, so it is not trained on a layout."""
    geo_dist: bool = True
    """The paper's ablation "w/o GeoDist" trains the layout, but derives no distances from it."""
    train_base: bool = False
    """The paper's ablation "Unfreeze PoseMLP Base" trains the base along with the rest."""
    causal: bool = False
    """Use the past, and no more than ``look_ahead_steps`` of the future."""
    look_ahead_steps: int = Field(default=0, ge=0, le=1000)

    @model_validator(mode="after")
    def _looks_ahead_only_if_causal(self) -> GaiaArchitecture:
        if self.look_ahead_steps and not self.causal:
            raise ValueError(
                "look_ahead_steps is for causal networks only: the others see all steps"
            )
        return self


WindowArchitecture = MlpArchitecture | PoseMlpArchitecture | GaiaArchitecture


class GaiaSetArchitecture(Settings):
    """Sizes of ``gaia-set``."""

    kind: Literal["gaia-set"] = "gaia-set"
    channels: _Width = 24
    """Channels C of the temporal encoder."""
    width: int = Field(default=64, ge=4, le=4096, multiple_of=4)
    """Width D of a token."""
    layers: int = Field(default=2, ge=0, le=16)
    """Layers of attention in each round; with 0, every anchor is on its own."""
    rounds: int = Field(default=2, ge=1, le=8)


ZONE_LONGEST_STEPS = 4096
"""Most steps that ``gaia-set`` processes at a time."""
ZONE_FARTHEST_M = 400.0
"""The distance from the middle of the path that ``gaia-set`` was trained to handle."""
ZONE_MOST_ANCHORS = 200
"""Most anchors that ``gaia-set`` processes at a time."""


class ModelDescription(Settings):
    """All that is known of a trained model besides its weights: ``model.json``.

    It is a :class:`WindowModel` or a :class:`ZoneModel`; these are the fields of both.
    """

    schema_version: Literal[1] = Field(default=1, alias="schema")
    network: WindowArchitecture | GaiaSetArchitecture
    data: dict[str, Any]
    """The training data."""
    training: WindowTrainingOptions | ZoneTrainingOptions
    metrics: dict[str, float]
    """Scores on the validation data."""
    version: str
    """Version of the package that trained it."""
    sha256: dict[str, str] = Field(default_factory=dict)
    """Checksums of the files next to this one, and of everything else in this one."""

    @model_serializer(mode="wrap")
    def _own_first(self, serialise: Callable[[Any], dict[str, Any]]) -> dict[str, Any]:
        """Write what a family alone says after the network, before data and training."""
        last = ("data", "training", "metrics", "version", "sha256")
        return dict(sorted(serialise(self).items(), key=lambda field: field[0] in last))


class WindowModel(ModelDescription):
    """A trained network from the paper."""

    network: Annotated[WindowArchitecture, Field(discriminator="kind")]
    training: WindowTrainingOptions
    n_anchors: int = Field(ge=1)
    """Channels; a log may have fewer anchors."""
    window_steps: int = Field(ge=1)
    """Length of the windows that it was trained on."""
    normalisation: Normalisation
    domain: Domain
    sigma_m: float = Field(gt=0)
    """Root mean square range error on the validation data."""
    plausible_correction_m: float | None = Field(default=None, gt=0)
    """Networks with a layout: a window that is corrected by more (``plausible_correction.py``) was
    mistaken for another layout, and gets a running median instead."""


class ZoneModel(ModelDescription):
    """A trained ``gaia-set``."""

    network: GaiaSetArchitecture
    training: ZoneTrainingOptions
    variance_scales: tuple[tuple[PositiveInt, _Scale], ...] = Field(min_length=1, strict=False)
    """Numbers of steps, and what variances of places are multiplied by in scenes as long as that,
    so that on validation scenes 90 % of the 90 % ellipses hold the anchor (split conformal)."""

    @model_validator(mode="after")
    def _lengths_grow(self) -> ZoneModel:
        steps = [steps for steps, _ in self.variance_scales]
        if steps != sorted(set(steps)):
            raise ValueError(f"variance_scales: expected increasing numbers of steps, got {steps}")
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


Model = TypeVar("Model", WindowModel, ZoneModel)
"""A description of either family."""
