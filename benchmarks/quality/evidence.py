"""What each kind of evidence decides on a straight, steady drive: docs/evidence-numbers.md.

    python benchmarks/quality/evidence.py --n 40                        # prints the page
    python benchmarks/quality/evidence.py --n 200 --table docs/evidence-numbers.md

The results are kept in benchmarks/out/evidence/: an interrupted run goes on from there, and a run
with a larger --n computes the further drives only. Processor times are those of the run that
computed the results.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

import _tally
import recorded_vehicle
from _drives import HELPERS, Case
from _peers import Method, Place, Result, ours, results_of
from gaia_uwb import PipelineConfig, Scene, __version__
from gaia_uwb._shared import Array, Float64, replace_file
from gaia_uwb.api import knowing
from gaia_uwb.logs import Vehicle
from gaia_uwb.vehicle_calibration import calibrate_vehicle
from peers import Cones, coverage, number

ROOT = Path(__file__).parents[2]
OUT = ROOT / "benchmarks" / "out" / "evidence"
N_SEEDS = 200
CALIBRATION_SEED, N_DRIVES = 1_000_000, 2
ONE = ((0.0, 0.0),)
ACROSS = ((0.0, 0.8), (0.0, -0.8))
ALONG = ((0.8, 0.0), (-0.8, 0.0))
HEAD = """\
# What evidence decides, in numbers

Written by `python benchmarks/quality/evidence.py --n {n} --table docs/evidence-numbers.md`; not edited by hand.

Every row is the same {n} drives (`road_drive_with_tags` in `tests/helpers/road_tags.py`): straight roads, a steady
60 km/h, 20 cones, in a taper on one side (even seeds) or in two rows, one on either side (odd seeds). Such a drive gives
the ranges of one tag nothing that tells left from right, or a clock offset from a shift along the road. The roads, radios
and drives are by code of their own, not the simulator's. Radios: noise 0.06 m, range bias 0.15 m, delays of cones 0.03 m,
of tags 0.05 m, patterns of 0.03 m, clocks 0.12 s apart, trucks in the way; positions with noise of 0.01 m. True lever
arms differ from the stated ones by 0.02 m, and the vehicle points 1° beside its course. Every tag takes 10 readings of a
cone per second. Angles have a bias of 3°, and 5 % of them come from anywhere; cones range their two nearest neighbours
20 times. A calibrated vehicle made {n_drives} drives before, past other cones: there and back, accelerating and braking
(`gaia vehicle calibrate`). All results are `gaia_uwb.reconstruct` with its default settings, which is given no truth.

Columns: *cones ok* is the share of all cones. Of these: *wrong sides* counts those nearer to their other position, beside
how many the stated probabilities expect; *error* is the distance to the true place, and *90 % ellipse* the share whose
ellipse holds it, with their number and a 95 % interval. *Sides open* counts cones of all drives. *Nearer place* is the
median distance of the nearer of a cone's two places, over all located cones, whatever their status, and *but for a
shift* the same after the median shift of all cones of a drive is taken out: a clock offset that is off moves all cones
along the road alike. *Processor* is per drive.
"""  # noqa: E501
RECORDED = """\
## Recorded: three tags on a trolley

