"""The denoiser with a network that was hardly trained: what it promises holds for any weights."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("torch", reason="needs PyTorch: install gaia-uwb[train]")

from gaia_uwb._shared.errors import ConfigError
from gaia_uwb.denoised import DenoisedRanges
from gaia_uwb.denoisers.registry import make_denoiser
from gaia_uwb.episode import Episode
from gaia_uwb.models.checkpoint import DESCRIPTION, ONNX
from gaia_uwb.models.description import ZONE_LONGEST_STEPS, ZONE_MOST_ANCHORS
from gaia_uwb.simulate import find_preset, simulate_episodes
from tiny_models import make_run, train_tiny_zone


@pytest.fixture(scope="module")
def model(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("gaia-set")
    train_tiny_zone(folder)
    return folder


@pytest.fixture(scope="module")
def episodes() -> list[Episode]:
    return list(simulate_episodes(find_preset("wild-test"), 6, seed=1))


def denoise(model: Path, episodes: list[Episode]) -> list[DenoisedRanges]:
    return make_denoiser(f"gaia-set:{model}")([episode.without_truth() for episode in episodes])


def moved(episode: Episode) -> Episode:
    turn = np.array([[0.6, 0.8], [-0.8, 0.6]])
    return replace(episode, position_m=episode.position_m @ turn + [500.0, -80.0], truth=None)


def test_each_result_is_what_the_episode_alone_gives(model: Path, episodes: list[Episode]) -> None:
    for together, episode in zip(denoise(model, episodes), episodes, strict=True):
        (alone,) = denoise(model, [episode])
        np.testing.assert_allclose(together.range_m, alone.range_m, atol=1e-4)
        assert together.zone is not None and alone.zone is not None
        np.testing.assert_allclose(together.zone.place_m, alone.zone.place_m, atol=5e-3)


def test_places_move_and_turn_with_the_scene(model: Path, episodes: list[Episode]) -> None:
    turn = np.array([[0.6, 0.8], [-0.8, 0.6]])
    here, there = denoise(model, episodes), denoise(model, list(map(moved, episodes)))
    for a, b in zip(here, there, strict=True):
        assert a.zone is not None and b.zone is not None
        np.testing.assert_allclose(b.range_m, a.range_m, atol=5e-3)
        np.testing.assert_allclose(
            b.zone.place_m, a.zone.place_m @ turn + [500.0, -80.0], atol=0.05
        )
        np.testing.assert_allclose(
            b.zone.covariance_m2, turn.T @ a.zone.covariance_m2 @ turn, rtol=0.02, atol=1e-3
        )


def test_ranges_are_where_they_were_measured_and_never_negative(
    model: Path, episodes: list[Episode]
) -> None:
    for found, episode in zip(denoise(model, episodes), episodes, strict=True):
        np.testing.assert_array_equal(found.valid, episode.valid)
        assert (found.range_m[found.valid] >= 0).all()


def test_an_anchor_with_hardly_a_range_keeps_them(model: Path, episodes: list[Episode]) -> None:
    episode = episodes[0]
    valid = episode.valid.copy()
    valid[:, 0] = False
    valid[[5, 9], 0] = episode.valid[[5, 9], 0] | True
    range_m = np.where(valid, np.nan_to_num(episode.range_m, nan=250.0), np.nan)
    (found,) = denoise(model, [replace(episode, range_m=range_m, valid=valid)])
    np.testing.assert_array_equal(found.range_m[valid[:, 0], 0], range_m[valid[:, 0], 0])


@pytest.mark.parametrize("n_steps", [1, 2, 3, 64, 700])
def test_any_length(model: Path, n_steps: int) -> None:
    run = make_run(7, n_steps=n_steps, missing=0.3)
    (found,) = denoise(model, [run])
    np.testing.assert_array_equal(found.valid, run.valid)
    assert (found.zone is not None) is (n_steps >= 3)


def test_what_is_too_long_is_taken_in_pieces_without_seams(model: Path) -> None:
    run = make_run(3, n_steps=ZONE_LONGEST_STEPS + 100, missing=0.3)
    (found,) = denoise(model, [run])
    np.testing.assert_array_equal(found.valid, run.valid)
    assert np.isfinite(found.range_m[run.valid]).all()
    assert found.zone is not None and found.zone.located.all()
    middle = slice(2000, 2010)
    assert np.nanmax(np.abs(np.diff(found.range_m[middle] - run.range_m[middle], axis=0))) < 0.5


def far_drive(middle_m: float) -> Episode:
    """Return 2,000 m of road, with four anchors about one of its places."""
    path = np.stack([np.linspace(-1000.0, 1000.0, 2001), np.zeros(2001)], axis=-1)
    place = np.array([[-20.0, 4.0], [0.0, 5.0], [15.0, 4.0], [30.0, 6.0]])
    place[:, 0] += middle_m
    distance = np.linalg.norm(path[:, None] - place, axis=2)
    valid = distance < 100.0
    return Episode(
        name="far",
        anchor_ids=("a", "b", "c", "d"),
        t_s=0.1 * np.arange(2001),
        position_m=path,
        range_m=np.where(valid, distance, np.nan),
        valid=valid,
    )


def test_where_on_a_long_drive_the_zone_is_changes_nothing(model: Path) -> None:
    end, middle = denoise(model, [far_drive(800.0), far_drive(0.0)])
    assert end.zone is not None and middle.zone is not None
    np.testing.assert_allclose(end.zone.place_m - [800.0, 0.0], middle.zone.place_m, atol=0.05)
    np.testing.assert_array_equal(end.valid, far_drive(800.0).valid)


def test_zones_far_apart_on_one_drive_are_what_each_is_alone(model: Path) -> None:
    near, far = far_drive(-800.0), far_drive(800.0)
    both = replace(
        near,
        anchor_ids=(*near.anchor_ids, *(f"{name}2" for name in far.anchor_ids)),
        range_m=np.hstack([near.range_m, far.range_m]),
        valid=np.hstack([near.valid, far.valid]),
    )
    (found,) = denoise(model, [both])
    assert found.zone is not None and found.zone.located.all()
    assert np.isfinite(found.range_m[both.valid]).all()
    for own, drive in ((slice(0, 4), near), (slice(4, 8), far)):
        (alone,) = denoise(model, [drive])
        assert alone.zone is not None
        off_m = found.zone.place_m[own] - alone.zone.place_m
        assert np.abs(off_m).max() < 1.0  # the pieces see other stretches of the path


def test_a_long_log_without_a_range_is_left_as_it_is(model: Path) -> None:
    drive = far_drive(0.0)
    nothing = np.full(drive.range_m.shape, np.nan)
    (found,) = denoise(model, [replace(drive, range_m=nothing, valid=~np.isnan(nothing))])
    assert found.zone is None and not found.valid.any()


def test_what_is_too_many_is_taken_in_groups_by_when_they_are_passed(model: Path) -> None:
    run = make_run(4, n_steps=40, n_anchors=ZONE_MOST_ANCHORS + 30, missing=0.0)
    # First come those that are ranged in the first half only, in any order of columns.
    early = np.random.default_rng(0).permutation(run.n_anchors)[: run.n_anchors // 2]
    valid = np.zeros((40, run.n_anchors), dtype=bool)
    valid[20:] = True
    valid[:, early] = ~valid[:, early]
    run = replace(run, valid=valid, range_m=np.where(valid, run.range_m, np.nan), truth=None)
    (found,) = denoise(model, [run])
    np.testing.assert_array_equal(found.valid, valid)
    assert np.isfinite(found.sigma_m[valid]).all()
    assert found.zone is not None and found.zone.located.all()
    ids = tuple(run.anchor_ids[n] for n in early)
    columns = {"range_m": run.range_m[:, early], "valid": valid[:, early]}
    up_m = np.ones(len(ids))
    (alone,) = denoise(model, [replace(run, anchor_ids=ids, anchor_up_m=up_m, **columns)])
    both = valid[:, early]
    np.testing.assert_allclose(found.range_m[:, early][both], alone.range_m[both], atol=1e-3)


@pytest.mark.parametrize("harm", ["missing", "damaged", "of another kind"])
def test_a_wrong_model_is_refused_in_one_line(model: Path, tmp_path: Path, harm: str) -> None:
    folder = tmp_path / "model"
    shutil.copytree(model, folder)
    if harm == "missing":
        (folder / ONNX).unlink()
    elif harm == "damaged":
        content = (folder / ONNX).read_bytes()
        (folder / ONNX).write_bytes(content[:-1] + bytes([content[-1] ^ 1]))
    else:
        text = (folder / DESCRIPTION).read_text(encoding="utf-8")
        (folder / DESCRIPTION).write_text(text.replace("gaia-set", "gaia"), encoding="utf-8")
    with pytest.raises(ConfigError) as caught:
        make_denoiser(f"gaia-set:{folder}")
    assert str(folder) in str(caught.value) and "\n" not in str(caught.value)
