"""Scores gaia-set on unseen zones and writes docs/gaia-set-results.md.

    gaia train gaia --data sim:wild --out out/wild-gaia          # the paper's network, same data
    gaia train gaia-set --data sim:mixed --seed 1 --out out/set1  # more seeds, where wanted
    python benchmarks/quality/zone_results.py --paper out/wild-gaia --model mixed --model out/set1

The outdoor UWB data set is expected in GAIA_DATA_DIR or the user's cache. Nothing here is tuned:
no training contains layouts of `wild-test` or `stress-test`, or any real range.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

import _tally
from gaia_uwb import __version__
from gaia_uwb._shared import replace_file
from gaia_uwb.api import load_scenes
from gaia_uwb.config import PipelineConfig, SidesConfig, SolverConfig
from gaia_uwb.episode import Episode
from gaia_uwb.estimate import AnchorFix
from gaia_uwb.evaluate import (
    STRESSORS,
    Metric,
    TestSet,
    aggregate,
    cramer_rao_m,
    make_test,
    score_method,
    stress,
    wrong_sides_probability,
)
from gaia_uwb.pipeline import prepare, reconstruct_episodes
from gaia_uwb.simulate import find_preset, simulate_zone
from gaia_uwb.zone import polygon_iou

PAGE = Path(__file__).parents[2] / "docs" / "gaia-set-results.md"
N_SIMULATED, STRESS_SEED = 500, 7
N_PASSES, PASS_S, PASS_SEED = 100, 60.0, 5000
OUR = PipelineConfig()
PAPER = PipelineConfig(solver=SolverConfig(kind="wls"), sides=SidesConfig(joint=False))
STRESSED = ("pose-kalman", "pose-mlp:stress", "gaia:stress")
COLUMNS = {
    "distance_mse_overall": "range MSE (m²)",
    "anchor_mae": "anchor error (m)",
    "polygon_iou": "IoU",
    "polygon_hausdorff": "Hausdorff (m)",
    "anchor_mae_right_side": "error given the right side (m)",
    "wrong_side_share": "wrong sides",
    "open_share": "sides called open",
    "region_coverage_90": "90 % region",
    "region_coverage_90_aligned": "90 % region, aligned",
}
BOUND_TITLES = {
    "median ratio to the bound": "median ratio of the error to the bound",
    "least share of wrong scenes": "lowest possible share of scenes with wrong sides",
    "scenes that ranges alone leave open": "share of scenes whose sides ranges alone leave open",
    "wrong sides in the other scenes": "share of wrong sides in the other scenes",
    "anchors in the other scenes": "number of anchors in the other scenes",
}
HEAD = """\
# gaia-set: results

Written by `python benchmarks/quality/zone_results.py`; not edited by hand.
[design-notes.md](design-notes.md) describes the model, what was tried and what limits it. The
numbers are means over episodes with 95 % bootstrap intervals. On real data the bootstrap draws
whole runs; with only eight, these intervals tend to be too short. `gaia-set` is trained on
simulation only; where several seeds are named, its rows are means over them. No row uses labels
unless it says "labels". Positions are `gaia-set`'s own or those of the robust solver. The
*90 % region* of an anchor is its 90 % ellipse. If the side is open (the mirror position keeps a
probability above 10 %), the region also includes the ellipse of the mirror position.
"""


ROBUSTNESS = """\
### Under more stress

