"""All figures of the paper, drawn from the predictions of its tables."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from gaia_uwb._shared import Array, Float64, OutputFolder, figure_files
from gaia_uwb.denoisers import make_denoiser
from gaia_uwb.episode import Episode
from gaia_uwb.learn import plot_losses
from gaia_uwb.reproduce.formats import QUICK_MARK
from gaia_uwb.reproduce.plan import METHODS
from gaia_uwb.reproduce.plots import (
    DrawnZone,
    GateRecord,
    plot_boxes,
    plot_cdfs,
    plot_error_over_distance,
    plot_gate,
    plot_layouts,
    plot_robustness,
)
from gaia_uwb.reproduce.scores import Row, Table
from gaia_uwb.reproduce.workshop import OUTDOOR, Workshop

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FOLDER = "figures"
OUTDOOR_SPLIT, OUTDOOR_SOLVER = "window", "wls"
"""Of the outdoor data's figures: what the paper seems to have done."""

_QUANTILES = (0.25, 0.5, 0.75)
_SHOWN_ZONES = ("pose-kalman", "pose-mlp", "gaia", "gaia-set")
_SHOWN_ERRORS = ("raw", "pose-kalman", "pose-mlp", "gaia", "gaia-set")
_GATE_WINDOWS = 12  # of a run, which is what a page is wide enough for


def draw_figures(
    workshop: Workshop,
    stress: Table,
    outdoor: Mapping[str, Table],
    robustness: Mapping[str, Any],
) -> dict[str, str]:
    """Draw and write all figures but those of the simulator's check, which table 5 draws.

    Parameters
    ----------
    workshop
        What all parts need.
    stress
        Table 2.
    outdoor
        The tables of table 1.
    robustness
        Table 4.

    Returns
    -------
    dict
        By the figure's name, what it shows.
    """
    real = _outdoor_table(workshop, outdoor)
    figures = [
        *_distributions(real, stress),
        (
            "robustness",
            plot_robustness(robustness),
            "IoU over the settings of each stressor, with 95 % bootstrap bands.",
        ),
        (
            "layouts",
            plot_layouts([_zones(real), _zones(stress)], ["outdoor data", "stress test"]),
            "True (grey) and reconstructed hulls of the episodes at the quartiles of GAIA's IoU, "
            "rotated to lie level. A long zone has a separate scale for each direction.",
        ),
        (
            "losses",
            plot_losses(_training_log(workshop)),
            f"GAIA's training on the stress preset, seed {workshop.plan.stress_seeds[0]}.",
        ),
        (
            "error-distance",
            plot_error_over_distance(
                {"outdoor data": _errors(real), "stress test": _errors(stress)}
            ),
            "Absolute range error over distance: median (with markers) and 95 % quantile "
            f"(dashed), {_words(real)} and on the stress test.",
        ),
        (
            "gate",
            plot_gate(_gate_records(workshop, real, stress)),
            "Range errors of one anchor, and GAIA's gate: 1 is the corrected range, 0 the "
            "layout's distance; its mean is dotted. Shown are a run of the outdoor data, window "
            "by window, each by the model that has not seen it, and the stress test's episode of "
            "median IoU, each for the anchor with the most ranges.",
        ),
    ]
    folder = OutputFolder(workshop.folder.path / FOLDER)
    note = QUICK_MARK if workshop.plan.quick else ""
    for name, figure, _ in figures:
        for kind, content in figure_files(figure, note=note).items():
            folder.write(f"{name}.{kind}", content)
    return {name: text for name, _, text in figures}


def _distributions(real: Table, stress: Table) -> Iterator[tuple[str, Figure, str]]:
    for name, table, where in (
        ("outdoor", real, _words(real)),
        ("stress", stress, "on the stress test"),
    ):
        yield (
            f"cdf-{name}",
            plot_cdfs(_scores(table)),
            f"Share of episodes with at most a given score, {where}.",
        )
        yield (
            f"box-{name}",
            plot_boxes(_scores(table)),
            f"Median and quartiles, whiskers from 5 % to 95 % and mean (diamond), {where}.",
        )


def _outdoor_table(workshop: Workshop, outdoor: Mapping[str, Table]) -> Table:
    """Return the outdoor table that is nearest to the paper's protocol."""
    plan = workshop.plan
    return outdoor[f"{plan.preparations[0]}/{plan.lengths[0] or 'whole'}/{OUTDOOR_SOLVER}"]


def _split(table: Table) -> str:
    splits = [row.split for row in table.rows]
    return OUTDOOR_SPLIT if OUTDOOR_SPLIT in splits else next(filter(None, splits), "")


def _words(table: Table) -> str:
    protocol = table.protocol
    return (
        f"windows of {protocol['length']} steps of the outdoor data, {protocol['preparation']}, "
        f"split {_split(table)}"
    )


def _rows(table: Table) -> dict[str, Row]:
    """Return the rows of the table's main split, in the order of the tables."""
    found = {row.method: row for row in table.of_split(_split(table))}
    packaged = {row.method: row for row in table.rows if row.method not in found}
    return {m.name: (found | packaged)[m.name] for m in METHODS if m.name in found | packaged}


