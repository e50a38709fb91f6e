"""Judge GAIA and general solvers by the same yardstick, and write docs/certainty-numbers.md.

    python benchmarks/quality/peers.py                     # all data that are here; prints the page
    python benchmarks/quality/peers.py --data lias outdoor-uwb --methods ours scipy --runs
    python benchmarks/quality/peers.py --table docs/certainty-numbers.md

The recorded data are expected in `../shared/data` beside the repository, or in --data-dir. The
results are kept in benchmarks/out/peers/: an interrupted run goes on from there, and a second run
only writes the tables. Processor times are those of the run that computed the results.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import _tally
from _drives import PAIRS, data_sets, passes_of
from _peers import Result, methods, results_of
from gaia_uwb import __version__
from gaia_uwb._shared import CHI_SQUARE_90, Array, Bool, Float64, replace_file
from gaia_uwb.evaluate import rigid_align, rotation_matrix
from gaia_uwb.zone import polygon_iou

ROOT = Path(__file__).parents[2]
OUT = ROOT / "benchmarks" / "out" / "peers"
DATA_DIR = ROOT.parent / "shared" / "data"
DATA = ("lias", "outdoor-uwb", "shuffled", "roads", "patterns")
METHODS = ("ours", "gtsam", "scipy")
N_SEEDS, N_RESAMPLES = 50, 2000
CHI_SQUARE_99_9 = 2.0 * np.log(1000.0)
SIGMAS_95 = 1.96
APART_M, APART_SIGMA = 0.1, 3.0  # as the metrics of `gaia evaluate` tell two positions apart
FEWEST_TO_ALIGN = 3
HEAD = """\
# Certainty: GAIA beside general solvers

Written by `python benchmarks/quality/peers.py --table docs/certainty-numbers.md`; not edited by
hand. All methods get the same logs, and no method sees the truth.

- *ours* is `gaia_uwb.reconstruct` with its default settings, or with the denoiser that is named.
- *SciPy* is `least_squares` with the Cauchy loss of scale 0.15 m, and *GTSAM* its range factors
  from fixed poses with the Cauchy noise model of the same scale. Both locate each anchor by itself
  from 8 starts and keep the best minimum. They use every reading at its own stamp, with the pose
  interpolated, the heights known, and neither a clock offset nor a range bias. Of several passes
  they get all readings. Their covariance is the inverse of J'J at the solution times the variance
  of the residuals: what a user of such a solver would take.

Columns: *RMSE* and *median error* are over all cones with a position, whatever their status.
*RMSE / SciPy's* is the geometric mean over runs of the ratio, on cones that both located. *IoU* is
that of the hulls, where the true hull has an area. *90 % ellipse* is the share of cones called ok
whose ellipse holds the true position, with their number and a 95 % interval: the wider of Wilson's
and a bootstrap over runs. *Aligned* is the same after the rigid move that brings a run's ok cones
nearest to the survey (three cones at least): it takes out what the frames of trajectory and
survey differ by, and some error with it. *Beyond 99.9 %* counts cones called ok outside their
99.9 % ellipse. *Wrong sides* counts cones called ok that are nearer to their other position, and
beside it stands how many the stated probabilities expect; both only where the two positions are
apart by 0.1 m and 3 standard deviations. General solvers call every cone ok that has 3 readings,
state no probability of a side, and have no verdict on a log. Their other position is their next
minimum.
"""
NOTES = {
    "lias": "Indoors, two drives with three tags each: runs of one drive are not independent.",
    "outdoor-uwb, errors shuffled": (
        "Every anchor's range errors (measured minus true, at the run's own clock offset), each "
        "moved to another moment of the same run. Compared with the runs as they are, this shows "
        "what errors that belong to a place do to the coverage."
    ),
    "outdoor-uwb, blocks of 8 s shuffled": (
        "The same, but errors are moved in blocks of 8 s, within which they keep their order."
    ),
}
COLUMNS = (
    "cones", "located", "called ok", "RMSE (m)", "median error (m)", "RMSE / SciPy's", "IoU",
    "90 % ellipse", "aligned", "beyond 99.9 %", "wrong sides (expected)", "logs ok",
    "processor s",
)  # fmt: skip
FUSED_HEAD = """\
## Fused passes beside the better one

