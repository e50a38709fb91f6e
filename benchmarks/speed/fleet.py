"""Many passes over many zones: throughput of one process and of two, and the same files.

    python benchmarks/speed/fleet.py [--zones 50] [--passes 20] [--workers 2]

Numerical libraries get one thread each in both, so that two processes are two processors.
"""

from __future__ import annotations

import hashlib
import tempfile
import time
from pathlib import Path

import numpy as np

from _measure import make_parser, write_json
from gaia_uwb.config import PipelineConfig
from gaia_uwb.fleet import find_zones, reconstruct_fleet, write_tables
from gaia_uwb.logs import write_native
from gaia_uwb.simulate import PRESETS, simulate_zone


def digest(folder: Path) -> str:
    """Return what names all files of a folder, byte for byte."""
    found = hashlib.sha256()
    for path in sorted(folder.rglob("*")):
        if path.is_file():
            found.update(str(path.relative_to(folder)).encode() + path.read_bytes())
    return found.hexdigest()


def main() -> None:
    """Print the times and whether the files are the same."""
    parser = make_parser(__doc__, __file__)
    parser.add_argument("--zones", type=int, default=50)
    parser.add_argument("--passes", type=int, default=20)
    parser.add_argument("--workers", type=int, default=2)
    arguments = parser.parse_args()
    lanes = np.tile([0.0, 3.6], arguments.passes)[: arguments.passes].tolist()
    passes = arguments.zones * arguments.passes
    with tempfile.TemporaryDirectory() as place:
        logs, times, digests = Path(place) / "logs", [], []
        for zone in range(arguments.zones):
            for scene in simulate_zone(PRESETS["straight"], 0, lanes_m=lanes, zone=zone):
                write_native(scene, logs / f"zone-{zone:03d}" / scene.name, file_format="parquet")
        zones = find_zones(logs)
        for workers in (1, arguments.workers):
            out = Path(place) / f"out-{workers}"
            out.mkdir()
            start = time.perf_counter()
            write_tables(
                list(reconstruct_fleet(zones, out, PipelineConfig(), workers=workers)), out
            )
            times.append(time.perf_counter() - start)
            digests.append(digest(out))
            print(f"{workers} workers: {passes} passes in {times[-1]:.1f} s")
    same = digests[0] == digests[1]
    print(f"{times[0] / times[1]:.2f} x one worker; same files: {same}")
    rows = {"passes": passes, "one_worker_s": times[0], "workers_s": times[1], "same_files": same}
    write_json(rows | {"workers": arguments.workers}, arguments.out)


if __name__ == "__main__":
    main()
