"""What a denoiser is, and how the classical ones work: on columns.

A column is one anchor of one episode. Columns of episodes with equally many steps are laid side by
side, and a method runs once over the steps for all of them: filters loop over T in Python and over
columns in numpy. No operation looks across columns, so each result is, to the last bit, what its
column alone gives, and a column of NaN touches no other. Columns are taken in chunks that bound
the memory.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

import numpy as np

from gaia_uwb._shared import Array, Float64
from gaia_uwb.config import Settings
from gaia_uwb.denoised import DenoisedRanges
from gaia_uwb.episode import Episode
from gaia_uwb.estimate import Reason

_CHUNK = 3 << 20  # readings laid side by side at a time
_SCALE_TO_SIGMA = float(np.sqrt(2.0))  # of the Student-t errors with 4 dof that are calibrated


class Options(Settings):
    """Base of every denoiser's options: strict, frozen, no unknown keys."""


class Denoiser(ABC):
    """Turn episodes into denoised ranges.

    Parameters
    ----------
    options
        An instance of the class's ``Options``.
    """

    Options: ClassVar[type[Options]] = Options
    """Model of its options; none by default."""
    uses_pose: ClassVar[bool] = False
    """Whether it uses the vehicle's pose."""
    keeps_ranges: ClassVar[bool] = False
    """Whether it leaves the ranges as they were measured."""
    locates: ClassVar[bool] = False
    """Whether it locates the anchors and pulls its ranges towards those places. A later step that
    locates the anchors again uses the measured ranges: these ones would only repeat the result."""

    def __init__(self, options: Any) -> None:
        self.options = options

    @abstractmethod
    def __call__(self, episodes: Sequence[Episode]) -> list[DenoisedRanges]:
        """Denoise episodes; each result is what the episode alone would give.

        Parameters
        ----------
        episodes
            Any number of episodes, of any lengths.

        Returns
        -------
        list of DenoisedRanges
            One per episode, in their order. ``sigma_m`` counts the error that neighbouring
            readings share where the episode's calibration knows it.
        """

    def notes(self, episode: Episode) -> tuple[Reason, ...]:
        """Return why its result for an episode is not reliable; nothing if it is.

        Parameters
        ----------
        episode
            Any.
        """
        del episode
        return ()


@dataclass(frozen=True)
class Part:
    """Some anchors of one episode."""

    index: int
    episode: Episode
    anchors: slice

    @property
    def width(self) -> int:
        """Number of anchors."""
        return len(range(*self.anchors.indices(self.episode.n_anchors)))


@dataclass(frozen=True)
class Columns:
    """Anchors of episodes with equally many steps, side by side: C columns.

    Parameters
    ----------
    parts
        Where the columns come from, from left to right.
    t_s, range_m : (T, C)
        Time in seconds, and the measured range in metres, NaN where not valid.
    """

    parts: tuple[Part, ...]
    t_s: Float64[Array, "T C"]
    range_m: Float64[Array, "T C"]


class ColumnRanges(NamedTuple):
    """Ranges of columns and their standard deviations, in metres; both NaN where not valid."""

    range_m: Float64[Array, "T C"]
    sigma_m: Float64[Array, "T C"]


class ColumnDenoiser(Denoiser):
    """A denoiser that treats every anchor of every episode on its own."""

    def __call__(self, episodes: Sequence[Episode]) -> list[DenoisedRanges]:
        """Denoise episodes; see the base class."""
        range_m = [np.empty(episode.range_m.shape) for episode in episodes]
        sigma_m = [np.empty(episode.range_m.shape) for episode in episodes]
        for columns in _chunks(episodes):
            found = self.denoise(columns)
            start = 0
            for part in columns.parts:
                cut = slice(start, start := start + part.width)
                range_m[part.index][:, part.anchors] = found.range_m[:, cut]
                total_m = np.hypot(found.sigma_m[:, cut], _slow_sigma_m(part.episode))
                sigma_m[part.index][:, part.anchors] = total_m
        return [_frozen(value, sigma) for value, sigma in zip(range_m, sigma_m, strict=True)]

    @abstractmethod
    def denoise(self, columns: Columns) -> ColumnRanges:
        """Return ranges and their standard deviations as if errors were independent, in metres.

        Parameters
        ----------
        columns
            What was measured.

        """


def _chunks(episodes: Sequence[Episode]) -> Iterator[Columns]:
    """Yield all columns, as many at a time as the memory's bound allows."""
    lengths = sorted({episode.n_steps for episode in episodes})
    for length in lengths:
        limit = max(1, _CHUNK // length)
        parts: list[Part] = []
        room = limit
        for index, episode in enumerate(episodes):
            start = 0
            while episode.n_steps == length and start < episode.n_anchors:
                stop = min(start + room, episode.n_anchors)
                parts.append(Part(index, episode, slice(start, stop)))
                room -= stop - start
                start = stop
                if room == 0:
                    yield _columns(parts)
                    parts, room = [], limit
        if parts:
            yield _columns(parts)


def _columns(parts: list[Part]) -> Columns:
    return Columns(
        parts=tuple(parts),
        t_s=np.repeat(
            np.stack([part.episode.t_s for part in parts], axis=1),
            [part.width for part in parts],
            axis=1,
        ),
        range_m=np.concatenate([part.episode.range_m[:, part.anchors] for part in parts], axis=1),
    )


def _slow_sigma_m(episode: Episode) -> float:
    """Return the standard deviation of the error that neighbouring readings share.

    Of errors whose correlation sums up to k steps, the share 1 / k is as good as independent and
    goes away with filtering; the rest stays (multipath, a body in the way). White noise has k = 1.
    """
    known = episode.calibration
    if known is None:
        return 0.0
    return _SCALE_TO_SIGMA * known.sigma_m * float(np.sqrt(1.0 - 1.0 / known.correlation))


def _frozen(range_m: Float64[Array, "T N"], sigma_m: Float64[Array, "T N"]) -> DenoisedRanges:
    """Hand the arrays over read-only, so that they are not copied."""
    valid = np.isfinite(range_m)
    for array in (range_m, sigma_m, valid):
        array.flags.writeable = False
    return DenoisedRanges(range_m=range_m, sigma_m=sigma_m, valid=valid)
