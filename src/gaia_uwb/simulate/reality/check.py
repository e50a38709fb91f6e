"""The statistical check of the simulator (the paper's Table 5) on runs that it was not fitted to.

The error model is fitted to the runs of two of the four cases, and the other cases' drives are
repeated with simulated errors (``replay.py``), for all six ways to choose two. Runs with and
without line of sight of one case stay together, since they share a layout and a path. Real and
simulated errors are measured by the same code; :data:`VIEWS` are the definitions.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import astuple, dataclass
from itertools import combinations
from types import MappingProxyType

import numpy as np

from gaia_uwb._shared import Array, Float64, InputError
from gaia_uwb.scene import Scene
from gaia_uwb.simulate import PRESETS, simulate
from gaia_uwb.simulate.reality.fit import fit_ranging
from gaia_uwb.simulate.reality.real_errors import ErrorDefinition, range_errors
from gaia_uwb.simulate.reality.replay import replay
from gaia_uwb.simulate.reality.statistics import (
    ErrorSummary,
    summarise,
    summary_intervals,
    wasserstein_m,
)
from gaia_uwb.simulate.settings import PassConfig, RangingConfig

PAPER_ROWS = MappingProxyType(
    {
        "real": ErrorSummary(-0.0385, 0.5127, 1.1279, 0.0120, 5.6889, 29.0),
        "naive": ErrorSummary(0.1680, 1.0564, 1.8520, 0.0563, 2.6068, 9.0),
        "calibrated": ErrorSummary(0.0662, 0.6303, 0.9009, 0.0066, 3.1784, 12.0),
    }
)
"""The paper's own Table 5."""

N_REPLAYS = 3
"""How often each drive is repeated, each time with other errors."""
N_PASSES = 20
"""Passes along the preset's lane closure, for the second view."""


@dataclass(frozen=True)
class View:
    """A definition of error and outlier, the same for real and simulated ranges."""

    name: str
    definition: ErrorDefinition
    outlier_m: float


VIEWS = (
    View("corrected", ErrorDefinition.CORRECTED, 1.0),
    View("corrected, 0.3 m", ErrorDefinition.CORRECTED, 0.3),
    View("paper", ErrorDefinition.PAPER, 1.0),
)
SIGHTS = ("all", "LOS", "NLOS")


@dataclass(frozen=True)
class Row:
    """One row of the table.

    Parameters
    ----------
    method
        ``real``, ``naive``, ``calibrated``, and the latter two on the lane closure.
    view
        How errors were measured.
    sight
        ``all``, ``LOS`` or ``NLOS`` readings.
    summary, intervals
        The columns, and their 95 % bootstrap intervals over runs.
    wasserstein_m
        Distance to the real errors of the same view and sight, in metres; 0 for ``real``.
    n
        Number of errors.
    """

    method: str
    view: View
    sight: str
    summary: ErrorSummary
    intervals: dict[str, tuple[float, float] | None]
    wasserstein_m: float
    n: int


@dataclass(frozen=True)
class Split:
    """One choice of the cases that the errors were fitted to.

    Parameters
    ----------
    fitted, held_out
        Names of the cases.
    view
        How errors were measured.
    real, calibrated
        Of the held-out cases' runs.
    """

    fitted: tuple[str, ...]
    held_out: tuple[str, ...]
    view: View
    real: ErrorSummary
    calibrated: ErrorSummary

    def gap_ratios(self) -> dict[str, float]:
        """Return each column's distance to the real value, over the same distance in the paper."""
        ours = np.abs(np.subtract(astuple(self.calibrated), astuple(self.real)))
        paper = np.subtract(astuple(PAPER_ROWS["calibrated"]), astuple(PAPER_ROWS["real"]))
        ratios = (ours / np.abs(paper)).tolist()
        return dict(zip(ErrorSummary.columns(), ratios, strict=True))


Runs = dict[str, list[Float64[Array, "_"]]]
"""The error tracks of each run, by the run's name."""


@dataclass(frozen=True)
class SimulatorCheck:
    """All that the check found.

    Parameters
    ----------
    rows, splits
        The tables.
    corrected_runs
        Error tracks by method, of the ``corrected`` definition, for pictures.
    fitted
        The error model fitted to all cases: what the preset ``calibrated`` ships.
    """

    rows: tuple[Row, ...]
    splits: tuple[Split, ...]
    corrected_runs: dict[str, Runs]
    fitted: RangingConfig


