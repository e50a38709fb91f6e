"""How good edges, ends and forms of zones along roads are: docs/edge-numbers.md.

    python benchmarks/quality/road_edges.py --n 24                      # prints the page
    python benchmarks/quality/road_edges.py --n 100 --table docs/edge-numbers.md

The results are kept in benchmarks/out/road-edges/: an interrupted run goes on from there, and a run
with a larger --n computes the further drives only.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

import _tally
from _drives import HELPERS
from gaia_uwb import PipelineConfig, __version__
from gaia_uwb._shared import replace_file
from gaia_uwb.config import BoundaryConfig
from gaia_uwb.evaluate import reconstruct_and_score

ROOT = Path(__file__).parents[2]
OUT = ROOT / "benchmarks" / "out" / "road-edges"
CLOSED_LANES = 1
NEAR_M = 0.5
FIRST_SEED = 200  # earlier ones, and those from 1,000, were looked at while the method was made
HEAD = """\
# The edge of a zone, in numbers

Written by `python benchmarks/quality/road_edges.py --n {n} --table docs/edge-numbers.md`; not edited by hand.

{n} zones (`road_form` in `tests/helpers/road_forms.py`, seeds from {first}; the method was developed on others): roads
that are straight, bend or are S-curves of 300 to 1,500 m radius; 20 to 40 cones in rows with tapers, with a gap, on both
sides of the lane, on both sides of the works, or around a closed lane; one drive, two in neighbouring lanes, two in
opposite directions, or one that turns round. The radios err as in `WITH_PATTERNS` of `tests/helpers/roads.py`: noise
0.06 m, range bias 0.15 m, delays and patterns of tag and cones, clocks 0.12 s apart, trucks in the way. All results are
`gaia_uwb.reconstruct` with default settings, which is given no truth, but that {lanes} lane is said to be closed behind a
row, so that every zone has a closed area.