The public LIAS drives (indoors, 8 surveyed anchors, three tags on one trolley), by
`python benchmarks/quality/recorded_vehicle.py`: each tag alone, and all as one vehicle whose lever
arms follow from the three paths.
"""
COLUMNS = (
    "evidence", "drives ok", "cones ok", "wrong sides (expected)", "sides open", "median error (m)",
    "90 % of errors below (m)", "90 % ellipse", "nearer place (m)", "but for a shift (m)",
    "processor (s)",
)  # fmt: skip


@dataclass(frozen=True)
class Row:
    """One kind of evidence: what the drives have, and whether the vehicle is calibrated.

    Parameters
    ----------
    name
        What the table calls it.
    levers
        Forward and left of each tag, in metres.
    angle_sigma_deg, cone_to_cone
        As ``road_drive_with_tags`` takes them.
    calibrated
        Whether the vehicle was calibrated by drives of its own before.
    """

    name: str
    levers: tuple[tuple[float, float], ...]
    angle_sigma_deg: float | None = None
    cone_to_cone: bool = False
    calibrated: bool = False

    def drive(self, seed: int) -> Scene:
        """Return the drive of a seed."""
        made: Scene = _roads().road_drive_with_tags(
            seed,
            self.levers,
            angle_sigma_deg=self.angle_sigma_deg,
            cone_to_cone=self.cone_to_cone,
        )
        return made

    def vehicle(self, seed: int) -> Vehicle | None:
        """Return what drives past other cones say of the vehicle, if it is calibrated."""
        if not self.calibrated:
            return None
        drives = [
            _roads().road_drive_with_tags(
                CALIBRATION_SEED + N_DRIVES * seed + k,
                self.levers,
                there_and_back=True,
                vehicle=seed,
            )
            for k in range(N_DRIVES)
        ]
        return calibrate_vehicle(drives, name="van").vehicle


ROWS = (
    Row("one tag", ONE),
    Row("two tags, 1.6 m across", ACROSS),
    Row("two tags, 1.6 m along", ALONG),
    Row("angles of 10°", ONE, angle_sigma_deg=10.0),
    Row("ranges between cones", ONE, cone_to_cone=True),
    Row("two tags across, angles", ACROSS, angle_sigma_deg=10.0),
    Row("two tags across, ranges between cones", ACROSS, cone_to_cone=True),
    Row("angles, ranges between cones", ONE, angle_sigma_deg=10.0, cone_to_cone=True),
    Row("one tag of a calibrated vehicle", ONE, calibrated=True),
    Row("two tags across of a calibrated vehicle", ACROSS, calibrated=True),
    Row("all of these", ACROSS, angle_sigma_deg=10.0, cone_to_cone=True, calibrated=True),
)


def _roads() -> Any:
    if str(HELPERS) not in sys.path:
        sys.path.insert(0, str(HELPERS))
    return import_module("road_tags")


def results(row: Row, n: int, folder: Path) -> list[Result]:
    """Return the results of the first n drives of a row."""
    scenes = {f"road-tags-{seed}": seed for seed in range(n)}
    vehicles: dict[str, Vehicle | None] = {}

    def cases() -> Iterator[Case]:
        for name, seed in scenes.items():
            yield Case(name, (row.drive(seed),))

    def calibrate(case: Case) -> None:
        vehicles[case.name] = row.vehicle(scenes[case.name])

    def locate(passes: Sequence[Scene]) -> tuple[list[Place], str]:
        vehicle = vehicles[passes[0].name]
        if vehicle is None:
            return ours(PipelineConfig())(passes)
        method: Method = ours(knowing(PipelineConfig(), vehicle))
        return method([vehicle.drove(scene) for scene in passes])

    return results_of(row.name, cases(), "ours", locate, folder, before=calibrate)


def cells(row: Row, found: Sequence[Result]) -> list[str]:
    """Return the cells of :data:`COLUMNS`."""
    cones = [Cones.of(result) for result in found]
    ok_m = np.concatenate([each.error_m[each.ok] for each in cones])
    wrong, expected = np.sum([each.sides() for each in cones], axis=0)
    nearer_m, shaped_m = (np.concatenate(each) for each in zip(*map(_nearer_m, cones), strict=True))
    n_cones = sum(len(each.ok) for each in cones)
    n_open = sum(place.side_is_open for result in found for place in result.places)
    return [
        row.name,
        f"{sum(result.status == 'ok' for result in found)} of {len(found)}",
        f"{len(ok_m) / n_cones:.1%}".replace("%", " %"),
        f"{wrong:.0f} ({expected:.1f})",
        f"{n_open} of {n_cones}",
        number(float(np.median(ok_m)) if len(ok_m) else np.nan),
        number(float(np.quantile(ok_m, 0.9)) if len(ok_m) else np.nan),
        coverage([each.chi_square() for each in cones]),
        number(float(np.median(nearer_m)) if len(nearer_m) else np.nan),
        number(float(np.median(shaped_m)) if len(shaped_m) else np.nan),
        f"{np.mean([result.processor_s for result in found]):.1f}",
    ]


def _nearer_m(cones: Cones) -> tuple[Float64[Array, "K"], Float64[Array, "K"]]:
    """Return errors of the nearer places of located cones, and those but for a common shift."""
    located = np.isfinite(cones.error_m)
    off_m, other_m = (
        (place_m - cones.true_m)[located] for place_m in (cones.position_m, cones.mirror_position_m)
    )
    mirrored = np.hypot(*other_m.T) < np.hypot(*off_m.T)  # NaN, where there is no other, is not
    off_m = np.where(mirrored[:, None], other_m, off_m)
    shift_m = np.median(off_m, axis=0) if located.any() else np.zeros(2)
    return np.hypot(*off_m.T), np.hypot(*(off_m - shift_m).T)


def page(n: int, found: Sequence[tuple[Row, Sequence[Result]]], recorded: str | None) -> str:
    """Return the page; with the table of the recorded drives, where they are here."""
    table = _tally.table(COLUMNS, (cells(row, each) for row, each in found))
    more = [] if recorded is None else [RECORDED, recorded]
    return "\n".join(
        [HEAD.format(n=n, n_drives=N_DRIVES), table, "", *more, f"gaia {__version__}.\n"]
    )


def main(arguments: Sequence[str] | None = None) -> None:
    """Compute what is not yet computed, and print or write the page."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--n", type=int, default=N_SEEDS, help="number of drives")
    parser.add_argument("--rows", nargs="+", choices=[row.name for row in ROWS], metavar="ROW")
    parser.add_argument("--out", type=Path, default=OUT, help="folder of the results")
    parser.add_argument("--table", type=Path, help="write the page here instead of printing it")
    given = parser.parse_args(arguments)
    rows = [row for row in ROWS if not given.rows or row.name in given.rows]
    found = [(row, results(row, given.n, given.out)) for row in rows]
    text = page(given.n, found, recorded_vehicle.table())
    if given.table is None:
        print(text)
    else:
        replace_file(given.table, text)


if __name__ == "__main__":
    main()
