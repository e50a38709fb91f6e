"""The commands of the researcher: train a network, repeat the paper's tables."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from gaia_uwb.cli_options import DataDirOption, OutOption, version
from gaia_uwb.terminal import plain, progress_bar, track

if TYPE_CHECKING:
    from gaia_uwb.files import OutputFolder
    from gaia_uwb.learning_sets import LearningSets
    from gaia_uwb.method_tables import Method, TableJob
    from gaia_uwb.recipes import Recipe

reproduce_app = typer.Typer(help="Repeat the paper's tables.", no_args_is_help=True)


class Network(StrEnum):
    """The networks that can be trained."""

    MLP = "mlp"
    POSE_MLP = "pose-mlp"
    GAIA = "gaia"


class Preparation(StrEnum):
    """What is done to logs before a network sees them."""

    ALIGNED = "aligned"
    PUBLISHED = "published"


class Split(StrEnum):
    """Ways of splitting real data in cross-validation."""

    WINDOW = "window"
    RUN = "run"
    LAYOUT = "layout"


SeedsOption = Annotated[
    int, typer.Option(min=1, max=100, help="Models of each learned method, with seeds 0, 1 ...")
]
QuickOption = Annotated[
    bool, typer.Option("--quick", help="The same code on little data: shows that it runs.")
]


def train(
    network: Annotated[Network, typer.Argument(metavar="MODEL", help="mlp, pose-mlp or gaia.")],
    data: Annotated[
        str,
        typer.Option(help="sim:PRESET, or logs with surveyed anchors, such as outdoor-uwb."),
    ],
    out: Annotated[Path, typer.Option("--out", help="Folder for the model; made if needed.")],
    split: Annotated[
        str, typer.Option(help="Logs only: all, or a fold to leave out: window/K, run/K, layout/K.")
    ] = "all",
    preparation: Annotated[
        Preparation,
        typer.Option(help="Logs only: as a reconstruction does, or as the paper seems to have."),
    ] = Preparation.ALIGNED,
    seed: Annotated[int, typer.Option(min=0, help="One seed gives the same model again.")] = 0,
    base: Annotated[
        Path | None,
        typer.Option(help="For gaia: folder of a trained pose-mlp. Otherwise it is trained first."),
    ] = None,
    recipe: Annotated[
        Path | None,
        typer.Option(help="YAML file: network, training and sets, as far as not the default."),
    ] = None,
    data_dir: DataDirOption = None,
) -> None:
    """Train a network; call it again to go on where it was stopped."""
    from gaia_uwb.files import OutputFolder
    from gaia_uwb.recipes import KINDS, load_recipe, make_recipe

    _require_torch()
    from gaia_uwb.training import Task
    from gaia_uwb.training import train as run

    chosen = make_recipe(KINDS[network.value], simulated=data.startswith("sim:")).with_seed(seed)
    sets_options = chosen.sets.model_copy(update={"preparation": preparation.value})
    chosen = chosen.model_copy(update={"sets": sets_options})
    if recipe is not None:
        chosen = load_recipe(recipe, chosen)
    folder = OutputFolder(out)
    sets = _learning_sets(data, split, chosen, data_dir)
    with progress_bar() as progress:

        def each(epochs: Iterable[int], name: str, done: int) -> Iterator[int]:
            left = list(epochs)
            if done:
                sys.stderr.write(f"{name}: goes on after {done} epochs\n")
            yield from track(progress, left, f"train {name}")

        task = Task(chosen.network, chosen.training, sets, version())
        found = run(task, folder, base=base, progress=each)
    for name, value in found.metrics.items():
        typer.echo(f"  {name}: {value:.4g}")
    typer.echo(f"wrote {out}; use it with: gaia reconstruct SOURCE --denoiser {network}:{out}")


@reproduce_app.command("table1")
def reproduce_table1(
    out: OutOption = Path("out"),
    split: Annotated[Split, typer.Option(help="How windows are held out.")] = Split.WINDOW,
    preparation: Annotated[
        Preparation, typer.Option(help="Data as a reconstruction prepares them, or as published.")
    ] = Preparation.ALIGNED,
    seeds: SeedsOption = 1,
    quick: QuickOption = False,
    data_dir: DataDirOption = None,
) -> None:
    """Compare all methods on the outdoor UWB data set's windows of 64 steps."""
    from gaia_uwb import method_tables
    from gaia_uwb.files import OutputFolder
    from gaia_uwb.sources import load_scenes

    _require_torch()
    folder = OutputFolder(out)
    scenes = load_scenes("outdoor-uwb", data_dir=data_dir)
    tables = method_tables.outdoor_table(
        scenes,
        split.value,
        preparation.value,
        _job(folder, seeds, quick),
    )
    _write_tables(folder, tables, quick)


@reproduce_app.command("table2")
def reproduce_table2(
    out: OutOption = Path("out"), seeds: SeedsOption = 3, quick: QuickOption = False
) -> None:
    """Compare all methods on the stress test; trains what is missing."""
    from gaia_uwb.method_tables import ALL_METHODS

    _stress(out, ALL_METHODS, seeds, quick)


