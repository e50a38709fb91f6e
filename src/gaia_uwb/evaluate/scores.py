"""Score methods on data with a known truth; the reconstruction itself never sees it.

Clock offset and range bias are estimated from each whole run, without truth; a window of
``length`` steps is then denoised and located from its own ranges alone. Windows are cut one after
another and an incomplete tail is left out. A window without a single range says nothing: it is
counted (``windows_without_ranges``) and not scored.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from gaia_uwb._shared import Cell, ConfigError, InputError, csv_text
from gaia_uwb.config import PipelineConfig
from gaia_uwb.episode import Episode
from gaia_uwb.evaluate.metrics import Metric, aggregate, score_episode
from gaia_uwb.evaluate.road_scores import score_road
from gaia_uwb.locate import end_to_end, in_one_frame, with_anchors
from gaia_uwb.pipeline import prepare, reconstruct_episodes, reconstruct_passes
from gaia_uwb.reconstruction import Reconstruction
from gaia_uwb.scene import Scene


def reconstruct_and_score(
    scene: Scene | Sequence[Scene], config: PipelineConfig = PipelineConfig()
) -> tuple[Reconstruction, dict[str, Metric] | None]:
    """Reconstruct one log without its truth, then score it against the truth where there is one.

    Parameters
    ----------
    scene
        The log, or the logs of several passes of one zone; these are scored if each of them has
        the truth of all anchors.
    config
        All settings.

    Returns
    -------
    (Reconstruction, dict or None)
        The result, and its metrics by name.
    """
    scenes = [scene] if isinstance(scene, Scene) else in_one_frame(scene)
    prepared = [prepare(each, config) for each in scenes]
    result = reconstruct_passes(prepared, config)
    known = [with_anchors(episode, result.episode.anchor_ids) for episode in prepared]
    if any(episode.truth is None for episode in known):
        return result, None
    episode, denoised = end_to_end(known, [ranges for _, ranges in result.passes])
    scores = score_episode(episode, denoised, result.anchors)
    return result, scores | score_road(result, episode)


@dataclass(frozen=True)
class TestSet:
    """The episodes that methods are scored on.

    Parameters
    ----------
    episodes
        Prepared, with their truth.
    groups
        The run that each was cut from; the bootstrap draws runs as a whole.
    windows_without_ranges
        Windows that were left out because they hold no range at all.
    """

    episodes: tuple[Episode, ...]
    groups: tuple[str, ...]
    windows_without_ranges: int


@dataclass(frozen=True)
class Scores:
    """One method's scores, episode by episode."""

    method: str
    per_episode: tuple[dict[str, Metric], ...]


def make_test(
    scenes: Sequence[Scene],
    length: int | None,
    config: PipelineConfig,
    each: Callable[[Sequence[Scene]], Iterator[Scene]] = iter,
) -> TestSet:
    """Prepare runs and cut them into windows.

    Parameters
    ----------
    scenes
        Whole runs with their truth.
    length
        Steps in a window; ``None`` for whole runs.
    config
        Settings of the preparation.
    each
        Goes through the scenes; a progress bar may stand here.

    Raises
    ------
    InputError
        If a scene has no truth, or none is long enough for a window with ranges.
    """
    episodes: list[Episode] = []
    groups: list[str] = []
    empty = 0
    for scene in each(scenes):
        if scene.truth is None:
            raise InputError("nothing to score against: no surveyed anchors", source=scene.name)
        run = prepare(scene, config)
        for episode in [run] if length is None else run.windows(length):
            if episode.valid.any():
                episodes.append(episode)
                groups.append(scene.name)
            else:
                empty += 1
    if not episodes:
        raise InputError(f"no run has a window of {length} steps with ranges")
    return TestSet(tuple(episodes), tuple(groups), empty)


def score_method(
    test: TestSet, method: str, config: PipelineConfig, *, true_nlos_labels: bool = False
) -> Scores:
    """Reconstruct every episode with one denoiser and score it.

    Parameters
    ----------
    test
        The episodes.
    method
        Name of the denoiser.
    config
        All other settings.
    true_nlos_labels
        Let the ``wls`` solver weight ranges by their true NLOS labels, as the paper does.

    Raises
    ------
    ConfigError
        If the method is unknown, or labels are asked for with another solver than ``wls``.
    """
    if true_nlos_labels and config.solver.kind != "wls":
        raise ConfigError("true NLOS labels go with the wls solver only")
    config = config.model_copy(update={"denoiser": method})
    labels = None
    if true_nlos_labels:
        labels = [e.truth.nlos for e in test.episodes if e.truth is not None]
    results = reconstruct_episodes(test.episodes, config, true_nlos=labels)
    per_episode = []
    for episode, run, result in zip(test.episodes, test.groups, results, strict=True):
        scores = score_episode(episode, result.denoised, result.anchors)
        if episode.name == run:  # no window of it: those of a few seconds pass no zone
            scores |= score_road(result, episode)
        per_episode.append(scores)
    return Scores(method, tuple(per_episode))


def results_json(
    scores: Sequence[Scores], test: TestSet, protocol: dict[str, Any], *, seed: int
) -> dict[str, Any]:
    """Return the content of ``results.json``: means with 95 % bootstrap intervals over runs.

    Parameters
    ----------
    scores
        One entry per method.
    test
        The episodes that they were scored on.
    protocol
        What was done, for the reader.
    seed
        Of the bootstrap.
    """
    rows = []
    for one in scores:
        metrics = aggregate(one.per_episode, test.groups, seed=seed)
        rows.append(
            {
                "method": one.method,
                "metrics": {
                    name: {
                        "value": m.value,
                        "ci95": m.ci95,
                        "n": m.n,
                        "unit": m.unit,
                        "how": m.how,
                        "left_out": m.left_out,
                    }
                    for name, m in metrics.items()
                },
            }
        )
    counts = {
        "episodes": len(test.episodes),
        "runs": len(set(test.groups)),
        "windows_without_ranges": test.windows_without_ranges,
    }
    return {"schema": 1, "protocol": protocol | counts | {"seed": seed}, "rows": rows}


def episodes_csv(scores: Sequence[Scores], test: TestSet) -> str:
    """Return every episode's scores as CSV: method, episode, run, metric, value, unit, n."""
    header = ["method", "episode", "run", "metric", "value", "unit", "n"]
    rows: Iterator[list[Cell]] = (
        [one.method, episode.name, run, m.name, m.value, m.unit, m.n]
        for one in scores
        for episode, run, metrics in zip(test.episodes, test.groups, one.per_episode, strict=True)
        for m in metrics.values()
    )
    return csv_text(header, rows)
