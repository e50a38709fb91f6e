"""``gaia reproduce``: the paper's tables and figures, each by one command, or all of them."""

from __future__ import annotations

import sys
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from gaia_uwb._shared import written_out
from gaia_uwb.cli.options import DataDirOption, OutOption, require_torch, version
from gaia_uwb.cli.terminal import Progress

if TYPE_CHECKING:
    from collections.abc import Callable

    from gaia_uwb.reproduce import Plan, Workshop

reproduce_app = typer.Typer(help="Reproduce the paper's tables and figures.", no_args_is_help=True)


class Preparation(StrEnum):
    """What is done to the outdoor data's logs."""

    ALIGNED = "aligned"
    PUBLISHED = "published"


class Split(StrEnum):
    """Ways of splitting the outdoor data."""

    WINDOW = "window"
    RUN = "run"
    LAYOUT = "layout"
    SIM = "sim"


QuickOption = Annotated[
    bool, typer.Option("--quick", help="Run the same code on little data, to show that it works.")
]
SeedsOption = Annotated[
    int | None,
    typer.Option(min=1, max=100, help="Models per learned method, with seeds 0, 1, ..."),
]
WorkersOption = Annotated[
    int | None, typer.Option(min=1, help="Number of training processes [one per core].")
]


@reproduce_app.command("table1")
def reproduce_table1(
    out: OutOption = Path("out"),
    split: Annotated[
        list[Split] | None, typer.Option(help="How windows are held out [all].")
    ] = None,
    preparation: Annotated[
        list[Preparation] | None,
        typer.Option(help="Data as `reconstruct` prepares them, or as published [both]."),
    ] = None,
    seeds: SeedsOption = None,
    quick: QuickOption = False,
    workers: WorkersOption = None,
    data_dir: DataDirOption = None,
) -> None:
    """Compare all methods on the outdoor UWB data set, for each split, preparation and length."""

    def narrowed(plan: Plan) -> Plan:
        from dataclasses import replace

        chosen: dict[str, tuple[object, ...]] = {}
        if split:
            chosen["splits"] = tuple(s.value for s in split)
        if preparation:
            chosen["preparations"] = tuple(p.value for p in preparation)
        if seeds:
            chosen["outdoor_seeds"] = tuple(range(seeds))
        return replace(plan, **chosen)  # type: ignore[arg-type]

    _run("table1", _workshop(out, quick, workers, data_dir, narrowed))


@reproduce_app.command("table2")
def reproduce_table2(
    out: OutOption = Path("out"),
    seeds: SeedsOption = None,
    quick: QuickOption = False,
    workers: WorkersOption = None,
) -> None:
    """Compare all methods on the stress test; train the models that are missing."""
    _run("table2", _workshop(out, quick, workers, None, _seeded(seeds)))


@reproduce_app.command("ablation")
def reproduce_ablation(
    out: OutOption = Path("out"),
    seeds: SeedsOption = None,
    quick: QuickOption = False,
    workers: WorkersOption = None,
) -> None:
    """Compare GAIA with the paper's three ablations (table 3) on the stress test."""
    _run("ablation", _workshop(out, quick, workers, None, _seeded(seeds)))


@reproduce_app.command("table4")
def reproduce_table4(
    out: OutOption = Path("out"),
    seeds: SeedsOption = None,
    quick: QuickOption = False,
    workers: WorkersOption = None,
) -> None:
    """Score the methods of table 2, with the same models, on increasingly difficult data."""
    _run("table4", _workshop(out, quick, workers, None, _seeded(seeds)))


@reproduce_app.command("table5")
def reproduce_table5(
    out: OutOption = Path("out"), quick: QuickOption = False, data_dir: DataDirOption = None
) -> None:
    """Check the simulator against the runs of the outdoor UWB data set (two minutes)."""
    _run("table5", _workshop(out, quick, None, data_dir), torch=False)


@reproduce_app.command("alignment")
def reproduce_alignment(
    out: OutOption = Path("out"), quick: QuickOption = False, data_dir: DataDirOption = None
) -> None:
    """Measure what each part of the alignment contributes, on the outdoor UWB data set."""
    _run("alignment", _workshop(out, quick, None, data_dir), torch=False)


