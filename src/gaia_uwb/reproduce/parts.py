"""The parts that one command makes: each computes, writes its files, and adds to results.json.

``results.json`` holds what every part found, with the code's checksum. A part that other code or
another plan made is thrown away when something is added, so that it never holds a mixture.
"""

from __future__ import annotations

import json
import platform
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

from gaia_uwb.reproduce import outdoor, robustness, stress_test
from gaia_uwb.reproduce.digests import code_digest, digest_of
from gaia_uwb.reproduce.formats import (
    differences_markdown,
    latex_table,
    marked,
    results_csv,
    results_markdown,
)
from gaia_uwb.reproduce.jobs import n_cores
from gaia_uwb.reproduce.paper import ABLATION, METRICS, TABLE_1, TABLE_2
from gaia_uwb.reproduce.plan import ablation_methods, existing_methods
from gaia_uwb.reproduce.robustness_formats import (
    robustness_csv,
    robustness_latex,
    summary_markdown,
)
from gaia_uwb.reproduce.scores import Table, episodes_csv, table_json
from gaia_uwb.reproduce.workshop import Ledger, Workshop, all_trainings

RESULTS = "results.json"
ALIGNMENT_METRICS = {
    "distance_mse_overall": "MSE (m²)",
    "anchor_mae": "anchor error (m)",
    "polygon_iou": "IoU",
    "polygon_hausdorff": "Hausdorff (m)",
    "anchor_mae_aligned": "error after rigid alignment (m)",
    "anchor_mae_right_side": "error given the right side (m)",
    "wrong_side_share": "wrong sides",
    "ellipse_coverage_90_aligned": "90 % ellipse, aligned",
    "region_coverage_90_aligned": "90 % region of open sides too, aligned",
}
"""Columns of the tables on what the alignment is worth."""


def _stress_part(
    workshop: Workshop, name: str, table: Table, paper: Mapping[str, Sequence[float]]
) -> dict[str, Any]:
    workshop.stress_tables[name] = table
    content = table_json(table)
    text = f"{results_markdown(content, paper)}\n{differences_markdown(content)}"
    _write(workshop, f"{name}.md", text)
    _write(workshop, f"{name}.tex", latex_table(content, paper))
    _write(workshop, f"{name}.csv", results_csv({name: content}))
    _write(workshop, f"{name}-episodes.csv", episodes_csv([(name, table)]))
    return {"tables": {name: content}}


def make_table1(workshop: Workshop) -> dict[str, Any]:
    """Make table 1: the outdoor data in every split, preparation and length.

    Parameters
    ----------
    workshop
        What all parts need.
    """
    tables = workshop.outdoor_tables = outdoor.outdoor_tables(workshop)
    contents = {name: table_json(table) for name, table in tables.items()}
    texts, latex = [], []
    for name, content in contents.items():
        paper = TABLE_1 if name.endswith("64/wls") else None
        texts.append(
            f"## {name}\n\n{results_markdown(content, paper)}\n{differences_markdown(content)}"
        )
        latex.append(f"% {name}\n{latex_table(content, paper)}")
    _write(workshop, "table1.md", "\n".join(texts))
    _write(workshop, "table1.tex", "\n".join(latex))
    _write(workshop, "table1.csv", results_csv(contents))
    _write(workshop, "table1-episodes.csv", episodes_csv(list(tables.items())))
    return {"tables": contents}


def make_table2(workshop: Workshop) -> dict[str, Any]:
    """Make table 2: the stress test.

    Parameters
    ----------
    workshop
        What all parts need.
    """
    table = stress_test.stress_table(workshop, existing_methods())
    return _stress_part(workshop, "table2", table, TABLE_2)


def make_ablation(workshop: Workshop) -> dict[str, Any]:
    """Make table 3: GAIA's variants on the stress test.

    Parameters
    ----------
    workshop
        What all parts need.
    """
    table = stress_test.stress_table(workshop, ablation_methods())
    return _stress_part(workshop, "ablation", table, ABLATION)


def make_table4(workshop: Workshop) -> dict[str, Any]:
    """Make table 4: the stress test under more stress.

    Parameters
    ----------
    workshop
        What all parts need.
    """
    content = workshop.robustness = robustness.robustness_table(workshop)
    _write(workshop, "table4.md", summary_markdown(content))
    _write(workshop, "table4.tex", robustness_latex(content))
    _write(workshop, "table4.csv", robustness_csv(content))
    return dict(content)


def make_table5(workshop: Workshop) -> dict[str, Any]:
    """Make table 5: the simulator's statistical check.

    Parameters
    ----------
    workshop
        What all parts need.
    """
    from gaia_uwb.reproduce.simulator_table import reproduce_table5, table5_json

    def each(choices: Sequence[tuple[str, ...]]) -> Iterable[tuple[str, ...]]:
        for k, choice in enumerate(choices):
            workshop.watch(f"{k + 1} of {len(choices)}: errors fitted to {', '.join(choice)}")
            yield choice

    check = reproduce_table5(
        workshop.scenes, workshop.folder, plan=workshop.plan, version=workshop.version, each=each
    )
    return table5_json(check, plan=workshop.plan)


