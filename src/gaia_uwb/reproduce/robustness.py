"""Table 4 and its figure: methods on data under stress.

The models are those of table 2, not trained again ("zero-shot"); the geometry is fixed.
"""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from gaia_uwb.evaluate import Stressor, aggregate, stress
from gaia_uwb.reproduce.plan import BASELINES, Method, existing_methods
from gaia_uwb.reproduce.predictions import whole
from gaia_uwb.reproduce.scores import NO_SPLIT, Row, difference, score_row
from gaia_uwb.reproduce.stress_test import stress_denoisers, stress_protocol
from gaia_uwb.reproduce.workshop import STRESS_SOLVERS, Workshop

METRICS = ("polygon_iou", "polygon_hausdorff", "anchor_mae", "distance_mse_overall")
_STRESS_SEED = 7


def robustness_table(
    workshop: Workshop, methods: tuple[Method, ...] | None = None
) -> dict[str, Any]:
    """Score methods at every setting of every stressor; trains what is missing.

    Parameters
    ----------
    workshop
        What all parts need.
    methods
        All rows of table 2 by default.

    Returns
    -------
    dict
        Ready for JSON: ``rows``, one per stressor, setting and method, and ``margins``: GAIA's IoU
        less that of the paper's best baseline, at both ends of every stressor.
    """
    denoisers = stress_denoisers(workshop, methods or existing_methods())
    settings = [(s, value) for s in workshop.plan.stressors for value in s.settings]
    rows: list[dict[str, Any]] = []
    margins: list[dict[str, Any]] = []
    for k, (stressor, setting) in enumerate(settings):
        workshop.watch(f"{k + 1} of {len(settings)}: {stressor.title} {setting:g}")
        scored = _scored(workshop, denoisers, stressor, setting)
        groups = [episode.name for episode in workshop.stress_test]
        for row in scored:
            found = aggregate([m for model in row.scores for m in model], groups * len(row.scores))
            metrics = {name: asdict(found[name]) for name in METRICS if name in found}
            which = {"stressor": stressor.name, "setting": setting, "method": row.method}
            rows.append(which | {"metrics": metrics})
        if setting in (stressor.settings[0], stressor.settings[-1]):
            margins += _margin(stressor, setting, scored, groups)
    protocol = stress_protocol(workshop) | {"stress_seed": _STRESS_SEED}
    titles = {s.name: s.title for s in workshop.plan.stressors}
    return {"protocol": protocol, "titles": titles, "rows": rows, "margins": margins}


def _scored(
    workshop: Workshop, denoisers: dict[str, list[str]], stressor: Stressor, setting: float
) -> list[Row]:
    """Score all methods at one setting."""
    episodes = stress(workshop.stress_test, stressor, setting, _STRESS_SEED)
    where = f"stress/{stressor.name}-{setting:g}"
    return [
        score_row(
            method,
            NO_SPLIT,
            [
                workshop.predict(
                    where, f"{method}-{k}", episodes, whole(name, episodes), STRESS_SOLVERS
                )
                for k, name in enumerate(names)
            ],
            episodes,
            "wls",
        )
        for method, names in denoisers.items()
    ]


def _margin(
    stressor: Stressor, setting: float, scored: list[Row], groups: list[str]
) -> list[dict[str, Any]]:
    """Return by how much GAIA's IoU is above that of the best baseline, if both are there."""
    rows = {row.method: row for row in scored}
    baselines = [rows[name] for name in BASELINES if name in rows]
    if "gaia" not in rows or not baselines:
        return []
    best = max(baselines, key=lambda row: float(row.values("polygon_iou").mean()))
    margin = difference(rows["gaia"], best, groups, "polygon_iou")
    return [{"stressor": stressor.name, "setting": setting, "best": best.method, "margin": margin}]
