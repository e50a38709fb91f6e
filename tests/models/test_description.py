from __future__ import annotations

import pytest
from pydantic import ValidationError

from gaia_uwb.models.description import GaiaArchitecture, WindowModel
from gaia_uwb.models.domain import Domain, Normalisation
from gaia_uwb.models.training_options import WindowTrainingOptions
from tiny_models import make_run


def test_contradicting_options_are_refused() -> None:
    with pytest.raises(ValidationError, match="look_ahead_steps is for causal networks only"):
        GaiaArchitecture(look_ahead_steps=3)


def test_a_description_survives_its_own_json() -> None:
    description = WindowModel(
        schema=1, network=GaiaArchitecture(causal=True, look_ahead_steps=4), n_anchors=12,
        window_steps=64, normalisation=Normalisation.fit([make_run(0)]),
        domain=Domain.of([make_run(0)]), sigma_m=0.1, data={"source": "sim:stress", "runs": 3},
        training=WindowTrainingOptions(), metrics={"validation_total": 0.5}, version="1",
    )  # fmt: skip
    again = WindowModel.model_validate_json(description.model_dump_json(by_alias=True))
    assert again == description
