"""What a model is trained, validated and tested on: sets that share no window.

``sim:PRESET``
    Episodes of the simulator. Training and validation draw from the preset's training layouts, the
    test from its test layouts; all have seeds of their own.
logs with surveyed anchors
    Windows of ``window_steps`` steps. Splits: ``window/K`` holds out one window in five, the same
    layouts in training and test; ``run/K`` holds out a run; ``layout/K`` all runs past a layout;
    ``all`` nothing. Training windows overlap; those that overlap a validation or test window are
    dropped.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from pydantic import Field

from gaia_uwb._shared import ConfigError, InputError
from gaia_uwb.config import AlignmentConfig, CalibrationConfig, PipelineConfig, Settings
from gaia_uwb.episode import Episode
from gaia_uwb.pipeline import prepare
from gaia_uwb.scene import Scene

WINDOW_FOLDS = 5
"""Folds of the split ``window``."""

_TRAINING_SEED, _VALIDATION_SEED = 1_000_001, 1_000_002  # no test has such seeds
_VALIDATION_SHARE = 0.15

PUBLISHED = PipelineConfig(
    alignment=AlignmentConfig(clock_offset="off", gate=False, resample="nearest"),
    calibration=CalibrationConfig(range_bias="off"),
)
"""Data as the paper appears to have used them: nearest sample, no clock correction, no gate."""


class WindowSetOptions(Settings):
    """How the sets are made."""

    preparation: Literal["aligned", "published"] = "aligned"
    """``aligned``: as a reconstruction prepares a log. ``published``: nearest sample, without clock
    correction, gate or range bias."""
    window_steps: int = Field(default=64, ge=2)
    training_stride: int = Field(default=4, ge=1)
    """Number of steps between the starts of consecutive training windows of a log."""
    n_training: int = Field(default=12_000, ge=1)
    """Number of simulated training episodes."""
    n_validation: int = Field(default=1_000, ge=1)
    """Number of simulated validation episodes."""


@dataclass(frozen=True)
class WindowSets:
    """Episodes of equally many steps, each with its truth.

    Parameters
    ----------
    training, validation, test
        The three sets; ``test`` may be empty.
    test_groups
        The run that each test episode was cut from; the bootstrap draws runs as a whole.
    description
        What they are, for the model's files.
    """

    training: tuple[Episode, ...]
    validation: tuple[Episode, ...]
    test: tuple[Episode, ...]
    test_groups: tuple[str, ...]
    description: dict[str, Any]


def preparation_config(name: str) -> PipelineConfig:
    """Return the settings of a preparation: ``aligned`` or ``published``.

    Parameters
    ----------
    name
        As in :class:`WindowSetOptions`.
    """
    return PUBLISHED if name == "published" else PipelineConfig()


def simulated_sets(
    preset: str, options: WindowSetOptions, *, n_test: int = 0, test_seed: int = 0
) -> WindowSets:
    """Simulate the three sets.

    Parameters
    ----------
    preset
        Name of a preset.
    options
        Numbers of episodes.
    n_test, test_seed
        Of the test's episodes; none by default.

    Raises
    ------
    ConfigError
        If there is no such preset, or its layouts do not vary.
    """
    from gaia_uwb.simulate import find_preset, simulate_episodes

    training = find_preset(f"{preset}-training")
    held_out = find_preset(f"{preset}-test")
    test = tuple(simulate_episodes(held_out, n_test, test_seed))
    return WindowSets(
        training=tuple(simulate_episodes(training, options.n_training, _TRAINING_SEED)),
        validation=tuple(simulate_episodes(training, options.n_validation, _VALIDATION_SEED)),
        test=test,
        test_groups=tuple(episode.name for episode in test),
        description={
            "source": f"sim:{preset}",
            "split": "training and test layouts are disjoint",
            "training": f"sim:{preset}-training/{_TRAINING_SEED}/{options.n_training}",
            "validation": f"sim:{preset}-training/{_VALIDATION_SEED}/{options.n_validation}",
        },
    )


def prepare_runs(scenes: Sequence[Scene], options: WindowSetOptions) -> list[Episode]:
    """Prepare logs, each as a whole.

    Parameters
    ----------
    scenes
        Logs with their truth.
    options
        ``preparation`` is used.
    """
    config = preparation_config(options.preparation)
    return [prepare(scene, config) for scene in scenes]


def logged_sets(
    runs: Sequence[Episode], source: str, split: str, options: WindowSetOptions
) -> WindowSets:
    """Cut logs with surveyed anchors into the three sets.

    Parameters
    ----------
    runs
        Whole runs with their truth, such as :func:`prepare_runs` returns.
    source
        What to call them.
    split
        ``window/K``, ``run/K``, ``layout/K`` or ``all``.
    options
        Windows, and how the runs were prepared.

    Raises
    ------
    ConfigError
        If there is no such split.
    InputError
        If nothing is left to train on.
    """
    windows = _windows(runs, options.window_steps)
    fold = _folds(runs, windows, split)
    rest = np.flatnonzero(~fold)
    n_validation = max(1, round(_VALIDATION_SHARE * len(rest)))
    validation = np.random.default_rng(0).permutation(rest)[:n_validation]
    held = [windows[k] for k in np.flatnonzero(fold)]
    kept = [windows[k] for k in np.sort(validation)]
    training = _training_windows(runs, held + kept, _excluded_runs(runs, split), options)
    if not training:
        raise InputError("no training data left after the split", source=f"{source}, split {split}")
    steps = options.window_steps

    def cut(chosen: Sequence[tuple[int, int]]) -> tuple[Episode, ...]:
        return tuple(runs[run].window(start, start + steps) for run, start in chosen)

    return WindowSets(
        training=cut(training),
        validation=cut(kept),
        test=cut(held),
        test_groups=tuple(runs[run].name for run, _ in held),
        description={
            "source": source,
            "split": split,
            "preparation": options.preparation,
            "training": f"{len(training)} windows of {steps} steps",
            "validation": f"{len(kept)} windows",
        },
    )


def held_out(runs: Sequence[Episode], split: str, window_steps: int) -> list[tuple[int, int]]:
    """Return the test windows of a fold, each as its run's index and its first step.

    Parameters
    ----------
    runs
        Whole runs with their truth.
    split
        As in :func:`logged_sets`.
    window_steps
        Length of a window.
    """
    windows = _windows(runs, window_steps)
    return [windows[k] for k in np.flatnonzero(_folds(runs, windows, split))]


def n_folds(split: str, runs: Sequence[Episode]) -> int:
    """Return how many folds a kind of split has: ``window``, ``run`` or ``layout``.

    Parameters
    ----------
    split
        The kind.
    runs
        Whole runs.
    """
    if split == "window":
        return WINDOW_FOLDS
    return len(runs) if split == "run" else len(_layouts(runs))


def _windows(runs: Sequence[Episode], steps: int) -> list[tuple[int, int]]:
    """Return all windows with ranges, one after another, as run and first step."""
    return [
        (run, start)
        for run, episode in enumerate(runs)
        for start in range(0, episode.n_steps - steps + 1, steps)
        if episode.valid[start : start + steps].any()
    ]


def _folds(runs: Sequence[Episode], windows: Sequence[tuple[int, int]], split: str) -> np.ndarray:
    """Return which windows are the test's."""
    kind, fold = _parse(split, runs)
    if kind == "all":
        return np.zeros(len(windows), dtype=np.bool_)
    run_of = np.array([run for run, _ in windows])
    if kind != "window":
        return np.isin(run_of, sorted(_excluded_runs(runs, split)))
    # Deal the windows of runs with and without line of sight out to the folds, one by one.
    label = np.array([_is_nlos(runs[run]) for run in run_of])
    dealt = np.empty(len(windows), dtype=np.int64)
    rng = np.random.default_rng(0)
    for value in (False, True):
        own = rng.permutation(np.flatnonzero(label == value))
        dealt[own] = np.arange(len(own)) % WINDOW_FOLDS
    return np.asarray(dealt == fold)