@reproduce_app.command("table4")
def reproduce_table4(
    out: OutOption = Path("out"), seeds: SeedsOption = 3, quick: QuickOption = False
) -> None:
    """Score the methods of table 2 on ever worse data; trains what is missing."""
    import json

    from gaia_uwb import robustness
    from gaia_uwb.error_plots import figure_svg
    from gaia_uwb.files import OutputFolder
    from gaia_uwb.method_tables import ALL_METHODS
    from gaia_uwb.plots import figure_png

    _require_torch()
    folder = OutputFolder(out)
    with progress_bar() as progress:
        results = robustness.robustness_table(
            ALL_METHODS,
            _job(folder, seeds, quick),
            each=lambda settings: track(progress, settings, "stress"),
        )
    results["protocol"] |= {"quick": True} if quick else {}
    mark = "QUICK RUN, numbers mean nothing\n\n" if quick else ""
    summary = mark + robustness.robustness_summary(results)
    folder.write_text("table4.md", summary)
    folder.write_text("table4.csv", robustness.robustness_csv(results))
    figure = robustness.plot_robustness(results)
    folder.write_bytes("robustness.png", figure_png(figure))
    folder.write_bytes("robustness.svg", figure_svg(figure))
    path = folder.write_text("results.json", json.dumps(results, indent=2, allow_nan=False) + "\n")
    typer.echo(plain(summary))
    typer.echo(f"wrote {path}")


@reproduce_app.command("ablation")
def reproduce_ablation(
    out: OutOption = Path("out"), seeds: SeedsOption = 3, quick: QuickOption = False
) -> None:
    """Compare GAIA with the paper's three ablations on the stress test; trains what is missing."""
    from gaia_uwb.method_tables import ablation_methods

    _stress(out, ablation_methods(), seeds, quick)


@reproduce_app.command("table5")
def reproduce_table5(
    out: OutOption = Path("out"),
    seed: Annotated[int, typer.Option(min=0, help="Of all that is simulated.")] = 0,
    data_dir: DataDirOption = None,
) -> None:
    """Check the simulator against the outdoor UWB data set's runs; two minutes."""
    from gaia_uwb import experiments
    from gaia_uwb.files import OutputFolder
    from gaia_uwb.sources import load_scenes

    folder = OutputFolder(out)
    scenes = load_scenes("outdoor-uwb", data_dir=data_dir)
    with progress_bar() as progress:
        check = experiments.reproduce_table5(
            scenes,
            folder,
            version=version(),
            seed=seed,
            each=lambda choices: track(progress, choices, "check"),
        )
    typer.echo(experiments.table_text(check.rows))
    typer.echo(f"wrote {out / 'simulator-check.md'} and the files beside it")


def _require_torch() -> None:
    """Say what is missing before any work, in one line."""
    from importlib.util import find_spec

    from gaia_uwb.errors import ConfigError

    for package in ("torch", "safetensors"):
        if find_spec(package) is None:
            raise ConfigError(f"training needs {package}: pip install 'gaia-uwb[train]'")


def _learning_sets(data: str, split: str, recipe: Recipe, data_dir: Path | None) -> LearningSets:
    """Return what to train on."""
    from gaia_uwb.errors import ConfigError
    from gaia_uwb.learning_sets import logged_sets, prepare_runs, simulated_sets
    from gaia_uwb.sources import load_scenes

    name, _, part = data.partition(":")
    if name == "sim":
        if split != "all":
            raise ConfigError(f"--split {split}: the simulator's presets have their own split")
        return simulated_sets(part, recipe.sets)
    runs = prepare_runs(load_scenes(data, data_dir=data_dir), recipe.sets)
    return logged_sets(runs, data, split, recipe.sets)


def _stress(out: Path, methods: Sequence[Method], seeds: int, quick: bool) -> None:
    from gaia_uwb import method_tables
    from gaia_uwb.files import OutputFolder

    _require_torch()
    folder = OutputFolder(out)
    table = method_tables.stress_table(methods, _job(folder, seeds, quick))
    _write_tables(folder, [table], quick)


def _job(folder: OutputFolder, seeds: int, quick: bool) -> TableJob:
    from gaia_uwb.method_tables import TableJob

    return TableJob(folder, range(seeds), version(), _shrink(quick), _say)


def _write_tables(folder: OutputFolder, tables: list[dict[str, Any]], quick: bool) -> None:
    """Write and show tables; a quick run is marked as such."""
    import json

    from gaia_uwb.method_tables import results_table

    text = ""
    for table in tables:
        protocol = table["protocol"] | ({"quick": True} if quick else {})
        table["protocol"] = protocol
        head = f"{protocol['data']}, {protocol['split']}, {protocol['solver']}"
        mark = "QUICK RUN, numbers mean nothing: " if quick else ""
        text += f"{mark}{head}\n\n{results_table(table)}\n"
    folder.write_text("table.md", text)
    content: Any = tables[0] if len(tables) == 1 else {"schema": 1, "tables": tables}
    path = folder.write_text("results.json", json.dumps(content, indent=2, allow_nan=False) + "\n")
    typer.echo(plain(text))
    typer.echo(f"wrote {path}")


def _shrink(quick: bool) -> Callable[[Recipe], Recipe]:
    """Return what makes a recipe small enough to be tried out."""

    def small(recipe: Recipe) -> Recipe:
        training = recipe.training.model_copy(update={"epochs": 1})
        sets = recipe.sets.model_copy(
            update={"n_training": 64, "n_validation": 16, "training_stride": 64}
        )
        return recipe.model_copy(update={"training": training, "sets": sets})

    return small if quick else lambda recipe: recipe


def _say(text: str) -> None:
    sys.stderr.write(f"{plain(text)}\n")