def check_simulator(
    scenes: Sequence[Scene],
    *,
    seed: int = 0,
    n_resamples: int = 200,
    n_replays: int = N_REPLAYS,
    n_passes: int = N_PASSES,
    each: Callable[[Sequence[tuple[str, ...]]], Iterable[tuple[str, ...]]] = iter,
) -> SimulatorCheck:
    """Compare real errors with those of simulators that have not seen the runs.

    Parameters
    ----------
    scenes
        Surveyed runs named ``SET:SIGHT/CASE``, like those of the outdoor UWB data set; runs of one
        case differ in their sight.
    seed
        Of all that is simulated, and of the bootstrap.
    n_resamples
        Of the bootstrap.
    n_replays, n_passes
        How often each drive is repeated, and passes along the lane closure.
    each
        Goes through the choices of cases; a progress bar may stand here.

    Raises
    ------
    InputError
        If there are fewer than four cases, or a scene has no surveyed anchors.
    """
    cases = sorted({case_of(scene) for scene in scenes})
    if len(cases) < 4:
        raise InputError(
            f"expected at least 4 cases, to fit some and check the others, got {cases}"
        )
    naive = PRESETS["naive"].ranging
    pools = {
        "real": list(scenes),
        "naive": [replay(s, naive, seed + k) for s in scenes for k in range(n_replays)],
        "calibrated": [],
    }
    splits: list[Split] = []
    for choice, fitted in enumerate(each(list(combinations(cases, len(cases) // 2)))):
        model = fit_ranging([scene for scene in scenes if case_of(scene) in fitted])
        held = [scene for scene in scenes if case_of(scene) not in fitted]
        seeds = range(seed + choice * n_replays, seed + (choice + 1) * n_replays)
        repeated = [replay(s, model, k) for s in held for k in seeds]
        pools["calibrated"] += repeated
        others = tuple(case for case in cases if case not in fitted)
        for view in VIEWS:
            real, simulated = (_summary(pool, view) for pool in (held, repeated))
            splits.append(Split(fitted, others, view, real, simulated))
    model = fit_ranging(scenes)
    pools |= _lane_closures({"naive": naive, "calibrated": model}, n_passes, seed)
    return SimulatorCheck(
        rows=tuple(_rows(pools, seed, n_resamples)),
        splits=tuple(splits),
        corrected_runs={
            method: _runs(pools[method], ErrorDefinition.CORRECTED, "all") for method in PAPER_ROWS
        },
        fitted=model,
    )


def case_of(scene: Scene) -> str:
    """Return the case of a run: what follows the sight in its name.

    Examples
    --------
    >>> from dataclasses import replace
    >>> from gaia_uwb.simulate import simulate_pass
    >>> case_of(replace(simulate_pass(PRESETS["parked"], seed=0), name="outdoor-uwb:LOS/A/1"))
    'A/1'
    """
    return scene.name.partition(":")[2].partition("/")[2]


def _lane_closures(
    models: dict[str, RangingConfig], n_passes: int, seed: int
) -> dict[str, list[Scene]]:
    """Simulate whole passes, with a vehicle's speed and a work zone's size."""
    return {
        f"{method}, lane closure": list(simulate(PassConfig(ranging=model), n_passes, seed))
        for method, model in models.items()
    }


def _rows(pools: dict[str, list[Scene]], seed: int, n_resamples: int) -> Iterator[Row]:
    """Yield the rows, view by view; passes of the simulator know only the corrected definition."""
    for view in VIEWS:
        for sight in SIGHTS:
            real = _runs(pools["real"], view.definition, sight)
            for method, pool in pools.items():
                if "," in method and view.definition is ErrorDefinition.PAPER:
                    continue
                runs = real if method == "real" else _runs(pool, view.definition, sight)
                if not runs:
                    continue
                yield _row(method, view, sight, runs, real, (seed, n_resamples))


def _row(
    method: str, view: View, sight: str, runs: Runs, real: Runs, bootstrap: tuple[int, int]
) -> Row:
    seed, n_resamples = bootstrap
    tracks = _all_tracks(runs)
    return Row(
        method=method,
        view=view,
        sight=sight,
        summary=summarise(tracks, outlier_m=view.outlier_m),
        intervals=summary_intervals(
            list(runs.values()), outlier_m=view.outlier_m, n_resamples=n_resamples, seed=seed
        ),
        wasserstein_m=0.0 if method == "real" else wasserstein_m(tracks, _all_tracks(real)),
        n=int(sum(np.isfinite(track).sum() for track in tracks)),
    )


def _summary(scenes: Sequence[Scene], view: View) -> ErrorSummary:
    tracks = _all_tracks(_runs(scenes, view.definition, "all"))
    return summarise(tracks, outlier_m=view.outlier_m)


def _runs(scenes: Sequence[Scene], definition: ErrorDefinition, sight: str) -> Runs:
    """Return the error tracks by run, NaN where the sight is another one; repeats are one run."""
    runs: Runs = {}
    for scene in scenes:
        nlos = None if scene.truth is None else scene.truth.nlos
        for track in range_errors(scene, definition):
            error_m = track.error_m
            if sight != "all":
                blocked = nlos is not None and nlos[track.reading]
                error_m = np.where(blocked == (sight == "NLOS"), error_m, np.nan)
            if np.isfinite(error_m).any():
                runs.setdefault(scene.name, []).append(error_m)
    return runs


def _all_tracks(runs: Runs) -> list[Float64[Array, "_"]]:
    return [track for tracks in runs.values() for track in tracks]