For each pair of passes, the median error over the cones that both passes and the fused result
located. The better pass is the one with the smaller median. *Fused worse* counts pairs whose fused
median exceeds the better pass's by more than the fused result states: the median over these cones
of the longer semi-axis of the 90 % ellipse.
"""
FUSED_COLUMNS = (
    "passes", "method", "pairs", "fused: median error (m)", "better pass: median error (m)",
    "stated by the fused (m)", "fused worse",
)  # fmt: skip


@dataclass(frozen=True)
class Cones:
    """The cones of one result as arrays; ``ok`` are those called ok."""

    true_m: Float64[Array, "N 2"]
    position_m: Float64[Array, "N 2"]
    covariance_m2: Float64[Array, "N 2 2"]
    mirror_position_m: Float64[Array, "N 2"]
    mirror_probability: Float64[Array, "N"]
    ok: Bool[Array, "N"]

    @classmethod
    def of(cls, result: Result) -> Cones:
        """Collect the places of a result."""
        places = result.places
        return cls(
            true_m=np.array([place.true_m for place in places]),
            position_m=np.array([place.position_m for place in places]),
            covariance_m2=np.array([place.covariance_m2 for place in places]),
            mirror_position_m=np.array([place.mirror_position_m for place in places]),
            mirror_probability=np.array([place.mirror_probability for place in places]),
            ok=np.array([place.status == "ok" for place in places]),
        )

    @property
    def error_m(self) -> Float64[Array, "N"]:
        """Distance to the true place, NaN where there is no position."""
        return np.asarray(np.hypot(*(self.position_m - self.true_m).T))

    def chi_square(self) -> Float64[Array, "K"]:
        """Return the squared errors of the ok cones, in standard deviations."""
        off_m = (self.position_m - self.true_m)[self.ok]
        return squared_sigmas(off_m, self.covariance_m2[self.ok])

    def chi_square_aligned(self) -> Float64[Array, "K"]:
        """Return the same after rigid alignment; nothing where the cones are too few for it."""
        if self.ok.sum() < FEWEST_TO_ALIGN:
            return np.zeros(0)
        alignment = rigid_align(self.position_m[self.ok], self.true_m[self.ok])
        turn = rotation_matrix(alignment.rotation_rad)
        covariance_m2 = turn @ self.covariance_m2[self.ok] @ turn.T
        return squared_sigmas(alignment.points_m - self.true_m[self.ok], covariance_m2)

    def sides(self) -> tuple[int, float]:
        """Return how many ok cones are on the wrong side, and how many are expected to be."""
        apart_m = self.position_m - self.mirror_position_m
        distance_m = np.hypot(*apart_m.T)
        variance_m4 = np.einsum("ni,nij,nj->n", apart_m, self.covariance_m2, apart_m)
        clear = self.ok & (distance_m > APART_M)
        clear &= distance_m**2 > APART_SIGMA * np.sqrt(variance_m4)
        wrong = np.hypot(*(self.mirror_position_m - self.true_m).T) < self.error_m
        return int((wrong & clear).sum()), float(np.nansum(self.mirror_probability[clear]))

    def iou(self) -> float:
        """Return the IoU of the hulls, NaN where the true one has no area."""
        if polygon_iou(self.true_m, self.true_m) == 0.0:
            return np.nan
        return polygon_iou(self.position_m[np.isfinite(self.error_m)], self.true_m)


def squared_sigmas(
    off_m: Float64[Array, "K 2"], covariance_m2: Float64[Array, "K 2 2"]
) -> Float64[Array, "K"]:
    """Return Mahalanobis distances squared; infinite where an ellipse has no area."""
    (xx, xy), (_, yy) = covariance_m2.transpose(1, 2, 0)
    determinant_m4 = xx * yy - xy**2
    east_m, north_m = off_m.T
    square_m4 = yy * east_m**2 - 2 * xy * east_m * north_m + xx * north_m**2
    flat = determinant_m4 <= 0
    return np.where(flat, np.inf, square_m4 / np.where(flat, 1.0, determinant_m4))


def interval_95(inside: Sequence[Bool[Array, "K"]]) -> tuple[float, float]:
    """Return the wider of Wilson's interval and that of a bootstrap over runs.

    Parameters
    ----------
    inside
        For each run, which of its cones were inside; not all empty.
    """
    count, n = np.array([[each.sum(), len(each)] for each in inside], dtype=np.float64).T
    share, total = count.sum() / n.sum(), n.sum()
    z2 = SIGMAS_95**2
    middle = (share + z2 / (2 * total)) / (1 + z2 / total)
    half = np.sqrt(z2 * (share * (1 - share) + z2 / (4 * total)) / total) / (1 + z2 / total)
    rng = np.random.default_rng(0)
    drawn = rng.integers(len(n), size=(N_RESAMPLES, len(n)))
    counts, totals = count[drawn].sum(axis=1), n[drawn].sum(axis=1)
    low, high = np.quantile((counts[totals > 0] / totals[totals > 0]), [0.025, 0.975])
    return min(middle - half, float(low)), max(middle + half, float(high))


def summary(results: Sequence[Result], reference: Sequence[Result] | None) -> list[str]:
    """Return the cells of :data:`COLUMNS` for these runs; the reference is SciPy's results."""
    cones = [Cones.of(result) for result in results]
    error_m = np.concatenate([each.error_m for each in cones])
    found_m = error_m[np.isfinite(error_m)]
    chi_square = np.concatenate([each.chi_square() for each in cones])
    wrong, expected = np.sum([each.sides() for each in cones], axis=0)
    iou = np.array([each.iou() for each in cones])
    states_sides = any(np.isfinite(each.mirror_probability).any() for each in cones)
    verdicts = [result.status for result in results if result.status]
    return [
        str(len(error_m)),
        str(len(found_m)),
        str(sum(int(each.ok.sum()) for each in cones)),
        number(float(np.sqrt(np.mean(found_m**2))) if len(found_m) else np.nan),
        number(float(np.median(found_m)) if len(found_m) else np.nan),
        "none" if reference is None else number(ratio(cones, [Cones.of(r) for r in reference])),
        number(float(np.nanmean(iou)) if np.isfinite(iou).any() else np.nan),
        coverage([each.chi_square() for each in cones]),
        coverage([each.chi_square_aligned() for each in cones]),
        str(int((chi_square > CHI_SQUARE_99_9).sum())),
        f"{wrong:.0f} ({f'{expected:.1f}' if states_sides else 'none stated'})",
        f"{verdicts.count('ok')} of {len(verdicts)}" if verdicts else "none",
        f"{sum(result.processor_s for result in results):.1f}",
    ]


