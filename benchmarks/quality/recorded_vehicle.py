"""Three recorded tags as one vehicle: the public LIAS drives, each tag alone and all together.

The data set has the path of each of three tags on one trolley. Where the tags are on it follows
from their three paths, and the trolley's heading from two of them; where the anchors are, from
nothing.

    python benchmarks/quality/recorded_vehicle.py

The data are expected in ``../shared/data`` beside the repository, or in --data-dir.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

import _tally
from gaia_uwb import Scene, read, reconstruct
from gaia_uwb._shared import CHI_SQUARE_90
from gaia_uwb.scene import RangeLog, Tag, Trajectory, Truth

DATA_DIR = Path(__file__).parents[3] / "shared" / "data"
DRIVES, N_TAGS = ("fast", "mid"), 3
COLUMNS = (
    "drive", "tags", "verdict", "root mean square error (m)", "in their 90 % ellipse",
    "processor (s)",
)  # fmt: skip


def one_vehicle(scenes: list[Scene]) -> Scene:
    """Return the logs of all tags as the log of one vehicle, which stands in their middle."""
    first = scenes[0]
    t_s = first.trajectory.t_s
    paths_m = [
        np.stack([np.interp(t_s, s.trajectory.t_s, x) for x in s.trajectory.position_m.T], axis=1)
        for s in scenes
    ]
    middle_m = np.mean(paths_m, axis=0)
    ahead_m = paths_m[1] - paths_m[0]
    heading_rad = np.unwrap(np.arctan2(ahead_m[:, 1], ahead_m[:, 0]))
    forward = np.stack([np.cos(heading_rad), np.sin(heading_rad)], axis=1)
    left = np.stack([-forward[:, 1], forward[:, 0]], axis=1)
    tags = [
        Tag(
            str(k),
            forward_m=float(np.median(((path_m - middle_m) * forward).sum(axis=1))),
            left_m=float(np.median(((path_m - middle_m) * left).sum(axis=1))),
            own_clock=True,
        )
        for k, path_m in enumerate(paths_m)
    ]
    stamp_s, anchor, range_m = (
        np.concatenate([getattr(s.ranges, name) for s in scenes])
        for name in ("t_s", "anchor", "range_m")
    )
    tag = np.concatenate([np.full(len(s.ranges), k) for k, s in enumerate(scenes)])
    order = np.argsort(stamp_s, kind="stable")
    log = RangeLog(stamp_s[order], anchor[order], range_m[order], tag=tag[order])
    path = Trajectory(t_s, middle_m, first.trajectory.up_m, heading_rad=heading_rad)
    truth = None if first.truth is None else Truth(anchor_m=first.truth.anchor_m)
    return replace(first, trajectory=path, ranges=log, tags=tuple(tags), truth=truth)


def cells(drive: str, tags: str, scene: Scene) -> tuple[str, ...]:
    """Return the cells of :data:`COLUMNS` of a log."""
    start_s = time.process_time()
    result = reconstruct(scene)
    took_s = time.process_time() - start_s
    if scene.truth is None:
        raise SystemExit(f"{scene.name}: its anchors were not surveyed")
    off_m = np.stack([fix.position_m for fix in result.anchors]) - scene.truth.anchor_m
    covariance_m2 = np.stack([fix.covariance_m2 for fix in result.anchors])
    scaled = np.linalg.solve(covariance_m2, off_m[..., None])[..., 0]
    inside = int(((off_m * scaled).sum(axis=1) <= CHI_SQUARE_90).sum())
    rms_m = float(np.sqrt((off_m**2).sum(axis=1).mean()))
    held = f"{inside} of {len(off_m)}"
    return drive, tags, result.status.value, f"{rms_m:.3f}", held, f"{took_s:.1f}"


def rows(data_dir: Path) -> Iterator[tuple[str, ...]]:
    """Yield the rows of the table."""
    for drive in DRIVES:
        scenes = [read(data_dir / "lias" / f"{drive}_tag{k}") for k in range(N_TAGS)]
        for k, scene in enumerate(scenes):
            yield cells(drive, f"tag {k} alone", scene)
        yield cells(drive, f"all {N_TAGS}, one vehicle", one_vehicle(scenes))


def table(data_dir: Path = DATA_DIR) -> str | None:
    """Return the table in Markdown; None where the data are not here."""
    return _tally.table(COLUMNS, rows(data_dir)) if (data_dir / "lias").is_dir() else None


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--data-dir", type=Path, default=DATA_DIR)
    found = table(parser.parse_args().data_dir)
    print(found or "left out: the LIAS data are not here")


if __name__ == "__main__":
    main()
