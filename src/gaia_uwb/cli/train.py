"""``gaia train``: train a network."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Iterator, Sequence
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from gaia_uwb.cli.options import DataDirOption, OutOption, require_torch, version
from gaia_uwb.cli.terminal import Progress as Watch

if TYPE_CHECKING:
    from gaia_uwb.learn import Progress, Recipe, WindowSets
    from gaia_uwb.models import WindowModel, ZoneModel


class Network(StrEnum):
    """The networks that can be trained."""

    MLP = "mlp"
    POSE_MLP = "pose-mlp"
    GAIA = "gaia"
    GAIA_SET = "gaia-set"


class Preparation(StrEnum):
    """How logs are prepared before a network sees them."""

    ALIGNED = "aligned"
    PUBLISHED = "published"


def train(
    network: Annotated[
        Network, typer.Argument(metavar="MODEL", help="mlp, pose-mlp, gaia, gaia-set.")
    ],
    data: Annotated[
        str,
        typer.Option(help="sim:PRESET, or surveyed logs (outdoor-uwb); sim:mixed for gaia-set."),
    ],
    out: OutOption,
    split: Annotated[
        str,
        typer.Option(help="Logs only: all, or a fold to hold out: window/K, run/K or layout/K."),
    ] = "all",
    preparation: Annotated[
        Preparation,
        typer.Option(
            help="Logs only: as `reconstruct` prepares them, or as the paper appears to have done."
        ),
    ] = Preparation.ALIGNED,
    seed: Annotated[
        int, typer.Option(min=0, help="Random seed; the same seed reproduces the same model.")
    ] = 0,
    base: Annotated[
        Path | None,
        typer.Option(help="gaia only: folder of a trained pose-mlp; without it, one is trained."),
    ] = None,
    recipe: Annotated[
        Path | None,
        typer.Option(help="YAML file with overrides for network, training and sets."),
    ] = None,
    portions: Annotated[
        int | None,
        typer.Option(min=1, help="gaia-set only: number of portions of 2,048 new scenes."),
    ] = None,
    data_dir: DataDirOption = None,
) -> None:
    """Train a network; run it again to resume."""
    from gaia_uwb.learn import KINDS, load_recipe, make_recipe
    from gaia_uwb.logs import results_folder

    require_torch()
    if network is Network.GAIA_SET:
        others = {"--split": split != "all", "--base": base, "--recipe": recipe}
        _train_zone(data, out, seed, portions, [name for name, given in others.items() if given])
        return
    from gaia_uwb.learn import WindowTask, train_window

    chosen = make_recipe(KINDS[network.value], simulated=data.startswith("sim:")).with_seed(seed)
    sets_options = chosen.sets.model_copy(update={"preparation": preparation.value})
    chosen = chosen.model_copy(update={"sets": sets_options})
    if recipe is not None:
        chosen = load_recipe(recipe, chosen)
    folder = results_folder(out, [data, *([base] if base else [])], data_dir=data_dir)
    with Watch() as progress:
        progress.update("prepare the training data")
        sets = _window_sets(data, split, chosen, data_dir)
        task = WindowTask(chosen.network, chosen.training, version(), sets)
        found = train_window(task, folder, base=base, progress=_watched(progress, "epochs"))
    _tell(found, out)


def _train_zone(
    data: str, out: Path, seed: int, portions: int | None, strange: Sequence[str]
) -> None:
    """Train ``gaia-set``, which has one mixture of simulated scenes and no splits."""
    from gaia_uwb._shared import ConfigError
    from gaia_uwb.learn import ZoneTask, train_zone
    from gaia_uwb.logs import results_folder
    from gaia_uwb.models import GaiaSetArchitecture, ZoneTrainingOptions

    if data != "sim:mixed" or strange:
        what = ", ".join(strange) or f"--data {data}"
        raise ConfigError(f"{what}: gaia-set can only be trained on the whole of sim:mixed")
    sizes = {"seed": seed} | ({} if portions is None else {"portions": portions})
    task = ZoneTask(GaiaSetArchitecture(), ZoneTrainingOptions.model_validate(sizes), version())
    with Watch() as progress:
        found = train_zone(task, results_folder(out), progress=_watched(progress, "portions"))
    _tell(found, out)


def _watched(progress: Watch, steps: str) -> Progress:
    """Return what shows the steps of trainings, and says where one resumes."""

    def each(left: Iterable[int], name: str, done: int) -> Iterator[int]:
        if done:
            sys.stderr.write(f"{name}: resuming after {done} {steps}\n")
        yield from progress.track(list(left), f"train {name}")

    return each


def _tell(found: WindowModel | ZoneModel, out: Path) -> None:
    """Print a model's scores, and how it is used."""
    for name, value in found.metrics.items():
        typer.echo(f"  {name}: {value:.4g}")
    denoiser = f"{found.network.kind}:{out}"
    typer.echo(f"wrote {out}; use it with: gaia reconstruct SOURCE --denoiser {denoiser}")


def _window_sets(data: str, split: str, recipe: Recipe, data_dir: Path | None) -> WindowSets:
    """Return what to train on."""
    from gaia_uwb._shared import ConfigError
    from gaia_uwb.api import load_scenes
    from gaia_uwb.learn import logged_sets, prepare_runs, simulated_sets

    name, _, part = data.partition(":")
    if name == "sim":
        if split != "all":
            raise ConfigError(
                f"--split {split}: not available for simulated data, which has its own split"
            )
        return simulated_sets(part, recipe.sets)
    runs = prepare_runs(load_scenes(data, data_dir=data_dir), recipe.sets)
    return logged_sets(runs, data, split, recipe.sets)
