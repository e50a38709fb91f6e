from __future__ import annotations

from dataclasses import replace

import numpy as np

from gaia_uwb.episode import Episode
from gaia_uwb.models.zone_inputs import make_zone_inputs, zone_readings
from gaia_uwb.simulate import find_preset, simulate_episodes


def episodes(n_anchors: int = 6, n: int = 4) -> list[Episode]:
    config = find_preset("wild").model_copy(
        update={"vary": {"road.direction_rad": [-3.0, 3.0], "drive.speed_mps": [3.0, 20.0]}}
    )
    closure = config.closure.model_copy(update={"n_anchors": n_anchors})
    return list(simulate_episodes(config.model_copy(update={"closure": closure}), n, seed=2))


def moved(episode: Episode, *, mirror: bool = False) -> Episode:
    turn = np.array([[0.6, 0.8], [-0.8, 0.6]])
    flip = np.diag([1.0, -1.0 if mirror else 1.0])
    return replace(episode, position_m=episode.position_m @ flip @ turn + [500.0, -80.0])


def test_nothing_of_place_and_direction_is_left() -> None:
    made = episodes()
    here, _ = make_zone_inputs(zone_readings(made))
    there, _ = make_zone_inputs(zone_readings([moved(episode) for episode in made]))
    for name, a, b in zip(here._fields, here, there, strict=True):
        np.testing.assert_allclose(b, a, rtol=1e-4, atol=2e-3, err_msg=name)


def test_a_mirrored_scene_swaps_left_and_right_and_nothing_else() -> None:
    made = episodes()
    here, _ = make_zone_inputs(zone_readings(made))
    there, _ = make_zone_inputs(zone_readings([moved(episode, mirror=True) for episode in made]))
    flip = np.array([1.0, -1.0])
    np.testing.assert_allclose(there.start, here.start[:, :, ::-1] * flip, rtol=1e-4, atol=2e-3)
    np.testing.assert_allclose(there.fit, here.fit[:, :, ::-1], rtol=1e-4, atol=5e-3)
    np.testing.assert_allclose(there.road, -here.road, rtol=1e-4, atol=1e-3)
    np.testing.assert_allclose(there.path_odd, -here.path_odd, rtol=1e-4, atol=1e-3)
    np.testing.assert_allclose(there.path_even, here.path_even, rtol=1e-4, atol=1e-3)


def test_one_of_both_places_is_the_true_one_where_ranges_are_good() -> None:
    config = find_preset("lane-closure")
    ranging = config.ranging.model_copy(
        update={"los_s": None, "burst_per_s": 0.0, "sigma_m": 0.01, "clock_offset_s": 0.0}
    )
    (episode,) = simulate_episodes(config.model_copy(update={"ranging": ranging}), 1, seed=4)
    assert episode.truth is not None
    inputs, frame = make_zone_inputs(zone_readings([episode]))
    start_m = frame.leave(inputs.start.reshape(1, -1, 2).astype(float)).reshape(-1, 2, 2)
    error_m = np.linalg.norm(start_m - episode.truth.anchor_m[:, None], axis=-1).min(axis=1)
    assert np.median(error_m) < 0.1
    assert (inputs.start[..., 0, 1] >= inputs.start[..., 1, 1]).all()


def test_an_episode_gives_what_it_gives_alone() -> None:
    made = episodes()
    together, _ = make_zone_inputs(zone_readings(made))
    for k, episode in enumerate(made):
        alone, _ = make_zone_inputs(zone_readings([episode]))
        for name, a, b in zip(alone._fields, alone, together, strict=True):
            np.testing.assert_allclose(b[k], a[0], rtol=1e-5, atol=1e-5, err_msg=name)


def test_anchors_of_unknown_height_and_without_ranges_are_taken() -> None:
    (episode, *_) = episodes()
    valid = episode.valid.copy()
    valid[:, 2] = False
    bare = replace(
        episode,
        range_m=np.where(valid, episode.range_m, np.nan),
        valid=valid,
        tag_up_m=None,
        anchor_up_m=None,
    )
    inputs, _ = make_zone_inputs(zone_readings([bare]))
    for name, values in inputs._asdict().items():
        assert np.isfinite(values).all(), name
    assert (inputs.height_gap == 0).all()
    assert (inputs.mask[0, 2] == 0).all() and (inputs.range[0, 2] == 0).all()
