"""Which limit detects a mistaken layout best: a comparison on validation windows.

    gaia reproduce all --out OUT
    python benchmarks/quality/mistaken_layouts.py OUT/models

A window that GAIA corrects farther than the limit gets a running median. The limit is a multiple of
a quantile of what the training windows need (``plausible_correction.py``). Each model is scored
on its own validation windows, which are neither in its training nor in any test. The output is the
mean squared range error in m² and the number of windows that got the median.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from gaia_uwb.api import load_scenes
from gaia_uwb.denoised import DenoisedRanges
from gaia_uwb.denoisers import WindowNetwork, make_denoiser
from gaia_uwb.episode import Episode
from gaia_uwb.learn import (
    WindowSetOptions,
    WindowSets,
    logged_sets,
    n_folds,
    prepare_runs,
    simulated_sets,
)
from gaia_uwb.models import largest_median_correction_m, needed_corrections_m

SHARES, TIMES = (0.98, 0.99, 0.995, 0.999, 1.0), (1.0, 1.25, 1.5, 2.0)


def main() -> None:
    """Compare and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("models", type=Path)
    parser.add_argument("--data-dir", type=Path)
    given = parser.parse_args()
    errors = {}
    for name, folds in all_folds(given.models, given.data_dir):
        looks = [look(folder, sets) for folder, sets in folds]
        rows = [[outcome(looks, share, times) for times in TIMES] for share in SHARES]
        print(f"{name}: never {outcome(looks, np.inf, 1.0)[0]:.4f}")
        for share, row in zip(SHARES, rows, strict=True):
            cells = (f"x{t:g}: {e:.4f} ({n})" for t, (e, n) in zip(TIMES, row, strict=True))
            print(f"  {share:.1%}  {'  '.join(cells)}")
        errors[name] = np.array([[error for error, _ in row] for row in rows])
    worse = np.exp(np.mean([np.log(e / e.min()) for e in errors.values()], axis=0))
    share, times = np.unravel_index(worse.argmin(), worse.shape)
    print("error relative to the best of each data set, geometric mean:")
    for quantile, row in zip(SHARES, worse, strict=True):
        texts = (f"x{t:g}: {w:.3f}" for t, w in zip(TIMES, row, strict=True))
        print(f"  {quantile:.1%}  {'  '.join(texts)}")
    print(f"least: {SHARES[share]:.1%} x {TIMES[times]:g}")


def all_folds(
    models: Path, data_dir: Path | None
) -> Iterator[tuple[str, list[tuple[Path, WindowSets]]]]:
    """Yield the models of each kind of data with the sets that they were trained on."""
    stress = simulated_sets("stress", WindowSetOptions())
    yield "stress", [(folder, stress) for folder in sorted(models.glob("gaia-seed*"))]
    scenes = load_scenes("outdoor-uwb", data_dir=data_dir)
    for preparation in ("published", "aligned"):
        options = WindowSetOptions(preparation=preparation)
        runs = prepare_runs(scenes, options)
        for split in ("window", "run"):
            folds = range(n_folds(split, runs))
            yield (
                f"{preparation}, {split}",
                [
                    (
                        models / f"{preparation}-{split}-{k}" / "gaia-seed0",
                        logged_sets(runs, "outdoor-uwb", f"{split}/{k}", options),
                    )
                    for k in folds
                ],
            )


def look(folder: Path, sets: WindowSets) -> dict[str, np.ndarray]:
    """Return what network and median make of validation windows, and what training windows need."""
    denoiser = make_denoiser(f"gaia:{folder}")
    assert isinstance(denoiser, WindowNetwork)
    denoiser.description = denoiser.description.model_copy(update={"plausible_correction_m": None})
    blind = [episode.without_truth() for episode in sets.validation]
    network, median = denoiser(blind), make_denoiser("median")(blind)
    moved_m = [
        largest_median_correction_m(ranges.range_m - episode.range_m, episode.valid)
        for ranges, episode in zip(network, blind, strict=True)
    ]
    return {
        "network": squared_errors(network, sets.validation),
        "median": squared_errors(median, sets.validation),
        "moved_m": np.array(moved_m),
        "needed_m": needed_corrections_m(sets.training),
    }


def squared_errors(found: list[DenoisedRanges], episodes: tuple[Episode, ...]) -> np.ndarray:
    """Return the mean squared range error of each window that has ranges, in m²; else NaN."""
    errors = []
    for ranges, episode in zip(found, episodes, strict=True):
        assert episode.truth is not None
        there = episode.valid & ranges.valid
        off_m = (ranges.range_m - episode.truth.range_m)[there]
        errors.append(np.mean(off_m**2) if there.any() else np.nan)
    return np.array(errors)


def outcome(looks: list[dict[str, np.ndarray]], share: float, times: float) -> tuple[float, int]:
    """Return the error under a limit, and how many windows were given to the median."""
    errors, count = [], 0
    for own in looks:
        limit_m = np.inf if share > 1 else times * np.quantile(own["needed_m"], share)
        mistaken = own["moved_m"] > limit_m
        errors.append(np.where(mistaken, own["median"], own["network"]))
        count += int(mistaken.sum())
    return float(np.nanmean(np.concatenate(errors))), count


if __name__ == "__main__":
    main()