@reproduce_app.command("figures")
def reproduce_figures(
    out: OutOption = Path("out"),
    quick: QuickOption = False,
    workers: WorkersOption = None,
    data_dir: DataDirOption = None,
) -> None:
    """Draw all figures, as PDF for print and as PNG, and make the tables behind them."""
    _run("figures", _workshop(out, quick, workers, data_dir))


@reproduce_app.command("all")
def reproduce_all(
    out: OutOption = Path("out"),
    quick: QuickOption = False,
    workers: WorkersOption = None,
    data_dir: DataDirOption = None,
) -> None:
    """Make every table and figure, and the results page; run it again to resume."""
    from gaia_uwb.reproduce import run_all

    require_torch()
    workshop = _workshop(out, quick, workers, data_dir)
    run_all(workshop)
    _write_page(workshop, None, None)


@reproduce_app.command("page")
def reproduce_page(
    out: OutOption = Path("out"),
    page: Annotated[
        Path | None,
        typer.Option(
            help="The page to write; its pictures go to images/results in the same folder."
        ),
    ] = None,
    prose: Annotated[
        Path | None,
        typer.Option(help="Handwritten text to include [results-prose.md in the page's folder]."),
    ] = None,
    quick: QuickOption = False,
) -> None:
    """Write the results page from OUT/results.json."""
    _write_page(_workshop(out, quick, None, None), page, prose)


def _workshop(
    out: Path,
    quick: bool,
    workers: int | None,
    data_dir: Path | None,
    change: Callable[[Plan], Plan] = lambda plan: plan,
) -> Workshop:
    from gaia_uwb.api import load_scenes
    from gaia_uwb.logs import results_folder
    from gaia_uwb.reproduce import OUTDOOR, QUICK, Plan, Workshop, n_cores

    return Workshop(
        folder=results_folder(out, [OUTDOOR], data_dir=data_dir),
        plan=change(QUICK if quick else Plan()),
        version=version(),
        load=lambda: load_scenes(OUTDOOR, data_dir=data_dir),
        watch=_say,
        workers=workers or n_cores(),
    )


def _seeded(seeds: int | None) -> Callable[[Plan], Plan]:
    def change(plan: Plan) -> Plan:
        from dataclasses import replace

        return replace(plan, stress_seeds=tuple(range(seeds))) if seeds else plan

    return change


def _run(name: str, workshop: Workshop, *, torch: bool = True) -> None:
    from gaia_uwb.reproduce import QUICK_MARK, run_part

    if torch:
        require_torch()
    with Progress() as progress:
        progress.update(name)
        run_part(workshop, name)
    text = workshop.folder.path / f"{name}.md"
    if text.is_file():
        typer.echo("\n".join(map(written_out, text.read_text(encoding="utf-8").split("\n"))))
    elif workshop.plan.quick:
        typer.echo(QUICK_MARK)
    typer.echo(f"wrote {workshop.folder.path / 'results.json'} and the files next to it")


def _write_page(workshop: Workshop, page: Path | None, prose: Path | None) -> None:
    from gaia_uwb._shared import ConfigError, read_regular, replace_file
    from gaia_uwb.reproduce import FOLDER, page_images, read_results, results_page

    results = read_results(workshop)
    source = workshop.folder.path / FOLDER
    images = FOLDER
    if page is None:
        page = workshop.folder.path / "results.md"
    else:
        if page.exists() and b"gaia reproduce page" not in read_regular(page, most_bytes=2**26):
            raise ConfigError(f"{page}: was not written by gaia reproduce: name another page")
        images = "images/results"
        (page.parent / images).mkdir(parents=True, exist_ok=True)
        for name in page_images(results):
            content = (source / f"{name}.png").read_bytes()
            replace_file(page.parent / images / f"{name}.png", content)
    text = prose or page.parent / "results-prose.md"
    words = text.read_text(encoding="utf-8") if text.is_file() else ""
    replace_file(page, results_page(results, words, images))
    typer.echo(f"wrote {page}")


def _say(text: str) -> None:
    sys.stderr.write(f"{written_out(text)}\n")
    sys.stderr.flush()