def number(value: float) -> str:
    """Return a number with three digits, or a word where there is none."""
    return f"{value:.3g}" if np.isfinite(value) else "none"


def coverage(chi_square: Sequence[Float64[Array, "K"]]) -> str:
    """Return the share inside the 90 % ellipse with number and interval."""
    inside = [each <= CHI_SQUARE_90 for each in chi_square]
    pooled = np.concatenate(inside)
    if not len(pooled):
        return "none"
    low, high = interval_95(inside)
    return f"{pooled.mean():.1%} of {len(pooled)} [{low:.1%}, {high:.1%}]".replace("%", " %")


def ratio(cones: Sequence[Cones], reference: Sequence[Cones]) -> float:
    """Return the geometric mean over runs of the RMSE beside the reference's, on shared cones."""
    logarithms = []
    for one, other in zip(cones, reference, strict=True):
        both = np.isfinite(one.error_m) & np.isfinite(other.error_m)
        if both.any():
            squared = [np.mean(each.error_m[both] ** 2) for each in (one, other)]
            logarithms.append(0.5 * np.log(squared[0] / squared[1]))
    return float(np.exp(np.mean(logarithms))) if logarithms else np.nan


def fused_row(fused: Sequence[Result], passes: Sequence[Result]) -> list[str]:
    """Return the cells of :data:`FUSED_COLUMNS` after the first two."""
    singles: dict[str, list[Cones]] = {}
    for result in passes:
        singles.setdefault(result.name.rpartition("-")[0], []).append(Cones.of(result))
    rows = []
    for result in fused:
        together, alone = Cones.of(result), singles[result.name]
        shared = np.isfinite([each.error_m for each in (together, *alone)]).all(axis=0)
        if shared.any():
            longer_m2 = np.linalg.eigvalsh(together.covariance_m2[shared])[:, -1]
            better_m = min(np.median(each.error_m[shared]) for each in alone)
            stated_m = np.median(np.sqrt(CHI_SQUARE_90 * longer_m2))
            rows.append([np.median(together.error_m[shared]), better_m, stated_m])
    columns = np.array(rows).reshape(-1, 3).T
    medians = [number(float(np.median(column))) if rows else "none" for column in columns]
    fused_m, least_m, states_m = columns
    return [str(len(rows)), *medians, str(int((fused_m - least_m > states_m).sum()))]


