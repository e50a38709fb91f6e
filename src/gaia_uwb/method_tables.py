"""Tables that compare methods: the paper's tables 1 and 2, and its ablations.

Models are trained where they are missing, each in a folder of its own, and a table that was stopped
goes on where it was. A trained method's score is the mean over its models (seeds), or over the
folds of the data, each scored on windows that it has not seen.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from gaia_uwb.config import PipelineConfig, SidesConfig, SolverConfig
from gaia_uwb.evaluate import Scores, Test, results_json, score_method
from gaia_uwb.files import OutputFolder
from gaia_uwb.learning_sets import (
    LearningSets,
    logged_sets,
    n_folds,
    preparation_config,
    prepare_runs,
    simulated_sets,
)
from gaia_uwb.model import GaiaOptions, NetworkOptions
from gaia_uwb.recipes import ABLATIONS, KINDS, Recipe, make_recipe
from gaia_uwb.scene import Scene

CLASSICAL = ("raw", "median", "kalman", "pose-kalman")
"""Methods without training, in the order of the tables."""

N_TEST, TEST_SEED = 216, 0
"""Episodes of the stress test, as many as the paper's, and their seed."""

Watch = Callable[[str], None]
"""Is told what begins."""


def paper_solver(config: PipelineConfig) -> PipelineConfig:
    """Return settings with the paper's solver: weighted least squares, each anchor by itself.

    Its labels are given to :func:`gaia_uwb.evaluate.score_method`.

    Parameters
    ----------
    config
        All other settings.
    """
    return config.model_copy(
        update={"solver": SolverConfig(kind="wls"), "sides": SidesConfig(joint=False)}
    )


@dataclass(frozen=True)
class TableJob:
    """How tables are made, and where.

    Parameters
    ----------
    folder
        Models are kept in its sub-folder ``models``.
    seeds
        Of the models of each learned method.
    version
        Of the package.
    shrink
        Changes every recipe; for a quick run.
    watch
        Is told what begins.
    """

    folder: OutputFolder
    seeds: Sequence[int]
    version: str
    shrink: Callable[[Recipe], Recipe] = lambda recipe: recipe
    watch: Watch = lambda text: None


@dataclass(frozen=True)
class Method:
    """A row of a table: a classical denoiser, or networks that one recipe made.

    Parameters
    ----------
    name
        What the table calls it.
    network
        What is trained; ``None`` for a classical denoiser.
    """

    name: str
    network: NetworkOptions | None = None


LEARNED = tuple(Method(kind, network) for kind, network in KINDS.items())
"""The paper's networks."""

ALL_METHODS = (*map(Method, CLASSICAL), *LEARNED)


def stress_table(methods: Sequence[Method], job: TableJob) -> dict[str, Any]:
    """Score methods on the stress test, 216 episodes past layouts that no model was trained on.

    Parameters
    ----------
    methods
        Rows of the table.
    job
        Where, and with which seeds.

    Returns
    -------
    dict
        Content of ``results.json``.
    """
    sets = stress_sets(job)
    test = Test(sets.test, sets.test_groups, 0)
    config = paper_solver(PipelineConfig())
    scores = []
    for method in methods:
        names = [method.name]
        if method.network is not None:
            names = [
                trained_model(method, sets, seed, job.folder.path / "models", job)
                for seed in job.seeds
            ]
        job.watch(f"score {method.name}")
        parts = [score_method(test, name, config, true_nlos_labels=True) for name in names]
        scores.append(Scores(method.name, tuple(m for part in parts for m in part.per_episode)))
    protocol = {
        "data": f"sim:stress-test/{TEST_SEED}/{N_TEST}",
        "split": "layouts disjoint from those of the training",
        "length": 64,
        "solver": "wls, each anchor by itself",
        "true_nlos_labels": True,
        "training_seeds": list(job.seeds),
        "trained_on": sets.description,
        "version": job.version,
    }
    return _results(scores, test, protocol)


def stress_sets(job: TableJob) -> LearningSets:
    """Simulate what the stress test's models are trained on, and the test itself.

    Parameters
    ----------
    job
        Gives the recipe.
    """
    recipe = job.shrink(make_recipe(KINDS["gaia"], simulated=True))
    job.watch("simulate")
    return simulated_sets("stress", recipe.sets, n_test=N_TEST, test_seed=TEST_SEED)


