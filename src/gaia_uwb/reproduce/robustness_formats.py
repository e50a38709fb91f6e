"""Table 4 as Markdown, LaTeX and CSV."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from gaia_uwb._shared import csv_text
from gaia_uwb.reproduce.formats import cell, markdown_table
from gaia_uwb.reproduce.paper import TABLE_4


def _summary(results: Mapping[str, Any]) -> Iterator[tuple[str, str, dict[str, Any]]]:
    """Yield each stressor's name and title with GAIA's IoU at both ends and its margin there."""
    iou = {
        (row["stressor"], row["setting"]): row["metrics"]["polygon_iou"]
        for row in results["rows"]
        if row["method"] == "gaia"
    }
    for stressor, title in results["titles"].items():
        ends = [m for m in results["margins"] if m["stressor"] == stressor]
        if ends:
            mild, worst = ends[0], ends[-1]
            found = {
                "mild": mild["setting"],
                "worst": worst["setting"],
                "base": iou[stressor, mild["setting"]],
                "severe": iou[stressor, worst["setting"]],
                "best": worst["best"],
                "margin": worst["margin"],
            }
            yield stressor, title, found


def summary_markdown(results: Mapping[str, Any]) -> str:
    """Return the paper's summary: GAIA's IoU at both ends, and its paired margin.

    Parameters
    ----------
    results
        Of table 4.
    """
    rows = []
    for stressor, title, found in _summary(results):
        printed = TABLE_4.get(stressor)
        paper = (
            "not in the paper" if printed is None else "{:.3f}, {:.3f}, {:+.3f}".format(*printed)
        )
        rows.append(
            [
                f"{title}: {found['mild']:g} to {found['worst']:g}",
                cell(found["base"]),
                cell(found["severe"]),
                found["best"],
                cell(found["margin"], signed=True),
                paper,
            ]
        )
    heads = [
        "stressor", "GAIA's IoU, none", "GAIA's IoU, most severe", "best baseline there",
        "GAIA's margin", "paper: none, severe, margin",
    ]  # fmt: skip
    return markdown_table(heads, rows) + "\n" + _verdict(results) + "\n"


def _verdict(results: Mapping[str, Any]) -> str:
    """Say in words where the margin is not positive, or might not be."""
    below, unsure = [], []
    for stressor, title, found in _summary(results):
        name = title if stressor in TABLE_4 else f"{title} (not the paper's)"
        margin = found["margin"]
        if margin["value"] <= 0:
            below.append(f"{name}, {margin['value']:+.3f}")
        elif margin["ci95"] is not None and margin["ci95"][0] <= 0:
            unsure.append(name)
    first = (
        "not positive at the most severe setting of: " + "; ".join(below)
        if below
        else ("positive at the most severe setting of every stressor")
    )
    second = f". Its interval contains 0 for: {'; '.join(unsure)}" if unsure else ""
    return f"GAIA's margin over the best of the paper's baselines is {first}{second}."


def robustness_latex(results: Mapping[str, Any]) -> str:
    """Return the summary as LaTeX.

    Parameters
    ----------
    results
        Of table 4.
    """
    lines = [
        r"\begin{tabular}{lccc}",
        r"\toprule",
        r"Stressor (base $\rightarrow$ severe) & GAIA IoU (base) & GAIA IoU (severe) "
        r"& Margin (severe) \\",
        r"\midrule",
    ]
    for _, title, found in _summary(results):
        margin = found["margin"]
        ends = "" if margin["ci95"] is None else " [{:+.3f}, {:+.3f}]".format(*margin["ci95"])
        lines.append(
            rf"{title} (${found['mild']:g} \rightarrow {found['worst']:g}$) & "
            rf"{found['base']['value']:.3f} & {found['severe']['value']:.3f} & "
            rf"${margin['value']:+.3f}${ends} \\"
        )
    return "\n".join([*lines, r"\bottomrule", r"\end{tabular}", ""])


def robustness_csv(results: Mapping[str, Any]) -> str:
    """Return all rows as CSV.

    Parameters
    ----------
    results
        Of table 4.
    """
    header = ["stressor", "setting", "method", "metric", "value", "low", "high", "n"]
    lines = []
    for row in results["rows"]:
        for name, metric in row["metrics"].items():
            low, high = metric["ci95"] or (None, None)
            which = (row["stressor"], row["setting"], row["method"], name)
            lines.append([*which, metric["value"], low, high, metric["n"]])
    return csv_text(header, lines)
