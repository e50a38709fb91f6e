from __future__ import annotations

from gaia_uwb.models.card import model_card
from gaia_uwb.models.description import GaiaArchitecture, WindowModel
from gaia_uwb.models.domain import Domain, Normalisation
from gaia_uwb.models.training_options import WindowTrainingOptions
from tiny_models import make_run


def test_the_card_says_what_the_description_says() -> None:
    description = WindowModel(
        schema=1, network=GaiaArchitecture(gru_hidden=77), n_anchors=12, window_steps=64,
        normalisation=Normalisation.fit([make_run(0)]), domain=Domain.of([make_run(0)]),
        sigma_m=0.1234, data={"source": "sim:stress", "validation": "1000 episodes"},
        training=WindowTrainingOptions(batch_size=321), metrics={"validation_total": 0.56789},
        version="9.9",
    )  # fmt: skip
    card = model_card(description)
    for words in (
        "# gaia, trained on sim:stress", "64 steps", "gru_hidden 77", "gaia 9.9",
        "gaia train gaia --data sim:stress --seed 0 --out my-model/",
        "- validation: 1000 episodes", "| validation_total | 0.5679 |", "at most 12 anchors",
        "east -10 to 10 m", "north -4 to -4 m", "0.123 m", "- batch_size: 321",
    ):  # fmt: skip
        assert words in " ".join(card.split())
    assert not any(line.endswith(" ") for line in card.splitlines())
