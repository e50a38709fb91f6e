"""Tables as Markdown, LaTeX and CSV, each number with its interval and beside the paper's."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from gaia_uwb._shared import csv_text
from gaia_uwb.reproduce.paper import METRICS, NAMES
from gaia_uwb.reproduce.plan import Plan

QUICK_MARK = "QUICK RUN: little data, the numbers mean nothing"

_COMMENTS = {"csv": "# ", "tex": "% ", "yaml": "# "}
_LATEX_HEADS = {
    "distance_mse_overall": r"MSE$_{\text{overall}}$",
    "distance_mse_los": r"MSE$_{\text{LOS}}$",
    "distance_mse_nlos": r"MSE$_{\text{NLOS}}$",
    "anchor_mae": r"MAE$_{\text{anchor}}$",
    "polygon_iou": "IoU",
    "polygon_hausdorff": "Hausdorff",
}

Metrics = Mapping[str, Mapping[str, Any]]


def marked(name: str, text: str, plan: Plan) -> str:
    """Return a file's text; that of a quick run says so in its first line.

    Parameters
    ----------
    name
        The file's.
    text
        Its content.
    plan
        Says whether it is a quick run.

    Examples
    --------
    >>> print(marked("table2.csv", "method", Plan(quick=True)))
    # QUICK RUN: little data, the numbers mean nothing
    method
    """
    if not plan.quick:
        return text
    comment = _COMMENTS.get(name.rpartition(".")[2])
    return f"{comment}{QUICK_MARK}\n{text}" if comment else f"**{QUICK_MARK}**\n\n{text}"


def number(value: float) -> str:
    """Return a number with about four digits.

    Examples
    --------
    >>> number(0.12345), number(2.3456), number(123.456)
    ('0.1235', '2.346', '123.5')
    """
    size = abs(value)
    return f"{value:.4f}" if size < 1 else f"{value:.3f}" if size < 100 else f"{value:.1f}"


def cell(metric: Mapping[str, Any] | None, *, signed: bool = False) -> str:
    """Return a value with its 95 % interval.

    Parameters
    ----------
    metric
        With ``value`` and ``ci95``; ``None`` where there was nothing to count.
    signed
        Whether to write a plus.
    """
    if metric is None:
        return "nothing to count"
    plus = "+" if signed and metric["value"] >= 0 else ""
    text = plus + number(metric["value"])
    if metric["ci95"] is None:
        return text
    digits = 3 if max(map(abs, metric["ci95"])) < 10 else 2
    low, high = (f"{end:.{digits}f}" for end in metric["ci95"])
    return f"{text} [{low}, {high}]"


def markdown_table(heads: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a Markdown table.

    Parameters
    ----------
    heads
        Of the columns.
    rows
        Of cells.

    Examples
    --------
    >>> print(markdown_table(["a", "b"], [["1", "2"]]), end="")
    | a | b |
    |---|---|
    | 1 | 2 |
    """
    lines = [f"| {' | '.join(heads)} |", "|---" * len(heads) + "|"]
    lines += [f"| {' | '.join(cells)} |" for cells in rows]
    return "\n".join(lines) + "\n"


def results_markdown(
    table: Mapping[str, Any],
    paper: Mapping[str, Sequence[float]] | None = None,
    metrics: Mapping[str, str] = METRICS,
) -> str:
    """Return a table's rows, each of the paper's methods with what the paper prints below it.

    Parameters
    ----------
    table
        With ``rows``.
    paper
        The paper's numbers by method, if they belong here.
    metrics
        The columns, by metric.
    """
    splits = len({row["split"] for row in table["rows"]}) > 1
    heads = ["method", *(["trained on"] if splits else []), *metrics.values()]
    lines, last = [], {row["method"]: k for k, row in enumerate(table["rows"])}
    for k, row in enumerate(table["rows"]):
        shown = [row["split"] or "nothing"] if splits else []
        lines.append([row["method"], *shown, *(cell(row["metrics"].get(m)) for m in metrics)])
        if paper and row["method"] in paper and last[row["method"]] == k:
            name = f"*paper: {NAMES[row['method']]}*"
            values = [f"*{value:.4g}*" for value in paper[row["method"]]]
            lines.append([name, *([""] if splits else []), *values])
    return markdown_table(heads, lines)


def differences_markdown(table: Mapping[str, Any], metrics: Sequence[str] = ()) -> str:
    """Return paired differences, one row for each pair and split.

    Parameters
    ----------
    table
        With ``differences``.
    metrics
        The columns; all of the paper's by default.
    """
    names = tuple(metrics) or tuple(METRICS)
    splits = any(row["split"] for row in table["differences"])
    heads = ["difference", *(["split"] if splits else []), *(METRICS[name] for name in names)]
    return markdown_table(
        heads,
        (
            [
                f"{row['method']} − {row['minus']}",
                *([row["split"]] if splits else []),
                *(cell(row["metrics"].get(name), signed=True) for name in names),
            ]
            for row in table["differences"]
        ),
    )


def latex_table(
    table: Mapping[str, Any], paper: Mapping[str, Sequence[float]] | None = None
) -> str:
    """Return a table as LaTeX (``booktabs``), intervals in small print below their numbers.

    Parameters
    ----------
    table
        With ``rows``.
    paper
        The paper's numbers by method.
    """
    lines = [
        rf"\begin{{tabular}}{{ll{'c' * len(METRICS)}}}",
        r"\toprule",
        rf"Method & Trained on & {' & '.join(_LATEX_HEADS.values())} \\",
        r"\midrule",
    ]
    for row in table["rows"]:
        found = [row["metrics"].get(name) for name in METRICS]
        values = ["--" if m is None else number(m["value"]) for m in found]
        ends = [_latex_interval(m) for m in found]
        lines.append(rf"{row['method']} & {row['split'] or '--'} & {' & '.join(values)} \\")
        lines.append(rf" & & {' & '.join(ends)} \\")
    if paper:
        lines.append(r"\midrule")
        for method, printed in paper.items():
            values = [f"{value:.4f}" for value in printed]
            lines.append(rf"{NAMES[method]} (paper) & & {' & '.join(values)} \\")
    return "\n".join([*lines, r"\bottomrule", r"\end{tabular}", ""])


def _latex_interval(metric: Mapping[str, Any] | None) -> str:
    if metric is None or metric["ci95"] is None:
        return ""
    low, high = metric["ci95"]
    return rf"{{\scriptsize [{low:.3f}, {high:.3f}]}}"


def results_csv(tables: Mapping[str, Mapping[str, Any]]) -> str:
    """Return all rows and all paired differences of tables as CSV, a line for each number.

    Parameters
    ----------
    tables
        By name.
    """
    header = ["table", "method", "minus", "split", "metric", "value", "low", "high", "n"]
    lines = []
    for name, table in tables.items():
        for row in [*table["rows"], *table.get("differences", [])]:
            for metric, found in row["metrics"].items():
                low, high = found["ci95"] or (None, None)
                which = (name, row["method"], row.get("minus", ""), row["split"], metric)
                lines.append([*which, found["value"], low, high, found["n"]])
    return csv_text(header, lines)
