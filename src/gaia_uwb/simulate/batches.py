"""Many simulated passes, one at a time or on several processes; each is what it is alone."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from dataclasses import fields
from itertools import islice

import numpy as np

from gaia_uwb.episode import Episode
from gaia_uwb.scene import Scene
from gaia_uwb.simulate.passes import simulate_episode, simulate_pass
from gaia_uwb.simulate.settings import PassConfig

_CHUNK = 100  # episodes that a process makes at once
_AHEAD = 3  # chunks per process that may wait to be used: this bounds the memory


def simulate(config: PassConfig, n: int, seed: int) -> Iterator[Scene]:
    """Simulate a batch of passes as vehicles record them, one at a time.

    Parameters
    ----------
    config
        Settings of the batch.
    n
        Number of passes.
    seed
        Seed of the batch, at least 0.

    Yields
    ------
    Scene
        Pass 0 to n - 1, each what :func:`simulate_pass` makes of it alone.

    Raises
    ------
    ConfigError
        Like :func:`simulate_pass`.
    """
    return (simulate_pass(config, seed, episode=k) for k in range(n))


def simulate_episodes(
    config: PassConfig, n: int, seed: int, *, workers: int = 1
) -> Iterator[Episode]:
    """Simulate a batch of episodes, one at a time.

    Parameters
    ----------
    config
        Settings of the batch.
    n
        Number of episodes.
    seed
        Seed of the batch, at least 0.
    workers
        Processes that work on it; the episodes do not depend on it. With more than one, a script
        needs the usual ``if __name__ == "__main__":``.

    Yields
    ------
    Episode
        Episode 0 to n - 1, each what :func:`simulate_episode` makes of it alone.

    Raises
    ------
    ConfigError
        Like :func:`simulate_episode`.

    Examples
    --------
    >>> from gaia_uwb.simulate.presets import PRESETS
    >>> [episode.n_anchors for episode in simulate_episodes(PRESETS["stress"], 3, seed=0)]
    [9, 11, 10]
    """
    if workers == 1:
        yield from (simulate_episode(config, seed, episode=k) for k in range(n))
        return
    from concurrent.futures import Future, ProcessPoolExecutor
    from multiprocessing import get_context

    # Processes are started afresh: a fork would copy other libraries' threads half-way.
    starts = iter(range(0, n, _CHUNK))
    with ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool:

        def submit(start: int) -> Future[list[Episode]]:
            return pool.submit(_simulate_chunk, config, start, min(start + _CHUNK, n), seed)

        waiting = deque(submit(start) for start in islice(starts, _AHEAD * workers))
        while waiting:
            episodes = waiting.popleft().result()
            waiting.extend(submit(start) for start in islice(starts, 1))
            for episode in episodes:
                _protect(episode)
                yield episode


def _simulate_chunk(config: PassConfig, start: int, stop: int, seed: int) -> list[Episode]:
    return [simulate_episode(config, seed, episode=k) for k in range(start, stop)]


def _protect(part: object) -> None:
    """Make arrays read-only again, which they are no longer after a journey between processes."""
    for field in fields(part):  # type: ignore[arg-type]  # an episode or its truth
        value = getattr(part, field.name)
        if isinstance(value, np.ndarray):
            value.flags.writeable = False
        elif field.name == "truth" and value is not None:
            _protect(value)
