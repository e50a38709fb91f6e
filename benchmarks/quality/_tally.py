"""How the benchmarks count: anchors beside their true places, means of the metrics, tables."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from gaia_uwb._shared import CHI_SQUARE_90, Array, Bool, Float64
from gaia_uwb.evaluate import Metric, TestSet, aggregate
from gaia_uwb.simulate import find_preset, simulate_episodes


class Tally:
    """Anchors' two places beside the true one: the place that was chosen first, then the other."""

    def __init__(self) -> None:
        self._error_m: list[Float64[Array, "2"]] = []
        self._covered: list[Bool[Array, "2"]] = []

    def add(
        self,
        places_m: Float64[Array, "2 2"],
        covariances_m2: Float64[Array, "2 2 2"],
        true_m: Float64[Array, "2"],
    ) -> None:
        """Count an anchor; a place that there is not is NaN."""
        off_m = places_m - true_m
        self._error_m.append(np.linalg.norm(off_m, axis=1))
        self._covered.append(in_ellipse_90(off_m, covariances_m2))

    def __len__(self) -> int:
        return len(self._error_m)

    @property
    def error_m(self) -> Float64[Array, "K 2"]:
        """Distance of both places to the true one."""
        return np.array(self._error_m).reshape(-1, 2)

    @property
    def right(self) -> Bool[Array, "K"]:
        """Whether the other place is no nearer to the true one."""
        chosen_m, other_m = self.error_m.T
        return np.asarray(~(other_m < chosen_m - 1e-9))

    @property
    def nearer_m(self) -> Float64[Array, "K"]:
        """Distance of the nearer place: a wrong side is counted as such, not as an error, too."""
        return np.asarray(np.fmin(*self.error_m.T))

    @property
    def covered(self) -> Bool[Array, "K"]:
        """Whether the 90 % ellipse of the nearer place holds the true one."""
        chosen, other = np.array(self._covered).reshape(-1, 2).T
        return np.where(self.right, chosen, other)


def in_ellipse_90(
    off_m: Float64[Array, "K 2"], covariance_m2: Float64[Array, "K 2 2"]
) -> Bool[Array, "K"]:
    """Return whether 90 % ellipses hold places that are ``off_m`` from their middles."""
    solved = np.linalg.solve(covariance_m2, off_m[..., None])[..., 0]
    return np.asarray((off_m * solved).sum(axis=-1) <= CHI_SQUARE_90)


def simulated(preset: str, n: int, seed: int = 0) -> TestSet:
    """Return episodes straight from the simulator, each a run of its own."""
    episodes = tuple(simulate_episodes(find_preset(preset), n, seed))
    return TestSet(episodes, tuple(episode.name for episode in episodes), 0)


def means(
    per_episode: Sequence[Mapping[str, Metric]], groups: Sequence[str], names: Iterable[str]
) -> dict[str, float]:
    """Return the means over episodes of these metrics, where there is anything to count."""
    found = aggregate(per_episode, groups)
    return {name: found[name].value for name in names if name in found}


def table_head(names: Iterable[str]) -> str:
    """Return the first two lines of a Markdown table."""
    cells = list(names)
    return f"{table_row(cells)}\n{'|---' * len(cells)}|"


def table_row(cells: Iterable[object]) -> str:
    """Return a line of a Markdown table."""
    return f"| {' | '.join(map(str, cells))} |"


def table(names: Iterable[str], rows: Iterable[Iterable[object]]) -> str:
    """Return a whole Markdown table."""
    return "\n".join([table_head(names), *map(table_row, rows)]) + "\n"
