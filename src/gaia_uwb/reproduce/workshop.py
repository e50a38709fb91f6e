"""What every part of the reproduction needs: where, how much, which data, and who is told."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

from gaia_uwb._shared import OutputFolder
from gaia_uwb.config import PipelineConfig
from gaia_uwb.episode import Episode
from gaia_uwb.learn import WindowSetOptions, prepare_runs
from gaia_uwb.reproduce.jobs import n_cores, run_jobs
from gaia_uwb.reproduce.plan import (
    TEST_PRESET,
    TEST_SEED,
    Method,
    Plan,
    existing_methods,
    paper_solver,
)
from gaia_uwb.reproduce.predictions import Pieces, Predictions, Solver, cached_predictions
from gaia_uwb.reproduce.scores import Table
from gaia_uwb.reproduce.trainings import (
    MODELS,
    Training,
    read_stamp,
    stress_training,
    with_bases,
)
from gaia_uwb.scene import Scene
from gaia_uwb.simulate import find_preset, simulate_episodes

OUTDOOR = "outdoor-uwb"
"""The data set of table 1."""

STRESS_SOLVERS = {"wls": Solver(paper_solver(PipelineConfig()), labels=True)}
"""On the stress test: the paper's."""


@dataclass
class Ledger:
    """What a part used and how long that took."""

    prediction_s: float = 0.0
    trainings: dict[str, Training] = field(default_factory=dict)

    def cost(self) -> dict[str, Any]:
        """Return the times in seconds, and the number of models."""
        stamps = [read_stamp(training.place) for training in self.trainings.values()]
        known = [s["seconds"] for s in stamps if s is not None and not s["taken_up"]]
        return {
            "models": len(stamps),
            "models_taken_up": len(stamps) - len(known),
            "training_s": round(float(sum(known)), 1),
            "prediction_s": round(self.prediction_s, 1),
        }


@dataclass
class Workshop:
    """Shared by all parts of one call.

    Parameters
    ----------
    folder
        For results; models and predictions are kept in its sub-folders.
    plan
        How much of everything.
    version
        Of the package.
    load
        Loads the outdoor data set's runs.
    watch
        Is told what happens.
    workers
        Processes that train; with 0 models are trained in this process.
    """

    folder: OutputFolder
    plan: Plan
    version: str
    load: Callable[[], Sequence[Scene]]
    watch: Callable[[str], None] = lambda text: None
    workers: int = field(default_factory=n_cores)
    ledger: Ledger = field(default_factory=Ledger)
    parts: set[str] = field(default_factory=set)
    """The parts that were made in this call."""
    outdoor_tables: dict[str, Table] = field(default_factory=dict)
    """Table 1 by its variants, once it is made."""
    stress_tables: dict[str, Table] = field(default_factory=dict)
    """Table 2 and the ablation by their parts' names, once they are made."""
    robustness: dict[str, Any] = field(default_factory=dict)
    """Table 4, once it is made."""
    _runs: dict[str, tuple[Episode, ...]] = field(default_factory=dict)
    _trained: set[Path] = field(default_factory=set)

    @property
    def models(self) -> OutputFolder:
        """Where models are kept."""
        return OutputFolder(self.folder.path / MODELS)

    @cached_property
    def scenes(self) -> list[Scene]:
        """The outdoor runs, as long as the plan wants them."""
        return self.plan.shortened(self.load())

    @cached_property
    def stress_test(self) -> tuple[Episode, ...]:
        """The stress test's episodes."""
        preset = find_preset(TEST_PRESET)
        return tuple(simulate_episodes(preset, self.plan.n_test, TEST_SEED))

    def runs(self, preparation: str) -> tuple[Episode, ...]:
        """Return the outdoor runs of table 1, prepared.

        Parameters
        ----------
        preparation
            ``aligned`` or ``published``.
        """
        if preparation not in self._runs:
            options = WindowSetOptions().model_copy(update={"preparation": preparation})
            scenes = self.scenes
            if self.plan.n_layouts is not None:
                layouts = sorted({scene.name.rpartition("/")[2] for scene in scenes})
                kept = layouts[: self.plan.n_layouts]
                scenes = [scene for scene in scenes if scene.name.rpartition("/")[2] in kept]
            self._runs[preparation] = tuple(prepare_runs(scenes, options))
        return self._runs[preparation]

    def stress_trainings(self, methods: Sequence[Method]) -> dict[str, list[Training]]:
        """Return the trainings of methods for the stress test, one for each seed.

        Parameters
        ----------
        methods
            Those without a network have none.
        """
        return {
            method.name: [
                stress_training(
                    self.models.path,
                    method.name,
                    self.plan.recipe(method.network, seed),
                    self.version,
                )
                for seed in self.plan.stress_seeds
            ]
            for method in methods
            if method.network is not None
        }

    def train(self, trainings: Sequence[Training]) -> None:
        """Train what is missing or stale, several models at a time.

        Parameters
        ----------
        trainings
            Bases that they need are added.
        """
        wanted = with_bases(trainings, self.plan)
        self.ledger.trainings |= {str(training.place): training for training in wanted}
        jobs = [t.job() for t in wanted if t.place not in self._trained]
        if jobs:
            start = time.monotonic()
            self.watch(f"{len(jobs)} models to train or check")
            run_jobs(jobs, self.workers, self.watch)
            self.watch(f"models ready after {time.monotonic() - start:.0f} s")
            self._trained |= {training.place for training in wanted}

    def predict(
        self,
        where: str,
        name: str,
        episodes: Sequence[Episode],
        pieces: Pieces,
        solvers: dict[str, Solver],
    ) -> Predictions:
        """Return predictions, from their file if that is fresh.

        Parameters
        ----------
        where, name
            Sub-folder and name of the file.
        episodes, pieces, solvers
            As in :func:`gaia_uwb.reproduce.predictions.cached_predictions`.
        """
        folder = OutputFolder(self.folder.path / "predictions" / where)
        found = cached_predictions(folder, name, episodes, pieces, solvers)
        self.ledger.prediction_s += found.seconds
        return found


def all_trainings(workshop: Workshop) -> list[Training]:
    """Return all trainings for the stress test: those of the tables and of the ablations.

    Parameters
    ----------
    workshop
        Gives plan and folders.
    """
    from gaia_uwb.reproduce.plan import ablation_methods

    methods = {m.name: m for m in (*existing_methods(), *ablation_methods())}
    found = workshop.stress_trainings(tuple(methods.values()))
    return [training for own in found.values() for training in own]
