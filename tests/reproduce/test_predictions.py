"""Predictions are the pipeline's, are kept, and are made again when anything has changed."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from gaia_uwb._shared.files import OutputFolder
from gaia_uwb.config import AlignmentConfig, PipelineConfig
from gaia_uwb.pipeline import prepare, reconstruct_episodes
from gaia_uwb.reproduce import predictions
from gaia_uwb.reproduce.plan import paper_solver
from gaia_uwb.reproduce.predictions import (
    Predictions,
    Solver,
    Stretch,
    cached_predictions,
    held_out_pieces,
    whole,
)
from surveyed import make_runs

ROBUST = {"robust": Solver(PipelineConfig(), labels=False)}
WLS = {"wls": Solver(paper_solver(PipelineConfig()), labels=True)}


@pytest.fixture(scope="module")
def episodes():
    return [w for run in make_runs(("A/1",)) for w in prepare(run).windows(64)][:3]


def predict(folder: Path, episodes, name: str = "kalman", solvers=ROBUST) -> Predictions:
    pieces = whole(name, episodes)
    return cached_predictions(OutputFolder(folder), "file", episodes, pieces, solvers)


@pytest.mark.parametrize(("solvers", "labels"), [(ROBUST, False), (WLS, True)])
@pytest.mark.parametrize("in_pieces", [False, True])
def test_they_are_what_the_pipeline_gives(
    tmp_path: Path, episodes, solvers, labels, in_pieces: bool
) -> None:
    pieces = whole("kalman" if in_pieces else "pose-kalman", episodes)
    if in_pieces:  # a second piece that nothing is taken from
        pieces = [[*own, Stretch("median", 0, 64, 64)] for own in pieces]
    found = cached_predictions(OutputFolder(tmp_path), "file", episodes, pieces, solvers)
    (name, solver) = next(iter(solvers.items()))
    config = solver.config.model_copy(update={"denoiser": pieces[0][0].denoiser})
    nlos = [e.truth.nlos for e in episodes] if labels else None
    expected = reconstruct_episodes(episodes, config, true_nlos=nlos)
    for k, own in enumerate(expected):
        np.testing.assert_allclose(found.denoised[k].range_m, own.denoised.range_m, rtol=1e-6)
        np.testing.assert_array_equal(found.denoised[k].valid, own.denoised.valid)
        for ours, theirs in zip(found.anchors[name][k], own.anchors, strict=True):
            np.testing.assert_array_equal(ours.position_m, theirs.position_m)
            np.testing.assert_array_equal(ours.mirror_position_m, theirs.mirror_position_m)
            np.testing.assert_array_equal(ours.covariance_m2, theirs.covariance_m2)
            assert (ours.status, ours.n_ranges) == (theirs.status, theirs.n_ranges)


def test_a_second_call_reads_the_file(
    tmp_path: Path, episodes, monkeypatch: pytest.MonkeyPatch
) -> None:
    first = predict(tmp_path, episodes)
    monkeypatch.setattr(predictions, "reconstruct_episodes", None)
    again = predict(tmp_path, episodes)
    assert again.key == first.key
    np.testing.assert_array_equal(again.denoised[0].range_m, first.denoised[0].range_m)


def test_whatever_has_changed_makes_them_stale(
    tmp_path: Path, episodes, monkeypatch: pytest.MonkeyPatch
) -> None:
    keys = [predict(tmp_path, episodes).key]
    noisy = [replace(e, position_m=e.position_m + 0.01) for e in episodes]
    keys.append(predict(tmp_path, noisy).key)
    keys.append(predict(tmp_path, episodes, "median").key)
    keys.append(predict(tmp_path, episodes, solvers=WLS).key)
    unsure = PipelineConfig(alignment=AlignmentConfig(clock_offset_sigma_s=0.1))
    keys.append(predict(tmp_path, episodes, solvers={"robust": Solver(unsure, labels=False)}).key)
    monkeypatch.setattr(predictions, "code_digest", lambda *names, without: "other code")
    keys.append(predict(tmp_path, episodes).key)
    assert len(set(keys)) == 6


@pytest.mark.parametrize("damage", [b"", b"no archive", None])
def test_a_damaged_file_is_made_again(tmp_path: Path, episodes, damage: bytes | None) -> None:
    first = predict(tmp_path, episodes)
    path = tmp_path / "file.npz"
    content = path.read_bytes()
    path.write_bytes(content[: len(content) // 2] if damage is None else damage)
    assert predict(tmp_path, episodes).key == first.key
    with np.load(path) as written:
        assert "robust.places" in written


def test_windows_of_a_long_episode_go_to_their_own_models(episodes) -> None:
    run = prepare(make_runs(("A/1",))[0])
    names = [f"model-{k}" for k in range(run.n_steps // 64)]
    pieces = held_out_pieces(run, names, 0, 64)
    used = np.zeros(run.n_steps, dtype=int)
    for piece in pieces:
        used[piece.used_from : piece.stop] += 1
    np.testing.assert_array_equal(used, 1)
    assert pieces[1] == Stretch("model-1", 64, 128, 64)
    if run.n_steps % 64:
        assert pieces[-1] == Stretch(names[-1], run.n_steps - 64, run.n_steps, len(names) * 64)
    part = held_out_pieces(run.window(64, 128), names, 64, 64)
    assert [piece.denoiser for piece in part] == ["model-1"]
