"""The page of results, written from ``results.json`` and a text by hand that it includes."""

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
# Results: the paper's tables and figures, repeated

Written by `gaia reproduce all --out OUT` and `gaia reproduce page --out OUT --page docs/results.md`
from `OUT/results.json`; not edited by hand, but for the section *What the numbers say*, which is
kept in [results-prose.md](results-prose.md). How the paper's method maps to the code, and where we
deviate: [method.md](method.md).

Means over episodes with 95 % bootstrap intervals. On real data the bootstrap draws whole runs,
of which there are eight: such an interval is too short (in simulation it holds the truth in 88
% of the cases). A *difference* is paired: both methods on the same episodes; an interval that
leaves out 0 tells them apart. Rows in italics are what the paper prints, on its own data.
"""

_SPLITS = """\
*trained on* is the split: **window**: a fifth of the windows is held out, the same layouts in
training and test (the paper's kind of split); **run**: one of eight runs is held out;
**layout**: all runs past one of four layouts are held out; **sim**: trained on the simulator's
stress preset only, whose coordinates mean nothing here; **nothing**: no training. A model is
trained once for each fold, on windows of 64 steps, and applied to all lengths. In the split
*window* a longer episode is denoised window by window, each by the model that has not seen it.
The clock's offset, the spike gate and the range bias of *aligned* are found from each whole run
without truth; *published* is the nearest sample without any of them, as the paper seems to have
used the data.
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
        The section by hand.
    image_folder
        Where its pictures lie, seen from the page.
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
    """Say which command made a part and what it took, or that it is missing."""
    if name not in parts:
        return f"*Not made, or made by other code: `gaia reproduce {name}`.*\n"
    cost = parts[name]["cost"]
    text = f"`gaia reproduce {name}`"
    if cost["models"]:
        text += f": {cost['models']} models, {spell(cost['training_s'])} of one core to train"
        if cost["models_taken_up"]:
            text += f" (without {cost['models_taken_up']} that were there before)"
    return f"{text}; {spell(cost['wall_s'])} for all else.\n"


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
            + (f", {left_out} without any range left out" if left_out else "")
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
    yield "## Table 4: the stress test made worse\n"
    yield _command(parts, "table4")
    if "table4" in parts:
        yield (
            "The models of table 2, not trained again; layouts and drives stay as they are. "
            "The first four stressors are the paper's, the others ours. The margin is paired, over "
            "the baseline whose mean is the best there. Every method at every setting: "
            "`table4.csv`.\n"
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
    yield "Definitions, all views, and pictures: [simulator-check.md](simulator-check.md).\n"


def _short(metric: Mapping[str, Any]) -> str:
    ends = "" if metric["ci95"] is None else " [{:.3g}, {:.3g}]".format(*metric["ci95"])
    return f"{metric['value']:.4g}{ends}"


def _alignment(parts: Mapping[str, Any]) -> Iterator[str]:
    yield "## What the parts of the alignment are worth\n"
    yield _command(parts, "alignment")
    if "alignment" not in parts:
        return
    yield "Without training and, unless a title says so, without labels. Not in the paper.\n"
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
        "Models that two parts share are counted in both; predictions that are kept from an "
        "earlier call are counted with the time that they took then.\n"
    )
