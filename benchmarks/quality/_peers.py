"""The methods of the comparison with general solvers, and their results on disk.

A result is kept as soon as its drive is done, so that an interrupted run goes on. A file of
results begins anew when what made it has changed: the code of this comparison and of the drives,
and the package (for ours) or the solver's library (for the others).
"""

from __future__ import annotations

import hashlib
import json
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from importlib import import_module, metadata
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from scipy.optimize import least_squares

import _drives
import gaia_uwb
from _drives import Case, height_gap_m, in_drive, tag_at
from gaia_uwb import GaiaError, PipelineConfig, Scene
from gaia_uwb._shared import Array, Float64, replace_file

LOSS_SCALE_M = 0.15
N_STARTS = 8
NEAR_SHARE = 0.05  # the starts' range is this quantile: a spike may be shorter than any true range
OTHER_MINIMUM_M = 0.5  # a minimum that is closer than this to the best one is the same
SUFFIXES = {".py", ".so", ".json", ".yaml", ".onnx"}


@dataclass(frozen=True)
class Place:
    """Where a method puts a cone; lists of numbers, since it goes to JSON and back.

    ``position_m`` is NaN where it has none, ``mirror_probability`` where it states none.
    """

    anchor_id: str
    true_m: list[float]
    position_m: list[float]
    covariance_m2: list[list[float]]
    mirror_position_m: list[float]
    mirror_probability: float
    status: str
    side_is_open: bool = False

    @classmethod
    def of(
        cls,
        anchor_id: str,
        true_m: Float64[Array, "2"],
        position_m: Float64[Array, "2"],
        covariance_m2: Float64[Array, "2 2"],
        mirror_position_m: Float64[Array, "2"],
        *,
        mirror_probability: float = np.nan,
        status: str,
    ) -> Place:
        """Return a place from arrays."""
        return cls(
            anchor_id,
            true_m.tolist(),
            position_m.tolist(),
            covariance_m2.tolist(),
            mirror_position_m.tolist(),
            mirror_probability,
            status,
        )

    @classmethod
    def nowhere(cls, anchor_id: str, true_m: Float64[Array, "2"], *, status: str) -> Place:
        """Return the place of a cone that was not located."""
        no_position, no_covariance = np.full(2, np.nan), np.full((2, 2), np.nan)
        return cls.of(anchor_id, true_m, no_position, no_covariance, no_position, status=status)


@dataclass(frozen=True)
class Result:
    """A method's result of one case; ``status`` is empty where a method has no verdict."""

    name: str
    places: tuple[Place, ...]
    status: str
    processor_s: float


Method = Callable[[Sequence[Scene]], tuple[list[Place], str]]


@dataclass(frozen=True)
class Readings:
    """All readings of one anchor, of all passes: where the tag was, and what was measured."""

    tag_m: Float64[Array, "R 2"]
    height_gap_m: Float64[Array, "R"]
    range_m: Float64[Array, "R"]

    @classmethod
    def of(cls, passes: Sequence[Scene], anchor_id: str) -> Readings:
        """Collect an anchor's readings, with the pose interpolated at the time of each stamp."""
        tags, gaps, ranges = [], [], []
        for scene in passes:
            if anchor_id not in scene.anchor_ids:
                continue
            log, anchor = scene.ranges, scene.anchor_ids.index(anchor_id)
            rows = (log.anchor == anchor) & in_drive(scene)
            tag_m, tag_up_m = tag_at(scene, log.t_s[rows])
            tags.append(tag_m)
            gaps.append(height_gap_m(scene, tag_up_m, log.anchor[rows]))
            ranges.append(log.range_m[rows])
        return cls(np.concatenate(tags), np.concatenate(gaps), np.concatenate(ranges))

    def starts_m(self) -> Float64[Array, "S 2"]:
        """Return points around one of the nearest poses, at the distance measured there."""
        nearest = np.argsort(self.range_m)[int(NEAR_SHARE * len(self.range_m))]
        flat2_m2 = self.range_m[nearest] ** 2 - self.height_gap_m[nearest] ** 2
        angle_rad = 2 * np.pi * np.arange(N_STARTS) / N_STARTS
        around = np.stack([np.cos(angle_rad), np.sin(angle_rad)], axis=1)
        return np.asarray(self.tag_m[nearest] + np.sqrt(max(flat2_m2, 0.01)) * around)


class Solver(Protocol):
    """A general solver that locates one anchor from its readings."""

    def fit(
        self, readings: Readings, start_m: Float64[Array, "2"]
    ) -> tuple[float, Float64[Array, "2"]]:
        """Return the cost at the end, and the position there."""
        ...

    def covariance_m2(
        self, readings: Readings, position_m: Float64[Array, "2"]
    ) -> Float64[Array, "2 2"]:
        """Return the inverse of J'J at a solution, times the variance of the residuals."""
        ...


