"""Kept zones: what a drive costs, how near they are to one fit of all drives, what they notice.

Usage: python benchmarks/quality/kept_zones.py [--n N] [--drives N] [--done FILE] [--table FILE]

Of N zones (seeds from 500; the method was developed on others): drives are added one by one, and
places, standard deviations and sides are compared with `gaia_uwb.reconstruct` of all of them. Of N
simulated days: what was noticed of a moved, a removed and an added cone, and after how many drives.
What is done is kept in a file, so that a run that was interrupted goes on.
"""

from __future__ import annotations

import argparse
import json
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from _tally import in_ellipse_90
from gaia_uwb import reconstruct
from gaia_uwb._shared import Array, Float64
from gaia_uwb.kept import ConeState, Zone
from gaia_uwb.reconstruction import Reconstruction
from gaia_uwb.scene import Scene
from gaia_uwb.simulate import (
    LYING_VEHICLE,
    PRESETS,
    Change,
    simulate_day,
    simulate_zone,
)

_FIRST_SEED = 500
_LANES_M = (0.0, 3.6, 0.2, 3.4, -0.2, 3.8, 0.1, 3.5)
_TOGETHER = 8  # drives of the comparison with one fit
_COVERED = (2, 10)  # drives after which ellipses are looked at, beside all of the cost's
_COST = (5, 10, 20, 50, 100, 200, 500, 1000)
_OTHER_SIDE_M = 1.0  # two places that are farther apart than this are on two sides
Row = dict[str, Any]


def zones(n: int) -> Iterator[tuple[str, Callable[[], Row]]]:
    """Yield what is to be done for the comparison with one fit."""
    for preset in ("lane-closure", "straight"):
        for k in range(n):
            yield f"zone {preset} {k}", partial(_zone, preset, _FIRST_SEED + k)


def _zone(preset: str, seed: int) -> Row:
    scenes = _one_after_another(
        simulate_zone(PRESETS[preset], seed=seed, lanes_m=_LANES_M[:_TOGETHER])
    )
    kept, two = _kept(scenes), _kept(scenes[:2])
    together = reconstruct(scenes)
    apart_m, ratio = _compared(kept, together)
    return {
        "kind": "zone",
        "set": preset,
        "apart_m": apart_m,
        "sigma_ratio": ratio,
        "cones": len(apart_m),
        "other_side": sum(distance > _OTHER_SIDE_M for distance in apart_m),
        "error_kept_m": _errors_m(kept, scenes[-1]),
        "error_together_m": _errors_m(together, scenes[-1]),
        "covered_kept": _covered(kept, scenes[-1]),
        "covered_two": _covered(two, scenes[1]),
        "covered_together": _covered(together, scenes[-1]),
    }


def days(n: int) -> Iterator[tuple[str, Callable[[], Row]]]:
    """Yield what is to be done for the simulated days."""
    for k in range(n):
        yield f"day {k}", partial(_day, _FIRST_SEED + k)


def _day(seed: int) -> Row:
    """Return after how many drives each change was noticed, and what was noticed wrongly."""
    day = simulate_day(PRESETS["lane-closure"], seed)
    noticed: dict[str, int | None] = {}
    suspected = wrong = cone_passes = left_out = lying_left_out = 0
    changed = {change.anchor_id: change for change in day.changes}
    with tempfile.TemporaryDirectory() as folder:
        zone = Zone.create(Path(folder) / "zone", frame=day.scenes[0].frame)
        for k, scene in enumerate(day.scenes):
            zone.add(scene)
            if zone.drives[-1].left_out:
                left_out += 1
                lying_left_out += scene.vehicle == LYING_VEHICLE
            cones = zone.cones()
            for name, cone in cones.items():
                cone_passes += 1
                change = changed.get(name)
                if change is None or k < change.drive:
                    suspected += cone.state is ConeState.MAYBE_MOVED
                    wrong += cone.state in (ConeState.SILENT, ConeState.GONE)
                    wrong += len(cone.stays) > 1 and k == len(day.scenes) - 1
            for change in day.changes:
                if change.kind not in noticed and k >= change.drive and _sees(cones, change):
                    passes = day.scenes[change.drive : k + 1]
                    noticed[change.kind] = sum(s.vehicle != LYING_VEHICLE for s in passes)
        result = zone.result()
    return {
        "kind": "day",
        "noticed": {change.kind: noticed.get(change.kind) for change in day.changes},
        "suspected": int(suspected),
        "wrong": int(wrong),
        "cone_passes": cone_passes,
        "lying": sum(scene.vehicle == LYING_VEHICLE for scene in day.scenes),
        "lying_left_out": int(lying_left_out),
        "others_left_out": int(left_out - lying_left_out),
        "error_kept_m": _errors_m(result, day.scenes[-1]),
        "covered_kept": _covered(result, day.scenes[-1]),
    }