def make_alignment(workshop: Workshop) -> dict[str, Any]:
    """Make the tables on what each part of the alignment is worth.

    Parameters
    ----------
    workshop
        What all parts need.
    """
    tables = outdoor.alignment_tables(workshop)
    names = tuple(dict.fromkeys([*METRICS, *ALIGNMENT_METRICS]))
    contents = {
        title: table_json(table, metrics=names, differences=False)
        for title, table in tables.items()
    }
    texts = [
        f"## {title}\n\n{results_markdown(content, metrics=ALIGNMENT_METRICS)}"
        for title, content in contents.items()
    ]
    _write(workshop, "alignment.md", "\n".join(texts))
    latex = (f"% {title}\n{latex_table(content)}" for title, content in contents.items())
    _write(workshop, "alignment.tex", "\n".join(latex))
    _write(workshop, "alignment.csv", results_csv(contents))
    return {"tables": contents}


def make_figures(workshop: Workshop) -> dict[str, Any]:
    """Draw all figures; what they show is made again from the predictions where it is not at hand.

    Parameters
    ----------
    workshop
        What all parts need.
    """
    from gaia_uwb.reproduce.figures import draw_figures

    for name in ("table1", "table2", "table4", "table5"):
        if name not in workshop.parts and not (name == "table5" and _is_fresh(workshop, name)):
            run_part(workshop, name)
    return {
        "figures": draw_figures(
            workshop,
            workshop.stress_tables["table2"],
            workshop.outdoor_tables,
            workshop.robustness,
        )
    }


PARTS: dict[str, Callable[[Workshop], dict[str, Any]]] = {
    "table5": make_table5,
    "alignment": make_alignment,
    "table2": make_table2,
    "ablation": make_ablation,
    "table4": make_table4,
    "table1": make_table1,
    "figures": make_figures,
}
"""All parts, in the order in which ``all`` makes them: first those without training."""

FIRST_TRAINED = "table2"


def run_part(workshop: Workshop, name: str) -> dict[str, Any]:
    """Make one part and add it to ``results.json``.

    Parameters
    ----------
    workshop
        What all parts need.
    name
        A key of :data:`PARTS`.
    """
    workshop.watch(f"== {name}")
    outer, workshop.ledger = workshop.ledger, Ledger()
    start = time.perf_counter()
    content = PARTS[name](workshop)
    content["cost"] = workshop.ledger.cost() | {"wall_s": round(time.perf_counter() - start, 1)}
    content["key"] = _part_key(workshop)
    content["quick"] = workshop.plan.quick
    workshop.ledger = outer
    workshop.parts.add(name)
    results = read_results(workshop)
    results["parts"][name] = content
    _write_results(workshop, results)
    return content


def run_all(workshop: Workshop) -> None:
    """Make every part; all models are trained together, which keeps all workers busy.

    Parameters
    ----------
    workshop
        What all parts need.
    """
    start = time.perf_counter()
    for name in PARTS:
        if name == FIRST_TRAINED:
            workshop.train([*all_trainings(workshop), *outdoor.outdoor_trainings(workshop)])
        run_part(workshop, name)
    _write_results(
        workshop, read_results(workshop) | {"wall_s": round(time.perf_counter() - start)}
    )


def read_results(workshop: Workshop) -> dict[str, Any]:
    """Return ``results.json`` with the parts that this code and this plan made.

    Parameters
    ----------
    workshop
        What all parts need.
    """
    head = {
        "schema": 1,
        "version": workshop.version,
        "quick": workshop.plan.quick,
        "plan": workshop.plan.describe(),
        "machine": f"{n_cores()} cores, {platform.machine()}",
        "parts": {},
    }
    try:
        text = (workshop.folder.path / RESULTS).read_text(encoding="utf-8")
        parts = json.loads(text)["parts"]
    except (OSError, ValueError, KeyError, TypeError):
        return head
    key = _part_key(workshop)
    head["parts"] = {name: part for name, part in parts.items() if part.get("key") == key}
    return head


def _is_fresh(workshop: Workshop, name: str) -> bool:
    return name in read_results(workshop)["parts"]


def _part_key(workshop: Workshop) -> str:
    """Return the checksum of the plan and of all code that numbers depend on."""
    code = code_digest(
        "reproduce.robustness", "reproduce.outdoor", "reproduce.stress_test", "denoisers",
        "reproduce.simulator_table", "simulate",
        without=("_shared.files", "_shared.figures", "reproduce.formats", "reproduce.plots"),
    )  # fmt: skip
    return digest_of([workshop.plan.describe(), code])


def _write_results(workshop: Workshop, results: dict[str, Any]) -> None:
    text = json.dumps(results, indent=1, allow_nan=False) + "\n"
    workshop.folder.write(RESULTS, text)


def _write(workshop: Workshop, name: str, text: str) -> None:
    workshop.folder.write(name, marked(name, text, workshop.plan))