class SciPy:
    """`scipy.optimize.least_squares` with the Cauchy loss.

    The covariance is what `scipy.optimize.curve_fit` makes of such a fit.
    """

    def fit(
        self, readings: Readings, start_m: Float64[Array, "2"]
    ) -> tuple[float, Float64[Array, "2"]]:
        """Return the cost at the end, and the position there."""
        found = self._solution(readings, start_m)
        return float(found.cost), found.x

    def covariance_m2(
        self, readings: Readings, position_m: Float64[Array, "2"]
    ) -> Float64[Array, "2 2"]:
        """Return the inverse of J'J at a solution, times the variance of the residuals."""
        found = self._solution(readings, position_m)
        variance_m2 = 2 * found.cost / (len(readings.range_m) - 2)
        return np.asarray(np.linalg.pinv(found.jac.T @ found.jac) * variance_m2)

    @staticmethod
    def _solution(readings: Readings, start_m: Float64[Array, "2"]) -> Any:
        def distance_m(place_m: Float64[Array, "2"]) -> Float64[Array, "R"]:
            flat_m = np.hypot(*(place_m - readings.tag_m).T)
            return np.asarray(np.maximum(np.hypot(flat_m, readings.height_gap_m), 1e-6))

        def residual_m(place_m: Float64[Array, "2"]) -> Float64[Array, "R"]:
            return distance_m(place_m) - readings.range_m

        def jacobian(place_m: Float64[Array, "2"]) -> Float64[Array, "R 2"]:
            return (place_m - readings.tag_m) / distance_m(place_m)[:, None]

        options: dict[str, Any] = {"jac": jacobian, "loss": "cauchy", "f_scale": LOSS_SCALE_M}
        return least_squares(residual_m, start_m, **options)


class Gtsam:
    """GTSAM: a range factor from each fixed pose to the anchor, whose height is known.

    The covariance is GTSAM's marginal one, times the variance of the whitened residuals.
    """

    def __init__(self) -> None:
        self._gtsam = import_module("gtsam")
        noise = self._gtsam.noiseModel
        cauchy = noise.mEstimator.Cauchy.Create(1.0)
        self._ranging = noise.Robust.Create(cauchy, noise.Isotropic.Sigma(1, LOSS_SCALE_M))
        self._height = noise.Diagonal.Sigmas(np.array([1e5, 1e5, 1e-5]))

    def fit(
        self, readings: Readings, start_m: Float64[Array, "2"]
    ) -> tuple[float, Float64[Array, "2"]]:
        """Return the cost at the end, and the position there."""
        _, values, cost = self._solution(readings, start_m)
        return cost, values.atPoint3(0)[:2]

    def covariance_m2(
        self, readings: Readings, position_m: Float64[Array, "2"]
    ) -> Float64[Array, "2 2"]:
        """Return the inverse of J'J at a solution, times the variance of the residuals."""
        graph, values, cost = self._solution(readings, position_m)
        marginal_m2 = self._gtsam.Marginals(graph, values).marginalCovariance(0)[:2, :2]
        return np.asarray(marginal_m2 * 2 * cost / (len(readings.range_m) - 2))

    def _solution(self, readings: Readings, start_m: Float64[Array, "2"]) -> tuple[Any, Any, float]:
        gtsam = self._gtsam
        graph, values = gtsam.NonlinearFactorGraph(), gtsam.Values()
        anchor_m = np.append(start_m, 0.0)  # heights count from the anchor's
        graph.add(gtsam.PriorFactorPoint3(0, anchor_m, self._height))
        values.insert(0, anchor_m)
        poses_m = np.column_stack([readings.tag_m, readings.height_gap_m])
        for pose, (pose_m, range_m) in enumerate(zip(poses_m, readings.range_m, strict=True), 1):
            graph.add(gtsam.NonlinearEqualityPoint3(pose, pose_m))
            graph.add(gtsam.RangeFactor3(pose, 0, float(range_m), self._ranging))
            values.insert(pose, pose_m)
        optimizer = gtsam.LevenbergMarquardtOptimizer(graph, values)
        found = optimizer.optimize()
        return graph, found, float(optimizer.error())


def each_alone(solver: Solver) -> Method:
    """Return the method that locates each anchor by itself, from several starts."""

    def locate(passes: Sequence[Scene]) -> tuple[list[Place], str]:
        return [_located(solver, passes, *each) for each in _truths(passes)], ""

    return locate


def _located(
    solver: Solver, passes: Sequence[Scene], anchor_id: str, true_m: Float64[Array, "2"]
) -> Place:
    readings = Readings.of(passes, anchor_id)
    if len(readings.range_m) < 3:
        return Place.nowhere(anchor_id, true_m, status="too-few-ranges")
    minima = sorted(
        (solver.fit(readings, start_m) for start_m in readings.starts_m()),
        key=lambda minimum: minimum[0],
    )
    position_m = minima[0][1]
    others = [m for _, m in minima[1:] if np.hypot(*(m - position_m)) > OTHER_MINIMUM_M]
    covariance_m2 = solver.covariance_m2(readings, position_m)
    other_m = others[0] if others else np.full(2, np.nan)
    return Place.of(anchor_id, true_m, position_m, covariance_m2, other_m, status="ok")