AllResults = Mapping[str, Mapping[str, Sequence[Result]]]


def page(results: AllResults) -> str:
    """Return the page: a table per data set, and what fusing gains."""
    pairs = [f"road, {kind}" for kind in PAIRS if f"road, {kind}" in results]
    parts = [HEAD]
    for data, found in results.items():
        if data in map(passes_of, pairs):
            continue
        n_runs = len(next(iter(found.values())))
        parts.append(f"## {data}, n = {n_runs}\n")
        if data in NOTES:
            parts.append(NOTES[data] + "\n")
        rows = ([name, *summary(each, found.get("SciPy"))] for name, each in found.items())
        parts.append(_tally.table(("method", *COLUMNS), rows))
    if pairs:
        parts += [FUSED_HEAD, _tally.table(FUSED_COLUMNS, _fused_rows(results, pairs))]
    parts.append(f"gaia {__version__}.\n")
    return "\n".join(parts)


def _fused_rows(results: AllResults, pairs: Iterable[str]) -> Iterable[list[str]]:
    for data in pairs:
        for name, fused in results[data].items():
            yield [data, name, *fused_row(fused, results[passes_of(data)][name])]


def runs_table(found: Mapping[str, Sequence[Result]]) -> str:
    """Return a row for each run and method."""
    reference = found.get("SciPy")
    rows = []
    for k, runs in enumerate(zip(*found.values(), strict=True)):
        for name, run in zip(found, runs, strict=True):
            rows.append([run.name, name, *summary([run], reference and [reference[k]])])
    return _tally.table(("run", "method", *COLUMNS), rows)


def main(arguments: Sequence[str] | None = None) -> None:
    """Compute what is not yet computed, and print or write the tables."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--data", nargs="+", choices=DATA, default=DATA)
    parser.add_argument("--methods", nargs="+", choices=METHODS, default=METHODS)
    parser.add_argument(
        "--denoiser", nargs="+", default=[], help="denoisers of ours besides the default"
    )
    parser.add_argument("--n", type=int, default=N_SEEDS, help="seeds of each kind of road drive")
    parser.add_argument("--runs", action="store_true", help="print every run, too")
    parser.add_argument("--data-dir", type=Path, default=DATA_DIR)
    parser.add_argument("--out", type=Path, default=OUT, help="folder of the results")
    parser.add_argument("--table", type=Path, help="write the page here instead of printing it")
    given = parser.parse_args(arguments)
    chosen = methods(given.methods, given.denoiser)
    results = {
        data: {
            name: results_of(data, cases(), name, method, given.out)
            for name, method in chosen.items()
        }
        for data, cases in data_sets(given.data, given.n, given.data_dir).items()
    }
    if not results:
        parser.error("none of the data is here")
    if given.runs:
        for data, found in results.items():
            print(f"{data}\n\n{runs_table(found)}")
    if given.table is None:
        print(page(results))
    else:
        replace_file(given.table, page(results))


if __name__ == "__main__":
    main()
