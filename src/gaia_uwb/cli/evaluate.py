"""``gaia evaluate``: scores of denoisers on data with a known truth."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from gaia_uwb.cli.options import (
    ConfigOption,
    DataDirOption,
    OutOption,
    SolverOption,
    SourceArgument,
    make_settings,
    model_folders,
    version,
)
from gaia_uwb.cli.terminal import Progress, print_results

SCORED = "raw,median,kalman,pose-kalman,gaia-set"


def evaluate(
    source: SourceArgument,
    out: OutOption = Path("out"),
    methods: Annotated[str, typer.Option(help="Comma-separated denoisers to compare.")] = SCORED,
    solver: SolverOption = None,
    length: Annotated[
        str, typer.Option(help="Steps per window, or 'whole' for whole runs.")
    ] = "whole",
    seed: Annotated[int, typer.Option(min=0, help="Random seed of the bootstrap.")] = 0,
    true_nlos_labels: Annotated[
        bool,
        typer.Option("--true-nlos-labels", help="Give wls the true NLOS labels (as in the paper)."),
    ] = False,
    config: ConfigOption = None,
    data_dir: DataDirOption = None,
) -> None:
    """Score denoisers on surveyed data; write results.json, episodes.csv and config.yaml."""
    import json

    from gaia_uwb.api import load_scenes
    from gaia_uwb.config import dump_config
    from gaia_uwb.evaluate import episodes_csv, make_test, results_json, score_method
    from gaia_uwb.logs import results_folder

    settings = make_settings(config, None, solver)
    names = _methods(methods)
    steps = _length(length)
    folder = results_folder(out, [source, *model_folders(names)], data_dir=data_dir)
    folder.claim(["config.yaml", "episodes.csv", "results.json"])
    scenes = load_scenes(source, data_dir=data_dir)
    with Progress() as progress:
        test = make_test(scenes, steps, settings, each=lambda runs: progress.track(runs, "prepare"))
        scores = [
            score_method(test, name, settings, true_nlos_labels=true_nlos_labels)
            for name in progress.track(names, "score")
        ]
    protocol = {
        "data": source,
        "split": "none (no method is trained)",
        "length": length,
        "solver": settings.solver.kind,
        "true_nlos_labels": true_nlos_labels,
        "version": version(),
    }
    results = results_json(scores, test, protocol, seed=seed)
    folder.write("config.yaml", dump_config(settings))
    folder.write("episodes.csv", episodes_csv(scores, test))
    path = folder.write("results.json", json.dumps(results, indent=2, allow_nan=False) + "\n")
    print_results(results, path)


def _methods(methods: str) -> list[str]:
    from gaia_uwb._shared import ConfigError
    from gaia_uwb.denoisers import make_denoiser

    names = [name.strip() for name in methods.split(",") if name.strip()]
    if not names:
        raise ConfigError(f"--methods: expected at least one denoiser, got {methods!r}")
    if len(set(names)) < len(names):
        raise ConfigError(f"--methods: duplicate denoisers in {methods!r}")
    for name in names:
        make_denoiser(name)
    return names


def _length(length: str) -> int | None:
    from gaia_uwb._shared import ConfigError

    if length == "whole":
        return None
    if not length.isdecimal() or int(length) < 1:
        raise ConfigError(f"--length: expected a number of steps or 'whole', got {length!r}")
    return int(length)