Mean IoU on `stress-test` at every setting of every stressor of table 4. `gaia-set` uses all seeds,
its own positions and no labels. The others use the model inside the package and `wls` with the
true NLOS labels, as in table 4.
"""


def main() -> None:
    """Score, and write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--model", action="append", help="model of gaia-set; repeat for several")
    parser.add_argument("--paper", help="folder of the paper's GAIA, trained on sim:wild")
    parser.add_argument("--episodes", type=int, default=N_SIMULATED)
    parser.add_argument(
        "--passes", type=int, default=N_PASSES, help="number of whole passes of each kind"
    )
    parser.add_argument("--data-dir", type=Path)
    parser.add_argument("--out", type=Path, default=PAGE.parent)
    given = parser.parse_args()
    models = [f"gaia-set:{name}" for name in given.model or ["mixed"]]
    began = time.perf_counter()
    parts = [HEAD]
    results: dict[str, Any] = {}
    for preset in ("wild", "stress"):
        test = _tally.simulated(f"{preset}-test", given.episodes)
        rows = rows_of(test, models)
        if preset == "wild" and given.paper:
            rows["paper's GAIA, trained on wild"] = scored(test, [f"gaia:{given.paper}"], OUR)
            rows["the same, wls, labels"] = scored(test, [f"gaia:{given.paper}"], PAPER)
        if preset == "stress":
            rows["paper's GAIA, wls, labels"] = scored(test, ["gaia:stress"], PAPER)
        results[preset] = {name: summary(test, scores) for name, scores in rows.items()}
        parts += [f"## Simulated: `{preset}-test`, 64 steps\n", table(results[preset])]
        results[f"{preset} bounds"] = bounds(test.episodes, models)
        parts.append(bounds_text(results[f"{preset} bounds"]))
        results[f"{preset} seeds"] = by_seed(test, rows["gaia-set"], models)
        parts += ["### Seed by seed\n", seeds_text(results[f"{preset} seeds"])]
        if preset == "stress":
            results["robustness"] = robustness(test, models)
            parts += [ROBUSTNESS, robustness_text(results["robustness"])]
    for name, test in whole_passes(given.passes):
        rows = rows_of(test, models)
        results[name] = {method: summary(test, scores) for method, scores in rows.items()}
        parts += [f"## Simulated: {name}, n = {len(test.episodes)}\n", table(results[name])]
    scenes = load_scenes("outdoor-uwb", data_dir=given.data_dir)
    for length, name in (
        (64, "windows of 64 steps"),
        (256, "windows of 256 steps"),
        (None, "runs"),
    ):
        test = make_test(scenes, length, OUR)
        rows = rows_of(test, models)
        results[name] = {method: summary(test, scores) for method, scores in rows.items()}
        parts += [f"## Real: {name}, n = {len(test.episodes)}\n", table(results[name])]
        if length == 64:
            results["layouts"] = by_layout(test, rows)
            parts += ["### Layout by layout: IoU\n", layouts_text(results["layouts"])]
    seconds = time.perf_counter() - began
    parts.append(
        f"Models: {', '.join(models)}; gaia {__version__}; {seconds:.0f} s on two cores.\n"
    )
    given.out.mkdir(parents=True, exist_ok=True)
    replace_file(given.out / PAGE.name, "\n".join(parts))
    replace_file(given.out / "gaia-set-results.json", json.dumps(results, indent=2) + "\n")


Scores = list[list[dict[str, Metric]]]


def scored(test: TestSet, methods: Sequence[str], config: PipelineConfig) -> Scores:
    """Return each model's scores, episode by episode; with the wls solver, with labels."""
    labels = config.solver.kind == "wls"
    return [
        list(score_method(test, method, config, true_nlos_labels=labels).per_episode)
        for method in methods
    ]


def rows_of(test: TestSet, models: Sequence[str]) -> dict[str, Scores]:
    """Score the classical methods and ours."""
    rows = {name: scored(test, [name], OUR) for name in ("raw", "median", "pose-kalman")}
    return rows | {"gaia-set": scored(test, models, OUR)}


def summary(test: TestSet, scores: Scores) -> dict[str, Any]:
    """Return means and intervals over the episodes of all seeds."""
    found = aggregate([m for one in scores for m in one], test.groups * len(scores))
    return {
        name: {"value": found[name].value, "ci95": found[name].ci95, "n": found[name].n}
        for name in COLUMNS
        if name in found
    }


def whole_passes(n: int) -> Iterator[tuple[str, TestSet]]:
    """Yield passes of a minute, from log to episode as a user's would be."""
    wild = find_preset("wild-test")
    minute = wild.drive.model_copy(update={"duration_s": PASS_S})
    for name, config in (
        ("whole passes of `wild-test`, 60 s", wild.model_copy(update={"drive": minute})),
        ("whole passes of `lane-closure`, 60 s", find_preset("lane-closure")),
    ):
        episodes = tuple(prepare(simulate_zone(config, PASS_SEED + k)[0], OUR) for k in range(n))
        yield name, TestSet(episodes, tuple(episode.name for episode in episodes), 0)


def robustness(test: TestSet, models: Sequence[str]) -> list[dict[str, Any]]:
    """Return every method's mean IoU at every setting of every stressor."""
    rows = []
    for stressor in STRESSORS:
        for setting in stressor.settings:
            episodes = tuple(stress(test.episodes, stressor, setting, STRESS_SEED))
            worse = replace(test, episodes=episodes)
            found = {"gaia-set": scored(worse, models, OUR)}
            found |= {name: scored(worse, [name], PAPER) for name in STRESSED}
            iou = {
                name: np.mean([[m["polygon_iou"].value for m in one] for one in scores])
                for name, scores in found.items()
            }
            rows.append(
                {"stressor": stressor.title, "setting": setting}
                | {name: float(value) for name, value in iou.items()}
            )
    return rows


def by_seed(test: TestSet, scores: Scores, models: Sequence[str]) -> dict[str, dict[str, float]]:
    """Return the means of each model by itself."""
    return {
        model: _tally.means(one, test.groups, COLUMNS)
        for model, one in zip(models, scores, strict=True)
    }


