"""The domain of a model of the paper's networks: its units of length, and what it has seen."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from pydantic import Field

from gaia_uwb._shared import InputError
from gaia_uwb.config import Settings
from gaia_uwb.episode import Episode

_STRANGE_SHARE = 0.1  # of a path outside what a model has seen


class Normalisation(Settings):
    """How lengths become numbers about 1: one scale for all of them, so that geometry holds."""

    origin_east_m: float = Field(ge=-1e8, le=1e8)
    origin_north_m: float = Field(ge=-1e8, le=1e8)
    scale_m: float = Field(gt=0, le=1e6)

    @classmethod
    def fit(cls, episodes: Sequence[Episode]) -> Normalisation:
        """Centre the paths, and scale by the root mean square of the ranges.

        Parameters
        ----------
        episodes
            Those that a model is trained on.

        Raises
        ------
        InputError
            If there is no range in them.
        """
        position_m = np.concatenate([episode.position_m for episode in episodes])
        range_m = np.concatenate([episode.range_m[episode.valid] for episode in episodes])
        if not len(range_m):
            raise InputError("expected episodes with ranges to train on, got none")
        east_m, north_m = position_m.mean(axis=0)
        return cls(
            origin_east_m=round(float(east_m), 3),
            origin_north_m=round(float(north_m), 3),
            scale_m=round(float(np.sqrt(np.mean(range_m**2))), 3),
        )


class Domain(Settings):
    """What a model has seen in training; elsewhere it guesses."""

    east_m: tuple[float, float] = Field(strict=False)
    """Least and largest east of the path."""
    north_m: tuple[float, float] = Field(strict=False)
    range_m: tuple[float, float] = Field(strict=False)
    n_anchors: tuple[int, int] = Field(strict=False)

    @classmethod
    def of(cls, episodes: Sequence[Episode]) -> Domain:
        """Return the domain of some episodes.

        Parameters
        ----------
        episodes
            At least one, with ranges.
        """
        position_m = np.concatenate([episode.position_m for episode in episodes])
        range_m = np.concatenate([episode.range_m[episode.valid] for episode in episodes])
        counts = [episode.n_anchors for episode in episodes]
        return cls(
            east_m=_span(position_m[:, 0]),
            north_m=_span(position_m[:, 1]),
            range_m=_span(range_m),
            n_anchors=(min(counts), max(counts)),
        )

    def strange(self, episode: Episode) -> list[str]:
        """Say in words how an episode differs from what a model has seen; nothing if it does not.

        Parameters
        ----------
        episode
            Any.
        """
        reasons = []
        share = self.outside_share(episode)
        if share > _STRANGE_SHARE:
            reasons.append(
                f"{100 * share:.0f} % of the path lies outside the area that it was trained on"
            )
        low, high = self.n_anchors
        if not low <= episode.n_anchors <= high:
            seen = f"{low}" if low == high else f"{low} to {high}"
            reasons.append(f"it was trained on {seen} cones, this log has {episode.n_anchors}")
        return reasons

    def outside_share(self, episode: Episode) -> float:
        """Return which share of an episode's path lies outside, with 10 % slack.

        Parameters
        ----------
        episode
            Any.
        """
        inside = np.ones(episode.n_steps, dtype=np.bool_)
        for axis, (low_m, high_m) in enumerate((self.east_m, self.north_m)):
            slack_m = 0.1 * (high_m - low_m)
            value_m = episode.position_m[:, axis]
            inside &= (value_m >= low_m - slack_m) & (value_m <= high_m + slack_m)
        return float(1.0 - inside.mean())


def _span(value: np.ndarray) -> tuple[float, float]:
    """Return the least and the largest value, rounded outwards to millimetres."""
    return float(np.floor(value.min() * 1e3) / 1e3), float(np.ceil(value.max() * 1e3) / 1e3)
