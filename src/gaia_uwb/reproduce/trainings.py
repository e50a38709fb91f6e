"""The tables' models: each in a folder of its own, trained once, and again when it is stale.

Beside a model lies ``training.json``: a checksum of all that the model depends on (recipe, every
number that it is trained on, its base, the code of network and training), and the time it took. A
model with another checksum is trained anew. One without that file, trained by ``gaia train`` or an
earlier version, is taken up if the state beside it belongs to the same data and recipe; otherwise
the training refuses it.
"""

from __future__ import annotations

import json
import time
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from gaia_uwb._shared import OutputFolder
from gaia_uwb.episode import Episode
from gaia_uwb.learn import Recipe, WindowSetOptions, WindowSets, logged_sets, simulated_sets
from gaia_uwb.models import DESCRIPTION, GaiaArchitecture, Normalisation, read_description
from gaia_uwb.reproduce.digests import code_digest, digest_of, episodes_digest
from gaia_uwb.reproduce.jobs import Job
from gaia_uwb.reproduce.plan import TRAINING_PRESET, Plan

MODELS = "models"
"""Folder of all models, inside that of the results."""
STAMP = "training.json"
_CODE = (
    "learn.window_training", "models.window_inputs", "models.plausible_correction",
    "learn.networks.window_losses", "learn.networks.augmentation", "learn.networks.export",
)  # fmt: skip
# What a training imports for its files and pictures, and what the key holds the values of.
_NOT_FOLLOWED = (
    "_shared", "config", "episode", "evaluate.bootstrap", "learn.loss_plots",
    "learn.networks.make", "learn.training_folder", "learn.window_sets", "models.card",
    "models.description", "models.domain", "models.training_options", "models.zone_inputs",
)  # fmt: skip

# Seconds on one thread; only the order of the jobs and the time left depend on them.
_STRESS_S = {"mlp": 75.0, "pose-mlp": 75.0, "gaia": 480.0}
_OUTDOOR_S = {"mlp": 28.0, "pose-mlp": 28.0, "gaia": 110.0}


@dataclass(frozen=True)
class Data:
    """What a model is trained on.

    Parameters
    ----------
    source
        ``sim:PRESET`` or the name of a data set.
    split
        A fold of logs, such as ``layout/3``; empty for the simulator.
    runs
        The logs' runs, prepared.
    """

    source: str
    split: str = ""
    runs: tuple[Episode, ...] = field(default=(), repr=False)

    def sets(self, options: WindowSetOptions) -> WindowSets:
        """Return the sets that the training sees.

        Parameters
        ----------
        options
            Of the recipe.
        """
        if self.split:
            return logged_sets(self.runs, self.source, self.split, options)
        return simulated_sets(self.source.removeprefix("sim:"), options)


@dataclass(frozen=True)
class Training:
    """One model to be trained.

    Parameters
    ----------
    place
        Its folder.
    recipe
        How.
    data
        On what.
    base
        For ``gaia``: folder of its base.
    version
        Of the package.
    """

    place: Path
    recipe: Recipe
    data: Data
    base: Path | None
    version: str

    @property
    def denoiser(self) -> str:
        """The model's name as a denoiser."""
        return f"{self.recipe.network.kind}:{self.place}"

    def job(self) -> Job:
        """Return it as a job that waits for its base."""
        times_s = _OUTDOOR_S if self.data.split else _STRESS_S
        after = () if self.base is None else (_name(self.base),)
        expected_s = times_s[self.recipe.network.kind]
        return Job(_name(self.place), train_model, (self,), after, expected_s)


def stress_training(folder: Path, name: str, recipe: Recipe, version: str) -> Training:
    """Return the training of a model for the stress test.

    Parameters
    ----------
    folder
        Of all models.
    name
        Of the method.
    recipe
        With its seed.
    version
        Of the package.
    """
    data = Data(f"sim:{TRAINING_PRESET}")
    return _training(folder, name, recipe, data, version)


def outdoor_training(folder: Path, name: str, recipe: Recipe, data: Data, version: str) -> Training:
    """Return the training of a model for one fold of the outdoor data.

    Parameters
    ----------
    folder
        Of all models.
    name
        Of the method.
    recipe
        With its seed and its preparation.
    data
        The fold.
    version
        Of the package.
    """
    fold = f"{recipe.sets.preparation}-{data.split.replace('/', '-')}"
    return _training(folder / fold, name, recipe, data, version)


