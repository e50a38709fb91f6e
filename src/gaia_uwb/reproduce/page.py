"""The page of results, made from ``results.json`` and a section that is written by hand."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from gaia_uwb.reproduce.formats import (
    QUICK_MARK,
    differences_markdown,
    markdown_table,
    results_markdown,
)
from gaia_uwb.reproduce.jobs import spell
from gaia_uwb.reproduce.paper import ABLATION, TABLE_1, TABLE_2
from gaia_uwb.reproduce.parts import ALIGNMENT_METRICS, PARTS
from gaia_uwb.reproduce.robustness_formats import summary_markdown

_HEAD = """\
# Results: the paper's tables and figures, reproduced

Written by `gaia reproduce all --out OUT` and `gaia reproduce page --out OUT --page docs/results.md`
from `OUT/results.json`. Only the section *What the numbers say* is written by hand; it is kept in
[results-prose.md](results-prose.md). [method.md](method.md) shows how the paper's method maps to
the code, and where we deviate.

The numbers are means over episodes with 95 % bootstrap intervals. On real data the bootstrap draws
whole runs. There are only eight, so these intervals are too short (in simulation they contain the
truth in 88 % of the cases). A *difference* is paired, with both methods on the same episodes; if
its interval excludes 0, the methods differ. Rows in italics are what the paper prints, on its own
data.
"""

_SPLITS = """\
*trained on* names the split. **window**: a fifth of the windows is held out, with the same layouts
in training and test (the paper's kind of split). **run**: one of eight runs is held out.
**layout**: all runs past one of four layouts are held out. **sim**: trained on the simulator's
stress preset only, whose coordinates mean nothing here. **nothing**: no training. A model is
trained once for each fold, on windows of 64 steps, and applied to all lengths. In the split
*window* a longer episode is denoised window by window, each by the model that has not seen it.
For *aligned* data, the clock offset, the spikes and the range bias are found from each whole run
without truth. *published* data are the nearest samples without any of these corrections, as the
paper appears to have used the data.
"""

_LENGTHS = {"64": "windows of 64 steps", "256": "windows of 256 steps", "whole": "whole runs"}
_DIFFERENCE_METRICS = ("distance_mse_overall", "anchor_mae", "polygon_iou", "polygon_hausdorff")


def results_page(results: Mapping[str, Any], prose: str, image_folder: str) -> str:
    """Return the page as Markdown.

    Parameters
    ----------
    results
        Content of ``results.json``.
    prose
        The section written by hand.
    image_folder
        Folder of its pictures, relative to the page.
    """
    parts = results["parts"]
    sections = [
        [_HEAD],
        [f"**{QUICK_MARK}**\n"] if results["quick"] else [],
        ["## What the numbers say\n", prose.strip() + "\n"] if prose.strip() else [],
        _table1(parts),
        _stress_part(parts, "table2", "Table 2: the stress test", TABLE_2),
        _stress_part(parts, "ablation", "Table 3: GAIA without one of its parts", ABLATION),
        _table4(parts, image_folder),
        _table5(parts),
        _alignment(parts),
        _figures(parts, image_folder),
        _times(results),
    ]
    return "\n".join(line for section in sections for line in section)


def page_images(results: Mapping[str, Any]) -> list[str]:
    """Return the names of the figures that the page shows.

    Parameters
    ----------
    results
        Content of ``results.json``.
    """
    return list(results["parts"].get("figures", {}).get("figures", {}))


def _command(parts: Mapping[str, Any], name: str) -> str:
    """Say which command made a part and how long it took, or that it is missing."""
    if name not in parts:
        return f"*Not made yet, or made by another version of the code: `gaia reproduce {name}`.*\n"
    cost = parts[name]["cost"]
    text = f"`gaia reproduce {name}`"
    if cost["models"]:
        text += f": {cost['models']} models, {spell(cost['training_s'])} of one core to train"
        if cost["models_taken_up"]:
            text += f" (not counting {cost['models_taken_up']} that already existed)"
    return f"{text}; {spell(cost['wall_s'])} for everything else.\n"


def _table1(parts: Mapping[str, Any]) -> Iterator[str]:
    yield "## Table 1: the outdoor UWB data set\n"
    yield _command(parts, "table1")
    if "table1" not in parts:
        return
    yield _SPLITS
    for name, table in parts["table1"]["tables"].items():
        preparation, length, solver = name.split("/")
        protocol = table["protocol"]
        left_out = protocol["windows_without_ranges"]
        yield f"### {_LENGTHS.get(length, length)}, data {preparation}, solver {solver}\n"
        yield (
            f"{protocol['episodes']} episodes of {protocol['runs']} runs"
            + (f", {left_out} without any range excluded" if left_out else "")
            + f"; solver: {protocol['solver']}.\n"
        )
        yield results_markdown(table, TABLE_1 if (length, solver) == ("64", "wls") else None)
        if table.get("differences"):
            yield "<details><summary>Paired differences</summary>\n"
            yield differences_markdown(table, _DIFFERENCE_METRICS)
            yield "</details>\n"


def _stress_part(
    parts: Mapping[str, Any], name: str, title: str, paper: Mapping[str, Sequence[float]]
) -> Iterator[str]:
    yield f"## {title}\n"
    yield _command(parts, name)
    if name in parts:
        table = parts[name]["tables"][name]
        protocol = table["protocol"]
        yield (
            f"{protocol['episodes']} episodes (`{protocol['data']}`), {protocol['split']}; solver: "
            f"{protocol['solver']}; learned methods: the mean over models with seeds "
            f"{', '.join(map(str, protocol['training_seeds']))}, trained on "
            f"{protocol['trained_on']}.\n"
        )
        yield results_markdown(table, paper)
        yield differences_markdown(table)


def _table4(parts: Mapping[str, Any], image_folder: str) -> Iterator[str]:
    yield "## Table 4: the stress test under more stress\n"
    yield _command(parts, "table4")
    if "table4" in parts:
        yield (
            "These are the models of table 2, not retrained; layouts and drives stay the same. "
            "The first four stressors are the paper's, the others are ours. The margin is the "
            "paired difference to the baseline with the best mean at that setting. `table4.csv` "
            "has every method at every setting.\n"
        )
        yield summary_markdown(parts["table4"])
        if "figures" in parts:
            yield f"![IoU under stress]({image_folder}/robustness.png)\n"


def _table5(parts: Mapping[str, Any]) -> Iterator[str]:
    yield "## Table 5: the simulator's statistical check\n"
    yield _command(parts, "table5")
    if "table5" not in parts:
        return
    part = parts["table5"]
    names = list(part["paper"]["real"])
    rows = [
        [f"*paper: {method}*", *(f"*{values[name]:.4g}*" for name in names)]
        for method, values in part["paper"].items()
    ]
    for row in part["rows"]:
        if row["view"] in ("paper", "corrected") and row["sight"] == "all":
            found = [row["metrics"][name] for name in names]
            rows.append([f"{row['method']}, view {row['view']}", *map(_short, found)])
    yield markdown_table(["source", *names], rows)
    yield "[simulator-check.md](simulator-check.md) has definitions, all views and pictures.\n"


def _short(metric: Mapping[str, Any]) -> str:
    ends = "" if metric["ci95"] is None else " [{:.3g}, {:.3g}]".format(*metric["ci95"])
    return f"{metric['value']:.4g}{ends}"


def _alignment(parts: Mapping[str, Any]) -> Iterator[str]:
    yield "## What each part of the alignment is worth\n"
    yield _command(parts, "alignment")
    if "alignment" not in parts:
        return
    yield "No training and, unless a title says so, no labels are used. Not in the paper.\n"
    for title, table in parts["alignment"]["tables"].items():
        settings = table["protocol"]["settings"]
        yield f"### {title[0].upper()}{title[1:]}\n"
        if settings:
            yield f"Settings that differ from the default: `{settings}`.\n"
        yield results_markdown(table, metrics=ALIGNMENT_METRICS)


def _figures(parts: Mapping[str, Any], image_folder: str) -> Iterator[str]:
    yield "## Figures\n"
    yield _command(parts, "figures")
    for name, text in parts.get("figures", {}).get("figures", {}).items():
        if name != "robustness":
            yield f"![{name}]({image_folder}/{name}.png)\n\n{text}\n"


def _times(results: Mapping[str, Any]) -> Iterator[str]:
    yield "## Times\n"
    parts = results["parts"]
    rows = []
    for name in PARTS:
        if name in parts:
            cost = parts[name]["cost"]
            rows.append(
                [
                    f"`gaia reproduce {name}`",
                    str(cost["models"]),
                    spell(cost["training_s"]),
                    spell(cost["prediction_s"]),
                    spell(cost["wall_s"]),
                ]
            )
    yield f"Machine: {results['machine']}. GAIA {results['version']}.\n"
    yield markdown_table(
        ["command", "models", "training (one core)", "predictions", "all but training"], rows
    )
    yield (
        "Models that two parts share are counted in both. Predictions kept from an earlier call "
        "are counted with the time that they took then.\n"
    )
