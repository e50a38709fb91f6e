"""Time and memory to read an hour's log of 10 anchors: 36,000 fixes and 360,000 ranges at 10 Hz.

    python benchmarks/speed/bag_reading.py [--hours 1]   (needs the extra ros)

The budget is 10 s and 1 GiB per format.
"""

from __future__ import annotations

import json
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from _measure import make_parser, tests_module, write_json

FORMATS = ("bag", "mcap", "folder-sqlite3")
HOUR_S, HZ, ANCHORS, START_S = 3600, 10, 10, 1_700_000_000
BUDGET_S, BUDGET_GIB = 10.0, 1.0


def read(path: Path) -> None:
    """Read a log and print what it took."""
    from gaia_uwb.logs import read_described

    start, cpu = time.perf_counter(), time.process_time()
    scene = read_described(path)
    row = {
        "wall_s": time.perf_counter() - start,
        "cpu_s": time.process_time() - cpu,
        "peak_gib": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20,
        "n_fixes": len(scene.trajectory),
        "n_ranges": len(scene.ranges),
        "mib": sum(f.stat().st_size for f in [path, *path.glob("*")] if f.is_file()) / 2**20,
    }
    print(json.dumps(row))


def write(folder: Path, kind: str, hours: float) -> Path:
    """Write the log."""
    bags = tests_module("bags")
    log = bags.Log(folder, kind)
    for k in range(round(hours * HOUR_S * HZ)):
        t_s = START_S + k / HZ
        log.fix("/fix", t_s, 37.0 + k * 1e-7, 127.0 + (k / 1e4) ** 2 * 1e-5)
        for n in range(ANCHORS):
            fields = {"header": log.header(t_s), "anchor_id": f"A{n}", "rssi": -80.0}
            log.add("/uwb", bags.VENDOR, t_s, **fields, range=20.0 + n)
    path: Path = log.close()
    return path


def main() -> None:
    """Write and read each format, each in a process of its own."""
    parser = make_parser(__doc__, __file__)
    parser.add_argument("--hours", type=float, default=1.0)
    parser.add_argument("--read", type=Path, help="read this log and print what it took")
    given = parser.parse_args()
    if given.read is not None:
        read(given.read)
        return
    rows = {}
    for kind in FORMATS:
        with tempfile.TemporaryDirectory() as folder:
            path = write(Path(folder), kind, given.hours)
            command = [sys.executable, __file__, "--read", str(path)]
            done = subprocess.run(command, capture_output=True, text=True, check=True)
        row = rows[kind] = json.loads(done.stdout)
        within = row["wall_s"] < BUDGET_S and row["peak_gib"] < BUDGET_GIB
        print(
            f"{kind:16} {row['wall_s']:5.1f} s ({row['cpu_s']:.1f} s of processor), "
            f"{row['peak_gib']:.2f} GiB, {row['n_ranges']} ranges in {row['mib']:.0f} MiB: "
            f"{'within' if within else 'OVER'} {BUDGET_S:g} s and {BUDGET_GIB:g} GiB"
        )
    write_json(rows, given.out)


if __name__ == "__main__":
    main()
