"""The robustness table (the paper's table 4 and its figure): methods on data made worse.

The models are those of the stress table, not trained again ("zero-shot"); the geometry is fixed.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from gaia_uwb.config import PipelineConfig
from gaia_uwb.evaluate import Test, score_method
from gaia_uwb.method_tables import (
    TEST_SEED,
    Method,
    TableJob,
    paper_solver,
    stress_sets,
    trained_model,
)
from gaia_uwb.metrics import aggregate
from gaia_uwb.stressors import STRESSORS, Stressor, stress

if TYPE_CHECKING:
    from matplotlib.figure import Figure

METRICS = ("polygon_iou", "polygon_hausdorff", "anchor_mae", "distance_mse_overall")
BASELINES = ("kalman", "mlp", "pose-kalman", "pose-mlp")
"""The paper's; the margin is over the best of them."""

_COLOURS = {
    "raw": "#9A9A9A",
    "median": "#56B4E9",
    "kalman": "#E69F00",
    "pose-kalman": "#009E73",
    "mlp": "#CC79A7",
    "pose-mlp": "#0072B2",
    "gaia": "#D55E00",
}
_MARKS = dict(zip(_COLOURS, "xv^s<Do", strict=True))
_STRESS_SEED = 7

Rows = list[dict[str, Any]]


def robustness_table(
    methods: Sequence[Method],
    job: TableJob,
    *,
    stressors: Sequence[Stressor] = STRESSORS,
    each: Callable[[Sequence[tuple[Stressor, float]]], Any] = iter,
) -> dict[str, Any]:
    """Score methods at every setting of every stressor.

    Parameters
    ----------
    methods
        Those of the stress table.
    job
        Where the models are, and with which seeds.
    stressors
        What is done to the data.
    each
        Goes through stressors and settings; a progress bar may stand here.

    Returns
    -------
    dict
        Content of ``results.json``: a row per stressor, setting and method.
    """
    sets = stress_sets(job)
    models = job.folder.path / "models"
    names = {
        method.name: [method.name]
        if method.network is None
        else [trained_model(method, sets, seed, models, job) for seed in job.seeds]
        for method in methods
    }
    config = paper_solver(PipelineConfig())
    rows: Rows = []
    for stressor, setting in each([(s, value) for s in stressors for value in s.settings]):
        test = Test(stress(sets.test, stressor, setting, _STRESS_SEED), sets.test_groups, 0)
        for method, models_of in names.items():
            per_episode = [
                metrics
                for name in models_of
                for metrics in score_method(test, name, config, true_nlos_labels=True).per_episode
            ]
            found = aggregate(per_episode, test.groups * len(models_of))
            metrics = {name: asdict(found[name]) for name in METRICS if name in found}
            rows.append(
                {
                    "stressor": stressor.name,
                    "setting": setting,
                    "method": method,
                    "metrics": metrics,
                }
            )
    protocol = {
        "data": f"sim:stress-test/{TEST_SEED}/{len(sets.test)}",
        "solver": "wls, each anchor by itself",
        "true_nlos_labels": True,
        "training_seeds": list(job.seeds),
        "stress_seed": _STRESS_SEED,
        "trained_on": sets.description,
        "version": job.version,
    }
    return {"schema": 1, "protocol": protocol, "rows": rows}


def robustness_summary(results: dict[str, Any]) -> str:
    """Return the paper's summary as Markdown: GAIA's IoU at both ends, and its margin.

    Parameters
    ----------
    results
        Of :func:`robustness_table`, with the paper's methods.
    """
    lines = [
        "| stressor | GAIA's IoU, none | GAIA's IoU, most severe | best baseline there | margin |",
        "|---|---|---|---|---|",
    ]
    for stressor in _stressors(results["rows"]):
        mildest, worst = stressor.settings[0], stressor.settings[-1]
        iou = {
            method: _iou(results["rows"], stressor, worst, method)["value"]
            for method in (*BASELINES, "gaia")
        }
        best = max(BASELINES, key=lambda method: iou[method])
        base = _iou(results["rows"], stressor, mildest, "gaia")["value"]
        lines.append(
            f"| {stressor.title}: {mildest:g} to {worst:g} | {base:.3f} | {iou['gaia']:.3f} | "
            f"{iou[best]:.3f} ({best}) | {iou['gaia'] - iou[best]:+.3f} |"
        )
    return "\n".join(lines) + "\n"


def robustness_csv(results: dict[str, Any]) -> str:
    """Return all rows as CSV.

    Parameters
    ----------
    results
        Of :func:`robustness_table`.
    """
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(["stressor", "setting", "method", "metric", "value", "low", "high", "n"])
    for row in results["rows"]:
        for name, metric in row["metrics"].items():
            low, high = metric["ci95"] or ("", "")
            which = (row["stressor"], row["setting"], row["method"], name)
            writer.writerow([*which, metric["value"], low, high, metric["n"]])
    return out.getvalue()


def plot_robustness(results: dict[str, Any]) -> Figure:
    """Draw every method's IoU over the settings of every stressor, with its 95 % interval.

    Parameters
    ----------
    results
        Of :func:`robustness_table`.
    """
    from matplotlib.figure import Figure

    stressors = _stressors(results["rows"])
    columns = min(4, len(stressors))
    count = -(-len(stressors) // columns)
    figure = Figure(figsize=(3.2 * columns, 2.9 * count), layout="constrained")
    grid = figure.subplots(count, columns, squeeze=False, sharey=True).ravel()
    methods = list(dict.fromkeys(row["method"] for row in results["rows"]))
    for axes, stressor in zip(grid, stressors, strict=False):
        for method in methods:
            found = [_iou(results["rows"], stressor, x, method) for x in stressor.settings]
            colour = _COLOURS.get(method, "#222222")
            axes.plot(
                stressor.settings,
                [metric["value"] for metric in found],
                color=colour,
                marker=_MARKS.get(method, "."),
                ms=4,
                lw=1.2,
                label=method,
            )
            bands = [metric["ci95"] or (metric["value"],) * 2 for metric in found]
            axes.fill_between(
                stressor.settings, *zip(*bands, strict=True), color=colour, alpha=0.15, lw=0
            )
        axes.set(xlabel=stressor.title, xticks=stressor.settings)
        if stressor.settings[0] > stressor.settings[-1]:
            axes.invert_xaxis()
        axes.grid(visible=True, lw=0.3)
    for axes in grid[len(stressors) :]:
        axes.set_axis_off()
    for axes in grid[::columns]:
        axes.set_ylabel("IoU")
    figure.legend(*grid[0].get_legend_handles_labels(), loc="outside upper center", ncols=7)
    return figure


def _stressors(rows: Rows) -> list[Stressor]:
    there = {row["stressor"] for row in rows}
    return [stressor for stressor in STRESSORS if stressor.name in there]


def _iou(rows: Rows, stressor: Stressor, setting: float, method: str) -> dict[str, Any]:
    for row in rows:
        if (row["stressor"], row["setting"], row["method"]) == (stressor.name, setting, method):
            found: dict[str, Any] = row["metrics"]["polygon_iou"]
            return found
    raise KeyError(f"{stressor.name}, {setting}, {method}")
