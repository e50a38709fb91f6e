"""Episodes that are made at once are what each is alone, and what each has always been."""

from __future__ import annotations

import hashlib
import pickle
from collections.abc import Iterable

import numpy as np
import pytest

from gaia_uwb._shared.errors import ConfigError
from gaia_uwb.episode import Episode
from gaia_uwb.simulate import PRESETS, PassConfig, simulate_episode, simulate_episodes
from gaia_uwb.simulate.blocks import simulate_blocks

# Passes that differ in what the others have, too: in steps, averaging and every kind of error.
CHANGING = PassConfig.model_validate({
    **PRESETS["wild"].model_dump(),
    "vary": PRESETS["wild"].vary | {
        "drive.duration_s": [5.0, 6.4, 6.4], "drive.rate_hz": [8.0, 10.0, 12.5],
        "drive.stop_s": [0.0, 2.0, 0.0], "drive.position_bias_m": [0.0, 0.5, 0.0],
        "drive.position_walk_m": [0.0, 0.2, 0.0], "drive.position_outage_per_s": [0.0, 0.3, 0.0],
        "drive.antenna_up_m": [1.2, 2.0], "closure.barrier_up_m": [0.0, 1.2, 0.8],
        "ranging.averaged": [1, 2, 5], "ranging.drift_sigma_m": [0.0, 0.2, 0.0],
        "ranging.outage_per_s": [0.0, 0.5, 0.0], "ranging.held_share": [0.0, 0.2],
        "ranging.soft_range_m": [0.0, 80.0, 0.0], "ranging.nlos_bias_m": [0.0, 1.0, 0.0],
        "ranging.nlos_bias_correlation_s": [0.01, 3.0, 0.003],
        "ranging.clock_offset_s": [0.0, 0.3, 0.0], "ranging.burst_per_s": [0.0, 2.0, 0.0],
        "ranging.bias_m": [0.0, 0.1, 0.0],
    },
})  # fmt: skip
# Of the code that made one episode after another: published results were made with these numbers.
DIGESTS = {
    "lane-closure": "53209b91194c98dc",
    "straight": "ecb43965e058bbb0",
    "parked": "2b5caf7bc4605d76",
    "naive": "f3e95fe63d75dc84",
    "calibrated": "10c873f6fb639344",
    "stress": "61b1454c1ab5bc1b",
    "wild": "47bafd65da226d58",
}


def digest(episodes: Iterable[Episode]) -> str:
    """Return a checksum of all numbers of some episodes; zeros of either sign are the same."""
    content = hashlib.sha256()
    for episode in episodes:
        truth = episode.truth
        assert truth is not None
        assert truth.outlier is not None
        assert truth.bias_m is not None
        assert episode.anchor_up_m is not None
        for part in (
            episode.t_s, episode.position_m, np.nan_to_num(episode.range_m), episode.anchor_up_m,
            truth.anchor_m, truth.range_m, truth.nlos, truth.outlier, truth.bias_m,
        ):  # fmt: skip
            content.update((part + 0.0).tobytes())
    return content.hexdigest()[:16]


@pytest.mark.parametrize("name", DIGESTS)
def test_a_preset_still_gives_the_numbers_of_the_published_results(name: str) -> None:
    assert digest(simulate_episodes(PRESETS[name], 5, seed=7)) == DIGESTS[name]


@pytest.mark.parametrize("name", sorted(PRESETS.keys() - DIGESTS.keys()))
def test_what_an_episode_cannot_hold_is_refused(name: str) -> None:
    with pytest.raises(ConfigError, match="an episode holds no tags, angles of arrival or ranges"):
        next(simulate_episodes(PRESETS[name], 1, seed=7))


def test_passes_that_differ_in_everything_still_give_these_numbers_in_order() -> None:
    batch = list(simulate_episodes(CHANGING, 60, seed=7))
    assert [episode.name for episode in batch] == [f"sim-7-{k}" for k in range(60)]
    assert len({episode.n_steps for episode in batch}) > 3
    assert digest(batch) == "199e8d139a76e60e"
    assert digest(batch) == digest(simulate_episode(CHANGING, 7, episode=k) for k in range(60))


def test_passes_of_one_shape_are_one_block() -> None:
    (block,) = simulate_blocks(PRESETS["wild"], 3, [8, 5])
    assert block.numbers == (8, 5)
    assert [episode.name for episode in block.episodes()] == ["sim-3-8", "sim-3-5"]
    assert len(block.range_m) == sum(block.anchors)
    blocks = simulate_blocks(CHANGING, 3, range(40))
    assert len(blocks) == len({(b.t_s.shape[1], b.numbers) for b in blocks}) > 3
    assert sorted(k for b in blocks for k in b.numbers) == list(range(40))


def test_rates_may_differ_among_passes_of_one_number_of_steps() -> None:
    config = PassConfig.model_validate({
        "drive": {"duration_s": 6.4, "position_walk_m": 0.1, "position_outage_per_s": 0.2},
        "vary": {"drive.rate_hz": [9.95, 10.05]},
    })  # fmt: skip
    (block,) = simulate_blocks(config, 3, range(20))
    assert len(np.unique(block.t_s[:, -1])) == 20
    alone = (simulate_episode(config, 3, episode=k) for k in range(20))
    assert digest(block.episodes()) == digest(alone)


def test_an_episode_is_read_only_and_shares_no_memory_with_its_block() -> None:
    (block,) = pickle.loads(pickle.dumps(simulate_blocks(PRESETS["stress"], 0, [0, 1])))
    shared = [value for value in vars(block).values() if isinstance(value, np.ndarray)]
    for episode in block.episodes():
        for part in (episode, episode.truth):
            arrays = [value for value in vars(part).values() if isinstance(value, np.ndarray)]
            assert len(arrays) >= 5
            for array in arrays:
                assert not array.flags.writeable
                assert not any(np.shares_memory(array, other) for other in shared)