*Settled* are zones in which no side is open; single drives that keep their speed leave sides open. All columns from
*edge error* on are of these, but for *band*. Edges are compared every metre, except in gaps, with lines through the true
places of the cones (`gaia_uwb.evaluate.road_scores`); *95 % of a zone's* errors are not larger, as a mean over zones.
*Band* is the share of the true edge inside the 90 % band, where there is an edge on its side. *Ends within {near} m* counts
zones whose start and end both are; *90 % intervals* is the share of starts and ends inside theirs: drives in one direction
do not tell a clock offset from a shift along the road. *Path inside* is the longest stretch of a driven path inside the
closed area, or its inner region. *Inner* and *outer* are the shares of zones for which what is said of these regions is
true.
"""  # noqa: E501
COLUMNS = (
    "zones", "n", "form right", "settled", "edge error, mean (m)", "95 % of a zone's (m)",
    "worst (m)", "band", "free width off by (m)", "ends within 0.5 m", "90 % intervals",
    "path inside (m)", "IoU", "inner", "outer",
)  # fmt: skip


@dataclass(frozen=True)
class Row:
    """What came out for one zone.

    Parameters
    ----------
    seed
        Of the zone.
    road, form, kind
        What it is.
    form_right
        Whether one zone of this form was found.
    is_settled
        Whether no side is open.
    status
        Of the result.
    scores
        Metric's name -> value and count.
    """

    seed: int
    road: str
    form: str
    kind: str
    form_right: bool
    is_settled: bool
    status: str
    scores: dict[str, tuple[float, int]]


def compute(seed: int) -> Row:
    """Reconstruct and score the zone of a seed."""
    if str(HELPERS) not in sys.path:
        sys.path.insert(0, str(HELPERS))
    forms: Any = import_module("road_forms")
    case = forms.road_form(seed)
    config = PipelineConfig(boundary=BoundaryConfig(closed_lanes=CLOSED_LANES))
    result, scores = reconstruct_and_score(case.drives, config)
    boundary = result.road_boundary
    zones = boundary.zones if boundary is not None else ()
    return Row(
        seed, case.road, case.form, case.kind,
        form_right=[zone.form.value for zone in zones] == [forms.NAMES[case.form]],
        is_settled=not any(anchor.side_is_open for anchor in result.anchors),
        status=result.status.value,
        scores={name: (metric.value, metric.n) for name, metric in (scores or {}).items()},
    )  # fmt: skip


def rows(n: int, folder: Path) -> Iterator[Row]:
    """Yield the results of the first n seeds; those that are not there yet are computed."""
    folder.mkdir(parents=True, exist_ok=True)
    for number in range(n):
        seed = FIRST_SEED + number
        path = folder / f"{seed}.json"
        if not path.exists():
            print(f"\r{number + 1} of {n} ", end="", file=sys.stderr, flush=True)
            replace_file(path, json.dumps(asdict(compute(seed))))
        content = json.loads(path.read_text(encoding="utf-8"))
        yield Row(**content)
    print(file=sys.stderr)


def cells(name: str, found: Sequence[Row]) -> list[str]:
    """Return the cells of :data:`COLUMNS`."""
    settled = [row for row in found if row.is_settled]

    def share(values: Sequence[bool]) -> str:
        return f"{sum(values)} of {len(values)}"

    def mean(metric: str, of: Sequence[Row] = settled) -> float:
        values, counts = np.array([row.scores[metric] for row in of if metric in row.scores]).T
        return float(np.average(values, weights=counts))

    def largest(*metrics: str) -> float:
        return max(row.scores.get(metric, (0.0, 1))[0] for row in settled for metric in metrics)

    if not settled:
        return [name, str(len(found)), share([row.form_right for row in found]), "0", *[""] * 11]
    ends = [
        max(row.scores[metric][0] for metric in ("zone_start_error", "zone_end_error")) <= NEAR_M
        for row in settled
    ]
    return [
        name,
        str(len(found)),
        share([row.form_right for row in found]),
        str(len(settled)),
        f"{mean('edge_error_mean'):.3f}",
        f"{mean('edge_error_95'):.3f}",
        f"{largest('edge_error_worst'):.2f}",
        percent(mean("edge_band_coverage_90", found)),
        f"{mean('free_width_error'):.3f}",
        share(ends),
        percent(mean("zone_ends_coverage_90")),
        f"{largest('path_in_closed_area', 'path_in_inner_region'):.1f}",
        f"{mean('closed_area_iou'):.3f}",
        percent(mean("inner_region_right")),
        percent(mean("outer_region_right")),
    ]


def percent(share: float) -> str:
    """Return a share as text."""
    return f"{100 * share:.1f} %"


def page(found: Sequence[Row]) -> str:
    """Return the page."""
    parts: list[tuple[str, Callable[[Row], str]]] = [
        ("By drives", lambda row: row.kind),
        ("By form", lambda row: row.form),
        ("By road", lambda row: row.road),
        ("By status", lambda row: row.status),
    ]
    text = [HEAD.format(n=len(found), near=NEAR_M, lanes="one", first=FIRST_SEED)]
    text.append(_tally.table(COLUMNS, [cells("all", found)]))
    for title, of in parts:
        names = dict.fromkeys(of(row) for row in found)
        grouped = [cells(name, [row for row in found if of(row) == name]) for name in names]
        text += [f"## {title}\n", _tally.table(COLUMNS, grouped)]
    return "\n".join([*text, f"gaia {__version__}.\n"])


def main(arguments: Sequence[str] | None = None) -> None:
    """Compute what is not yet computed, and print or write the page."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--n", type=int, default=100, help="number of zones")
    parser.add_argument("--out", type=Path, default=OUT, help="folder of the results")
    parser.add_argument("--table", type=Path, help="write the page here instead of printing it")
    given = parser.parse_args(arguments)
    text = page(list(rows(given.n, given.out)))
    if given.table is None:
        print(text)
    else:
        replace_file(given.table, text)


if __name__ == "__main__":
    main()
