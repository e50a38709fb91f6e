"""Models are trained once, again when stale, and taken up where they belong to the same data."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest

from gaia_uwb._shared.errors import ConfigError
from gaia_uwb.learn.recipes import KINDS
from gaia_uwb.reproduce import trainings
from gaia_uwb.reproduce.jobs import run_jobs
from gaia_uwb.reproduce.trainings import (
    STAMP,
    Training,
    read_stamp,
    stress_training,
    train_model,
    with_bases,
)
from tiny import TINY

pytest.importorskip("torch", reason="PyTorch is not installed: no model can be trained here")


def make_training(folder: Path, kind: str = "mlp", seed: int = 0) -> Training:
    return stress_training(folder / "models", kind, TINY.recipe(KINDS[kind], seed), "1.2.3")


def weights(training: Training) -> bytes:
    return (training.place / "weights.safetensors").read_bytes()


def test_a_fresh_model_is_left_alone(tmp_path: Path) -> None:
    training = make_training(tmp_path)
    assert train_model(training) is True
    before = weights(training)
    assert train_model(training) is False
    assert weights(training) == before
    stamp = read_stamp(training.place)
    assert stamp is not None
    assert stamp["done"] is True
    assert stamp["taken_up"] is False


def test_a_model_of_other_code_is_trained_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    training = make_training(tmp_path)
    train_model(training)
    monkeypatch.setattr(trainings, "code_digest", lambda *names, without: "other code")
    assert train_model(training) is True
    assert train_model(training) is False


def test_a_model_without_a_note_is_taken_up_if_it_is_of_the_same_training(tmp_path: Path) -> None:
    training = make_training(tmp_path)
    train_model(training)
    before = weights(training)
    (training.place / STAMP).unlink()
    assert train_model(training) is True
    stamp = read_stamp(training.place)
    assert stamp is not None
    assert stamp["taken_up"] is True
    assert weights(training) == before
    (training.place / STAMP).unlink()
    other = Training(training.place, TINY.recipe(KINDS["mlp"], 1), training.data, None, "1.2.3")
    with pytest.raises(ConfigError, match="another training"):
        train_model(other)


def test_a_training_that_was_stopped_goes_on_to_the_same_weights(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    import gaia_uwb.learn as module

    plan, real = replace(TINY, epochs=2), module.train_window
    recipe = plan.recipe(KINDS["mlp"], 0)
    stopped, whole = (
        stress_training(tmp_path / name / "models", "mlp", recipe, "1.2.3")
        for name in ("stopped", "whole")
    )

    def stop_after_one(task, folder, *, base, progress):
        def once(epochs, name, done):
            for k, epoch in enumerate(progress(epochs, name, done)):
                if k == 1:
                    raise KeyboardInterrupt
                yield epoch

        return real(task, folder, base=base, progress=once)

    monkeypatch.setattr(module, "train_window", stop_after_one)
    with pytest.raises(KeyboardInterrupt):
        train_model(stopped)
    stamp = read_stamp(stopped.place)
    assert stamp is not None
    assert stamp["done"] is False
    monkeypatch.setattr(module, "train_window", real)
    assert train_model(stopped) is True
    assert len((stopped.place / "training-log.jsonl").read_text().splitlines()) == 2
    train_model(whole)
    assert weights(stopped) == weights(whole)
    again = read_stamp(stopped.place)
    assert again is not None
    assert again["seconds"] >= stamp["seconds"]
    assert again["taken_up"] is False


def test_a_base_is_trained_before_what_stands_on_it(tmp_path: Path) -> None:
    gaia = make_training(tmp_path, "gaia")
    wanted = with_bases([gaia], TINY)
    assert [training.place.name for training in wanted] == ["gaia-seed0", "pose-mlp-seed0"]
    done = run_jobs([training.job() for training in wanted], 0)
    assert list(done) == ["pose-mlp-seed0", "gaia-seed0"]
    assert gaia.denoiser == f"gaia:{gaia.place}"


@pytest.mark.parametrize("text", ["", "[]", json.dumps({"key": "k"})])
def test_a_damaged_note_is_none(tmp_path: Path, text: str) -> None:
    (tmp_path / STAMP).write_text(text)
    assert read_stamp(tmp_path) is None
