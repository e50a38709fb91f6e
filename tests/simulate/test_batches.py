"""A batch is its episodes, whoever makes them and in whatever company."""

from __future__ import annotations

from itertools import islice
from multiprocessing import active_children
from types import SimpleNamespace

import numpy as np
import pytest

from alike import assert_same
from gaia_uwb._shared.errors import ConfigError
from gaia_uwb.episode import Episode
from gaia_uwb.simulate import PRESETS, simulate_episode, simulate_episodes
from gaia_uwb.simulate.settings import PassConfig
from gaia_uwb.simulate.variation import layout_part


@pytest.mark.parametrize("preset", ["stress", "wild"])
def test_an_episode_alone_is_that_of_the_batch(preset: str) -> None:
    batch = list(simulate_episodes(PRESETS[preset], 5, seed=8))
    assert len({episode.name for episode in batch}) == 5
    for k, episode in enumerate(batch):
        assert_same(episode, simulate_episode(PRESETS[preset], 8, episode=k))
    assert_same(batch[3], next(islice(simulate_episodes(PRESETS[preset], 10**9, 8), 3, None)))
    other = simulate_episode(PRESETS[preset], 9)
    assert not np.array_equal(other.position_m, batch[0].position_m)
    assert not np.array_equal(batch[1].position_m, batch[0].position_m)


def test_workers_change_nothing() -> None:
    alone = list(simulate_episodes(PRESETS["stress"], 430, seed=1))
    shared = list(simulate_episodes(PRESETS["stress"], 430, seed=1, workers=2))
    assert len(shared) == 430
    for one, other in zip(alone, shared, strict=True):
        assert_same(one, other)
    assert_frozen(shared[-1])


def test_workers_end_when_nobody_wants_more() -> None:
    episodes = simulate_episodes(PRESETS["stress"], 10**9, seed=1, workers=2)
    first = [next(episodes) for _ in range(3)]
    assert len(active_children()) == 2
    episodes.close()
    assert not active_children()
    for one, other in zip(first, simulate_episodes(PRESETS["stress"], 3, seed=1), strict=True):
        assert_same(one, other)


def test_no_episodes_are_none() -> None:
    assert list(simulate_episodes(PRESETS["stress"], 0, seed=1)) == []
    assert list(simulate_episodes(PRESETS["stress"], 0, seed=1, workers=2)) == []


def assert_frozen(episode: Episode) -> None:
    assert episode.truth is not None
    for part in (episode, episode.truth):
        for value in vars(part).values():
            if isinstance(value, np.ndarray):
                assert not value.flags.writeable


def test_parts_of_the_layouts_are_disjoint_in_a_batch() -> None:
    places = {}
    for part in ("training", "test"):
        config = PRESETS["stress"].model_copy(update={"split": part})
        episodes = simulate_episodes(config, 30, seed=0)
        places[part] = {e.truth.anchor_m.tobytes() for e in episodes if e.truth is not None}
    assert not places["training"] & places["test"]


def test_an_impossible_part_is_told_by_the_worker_too() -> None:
    other = {"training": "test", "test": "training"}[layout_part(PassConfig())]
    config = PassConfig.model_validate({"split": other})
    with pytest.raises(ConfigError, match="no layout"):
        next(simulate_episodes(config, 2, seed=0))
    with pytest.raises(ConfigError, match="no layout"):
        next(simulate_episodes(config, 2, seed=0, workers=2))


def test_what_goes_wrong_in_a_process_is_raised_here(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    broken = PRESETS["straight"].model_copy(update={"split": ["neither", "nor"]})
    with pytest.raises(Exception, match=r".") as caught:  # whatever a bug raises
        list(simulate_episodes(broken, 1, 0, workers=2))
    assert "simulate_blocks" in "".join(caught.value.__notes__)
    assert capfd.readouterr().err == ""

    class Ended:
        def recv(self) -> None:
            raise EOFError

        def close(self) -> None:
            """Nothing is open."""

    monkeypatch.setattr(
        "gaia_uwb.simulate.batches.get_context",
        lambda _: SimpleNamespace(
            Pipe=lambda duplex: (Ended(), Ended()),
            Process=lambda **_: SimpleNamespace(
                start=lambda: None, terminate=lambda: None, join=lambda: None
            ),
        ),
    )
    with pytest.raises(ConfigError, match="was killed from outside"):
        list(simulate_episodes(PRESETS["straight"], 1, 0, workers=2))