def _truths(passes: Sequence[Scene]) -> Iterator[tuple[str, Float64[Array, "2"]]]:
    """Yield every anchor's name and true place, from the first pass that has it."""
    known: dict[str, Float64[Array, "2"]] = {}
    for scene in passes:
        assert scene.truth is not None
        for anchor_id, true_m in zip(scene.anchor_ids, scene.truth.anchor_m, strict=True):
            known.setdefault(anchor_id, true_m)
    yield from known.items()


def ours(config: PipelineConfig) -> Method:
    """Return `gaia_uwb.reconstruct`, which is given no truth; a log that it refuses is one."""

    def reconstruct(passes: Sequence[Scene]) -> tuple[list[Place], str]:
        blind = [scene.without_truth() for scene in passes]
        try:
            result = gaia_uwb.reconstruct(blind if len(blind) > 1 else blind[0], config)
        except GaiaError:
            return [Place.nowhere(*each, status="refused") for each in _truths(passes)], "refused"
        fixes = {fix.anchor_id: fix for fix in result.anchors}
        places = [
            replace(
                Place.of(
                    anchor_id,
                    true_m,
                    fixes[anchor_id].position_m,
                    fixes[anchor_id].covariance_m2,
                    fixes[anchor_id].mirror_position_m,
                    mirror_probability=fixes[anchor_id].mirror_probability,
                    status=fixes[anchor_id].status.value,
                ),
                side_is_open=fixes[anchor_id].side_is_open,
            )
            for anchor_id, true_m in _truths(passes)
        ]
        return places, result.status.value

    return reconstruct


def methods(names: Sequence[str], denoisers: Sequence[str]) -> dict[str, Method]:
    """Return the methods by name; GTSAM is left out, with a line, where it is not installed."""
    found: dict[str, Method] = {}
    if "ours" in names:
        found["ours"] = ours(PipelineConfig())
        found |= {f"ours, {name}": ours(PipelineConfig(denoiser=name)) for name in denoisers}
    if "gtsam" in names:
        try:
            found["GTSAM"] = each_alone(Gtsam())
        except ModuleNotFoundError:
            print("left out: gtsam is not installed", file=sys.stderr)
    if "scipy" in names:
        found["SciPy"] = each_alone(SciPy())
    return found


def made_by(method: str) -> str:
    """Return a digest of all that a method's results follow from, but for the data."""
    digest = hashlib.sha256()
    drives = (_drives.HELPERS / name for name in ("roads.py", "road_tags.py"))
    for path in (Path(__file__), Path(_drives.__file__), *drives):
        digest.update(path.read_bytes())
    if method.startswith("ours"):
        package = Path(gaia_uwb.__file__).parent
        for path in sorted(p for p in package.rglob("*") if p.suffix in SUFFIXES):
            digest.update(str(path.relative_to(package)).encode() + path.read_bytes())
    else:
        digest.update(metadata.version(method.lower()).encode())
    return digest.hexdigest()


def results_of(
    data: str,
    cases: Iterable[Case],
    method: str,
    locate: Method,
    folder: Path,
    *,
    before: Callable[[Case], None] = lambda case: None,
) -> list[Result]:
    """Return a method's results of all cases: those on disk, and the others computed and kept.

    What comes ``before`` a case is located is not part of its time.
    """
    path = folder / f"{data}, by {method}.json".replace(", ", "--").replace(" ", "-")
    digest, kept = made_by(method), {}
    if path.is_file():
        read = json.loads(path.read_text(encoding="utf-8"))
        if read["made_by"] == digest:
            kept = {each["name"]: each for each in read["results"]}
    found = []
    for case in cases:
        if case.name not in kept:
            before(case)
            kept[case.name] = asdict(_timed(case, locate))
            content = {"made_by": digest, "results": list(kept.values())}
            path.parent.mkdir(parents=True, exist_ok=True)
            replace_file(path, json.dumps(content))
            print(f"{data}: {case.name}: {method}: {kept[case.name]['processor_s']:.1f} s",
                  file=sys.stderr, flush=True)  # fmt: skip
        found.append(_from_json(kept[case.name]))
    return found


def _timed(case: Case, locate: Method) -> Result:
    start_s = time.process_time()
    places, status = locate(case.passes)
    return Result(case.name, tuple(places), status, time.process_time() - start_s)


def _from_json(read: dict[str, Any]) -> Result:
    places = tuple(Place(**place) for place in read["places"])
    return Result(read["name"], places, read["status"], read["processor_s"])