def bounds(episodes: Sequence[Episode], models: Sequence[str]) -> dict[str, float]:
    """Return how close the positions come to the Cramer-Rao bound, and how many sides are open."""
    wrong = np.array([wrong_sides_probability(episode) for episode in episodes])
    limits = [cramer_rao_m(episode) for episode in episodes]
    ratios, decidable_wrong, right_iou = [], [], []
    for model in models:
        results = reconstruct_episodes(episodes, OUR.model_copy(update={"denoiser": model}))
        for episode, found, doubt, limit_m in zip(episodes, results, wrong, limits, strict=True):
            assert episode.truth is not None
            right_iou.append(iou_on_right_sides(found.anchors, episode.truth.anchor_m))
            for n, fix in enumerate(found.anchors):
                if not fix.status.has_position or not np.isfinite(limit_m[n]):
                    continue
                own_m, mirror_m = (
                    float(np.hypot(*(place - episode.truth.anchor_m[n])))
                    for place in (fix.position_m, fix.mirror_position_m)
                )
                ratios.append(min(own_m, mirror_m) / limit_m[n])
                apart_m = float(np.hypot(*(fix.position_m - fix.mirror_position_m)))
                if doubt < 0.05 and apart_m > 0.5:
                    decidable_wrong.append(mirror_m < own_m)
    return {
        "median ratio to the bound": float(np.median(ratios)),
        "least share of wrong scenes": float(wrong.mean()),
        "scenes that ranges alone leave open": float((wrong >= 0.05).mean()),
        "wrong sides in the other scenes": float(np.mean(decidable_wrong))
        if decidable_wrong
        else float("nan"),
        "anchors in the other scenes": float(len(decidable_wrong)) / len(models),
        "IoU if an oracle chose every anchor's side": float(np.mean(right_iou)),
    }


def iou_on_right_sides(anchors: Sequence[AnchorFix], true_m: np.ndarray) -> float:
    """Return the IoU of the hull with each anchor at whichever of its two places is nearer."""
    both_m = np.array([[fix.position_m, fix.mirror_position_m] for fix in anchors])
    off_m = np.linalg.norm(both_m - true_m[:, None], axis=-1)
    nearer = np.nan_to_num(off_m, nan=np.inf).argmin(axis=1)
    return polygon_iou(both_m[np.arange(len(both_m)), nearer], true_m)


def by_layout(test: TestSet, rows: dict[str, Scores]) -> dict[str, dict[str, float]]:
    """Return each method's mean IoU on each layout."""
    layout = np.array([group.rpartition("/")[2] for group in test.groups])
    found: dict[str, dict[str, float]] = {}
    for method, scores in rows.items():
        iou = np.array([[m["polygon_iou"].value for m in one] for one in scores]).mean(axis=0)
        found[method] = {name: float(iou[layout == name].mean()) for name in sorted(set(layout))}
    return found


def table(rows: dict[str, Any]) -> str:
    """Return rows as Markdown."""
    return _tally.table(
        ["method", *COLUMNS.values()],
        ([method, *(cell(found.get(name)) for name in COLUMNS)] for method, found in rows.items()),
    )


def cell(metric: dict[str, Any] | None) -> str:
    """Return a value with its interval."""
    if metric is None:
        return "none"
    text = f"{metric['value']:.4g}"
    return text if metric["ci95"] is None else text + " [{:.3g}, {:.3g}]".format(*metric["ci95"])


def bounds_text(found: dict[str, float]) -> str:
    """Return the bounds in words."""
    titled = ((BOUND_TITLES.get(name, name), value) for name, value in found.items())
    return "".join(f"- {title}: {value:.3g}\n" for title, value in titled)


def seeds_text(found: dict[str, dict[str, float]]) -> str:
    """Return each model's means as Markdown."""
    return _tally.table(
        ["model", *COLUMNS.values()],
        ([k, *(f"{v[name]:.4g}" for name in COLUMNS)] for k, v in enumerate(found.values())),
    )


def robustness_text(rows: list[dict[str, Any]]) -> str:
    """Return the robustness table as Markdown."""
    names = ["gaia-set", *STRESSED]
    lines = []
    for row in rows:
        best = max(row[name] for name in names)
        cells = [f"**{row[n]:.3f}**" if row[n] == best else f"{row[n]:.3f}" for n in names]
        lines.append([row["stressor"], f"{row['setting']:g}", *cells])
    return _tally.table(["stressor", "setting", *names], lines)


def layouts_text(found: dict[str, dict[str, float]]) -> str:
    """Return the layouts' table as Markdown."""
    names = list(next(iter(found.values())))
    return _tally.table(
        ["method", *(f"case {name}" for name in names)],
        ([method, *(f"{v:.3f}" for v in values.values())] for method, values in found.items()),
    )


if __name__ == "__main__":
    main()