def _sees(cones: Mapping[str, Any], change: Change) -> bool:
    """Tell whether a zone knows of a change."""
    cone = cones.get(change.anchor_id)
    if cone is None:
        return False
    if change.kind == "moved":
        return len(cone.stays) > 1 or cone.state is ConeState.MAYBE_MOVED
    if change.kind == "removed":
        return cone.state in (ConeState.SILENT, ConeState.GONE)
    return True


def cost(drives: int) -> Iterator[tuple[str, Callable[[], Row]]]:
    """Yield what is to be done for the cost of a drive."""
    yield f"cost {drives}", partial(_cost, drives)


def _cost(drives: int) -> Row:
    """Return the time that folding takes, as the median of five drives around each number."""
    lanes_m = [_LANES_M[k % len(_LANES_M)] for k in range(drives)]
    scenes = simulate_zone(PRESETS["lane-closure"], seed=_FIRST_SEED, lanes_m=lanes_m)
    scenes = _one_after_another(scenes)
    times_s, covered = [], {}
    with tempfile.TemporaryDirectory() as folder:
        zone = Zone.create(Path(folder) / "zone", frame=scenes[0].frame)
        for k, scene in enumerate(scenes):
            start_s = time.perf_counter()
            zone.add(scene)
            times_s.append(time.perf_counter() - start_s)
            if k + 1 in _COVERED or k + 1 == drives:
                covered[str(k + 1)] = _covered(zone.result(), scene)
        counts = vars(zone.counts)
    around = {
        str(k): float(np.median(times_s[max(k - 3, 5) : k + 2]))
        for k in (*_COST, drives)
        if k <= drives
    }
    return {"kind": "cost", "drives": drives, "times_s": around, "covered": covered, **counts}


def _one_after_another(scenes: Sequence[Scene]) -> list[Scene]:
    """Return drives that were recorded ten minutes apart."""
    later = []
    for k, scene in enumerate(scenes):
        path, log = scene.trajectory, scene.ranges
        path = replace(path, t_s=path.t_s + 600.0 * k)
        later.append(replace(scene, trajectory=path, ranges=replace(log, t_s=log.t_s + 600.0 * k)))
    return later


def _kept(scenes: Sequence[Scene]) -> Reconstruction:
    with tempfile.TemporaryDirectory() as folder:
        zone = Zone.create(Path(folder) / "zone", frame=scenes[0].frame)
        for scene in scenes:
            zone.add(scene)
        return zone.result()


def _compared(kept: Reconstruction, together: Reconstruction) -> tuple[list[float], list[float]]:
    """Return how far apart both put each cone, and the ratio of their 90 % semi-axes."""
    others = {fix.anchor_id: fix for fix in together.anchors}
    apart_m, ratio = [], []
    for fix in kept.anchors:
        other = others[fix.anchor_id]
        apart_m.append(float(np.hypot(*(fix.position_m - other.position_m))))
        ratio.append(fix.semi_axes_90_m[0] / other.semi_axes_90_m[0])
    return apart_m, ratio


def _off_m(result: Reconstruction, last: Scene) -> list[Float64[Array, "2"]]:
    """Return how far each cone is from the truth after the last drive."""
    truth = last.truth
    if truth is None:
        raise ValueError(f"{last.name}: has no truth")
    true_m = dict(zip(last.anchor_ids, truth.anchor_m, strict=True))
    return [fix.position_m - true_m[fix.anchor_id] for fix in result.anchors]


def _errors_m(result: Reconstruction, last: Scene) -> list[float]:
    return [float(np.hypot(*off_m)) for off_m in _off_m(result, last)]


def _covered(result: Reconstruction, last: Scene) -> list[bool]:
    off_m = np.array(_off_m(result, last))
    spread_m2 = np.array([fix.covariance_m2 for fix in result.anchors])
    return [bool(each) for each in in_ellipse_90(off_m, spread_m2)]


def done_before(path: Path) -> dict[str, Row]:
    """Return what an earlier run has done, by name."""
    if not path.is_file():
        return {}
    rows = [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()]
    return {row["name"]: row for row in rows}


def page(rows: Sequence[Row], command: str) -> str:
    """Return the tables as a page."""
    parts = [
        "# A kept zone, in numbers",
        f"Written by `{command}`; not edited by hand. Simulated zones, seeds from "
        f"{_FIRST_SEED}; the method was developed on others. Covered are cones whose 90 % ellipse "
        "holds the truth.",
    ]
    of = {kind: [row for row in rows if row["kind"] == kind] for kind in ("cost", "zone", "day")}
    if of["cost"]:
        parts += ["## What a drive costs", *_cost_words(of["cost"][-1])]
    if of["zone"]:
        parts += ["## Beside one fit of all drives", *_zone_words(of["zone"])]
    if of["day"]:
        parts += ["## What is noticed in a day", *_day_words(of["day"])]
    return "\n\n".join(parts) + "\n"