def _training(folder: Path, name: str, recipe: Recipe, data: Data, version: str) -> Training:
    seed = recipe.training.seed
    base = folder / f"pose-mlp-seed{seed}" if isinstance(recipe.network, GaiaArchitecture) else None
    return Training(folder / f"{name}-seed{seed}", recipe, data, base, version)


def with_bases(trainings: Iterable[Training], plan: Plan) -> list[Training]:
    """Return trainings without repeats, and the bases that they need.

    Parameters
    ----------
    trainings
        Any.
    plan
        Gives the recipe of a base.
    """
    from gaia_uwb.learn import KINDS

    found: dict[Path, Training] = {}
    for training in trainings:
        found[training.place] = training
        if training.base is not None and training.base not in found:
            old = training.recipe
            simulated = not training.data.split
            recipe = plan.recipe(
                KINDS["pose-mlp"],
                old.training.seed,
                preparation=None if simulated else old.sets.preparation,
            )
            found[training.base] = Training(
                training.base, recipe, training.data, None, training.version
            )
    return list(found.values())


def train_model(training: Training) -> bool:
    """Train a model unless it is there and fresh; return whether there was anything to do.

    Parameters
    ----------
    training
        What to do.
    """
    folder = OutputFolder(training.place)
    sets = _sets(training.data, training.recipe.sets)
    key = _key(training, sets)
    stamp = read_stamp(training.place)
    if stamp is not None and stamp["key"] != key:
        _forget(folder)
        stamp = None
    if stamp is not None and stamp["done"] and (training.place / DESCRIPTION).is_file():
        return False
    from gaia_uwb.learn import STATE, WindowTask, train_window

    taken_up = stamp is None and (training.place / STATE).is_file()
    note: dict[str, Any] = stamp or {"key": key, "seconds": 0.0, "taken_up": taken_up}
    before_s, start = note["seconds"], time.monotonic()

    def write(*, done: bool) -> None:
        note.update(seconds=round(before_s + time.monotonic() - start, 1), done=done)
        folder.write(STAMP, json.dumps(note, indent=2) + "\n")

    def noted(epochs: Iterable[int], name: str, n_done: int) -> Iterator[int]:
        del name, n_done
        for epoch in epochs:
            yield epoch
            write(done=False)

    recipe = training.recipe
    task = WindowTask(recipe.network, recipe.training, training.version, sets)
    if not taken_up:
        write(done=False)
    train_window(task, folder, base=training.base, progress=noted)
    write(done=True)
    return True


def read_stamp(place: Path) -> dict[str, Any] | None:
    """Return what is noted beside a model, if anything is.

    Parameters
    ----------
    place
        The model's folder.
    """
    try:
        content = json.loads((place / STAMP).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    known = isinstance(content, dict) and {"key", "seconds", "taken_up", "done"} <= set(content)
    return content if known else None


def _name(place: Path) -> str:
    """Return what to call a model: the end of its folder's name."""
    inside = place.parts[-2:]
    return inside[1] if inside[0] == MODELS else "/".join(inside)


_kept: dict[str, WindowSets] = {}
"""The last sets of this process: the models of one fold share them."""


def _sets(data: Data, options: WindowSetOptions) -> WindowSets:
    key = digest_of([data.source, data.split, episodes_digest(data.runs), options.model_dump()])
    if key not in _kept:
        _kept.clear()
        _kept[key] = data.sets(options)
    return _kept[key]


def _key(training: Training, sets: WindowSets) -> str:
    base, kind = training.base, training.recipe.network.kind.replace("-", "_")
    return digest_of(
        {
            "recipe": training.recipe.model_dump(),
            "training": episodes_digest(sets.training),
            "validation": episodes_digest(sets.validation),
            "normalisation": Normalisation.fit(sets.training).model_dump(),
            "base": None if base is None else read_description(base).sha256,
            "code": code_digest(*_CODE, f"learn.networks.{kind}", without=_NOT_FOLLOWED),
        }
    )


def _forget(folder: OutputFolder) -> None:
    """Remove a stale model, so that its state is not taken up."""
    from gaia_uwb.learn import STATE

    for name in (STATE, DESCRIPTION, STAMP):
        folder.remove(name)
