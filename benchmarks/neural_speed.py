"""How fast trained networks denoise windows of 64 steps x 12 anchors, and how soon the first.

Side by side in one run: ONNX Runtime (what a reconstruction uses) and PyTorch, on the same
features, with all cores; then the whole denoiser, from episodes to episodes. Run it on a quiet
machine.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
from collections.abc import Callable

from gaia_uwb.denoisers import make_denoiser
from gaia_uwb.models.checkpoint import find_model, read_description, read_weights
from gaia_uwb.models.window_inputs import make_features
from timing import per_second, stress_windows

_FIRST = """
import time
start = time.perf_counter()
from gaia_uwb.denoisers import make_denoiser
from gaia_uwb.simulate import PRESETS, simulate_episode
episode = simulate_episode(PRESETS["stress"], seed=0)
made = time.perf_counter()
make_denoiser("{name}")([episode])
print(time.perf_counter() - start, time.perf_counter() - made)
"""


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--model", default="gaia:stress", help="KIND:MODEL")
    parser.add_argument("--windows", type=int, default=2048)
    parser.add_argument("--rounds", type=int, default=5)
    chosen = parser.parse_args()
    kind, _, model = chosen.model.partition(":")

    import onnxruntime
    import torch

    from gaia_uwb.learn.networks import make_network

    episodes = stress_windows(chosen.windows)
    folder = find_model(kind, model)
    description = read_description(folder)
    features = make_features(episodes, description.n_anchors, description.normalisation)
    session = onnxruntime.InferenceSession(
        str(folder / "model.onnx"), providers=["CPUExecutionProvider"]
    )
    inputs = features._asdict()
    network = make_network(description.n_anchors, description.network).eval()
    weights = {k: torch.from_numpy(v) for k, v in read_weights(folder, description).items()}
    network.load_state_dict(weights)
    tensors = [torch.from_numpy(part) for part in features]

    def in_pytorch() -> None:
        with torch.no_grad():
            network(*tensors)

    denoiser = make_denoiser(chosen.model)
    jobs: dict[str, Callable[[], object]] = {
        "ONNX Runtime, the network alone": lambda: session.run(["predicted_distance"], inputs),
        "PyTorch, the network alone": in_pytorch,
        "the denoiser, from episodes to denoised ranges": lambda: denoiser(episodes),
    }
    print(
        f"{chosen.model}, {chosen.windows} windows of 64 x {description.n_anchors}, "
        f"{torch.get_num_threads()} threads"
    )
    for name, job in jobs.items():
        print(f"  {name}: {per_second(job, chosen.windows, chosen.rounds):,.0f} windows/s")
    command = [sys.executable, "-c", _FIRST.format(name=chosen.model)]
    times = []
    for _ in range(chosen.rounds):
        done = subprocess.run(command, capture_output=True, text=True, check=True)
        times.append([float(word) for word in done.stdout.split()])
    whole, own = (sorted(column)[len(times) // 2] for column in zip(*times, strict=True))
    print(f"  first window in a fresh process: {own:.2f} s to load the model and denoise,")
    print(f"  {whole:.2f} s with importing the package and simulating the window (medians)")


if __name__ == "__main__":
    main()