def _cost_words(row: Row) -> Iterator[str]:
    yield (
        "One zone of 8 cones on one core: preparing a log, folding it in and writing the folder, "
        "as the median of five drives in a row."
    )
    times_s = row["times_s"]
    yield _table(
        ["drives in the zone", "a drive takes (s)", "times the 5th"],
        [[k, f"{own_s:.2f}", f"{own_s / times_s['5']:.2f}"] for k, own_s in times_s.items()],
    )
    shares = ", ".join(f"{np.mean(each):.0%} after {k}" for k, each in row["covered"].items())
    yield (
        f"Sums were formed anew {row['resummed']} times, and {row['refolded']} blocks taken anew. "
        f"Covered, of the 8 cones: {shares} drives."
    )


def _zone_words(rows: Sequence[Row]) -> Iterator[str]:
    yield (
        f"Zones of 8 cones with {_TOGETHER} drives in two lanes, folded in one by one and "
        "reconstructed together. `reconstruct` ends when its steps are a tenth of its errors; what "
        "all cones share converges slowly, so that its places are off its own optimum by "
        "centimetres, and most of the distance between both columns of places is that."
    )
    table = []
    for name in dict.fromkeys(row["set"] for row in rows):
        own = [row for row in rows if row["set"] == name]
        all_of = {
            key: np.concatenate([row[key] for row in own])
            for key, values in own[0].items()
            if isinstance(values, list)
        }
        error_m = [np.mean(all_of[f"error_{which}_m"]) for which in ("kept", "together")]
        covered = [np.mean(all_of[f"covered_{which}"]) for which in ("two", "kept", "together")]
        table.append(
            [
                f"`{name}`",
                str(len(own)),
                f"{1e3 * np.median(all_of['apart_m']):.0f}",
                f"{np.median(all_of['sigma_ratio']):.3f}",
                str(sum(row["other_side"] for row in own)),
                " / ".join(f"{each:.3f}" for each in error_m),
                " / ".join(f"{each:.1%}" for each in covered),
            ]
        )
    yield _table(
        [
            "zones",
            "n",
            "apart, median (mm)",
            "ratio of semi-axes, median",
            "cones on another side",
            "mean error, kept / together (m)",
            "covered, after 2 drives / kept / together",
        ],
        table,
    )


def _day_words(rows: Sequence[Row]) -> Iterator[str]:
    yield (
        f"{len(rows)} days of 60 drives past 8 cones by six vehicles (`simulate_day`): one cone "
        "moved by 1 m, one removed, one added. One vehicle's clock is 0.4 s off; another one's "
        "positions are off by 2 m, and its drives do not count. *Moved* is told when the zone "
        "suspects it."
    )
    table = []
    for kind in ("moved", "removed", "added"):
        after = [row["noticed"][kind] for row in rows]
        within = [sum(each is not None and each <= most for each in after) for most in (1, 2, 3)]
        table.append([kind, *(f"{count / len(rows):.1%}" for count in within)])
    yield _table(["change", "told at the first drive", "within 2", "within 3"], table)
    suspected, wrong, passes = (
        sum(row[key] for row in rows) for key in ("suspected", "wrong", "cone_passes")
    )
    lying, out = (sum(row[key] for row in rows) for key in ("lying", "lying_left_out"))
    others = sum(row["others_left_out"] for row in rows)
    covered = np.mean(np.concatenate([row["covered_kept"] for row in rows]))
    error_m = np.mean(np.concatenate([row["error_kept_m"] for row in rows]))
    yield (
        f"False alarms in {passes} cone-passes: {suspected} suspicions of cones that were not "
        f"moved, and {wrong} such cones that were called silent or given another stay. Of {lying} "
        f"drives with wrong positions, {out} were left out, and "
        f"{others} others. At the end of the day, cones stand {error_m:.3f} m from the truth in "
        f"the mean, and {covered:.1%} of the 90 % ellipses hold it."
    )


def _table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def main() -> None:
    """Do what is not done yet, and print or write the page."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("--n", type=int, default=100, help="zones of each preset, and days")
    parser.add_argument("--drives", type=int, default=1000, help="of the cost of a drive")
    parser.add_argument("--done", type=Path, default=Path("kept-zones.jsonl"), help="what is done")
    parser.add_argument("--table", type=Path, help="where to write the page")
    options = parser.parse_args()
    done = done_before(options.done)
    rows = []
    for name, work in (*cost(options.drives), *zones(options.n), *days(options.n)):
        if name not in done:
            done[name] = {"name": name, **work()}
            with options.done.open("a", encoding="utf-8") as file:
                file.write(json.dumps(done[name]) + "\n")
        rows.append(done[name])
    command = f"python benchmarks/quality/kept_zones.py --n {options.n} --drives {options.drives}"
    text = page(rows, command)
    if options.table is None:
        print(text)
    else:
        options.table.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