def _parse(split: str, runs: Sequence[Episode]) -> tuple[str, int]:
    kind, _, number = split.partition("/")
    if kind == "all" and not number:
        return kind, 0
    if kind in ("window", "run", "layout") and number.isascii() and number.isdigit():
        count = n_folds(kind, runs)
        if int(number) < count:
            return kind, int(number)
        raise ConfigError(f"split {split!r}: folds are numbered 0 to {count - 1}")
    raise ConfigError(
        f"unknown split {split!r}; available: all, window/K, run/K and layout/K, with K from 0"
    )


def _excluded_runs(runs: Sequence[Episode], split: str) -> set[int]:
    """Return the runs that are the test's as a whole."""
    kind, fold = _parse(split, runs)
    if kind == "run":
        return {fold}
    if kind == "layout":
        chosen = _layouts(runs)[fold]
        return {k for k, run in enumerate(runs) if _layout(run) == chosen}
    return set()


def _layouts(runs: Sequence[Episode]) -> list[str]:
    return sorted({_layout(run) for run in runs})


def _layout(run: Episode) -> str:
    """Return which layout a run went past: in the outdoor data set its case, the name's end."""
    return run.name.rpartition("/")[2]


def _is_nlos(run: Episode) -> bool:
    return run.truth is not None and bool(np.mean(run.truth.nlos) > 0.5)


def _training_windows(
    runs: Sequence[Episode],
    held_out: Sequence[tuple[int, int]],
    excluded: set[int],
    options: WindowSetOptions,
) -> list[tuple[int, int]]:
    """Return overlapping windows of the runs that touch none of those held out."""
    steps, chosen = options.window_steps, []
    for run, episode in enumerate(runs):
        if run in excluded:
            continue
        starts = np.array([start for other, start in held_out if other == run])
        for start in range(0, episode.n_steps - steps + 1, options.training_stride):
            free = not len(starts) or np.abs(starts - start).min() >= steps
            if free and episode.valid[start : start + steps].any():
                chosen.append((run, start))
    return chosen
