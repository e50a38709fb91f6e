"""How fast trained denoisers are: windows of 64 steps x 12 anchors, and whole runs from the shell.

The network alone: ONNX Runtime (what a reconstruction uses) beside PyTorch, on the same features,
with all cores; then the whole denoiser, from episodes to episodes, and how soon the first window is
done in a new process.

The zone: gaia-set beside pose-kalman, denoising alone and with places, sides and boundary; then
``gaia reconstruct`` of a run of some minutes. Run it on a quiet machine.

    python benchmarks/speed/denoisers.py [--part network] [--part zone]
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
from collections.abc import Callable
from functools import partial
from pathlib import Path
from statistics import median

from _measure import command_seconds, make_parser, per_second, run_parts, stress_windows
from gaia_uwb.config import PipelineConfig
from gaia_uwb.denoisers import find_trained, make_denoiser
from gaia_uwb.models import WindowModel, make_window_inputs, read_weights
from gaia_uwb.pipeline import reconstruct_episodes

_FIRST = """
import time
start = time.perf_counter()
from gaia_uwb.denoisers.registry import make_denoiser
from gaia_uwb.simulate import PRESETS, simulate_episode
episode = simulate_episode(PRESETS["stress"], seed=0)
made = time.perf_counter()
make_denoiser("{name}")([episode])
print(time.perf_counter() - start, time.perf_counter() - made)
"""


def network(given: argparse.Namespace) -> dict[str, float]:
    """Print and return windows per second of one network, and the seconds to its first window."""
    import onnxruntime
    import torch

    from gaia_uwb.learn import make_network

    kind, _, model = given.model.partition(":")
    episodes = stress_windows(given.windows)
    folder, description = find_trained(kind, model, WindowModel)
    features = make_window_inputs(episodes, description.n_anchors, description.normalisation)
    session = onnxruntime.InferenceSession(
        str(folder / "model.onnx"), providers=["CPUExecutionProvider"]
    )
    inputs = features._asdict()
    in_torch = make_network(description.n_anchors, description.network).eval()
    weights = {k: torch.from_numpy(v) for k, v in read_weights(folder, description).items()}
    in_torch.load_state_dict(weights)
    tensors = [torch.from_numpy(part) for part in features]

    def in_pytorch() -> None:
        with torch.no_grad():
            in_torch(*tensors)

    denoiser = make_denoiser(given.model)
    jobs: dict[str, Callable[[], object]] = {
        "ONNX Runtime, the network alone": lambda: session.run(["predicted_distance"], inputs),
        "PyTorch, the network alone": in_pytorch,
        "the denoiser, from episodes to denoised ranges": lambda: denoiser(episodes),
    }
    print(
        f"{given.model}, {given.windows} windows of 64 x {description.n_anchors}, "
        f"{torch.get_num_threads()} threads"
    )
    rows = {}
    for name, job in jobs.items():
        rows[f"{name}: windows/s"] = rate = per_second(job, given.windows, given.rounds)
        print(f"  {name}: {rate:,.0f} windows/s")
    own_s, whole_s = first_window_s(given.model, given.rounds)
    print(f"  first window in a fresh process: {own_s:.2f} s to load the model and denoise,")
    print(f"  {whole_s:.2f} s with importing the package and simulating the window (medians)")
    return rows | {"first window: s": own_s, "first window, with imports: s": whole_s}


def first_window_s(model: str, rounds: int) -> tuple[float, float]:
    """Return how long the first window takes in a new process, without and with its imports."""
    command = [sys.executable, "-c", _FIRST.format(name=model)]
    times = []
    for _ in range(rounds):
        done = subprocess.run(command, capture_output=True, text=True, check=True)
        times.append([float(word) for word in done.stdout.split()])
    whole_s, own_s = (sorted(column)[len(times) // 2] for column in zip(*times, strict=True))
    return own_s, whole_s


def zone(given: argparse.Namespace) -> dict[str, dict[str, float]]:
    """Print and return windows per second up to the boundary, and the seconds of a whole run."""
    n = given.zone_windows
    episodes, rows = stress_windows(n), {}
    for name in ("pose-kalman", "gaia-set"):
        denoiser, settings = make_denoiser(name), PipelineConfig(denoiser=name)
        alone = per_second(partial(denoiser, episodes), n, given.rounds)
        whole = per_second(partial(reconstruct_episodes, episodes, settings), n, given.rounds)
        print(f"{name}: {alone:,.0f} windows/s denoised, {whole:,.0f} with places and sides")
        with tempfile.TemporaryDirectory() as place:
            command = ["reconstruct", given.source, "--denoiser", name]
            command += ["--out", str(Path(place) / "out")]
            seconds = median(command_seconds(command, given.rounds))
        print(f"  gaia reconstruct {given.source}: {seconds:.2f} s (median)")
        rows[name] = {
            "denoised: windows/s": alone,
            "with places and sides: windows/s": whole,
            f"gaia reconstruct {given.source}: s": seconds,
        }
    return rows


def main() -> None:
    """Measure and print."""
    parser = make_parser(__doc__, __file__)
    parser.add_argument("--model", default="gaia:stress", help="KIND:MODEL of the network alone")
    parser.add_argument("--windows", type=int, default=2048, help="for the network alone")
    parser.add_argument("--zone-windows", type=int, default=512)
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--source", default="outdoor-uwb:NLOS/B/4", help="a run of some minutes")
    run_parts(parser, {"network": network, "zone": zone})


if __name__ == "__main__":
    main()
