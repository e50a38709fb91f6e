"""Where the random numbers of a pass come from: one source for each kind of number.

Each is a Philox generator whose key is the seed and the number of the episode, and whose counter
starts at the kind's number. So one seed gives the same passes everywhere, alone or in a batch, and
numbers of one kind do not depend on how many of another are drawn.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from gaia_uwb._shared import Array, ConfigError, Float64

Stream = Callable[[str], np.random.Generator]
"""Gives the source of randomness of a name: one source per kind of number."""

_STREAMS = (
    "zone", "obstacles", "positions", "polls",
    "ranging-uniform", "ranging-normal", "drift", "tails", "power",
    "vehicle", "azimuth", "wild-azimuth",
)  # fmt: skip
_STREAM_NUMBER = {name: number for number, name in enumerate(_STREAMS)}
_RADIO = 64  # numbers kept for the kinds of each radio of a pass
_SEEDS = 2**64


class Source:
    """The random numbers of a batch.

    There is one generator per kind of number; to ask for the stream of another pass sets it back,
    ten times faster than making a new one. So the passes draw one after another.

    Parameters
    ----------
    seed
        Seed of the batch.
    """

    def __init__(self, seed: int) -> None:
        self._seed = seed
        self._generators: dict[int, tuple[np.random.Generator, dict[str, Any]]] = {}

    def stream(self, episode: int, *, radio: int = 0) -> Stream:
        """Return what gives a pass its source of randomness of each name.

        Parameters
        ----------
        episode
            Number of the pass in its batch.
        radio
            Which radio of the pass it is for: 0 for the first tag and for all that is no radio's.

        Raises
        ------
        ConfigError
            If the seed or the episode's number is not in 0 ... 2^64 - 1.
        """
        seed = self._seed
        if not (0 <= seed < _SEEDS and 0 <= episode < _SEEDS):
            raise ConfigError(
                f"expected a seed and an episode below 2^64, got {seed} and {episode}"
            )
        key = np.array([seed, episode], dtype=np.uint64)

        def stream(name: str) -> np.random.Generator:
            number = _STREAM_NUMBER[name] + _RADIO * radio
            if number not in self._generators:
                self._generators[number] = _new_generator(number)
            generator, start = self._generators[number]
            start["state"]["key"] = key
            generator.bit_generator.state = start
            return generator

        return stream


def _new_generator(number: int) -> tuple[np.random.Generator, dict[str, Any]]:
    """Return a generator and its state before the first draw, with a counter of this number."""
    counter = np.array([0, 0, 0, number], dtype=np.uint64)
    generator = np.random.Generator(np.random.Philox(key=0, counter=counter))
    return generator, dict(generator.bit_generator.state)


@dataclass(frozen=True)
class RowStreams:
    """Random numbers for the anchors of several passes, row by row.

    Parameters
    ----------
    streams
        The passes' sources of randomness.
    counts
        Their numbers of rows; the rows of a pass stand together, in the order of the passes.
    """

    streams: Sequence[Stream]
    counts: Sequence[int]

    def uniform(self, name: str, *shape: int) -> Float64[Array, "N *shape"]:
        """Return numbers between 0 and 1 of this shape for each row."""
        drawn = np.empty((sum(self.counts), *shape))
        for rng, rows in self._rows(name):
            rng.random(out=drawn[rows])
        return drawn

    def normal(self, name: str, *shape: int) -> Float64[Array, "N *shape"]:
        """Return standard normal numbers of this shape for each row."""
        drawn = np.empty((sum(self.counts), *shape))
        for rng, rows in self._rows(name):
            rng.standard_normal(out=drawn[rows])
        return drawn

    def common_normal(self, name: str, size: int) -> Float64[Array, "N size"]:
        """Return standard normal numbers that the rows of a pass have in common."""
        drawn = np.empty((sum(self.counts), size))
        for rng, rows in self._rows(name):
            drawn[rows] = rng.standard_normal(size)
        return drawn

    def gamma(self, name: str, order: Float64[Array, "N 1"], size: int) -> Float64[Array, "N size"]:
        """Return standard gamma numbers of each row's order."""
        drawn = np.empty((len(order), size))
        for rng, rows in self._rows(name):
            rng.standard_gamma(order[rows], out=drawn[rows])
        return drawn

    def _rows(self, name: str) -> Iterator[tuple[np.random.Generator, slice]]:
        stop = 0
        for stream, count in zip(self.streams, self.counts, strict=True):
            start, stop = stop, stop + count
            yield stream(name), slice(start, stop)
