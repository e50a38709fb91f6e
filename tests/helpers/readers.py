"""All that GAIA reads: a good input of each kind, a look at it, and the job it is for.

Logs come first, then a data set's files, then settings, feeds and lists that a user hands in.
"""

from __future__ import annotations

import io
import json
from collections.abc import Callable, Iterable
from contextlib import redirect_stdout
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import cache, partial
from pathlib import Path

import yaml

from gaia_uwb._shared.errors import GaiaError
from gaia_uwb._shared.text import written_out
from gaia_uwb.api import load_scenes
from gaia_uwb.cli.commands import app
from gaia_uwb.config import PipelineConfig, dump_config, load_config
from gaia_uwb.denoisers.registry import make_denoiser
from gaia_uwb.evaluate.log_check import CheckReport
from gaia_uwb.evaluate.outdoor_check import check_outdoor_static
from gaia_uwb.evaluate.source_check import check_source
from gaia_uwb.fleet.manifests import find_zones
from gaia_uwb.fleet.zones import reconstruct_zone
from gaia_uwb.learn.recipes import KINDS, load_recipe, make_recipe
from gaia_uwb.logs.episodes import read_episodes, write_episodes
from gaia_uwb.outputs.geojson import boundary_geojson
from gaia_uwb.outputs.report import make_report
from gaia_uwb.pipeline import reconstruct
from gaia_uwb.reconstruction import Reconstruction
from gaia_uwb.scene import Scene
from gaia_uwb.simulate import PRESETS, find_preset, simulate_episodes, simulate_pass
from gaia_uwb.wzdx import make_feed_config, make_feeds, write_feeds, zone_of
from good_logs import LOGS, write_own
from outdoor_files import ROW, SUMMARY, write_run, write_static

SCHEMAS = Path(__file__).parents[3] / "shared" / "schemas"
"""The official schemas, where they are."""

RUN = "outdoor-uwb:NLOS/B/4"
FEED = {
    "publisher": "Test DOT",
    "data_source": {"organization_name": "Test DOT"},
    "road_names": ["I-80"],
    "direction": "northbound",
    "start_date": "2026-11-22T09:00:00Z",
    "end_date": "2026-11-22T17:00:00Z",
    "name": "Bridge repair",
    "device_ids": {"cone-1": "d1"},
    "reduced_speed_limit_kph": 40.0,
    "extension": True,
    "deprecated_members": True,
}
PRIOR = {"side": "right", "spacing_m": 12.0, "closure": "lane-closure"}


@dataclass(frozen=True)
class Reader:
    """One kind of input.

    Parameters
    ----------
    write
        Writes a good one into a folder and returns the file or folder that is to be damaged.
    read
        Reads it and returns the lines that a user is shown; raises one of our errors if it is
        refused.
    use
        Does with it what it is for; takes much longer.
    """

    write: Callable[[Path], Path]
    read: Callable[[Path], Iterable[str]]
    use: Callable[[Path], object] = lambda path: None


def run(*arguments: str | Path) -> list[str]:
    """Run ``gaia`` and return the lines that it prints."""
    printed = io.StringIO()
    with redirect_stdout(printed):
        app([str(argument) for argument in arguments], standalone_mode=False)
    return printed.getvalue().removesuffix("\n").split("\n")


def lines_of(report: CheckReport) -> list[str]:
    """Return a report's lines; raise the line that says why the log cannot be read."""
    if not report.readable:
        (line,) = report.problems
        raise GaiaError(line)
    return report.lines()


def check_log(log: Path) -> list[str]:
    (report,) = check_source(str(log))
    return lines_of(report)


def reconstruct_log(log: Path) -> None:
    reconstruct(load_scenes(str(log))[0])


# Data sets ---------------------------------------------------------------------------------------


def write_outdoor_run(folder: Path) -> Path:
    write_run(folder / "outdoor-uwb")
    return next(folder.rglob("Case_4"))


def check_outdoor_run(case: Path) -> list[str]:
    (report,) = check_source(RUN, data_dir=case.parents[4])
    return lines_of(report)


def reconstruct_outdoor_run(case: Path) -> None:
    reconstruct(load_scenes(RUN, data_dir=case.parents[4])[0])


def write_outdoor_static(folder: Path) -> Path:
    for k in (2, 4, 6):
        rows = [ROW.replace("442.5", f"{442 + n / 7}") for n in range(20)]
        write_static(folder, f"LOS/height_50.0cm/{k}m.csv", *rows, SUMMARY)
    return next(folder.rglob("height_*"))


def check_static(height: Path) -> list[str]:
    return check_outdoor_static(height.parents[2]).lines()


def write_simulated_episodes(folder: Path) -> Path:
    list(write_episodes(simulate_episodes(PRESETS["wild"], 3, seed=0), folder))
    return folder


def read_all_episodes(folder: Path) -> list[str]:
    lines = [f"{episode.name}: {episode.n_steps} steps" for episode in read_episodes(folder)]
    return [written_out(line) for line in lines]