def _scores(table: Table) -> dict[str, dict[str, Float64[Array, "_"]]]:
    rows = _rows(table)
    return {
        label: {name: row.values(metric) for name, row in rows.items()}
        for metric, label in (("polygon_iou", "IoU"), ("polygon_hausdorff", "Hausdorff (m)"))
    }


def _zones(table: Table) -> list[DrawnZone]:
    """Return the episodes at the quartiles of GAIA's IoU."""
    rows = _rows(table)
    iou = rows["gaia"].values("polygon_iou")
    order = np.argsort(iou, kind="stable")
    chosen = [int(order[round(q * (len(order) - 1))]) for q in _QUANTILES]
    return [
        _zone(table, rows, k, f"quartile {n}: GAIA's IoU {iou[k]:.2f}\n{name}")
        for n, k in enumerate(chosen, start=1)
        for name in [table.episodes[k].name.removeprefix(f"{OUTDOOR}:")]
    ]


def _zone(table: Table, rows: Mapping[str, Row], k: int, title: str) -> DrawnZone:
    episode = table.episodes[k]
    if episode.truth is None:
        raise ValueError(f"{episode.name}: expected its truth")
    observed = episode.valid.any(axis=0)
    found_m = {}
    for name in _SHOWN_ZONES:
        if name in rows:
            anchors = rows[name].predictions[0].anchors[table.solver][k]
            places_m = np.array([fix.position_m for fix in anchors])[observed]
            found_m[name] = places_m[np.isfinite(places_m).all(axis=1)]
    return DrawnZone(title, episode.position_m, episode.truth.anchor_m[observed], found_m)


def _training_log(workshop: Workshop) -> list[dict[str, Any]]:
    """Return the log of GAIA's training on the stress preset."""
    from gaia_uwb.learn import LOG

    seed = workshop.plan.stress_seeds[0]
    path = workshop.models.path / f"gaia-seed{seed}" / LOG
    return [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()]


def _errors(table: Table) -> dict[str, tuple[Float64[Array, "_"], Float64[Array, "_"]]]:
    """Return true distances and range errors of some methods, all episodes together."""
    rows, found = _rows(table), {}
    for name in _SHOWN_ERRORS:
        if name in rows:
            true_m, error_m = [], []
            for episode, denoised in zip(
                table.episodes, rows[name].predictions[0].denoised, strict=True
            ):
                if episode.truth is not None:
                    used = episode.valid & denoised.valid
                    true_m.append(episode.truth.range_m[used])
                    error_m.append((denoised.range_m - episode.truth.range_m)[used])
            found[name] = (np.concatenate(true_m), np.concatenate(error_m))
    return found


def _gate_records(workshop: Workshop, real: Table, stress: Table) -> list[GateRecord]:
    """Return the gate over the first minutes of an outdoor run, and over a stress episode."""
    rows = _rows(stress)
    order = np.argsort(rows["gaia"].values("polygon_iou"), kind="stable")
    median = stress.episodes[int(order[(len(order) - 1) // 2])]
    model = workshop.models.path / f"gaia-seed{workshop.plan.stress_seeds[0]}"
    records = [_record(f"stress test: {median.name}", [(median, model)])]
    row, run = _rows(real).get("gaia"), _longest_run(real)
    if row is not None and row.pieces:
        windows = [
            (episode, Path(own[0].denoiser.partition(":")[2]))
            for episode, group, own in zip(real.episodes, real.groups, row.pieces, strict=True)
            if group == run and len(own) == 1
        ]
        if windows:
            records.insert(0, _record(f"outdoor data: {run}", windows[:_GATE_WINDOWS]))
    return records


def _longest_run(table: Table) -> str:
    """Return the run with most episodes among those without line of sight, else among all."""
    blocked = [
        group
        for episode, group in zip(table.episodes, table.groups, strict=True)
        if episode.truth is not None and episode.truth.nlos.mean() > 0.5
    ]
    counts = Counter(blocked or table.groups)
    return max(counts, key=lambda run: counts[run])


def _record(title: str, windows: Sequence[tuple[Episode, Path]]) -> GateRecord:
    """Put together what networks do to the best-heard anchor of windows in a row."""
    from gaia_uwb.reproduce.inspection import gate_and_layout

    heard = np.sum([episode.valid.sum(axis=0) for episode, _ in windows], axis=0)
    anchor = int(np.argmax(heard))
    columns: list[Float64[Array, "6 _"]] = []
    for episode, model in windows:
        if episode.truth is None:
            raise ValueError(f"{episode.name}: expected its truth")
        denoised_m = make_denoiser(f"gaia:{model}")([episode.without_truth()])[0].range_m
        gate, layout_m = (found[0, :, anchor] for found in gate_and_layout(model, [episode]))
        true_m, there = episode.truth.range_m[:, anchor], episode.valid[:, anchor]
        own = [
            episode.range_m[:, anchor] - true_m,
            denoised_m[:, anchor] - true_m,
            layout_m - true_m,
            gate,
        ]
        shown = [np.where(there, values, np.nan) for values in own]
        columns.append(np.stack([episode.t_s, *shown, episode.truth.nlos[:, anchor]]))
    t_s, measured_m, denoised_m, layout_m, gate, nlos = np.concatenate(columns, axis=1)
    return GateRecord(title, t_s - t_s[0], measured_m, denoised_m, layout_m, gate, nlos > 0.5)
