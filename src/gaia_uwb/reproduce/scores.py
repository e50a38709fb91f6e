"""From predictions to a table: means with intervals, and paired differences.

A learned method may have several models (seeds): its mean is over all of them, and in a paired
difference each episode counts once, with the mean over the models.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np

from gaia_uwb._shared import Cell, csv_text
from gaia_uwb.episode import Episode
from gaia_uwb.evaluate import Metric, aggregate, paired_difference, score_episode
from gaia_uwb.reproduce.paper import METRICS
from gaia_uwb.reproduce.plan import REFERENCES
from gaia_uwb.reproduce.predictions import Pieces, Predictions

NO_SPLIT = ""
"""Split of a method that is not trained on the data."""


@dataclass(frozen=True)
class Row:
    """A method's predictions and scores.

    Parameters
    ----------
    method
        Its name.
    split
        Of the data that its models were trained on, if that makes a difference.
    predictions
        One for each of its models.
    scores
        Metrics by name, for each model and each episode.
    pieces
        Who denoised which episode with the first model, for those who want to look inside.
    """

    method: str
    split: str
    predictions: tuple[Predictions, ...] = field(repr=False)
    scores: tuple[tuple[Mapping[str, Metric], ...], ...] = field(repr=False)
    pieces: Pieces = field(default=(), repr=False)

    def values(self, metric: str) -> np.ndarray:
        """Return a metric of every episode, the mean over the models; NaN where there is none.

        Parameters
        ----------
        metric
            Its name.
        """
        found = [
            [own[metric].value if metric in own else np.nan for own in model]
            for model in self.scores
        ]
        return np.asarray(np.mean(found, axis=0))


@dataclass(frozen=True)
class Table:
    """Methods on the same episodes.

    Parameters
    ----------
    protocol
        What was done, for the reader.
    episodes, groups
        The episodes, and the run that each comes from.
    solver
        Name of the solver among those of the predictions.
    rows
        The methods.
    """

    protocol: Mapping[str, Any]
    episodes: tuple[Episode, ...] = field(repr=False)
    groups: tuple[str, ...] = field(repr=False)
    solver: str
    rows: tuple[Row, ...]

    def row(self, method: str, split: str = NO_SPLIT) -> Row | None:
        """Return a method's row in a split, or its only one, if there is any.

        Parameters
        ----------
        method
            Its name.
        split
            Which split.
        """
        for row in self.rows:
            if row.method == method and row.split in (split, NO_SPLIT):
                return row
        return None

    def of_split(self, split: str) -> list[Row]:
        """Return the rows that stand side by side in one split.

        Parameters
        ----------
        split
            Which; the rows without any are in all of them.
        """
        return [row for row in self.rows if row.split in (split, NO_SPLIT)]


def score_row(
    method: str,
    split: str,
    predictions: Sequence[Predictions],
    episodes: Sequence[Episode],
    solver: str,
) -> Row:
    """Score one method.

    Parameters
    ----------
    method, split
        What the row is called.
    predictions
        Of each of its models.
    episodes
        With their truth.
    solver
        Which anchors count.
    """
    scores = tuple(
        tuple(
            score_episode(episode, denoised, anchors)
            for episode, denoised, anchors in zip(
                episodes, own.denoised, own.anchors[solver], strict=True
            )
        )
        for own in predictions
    )
    return Row(method, split, tuple(predictions), scores)


def table_json(
    table: Table, *, metrics: Sequence[str] = (), differences: bool = True
) -> dict[str, Any]:
    """Return a table with its intervals, ready for JSON.

    Parameters
    ----------
    table
        With its scores.
    metrics
        Which; the paper's six by default.
    differences
        Whether to form paired differences.
    """
    names = tuple(metrics) or tuple(METRICS)
    content: dict[str, Any] = {
        "protocol": dict(table.protocol)
        | {"episodes": len(table.episodes), "runs": len(set(table.groups))},
        "rows": [
            {
                "method": row.method,
                "split": row.split,
                "models": len(row.predictions),
                "metrics": means(row, table.groups, names),
            }
            for row in table.rows
        ],
    }
    if differences:
        content["differences"] = list(_differences(table))
    return content


def means(row: Row, groups: Sequence[str], metrics: Sequence[str]) -> dict[str, Any]:
    """Return a row's means over episodes and models with their intervals.

    Parameters
    ----------
    row
        With its scores.
    groups
        The run of each episode.
    metrics
        Which.
    """
    found = aggregate([own for model in row.scores for own in model], [*groups] * len(row.scores))
    return {name: asdict(found[name]) for name in metrics if name in found}


def difference(
    first: Row, second: Row, groups: Sequence[str], metric: str
) -> dict[str, Any] | None:
    """Return the mean of ``first`` minus ``second`` on the episodes that both have.

    Parameters
    ----------
    first, second
        Rows of one table.
    groups
        The run of each episode.
    metric
        Its name.
    """
    ours, theirs = first.values(metric), second.values(metric)
    both = np.isfinite(ours) & np.isfinite(theirs)
    if not both.any():
        return None
    kept = [group for group, there in zip(groups, both, strict=True) if there]
    found = paired_difference(ours[both], theirs[both], kept)
    return {"value": found.value, "ci95": found.interval, "n": int(both.sum())}


def _differences(table: Table) -> Iterator[dict[str, Any]]:
    splits = dict.fromkeys(row.split for row in table.rows if row.split != NO_SPLIT) or [NO_SPLIT]
    for split in splits:
        rows = table.of_split(split)
        for reference in (row for row in rows if row.method in REFERENCES):
            for other in rows:
                if other is not reference:
                    found = {
                        name: difference(reference, other, table.groups, name) for name in METRICS
                    }
                    yield {
                        "method": reference.method,
                        "minus": other.method,
                        "split": split,
                        "metrics": {name: d for name, d in found.items() if d is not None},
                    }


def episodes_csv(tables: Sequence[tuple[str, Table]]) -> str:
    """Return every score of every episode as CSV.

    Parameters
    ----------
    tables
        Each with a name for its first column.
    """
    header = ["table", "method", "split", "model", "episode", "run", "metric", "value"]
    lines: list[list[Cell]] = []
    for name, table in tables:
        for row in table.rows:
            for model, scores in enumerate(row.scores):
                for episode, run, own in zip(table.episodes, table.groups, scores, strict=True):
                    start = (name, row.method, row.split, model, episode.name, run)
                    lines += [[*start, m, own[m].value] for m in METRICS if m in own]
    return csv_text(header, lines)
