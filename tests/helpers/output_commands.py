"""The commands that write files, as two calls each: into any folder, and with other results."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from gaia_uwb.logs.native import write_native
from gaia_uwb.simulate import load
from wzdx_cases import FEED_YAML

DATE = "2026-11-22T10:00:00Z"

Arguments = list[object]


@dataclass(frozen=True)
class OutputCommand:
    """A command, and the one whose results it finds there.

    Parameters
    ----------
    now, before
        From an output folder to the arguments. Both write files of the same names with other
        content, the same at each call.
    """

    now: Callable[[Path], Arguments]
    before: Callable[[Path], Arguments]


def output_commands(folder: Path, results: Path) -> dict[str, OutputCommand]:
    """Return the commands by name.

    Parameters
    ----------
    folder
        For their inputs.
    results
        Where ``gaia reconstruct`` has written.
    """
    config, old = folder / "feed.yaml", folder / "raw.yaml"
    config.write_text(FEED_YAML, encoding="utf-8")
    old.write_text("denoiser: raw\n", encoding="utf-8")
    for zone, episode in (("north", 1), ("south", 2)):
        write_native(load(f"lane-closure/{episode}")[0], folder / "logs" / zone)
    log = ["reconstruct", "sim:lane-closure/3", "--svg", "--gis"]
    passes = ["simulate", "--preset", "straight"]
    logs = folder / "logs"
    return {
        "reconstruct": _pair(log, ["--denoiser", "raw"]),
        "reconstruct a folder": _pair(["reconstruct", logs], ["--denoiser", "raw"]),
        "fleet": _pair(["fleet", logs], ["--config", old]),
        "simulate": _pair([*passes, "--seed", "1"], ["--seed", "0"]),
        "simulate ten": _pair(
            [*passes, "--episodes", "10", "--format", "csv", "--seed", "1"], ["--seed", "0"]
        ),
        "evaluate": _pair(["evaluate", logs, "--methods", "raw"], ["--solver", "wls"]),
        "wzdx write": _pair(
            ["wzdx", "write", results, "--config", config, "--update-date", DATE],
            ["--update-date", "2026-11-22T09:30:00Z"],
        ),
    }


def _pair(now: Arguments, change: Arguments) -> OutputCommand:
    """Return a command, and the same with other options: of two of a kind the last counts."""
    return OutputCommand(
        lambda out: [*now, "--out", out], lambda out: [*now, *change, "--out", out]
    )
