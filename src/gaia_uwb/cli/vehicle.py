"""``gaia vehicle``: what stays the same from one drive of a vehicle to the next."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from gaia_uwb._shared import written_out
from gaia_uwb.cli.exit_codes import UNRELIABLE
from gaia_uwb.cli.options import DataDirOption
from gaia_uwb.cli.terminal import Progress

if TYPE_CHECKING:
    from gaia_uwb.vehicle_calibration import Calibration

vehicle_app = typer.Typer(help="Calibrate a vehicle.", no_args_is_help=True)

_DRIVES = {
    "clock_offset_s": "speed up and brake beside the cones, or stop and go",
    "range_bias_m": "weave or turn beside the cones, and pass them near and far",
    "delay_m": "drive on for longer, so that all tags hear the same cones",
    "forward_m": "stop and go beside the cones, and turn; more drives help",
    "left_m": "pass cones on both sides, in both directions, and turn; more drives help",
}
"""Which drive tells a number."""


@vehicle_app.callback()
def _vehicle() -> None:
    """Calibrate a vehicle."""


@vehicle_app.command("calibrate")
def vehicle_calibrate(
    sources: Annotated[
        list[str],
        typer.Argument(
            metavar="LOG...",
            help="Logs of drives of one vehicle, each past any cones; or folders of such logs.",
        ),
    ],
    out: Annotated[
        Path,
        typer.Option("--out", metavar="FILE", help="YAML file of the vehicle, for --vehicle."),
    ],
    vehicle: Annotated[
        Path | None,
        typer.Option(
            "--vehicle",
            metavar="FILE",
            help="The vehicle as far as it is known: the lever arms of its tags, to 2 cm.",
        ),
    ] = None,
    name: Annotated[
        str | None,
        typer.Option(help="Its name; by default that in --vehicle, or that of the output file."),
    ] = None,
    levers_unknown: Annotated[
        bool,
        typer.Option(
            "--levers-unknown",
            help="Lever arms were not measured: they are sought within 2 m of what is given.",
        ),
    ] = False,
    data_dir: DataDirOption = None,
) -> None:
    """Estimate a vehicle's clock offset, range bias, delays and lever arms from its drives."""
    from gaia_uwb.api import load_scenes
    from gaia_uwb.logs import read_vehicle, results_folder, vehicle_text
    from gaia_uwb.vehicle_calibration import calibrate_vehicle

    known = None if vehicle is None else read_vehicle(vehicle)
    folder = results_folder(out.parent, sources, data_dir=data_dir)
    folder.claim([out.name])
    called = name or (out.stem if known is None else known.name)
    with Progress() as progress:
        scenes = [
            scene
            for source in progress.track(sources, "read")
            for scene in load_scenes(source, data_dir=data_dir, vehicle=known)
        ]
        progress.update("calibrate", 0, len(scenes))
        found = calibrate_vehicle(
            scenes,
            known,
            name=called,
            levers_unknown=levers_unknown,
            progress=lambda done: progress.update("calibrate", done, len(scenes)),
        )
    folder.write(out.name, vehicle_text(found.vehicle))
    for line in _lines(found):
        typer.echo(written_out(line))
    typer.echo(f"wrote {out}")
    if found.unknown:
        raise typer.Exit(UNRELIABLE)


def _lines(found: Calibration) -> list[str]:
    """Return what was found, and for what was not, which drive tells it."""
    from gaia_uwb.vehicle_calibration import tag_of_value

    drives = f"{found.n_drives} drive{'' if found.n_drives == 1 else 's'}"
    lines = [f"{found.vehicle.name}: {drives}"]
    for name, value in found.found.items():
        tag_id, what = tag_of_value(name)
        label = f"tag {tag_id}, {what}" if tag_id else what
        line = f"  {label}: {value.value:+.4f}, standard error {value.sigma:.4f}"
        if name in found.unknown:
            line += f": the drives do not tell it; {_DRIVES[what]}"
        lines.append(line)
    return lines