def outdoor_table(
    scenes: Sequence[Scene], split: str, preparation: str, job: TableJob
) -> list[dict[str, Any]]:
    """Score all methods on windows of real runs, in cross-validation.

    Parameters
    ----------
    scenes
        The eight runs.
    split
        ``window``, ``run`` or ``layout``.
    preparation
        ``aligned`` or ``published``.
    job
        Where, and with which seeds.

    Returns
    -------
    list of dict
        Contents of ``results.json``: with the paper's solver and its labels, and with the robust
        solver that needs none.
    """
    prepared = preparation_config(preparation)
    tests: list[Test] = []
    names: dict[str, list[list[str]]] = {method.name: [] for method in ALL_METHODS}
    base = make_recipe(KINDS["gaia"], simulated=False)
    options = job.shrink(base).sets.model_copy(update={"preparation": preparation})
    description: dict[str, Any] = {}
    runs = prepare_runs(scenes, options)
    for fold in range(n_folds(split, runs)):
        sets = logged_sets(runs, "outdoor-uwb", f"{split}/{fold}", options)
        tests.append(Test(sets.test, sets.test_groups, 0))
        description = sets.description
        models = job.folder.path / "models" / f"{preparation}-{split}-{fold}"
        for method in ALL_METHODS:
            names[method.name].append(
                [method.name]
                if method.network is None
                else [trained_model(method, sets, seed, models, job) for seed in job.seeds]
            )
    episodes = tuple(episode for test in tests for episode in test.episodes)
    n_windows = sum(run.n_steps // options.window_steps for run in runs)
    groups = tuple(group for test in tests for group in test.groups)
    whole = Test(episodes, groups, n_windows - len(episodes))
    tables = []
    for label, config in (("wls", paper_solver(prepared)), ("robust", prepared)):
        scores = []
        for method in ALL_METHODS:
            job.watch(f"score {method.name} with {label}")
            n_models = len(names[method.name][0])
            per_episode = [
                metrics
                for model in range(n_models)
                for test, found in zip(tests, names[method.name], strict=True)
                for metrics in score_method(
                    test, found[model], config, true_nlos_labels=label == "wls"
                ).per_episode
            ]
            scores.append(Scores(method.name, tuple(per_episode)))
        protocol = {
            "data": "outdoor-uwb",
            "split": f"{split}, {len(tests)} folds",
            "length": options.window_steps,
            "preparation": preparation,
            "solver": "wls, each anchor by itself" if label == "wls" else "robust, sides jointly",
            "true_nlos_labels": label == "wls",
            "training_seeds": list(job.seeds),
            "trained_on": description,
            "version": job.version,
        }
        tables.append(_results(scores, whole, protocol))
    return tables


def ablation_methods() -> tuple[Method, ...]:
    """Return the whole network and the paper's three ablations."""
    return tuple(Method(name, network) for name, network in ABLATIONS.items())


def results_table(results: dict[str, Any]) -> str:
    """Return a table of results as Markdown: the paper's six metrics with their intervals.

    Parameters
    ----------
    results
        Content of one ``results.json``.
    """
    names = {
        "distance_mse_overall": "MSE (m^2)",
        "distance_mse_los": "MSE LOS",
        "distance_mse_nlos": "MSE NLOS",
        "anchor_mae": "anchor error (m)",
        "polygon_iou": "IoU",
        "polygon_hausdorff": "Hausdorff (m)",
    }
    lines = [f"| method | {' | '.join(names.values())} |", "|---" * (len(names) + 1) + "|"]
    for row in results["rows"]:
        cells = [_cell(row["metrics"].get(name)) for name in names]
        lines.append(f"| {row['method']} | {' | '.join(cells)} |")
    return "\n".join(lines) + "\n"


def _cell(metric: dict[str, Any] | None) -> str:
    if metric is None:
        return "none"
    text = f"{metric['value']:.4f}" if metric["value"] < 1 else f"{metric['value']:.3f}"
    if metric["ci95"] is None:
        return text
    low, high = metric["ci95"]
    return f"{text} [{low:.3f}, {high:.3f}]"


def trained_model(
    method: Method, sets: LearningSets, seed: int, models: Path, job: TableJob
) -> str:
    """Return the name of a method's model as a denoiser; train it if it is not there.

    Parameters
    ----------
    method
        With a network.
    sets
        What it is trained on.
    seed
        Of the training.
    models
        Folder of all models.
    job
        How tables are made.
    """
    from gaia_uwb.training import Task, train

    if method.network is None:
        raise ValueError(f"{method.name} is not trained")
    simulated = sets.description["source"].startswith("sim:")
    recipe = job.shrink(make_recipe(method.network, simulated=simulated)).with_seed(seed)
    place = models / f"{method.name}-seed{seed}"
    base = None
    if isinstance(method.network, GaiaOptions):
        base = models / f"pose-mlp-seed{seed}"
        if not (base / "model.json").is_file():
            pose = Method("pose-mlp", KINDS["pose-mlp"])
            trained_model(pose, sets, seed, models, job)
    job.watch(f"train {method.name}, seed {seed}, {sets.description['split']}")
    train(Task(recipe.network, recipe.training, sets, job.version), OutputFolder(place), base=base)
    return f"{method.network.kind}:{place}"


def _results(scores: Sequence[Scores], test: Test, protocol: dict[str, Any]) -> dict[str, Any]:
    """Return results; a learned method has its episodes once for each seed."""
    rows = []
    content: dict[str, Any] = {}
    for one in scores:
        repeats = len(one.per_episode) // len(test.episodes)
        repeated = replace(test, episodes=test.episodes * repeats, groups=test.groups * repeats)
        content = results_json([one], repeated, protocol, seed=0)
        rows += content["rows"]
    counts = {"episodes": len(test.episodes), "runs": len(set(test.groups))}
    return content | {"protocol": content["protocol"] | counts, "rows": rows}
