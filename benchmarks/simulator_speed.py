"""Time the simulator: episodes of 64 steps x 12 anchors, with one process and with two.

Run ``python benchmarks/simulator_speed.py``; a table is printed and kept in ``benchmarks/out/``.
The times are those of a wall clock, so nothing else should run. Starting the processes is left out.
"""

from __future__ import annotations

import json
import os
import resource
import tempfile
import time
from itertools import islice
from pathlib import Path

from gaia_uwb.datasets.episodes import read_episodes, write_episodes
from gaia_uwb.simulate import PRESETS, PassConfig, simulate_episodes

OUT = Path(__file__).parent / "out"
EPISODES, WARM_UP, WRITTEN, MUCH_WRITTEN = 4000, 400, 2000, 8000


def with_12_anchors(name: str) -> PassConfig:
    """Return a preset in which every episode has 64 steps and 12 anchors."""
    preset = PRESETS[name]
    closure = preset.closure.model_copy(update={"n_anchors": 12})
    vary = {key: span for key, span in preset.vary.items() if key != "closure.n_anchors"}
    return preset.model_copy(update={"closure": closure, "vary": vary})


def rate(config: PassConfig, workers: int) -> tuple[float, float]:
    """Return episodes a second, and processor time per episode in milliseconds."""
    episodes = simulate_episodes(config, EPISODES, 0, workers=workers)
    for _ in islice(episodes, WARM_UP):
        pass
    start, processor = time.perf_counter(), time.process_time()
    count = sum(1 for _ in episodes)
    wall_s, processor_s = time.perf_counter() - start, time.process_time() - processor
    return count / wall_s, 1e3 * processor_s / count


def write(config: PassConfig, n: int) -> tuple[float, float, float]:
    """Return episodes a second written and read, and the memory's high-water mark in MB."""
    with tempfile.TemporaryDirectory() as place:
        start = time.perf_counter()
        for _ in write_episodes(simulate_episodes(config, n, 0, workers=2), Path(place)):
            pass
        written = time.perf_counter()
        count = sum(1 for _ in read_episodes(Path(place)))
        read = time.perf_counter()
    peak_mb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3
    return n / (written - start), count / (read - written), peak_mb


def main() -> None:
    """Run the benchmark."""
    result: dict[str, float] = {}
    for name in ("stress", "wild"):
        config = with_12_anchors(name)
        for workers in (1, 2):
            result[f"{name}, {workers} processes: episodes/s"], cost_ms = rate(config, workers)
            if workers == 1:
                result[f"{name}: ms of processor time per episode"] = cost_ms
    for n in (WRITTEN, MUCH_WRITTEN):
        written, read, peak_mb = write(with_12_anchors("stress"), n)
        result[f"{n} episodes written/s"] = written
        result[f"{n} episodes read/s"] = read
        result[f"{n} episodes: memory high-water mark, MB"] = peak_mb
    result["load before and during"] = os.getloadavg()[0]
    for what, value in result.items():
        print(f"{what:<50}{value:>10.2f}")
    OUT.mkdir(exist_ok=True)
    (OUT / "simulator_speed.json").write_text(json.dumps(result, indent=2) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
