"""Recipes: what a file changes, what it may not, and what the per-step networks differ in."""

from __future__ import annotations

from pathlib import Path

import pytest

from gaia_uwb._shared.errors import ConfigError
from gaia_uwb.learn.recipes import ABLATIONS, KINDS, load_recipe, make_recipe


def test_a_file_changes_what_it_names(tmp_path: Path) -> None:
    path = tmp_path / "recipe.yaml"
    path.write_text("network: {gru_hidden: 16}\ntraining: {epochs: 3}\nsets: {n_training: 7}\n")
    default = make_recipe(KINDS["gaia"], simulated=True)
    recipe = load_recipe(path, default)
    assert recipe.network.gru_hidden == 16  # type: ignore[union-attr]
    assert (recipe.training.epochs, recipe.sets.n_training) == (3, 7)
    assert recipe.training.batch_size == default.training.batch_size


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("training: {epoch: 3}", "training.epoch"),
        ("training: {epochs: 0}", "greater than or equal to 1"),
        ("train: {epochs: 3}", "sections"),
        ("training: 3", "training"),
        ("network: {kind: transformer}", "transformer"),
        ("[1, 2]", "sections"),
        ("{", "cannot read"),
        ("sets: {}\nsets: {}", "line 2: duplicate key 'sets'"),
    ],
)
def test_a_wrong_file_is_one_line(tmp_path: Path, text: str, problem: str) -> None:
    path = tmp_path / "recipe.yaml"
    path.write_text(text)
    with pytest.raises(ConfigError, match=problem) as caught:
        load_recipe(path, make_recipe(KINDS["gaia"], simulated=True))
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_missing_file_is_one_line(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="cannot read a recipe"):
        load_recipe(tmp_path / "none.yaml", make_recipe(KINDS["mlp"], simulated=True))


def test_per_step_networks_know_no_geometry() -> None:
    for simulated in (True, False):
        gaia = make_recipe(KINDS["gaia"], simulated=simulated).training
        assert gaia.anchor_weight > 0
        for kind in ("mlp", "pose-mlp"):
            training = make_recipe(KINDS[kind], simulated=simulated).training
            assert training.anchor_weight == 0
            assert training.learning_rate == gaia.learning_rate


def test_ablations_differ_from_the_whole_in_what_they_say() -> None:
    assert ABLATIONS["gaia"] == KINDS["gaia"]
    assert len({str(network) for network in ABLATIONS.values()}) == 4
