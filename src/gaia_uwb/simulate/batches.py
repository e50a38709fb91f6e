"""Many simulated passes, one at a time or on several processes; each is what it is alone."""

from __future__ import annotations

import traceback
from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import ExitStack
from multiprocessing import get_context
from multiprocessing.connection import Connection

from gaia_uwb._shared import ConfigError, without_interrupts
from gaia_uwb.episode import Episode
from gaia_uwb.scene import Scene
from gaia_uwb.simulate.blocks import EpisodeBlock, simulate_blocks
from gaia_uwb.simulate.passes import simulate_pass
from gaia_uwb.simulate.settings import PassConfig

_CHUNK = 100  # episodes that are computed at once: more do not fit into a processor's cache


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
    config: PassConfig, n: int, seed: int, *, first: int = 0, workers: int = 1
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
    first
        Number of the first episode, at least 0: those before it are left out.
    workers
        Processes that work on it; the episodes do not depend on it. With more than one, a script
        needs the usual ``if __name__ == "__main__":``.

    Yields
    ------
    Episode
        Episode ``first`` to n - 1, each what :func:`simulate_episode` makes of it alone.

    Raises
    ------
    ConfigError
        Like :func:`simulate_episode`.

    Examples
    --------
    >>> from gaia_uwb.simulate import PRESETS
    >>> [episode.n_anchors for episode in simulate_episodes(PRESETS["stress"], 3, seed=0)]
    [9, 11, 10]
    """
    starts = range(first, n, _CHUNK)
    made = (simulate_blocks(config, seed, _chunk(start, n)) for start in starts)
    for blocks in made if workers == 1 else _simulate_elsewhere(config, n, seed, starts, workers):
        yield from _in_order(blocks)


def _chunk(start: int, n: int) -> range:
    """Return the numbers of the episodes that are computed at once."""
    return range(start, min(start + _CHUNK, n))


def _in_order(blocks: list[EpisodeBlock]) -> Iterator[Episode]:
    """Return the episodes of a chunk in the order of their numbers."""
    if len(blocks) == 1:
        return blocks[0].episodes()
    episodes = {
        number: episode
        for block in blocks
        for number, episode in zip(block.numbers, block.episodes(), strict=True)
    }
    return (episodes[number] for number in sorted(episodes))


def _simulate_elsewhere(
    config: PassConfig, n: int, seed: int, starts: range, workers: int
) -> Iterator[list[EpisodeBlock]]:
    """Return the chunks of episodes, which several processes make in turn.

    Each has a pipe of its own, which is read here and not in a thread beside: that would wait for
    Python's lock after every 64 kB. A process that is two chunks ahead waits until it is read from,
    which bounds the memory.
    """
    # Processes are started afresh: a fork would copy other libraries' threads half-way.
    context = get_context("spawn")
    with ExitStack() as stack:
        pipes = []
        for worker in range(workers):
            here, there = context.Pipe(duplex=False)
            process = context.Process(
                target=_work, args=(there, config, n, seed, starts[worker::workers]), daemon=True
            )
            with without_interrupts():
                process.start()
            there.close()  # it is the worker's now: without it, the pipe has ended
            for clean_up in (process.join, process.terminate, here.close):
                stack.callback(clean_up)  # called last first
            pipes.append(here)
        for k in range(len(starts)):
            try:
                made = pipes[k % workers].recv()
            except EOFError as error:
                problem = "a simulating process was killed from outside, perhaps for lack of memory"
                raise ConfigError(problem) from error
            if isinstance(made, Exception):
                raise made
            yield made


def _work(pipe: Connection, config: PassConfig, n: int, seed: int, starts: range) -> None:
    """Send the chunks that start with these episodes, or the error that stops them."""
    with ThreadPoolExecutor(1) as sender:
        sent: Future[None] | None = None
        for start in starts:
            try:
                made: list[EpisodeBlock] | Exception
                made = simulate_blocks(config, seed, _chunk(start, n))
            except Exception as error:  # it is raised where somebody waits, and told there
                error.add_note("".join(traceback.format_exception(error)))
                made = error
            if sent is not None:
                sent.result()
            sent = sender.submit(pipe.send, made)  # while the next chunk is made
            if isinstance(made, Exception):
                return
