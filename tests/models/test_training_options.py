from __future__ import annotations

from gaia_uwb.models.training_options import WindowTrainingOptions, base_training


def test_networks_of_one_step_are_trained_on_the_masked_loss_for_longer() -> None:
    gaia = WindowTrainingOptions(epochs=6, seed=3, batch_size=7)
    found = base_training(gaia)
    assert (found.epochs, found.anchor_weight, found.seed, found.batch_size) == (12, 0.0, 3, 7)
