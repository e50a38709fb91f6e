"""Training, validation and test share no window; what is held out is held out as a whole."""

from __future__ import annotations

import re

import numpy as np
import pytest

from gaia_uwb._shared.errors import ConfigError, InputError
from gaia_uwb.episode import Episode
from gaia_uwb.learn.window_sets import (
    WindowSetOptions,
    WindowSets,
    logged_sets,
    n_folds,
    prepare_runs,
    simulated_sets,
)
from gaia_uwb.simulate.variation import layout_part
from surveyed import make_runs

OPTIONS = WindowSetOptions(window_steps=32, training_stride=8)


@pytest.fixture(scope="module")
def runs() -> list[Episode]:
    return prepare_runs(make_runs(), OPTIONS)


def make_sets(runs: list[Episode], split: str) -> WindowSets:
    return logged_sets(runs, "walks", split, OPTIONS)


def span(episode: Episode) -> tuple[str, int, int]:
    """Return which run a window was cut from, and its first and last step but one."""
    run, start, stop = re.fullmatch(r"(.*)\[(\d+):(\d+)\]", episode.name).groups()  # type: ignore[union-attr]
    return run, int(start), int(stop)


def overlapping(first: tuple[Episode, ...], second: tuple[Episode, ...]) -> bool:
    spans = [span(episode) for episode in second]
    return any(
        run == other and start < there and begin < stop
        for run, start, stop in map(span, first)
        for other, begin, there in spans
    )


@pytest.mark.parametrize("split", ["all", "window/0", "window/4", "run/3", "layout/2"])
def test_no_window_is_in_two_sets(runs: list[Episode], split: str) -> None:
    sets = make_sets(runs, split)
    assert sets.training
    assert sets.validation
    assert not overlapping(sets.training, sets.validation)
    assert not overlapping(sets.training, sets.test)
    assert not overlapping(sets.validation, sets.test)
    assert bool(sets.test) == (split != "all")
    assert {episode.n_steps for episode in (*sets.training, *sets.test)} == {32}


def test_folds_of_windows_hold_each_window_once_and_both_kinds_of_sight(
    runs: list[Episode],
) -> None:
    folds = [make_sets(runs, f"window/{fold}") for fold in range(n_folds("window", runs))]
    names = [episode.name for fold in folds for episode in fold.test]
    assert (
        len(names)
        == len(set(names))
        == sum(window.valid.any() for run in runs for window in run.windows(32))
    )
    for fold in folds:
        nlos = [episode.name.startswith("walks:NLOS") for episode in fold.test]
        assert 0.3 < np.mean(nlos) < 0.7


def test_a_run_and_a_layout_are_held_out_as_a_whole(runs: list[Episode]) -> None:
    run = make_sets(runs, "run/2")
    assert set(run.test_groups) == {runs[2].name}
    assert not {runs[2].name} & {span(episode)[0] for episode in run.training}
    layout = make_sets(runs, "layout/3")
    assert set(layout.test_groups) == {"walks:LOS/B/4", "walks:NLOS/B/4"}
    seen = {span(episode)[0] for episode in (*layout.training, *layout.validation)}
    assert len(seen) == 6
    assert not seen & set(layout.test_groups)


def test_published_data_are_neither_shifted_nor_calibrated() -> None:
    options = OPTIONS.model_copy(update={"preparation": "published"})
    (episode,) = prepare_runs(make_runs()[:1], options)
    assert episode.clock is not None
    assert not episode.clock.applied
    assert episode.calibration is None


@pytest.mark.parametrize(
    "split", ["window", "window/5", "window/x", "run/8", "layout/4", "all/0", "fold/1", ""]
)
def test_unknown_splits_are_one_line(runs: list[Episode], split: str) -> None:
    with pytest.raises(ConfigError, match="split") as caught:
        make_sets(runs, split)
    assert "\n" not in str(caught.value)


def test_nothing_left_to_train_on(runs: list[Episode]) -> None:
    long = OPTIONS.model_copy(update={"window_steps": 10_000})
    with pytest.raises(InputError, match="no training data left after the split"):
        logged_sets(runs[:2], "walks", "all", long)


def test_simulated_test_layouts_are_none_of_the_training() -> None:
    options = WindowSetOptions(n_training=6, n_validation=4)
    sets = simulated_sets("stress", options, n_test=5, test_seed=3)
    again = simulated_sets("stress", options)
    assert [len(part) for part in (sets.training, sets.validation, sets.test)] == [6, 4, 5]
    assert not again.test
    for first, second in zip(sets.training, again.training, strict=True):
        np.testing.assert_array_equal(first.range_m, second.range_m)
    assert not np.array_equal(sets.training[0].position_m, sets.validation[0].position_m)
    assert "stress-training" in sets.description["training"]


def test_layout_parts_are_told_apart() -> None:
    from gaia_uwb.simulate import find_preset

    assert find_preset("stress-training").split == "training"
    assert layout_part(find_preset("stress")) in ("training", "test")
