"""Time the simulator: episodes of 64 steps x 12 anchors, with one process and with two.

    python benchmarks/speed/simulator.py [--episodes 10000] [--written 2000 8000 32000]

The rates are those of a wall clock, so nothing else should run; the processor time per episode of
all processes together says what a busy machine hides. "From the start" counts the start of the
processes, too. The memory is that of ``gaia simulate --as episodes`` with two workers, as the
largest that its processes ever held, for more and more episodes.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from itertools import islice
from pathlib import Path

from _measure import make_parser, write_json
from gaia_uwb.logs import read_episodes
from gaia_uwb.simulate import PRESETS, PassConfig, simulate_episodes

WARM_UP = 0.1  # of the episodes


def with_12_anchors(name: str) -> PassConfig:
    """Return a preset in which every episode has 64 steps and 12 anchors."""
    preset = PRESETS[name]
    closure = preset.closure.model_copy(update={"n_anchors": 12})
    vary = {key: span for key, span in preset.vary.items() if key != "closure.n_anchors"}
    return preset.model_copy(update={"closure": closure, "vary": vary})


def measure_rate(name: str, workers: int, n: int) -> Iterator[tuple[str, float]]:
    """Return episodes a second, sustained and from the start, and processor time per episode."""
    start, processor_s = time.perf_counter(), sum(os.times()[:4])
    episodes = simulate_episodes(with_12_anchors(name), n, 0, workers=workers)
    for _ in islice(episodes, int(WARM_UP * n)):
        pass
    warm = time.perf_counter()
    count = sum(1 for _ in episodes)
    end = time.perf_counter()
    processor_s = sum(os.times()[:4]) - processor_s
    what = f"{name}, {workers} worker{'s' if workers > 1 else ''}"
    yield f"{what}: episodes/s", count / (end - warm)
    yield f"{what}: episodes/s from the start", n / (end - start)
    yield f"{what}: ms of processor time per episode", 1e3 * processor_s / n


def measure_writing(n: int) -> Iterator[tuple[str, float]]:
    """Return episodes a second written and read, and the largest memory of parent and workers."""
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place) / "episodes"
        start = time.perf_counter()
        options = (
            f"simulate --preset stress --episodes {n} --as episodes --workers 2 --out {folder}"
        )
        command = [sys.executable, "-m", "gaia_uwb", *options.split()]
        with subprocess.Popen(command, stdout=subprocess.DEVNULL) as process:
            peaks_mb: dict[int, float] = {}
            while process.poll() is None:
                for pid in family(process.pid):
                    peaks_mb[pid] = max(peak_mb(pid), peaks_mb.get(pid, 0.0))
                time.sleep(0.1)
        written = time.perf_counter()
        count = sum(1 for _ in read_episodes(folder))
        read = time.perf_counter()
    parent_mb = peaks_mb.pop(process.pid)
    yield f"{n} episodes written/s, with the start", n / (written - start)
    yield f"{n} episodes read/s", count / (read - written)
    yield f"{n} episodes: peak memory of the parent, MB", parent_mb
    yield f"{n} episodes: peak memory of a worker, MB", max(peaks_mb.values())


def family(pid: int) -> list[int]:
    """Return a process and its children (Linux)."""
    try:
        tasks = [task / "children" for task in Path(f"/proc/{pid}/task").iterdir()]
        return [pid, *(int(child) for task in tasks for child in task.read_text().split())]
    except OSError:
        return [pid]  # it has just ended


def peak_mb(pid: int) -> float:
    """Return the most memory that a process ever held (Linux); 0 if it has ended."""
    try:
        lines = Path(f"/proc/{pid}/status").read_text(encoding="ascii").splitlines()
    except OSError:
        return 0.0
    return sum(float(line.split()[1]) / 1e3 for line in lines if line.startswith("VmHWM"))


def main() -> None:
    """Run the benchmark."""
    parser = make_parser(__doc__, __file__)
    parser.add_argument("--episodes", type=int, default=10_000, help="of which the rate is taken")
    parser.add_argument("--written", type=int, nargs="+", default=[2000, 8000, 32_000])
    given = parser.parse_args()
    result: dict[str, float] = {"load before": os.getloadavg()[0]}
    for name in ("stress", "wild"):
        for workers in (1, 2):
            result |= measure_rate(name, workers, given.episodes)
    for n in given.written:
        result |= measure_writing(n)
    result["load at the end"] = os.getloadavg()[0]
    for what, value in result.items():
        print(f"{what:<60}{value:>10.2f}")
    write_json(result, given.out)


if __name__ == "__main__":
    main()