# What else a user hands in -----------------------------------------------------------------------


@cache
def simulated_pass() -> Scene:
    return simulate_pass(PRESETS["lane-closure"], seed=3)


@cache
def reconstructed_pass() -> Reconstruction:
    return reconstruct(simulated_pass())


def write_both_feeds(folder: Path) -> Path:
    feeds = make_feeds(
        zone_of(reconstructed_pass()), make_feed_config(FEED), datetime(2026, 11, 22, tzinfo=UTC)
    )
    write_feeds(feeds, folder)
    return folder


def validate_feeds(folder: Path, *options: str | Path) -> list[str]:
    return run("wzdx", "validate", *sorted(folder.glob("*.geojson")), *options)


def validate_by_schemas(folder: Path) -> None:
    if SCHEMAS.is_dir():
        validate_feeds(folder, "--schemas", SCHEMAS)


def write_results(folder: Path) -> Path:
    """Write what ``gaia wzdx write`` takes: results of ``gaia reconstruct``, and settings."""
    result = reconstructed_pass()
    for name, content in (
        ("report.json", make_report(result)),
        ("boundary.geojson", boundary_geojson(result)),
        ("feed.yaml", FEED),
    ):
        text = yaml.safe_dump(content) if name.endswith("yaml") else json.dumps(content, indent=1)
        (folder / name).write_text(text, encoding="utf-8")
    return folder


def write_feeds_of_results(folder: Path) -> list[str]:
    options: list[str | Path] = ["--config", folder / "feed.yaml", "--out", folder / "feeds"]
    return run("wzdx", "write", folder, *options, "--update-date", "2026-11-22T10:00:00Z")


def write_settings(folder: Path) -> Path:
    config = PipelineConfig.model_validate({"prior": PRIOR | {"known_anchors": [
        {"anchor_id": "cone-3", "east_m": 12.1, "north_m": 3.4}]}})  # fmt: skip
    (folder / "settings.yaml").write_text(dump_config(config), encoding="utf-8")
    return folder / "settings.yaml"


def read_settings(path: Path) -> list[str]:
    make_denoiser(load_config(path).denoiser)
    return []


def reconstruct_with(path: Path) -> None:
    reconstruct(simulated_pass(), load_config(path))


def write_preset(folder: Path) -> Path:
    (folder / "preset.yaml").write_text(dump_config(PRESETS["wild"]), encoding="utf-8")
    return folder / "preset.yaml"


def read_preset(path: Path) -> list[str]:
    find_preset(str(path))
    return []


def simulate_preset(path: Path) -> None:
    simulate_pass(find_preset(str(path)), seed=0)


def write_recipe(folder: Path) -> Path:
    text = dump_config(make_recipe(KINDS["gaia"], simulated=True))
    (folder / "recipe.yaml").write_text(text, encoding="utf-8")
    return folder / "recipe.yaml"


def read_recipe(path: Path) -> list[str]:
    load_recipe(path, make_recipe(KINDS["gaia"], simulated=True))
    return []


def write_fleet(folder: Path, suffix: str = ".csv") -> Path:
    for name in ("pass-1", "pass-2", "pass-3"):
        (folder / name).mkdir()
        write_own(folder / name)
    manifest = folder / f"zones{suffix}"
    table = "log,zone\npass-1,north\npass-2,north\npass-3,south\n"
    lists = "north: [pass-1, pass-2]\nsouth:\n- pass-3\n"
    manifest.write_text(table if suffix == ".csv" else lists, encoding="utf-8")
    return manifest


def list_fleet(manifest: Path) -> list[str]:
    return [written_out(f"{zone.name}: {len(zone.logs)} logs") for zone in find_zones(manifest)]


def reconstruct_fleet(manifest: Path) -> None:
    for zone in find_zones(manifest):
        reconstruct_zone(zone, manifest.parent / "out" / zone.name, PipelineConfig(denoiser="raw"))


READERS: dict[str, Reader] = {
    **{name: Reader(write, check_log, reconstruct_log) for name, write in LOGS.items()},
    "outdoor-uwb": Reader(write_outdoor_run, check_outdoor_run, reconstruct_outdoor_run),
    "outdoor-uwb-static": Reader(write_outdoor_static, check_static),
    "episodes": Reader(write_simulated_episodes, read_all_episodes),
    "wzdx-validate": Reader(write_both_feeds, validate_feeds, validate_by_schemas),
    "wzdx-write": Reader(write_results, write_feeds_of_results),
    "settings": Reader(write_settings, read_settings, reconstruct_with),
    "preset": Reader(write_preset, read_preset, simulate_preset),
    "recipe": Reader(write_recipe, read_recipe),
    "fleet": Reader(write_fleet, list_fleet, reconstruct_fleet),
    "fleet-yaml": Reader(partial(write_fleet, suffix=".yaml"), list_fleet, reconstruct_fleet),
}
"""The kinds of input, by name."""
