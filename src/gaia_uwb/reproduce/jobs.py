"""Independent jobs in processes of their own, each on one thread, in the order that ends soonest.

A job may wait for others. Of those that are ready the one goes first on whose chain of waiting jobs
most work hangs. Whoever watches is told after each job how much is left.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

from gaia_uwb._shared import ConfigError, end_with_parent, without_interrupts

_THREADS = ("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS")


@dataclass(frozen=True)
class Job:
    """Something to be done once.

    Parameters
    ----------
    name
        Unique among the jobs.
    work
        A function of a module, so that another process can call it.
    arguments
        What it is called with.
    after
        Names of the jobs that must be done before; those that are not there count as done.
    expected_s
        About how long it takes, in seconds on one thread.
    """

    name: str
    work: Callable[..., Any]
    arguments: tuple[Any, ...]
    after: tuple[str, ...] = ()
    expected_s: float = 1.0


def run_jobs(
    jobs: Sequence[Job], workers: int, watch: Callable[[str], None] = lambda text: None
) -> dict[str, Any]:
    """Do all jobs and return what each returned, by name.

    Parameters
    ----------
    jobs
        In any order.
    workers
        Number of processes; with 0 the jobs are done in this process, one by one.
    watch
        Is told what was done and how much time is left.

    Raises
    ------
    ConfigError
        If a process was ended from outside.

    Examples
    --------
    >>> jobs = [Job("b", pow, (2, 3), after=("a",)), Job("a", pow, (2, 2))]
    >>> run_jobs(jobs, 0)
    {'a': 4, 'b': 8}
    """
    order = _by_urgency(jobs)
    names = {job.name for job in jobs}
    done: dict[str, Any] = {}
    clock = _Clock(order, max(1, workers))
    if workers == 0:
        while len(done) < len(order):
            job = next(job for job in order if _ready(job, names, done))
            done[job.name] = job.work(*job.arguments)
            watch(clock.line(job))
        return done
    with _pool(workers) as pool:
        running: dict[Future[Any], Job] = {}
        started: set[str] = set()
        while len(done) < len(order):
            for job in order:
                if len(running) < workers and job.name not in started and _ready(job, names, done):
                    with without_interrupts():  # a process is started here when one is needed
                        running[pool.submit(job.work, *job.arguments)] = job
                    started.add(job.name)
            for future in wait(running, return_when=FIRST_COMPLETED).done:
                job = running.pop(future)
                try:
                    done[job.name] = future.result()
                except BrokenProcessPool as error:
                    raise ConfigError(
                        f"{job.name}: its process was killed from outside, perhaps for lack of "
                        "memory; the same command resumes, --workers 1 needs less"
                    ) from error
                watch(clock.line(job))
    return done


def _ready(job: Job, names: set[str], done: Mapping[str, Any]) -> bool:
    return job.name not in done and all(n in done or n not in names for n in job.after)


def _by_urgency(jobs: Sequence[Job]) -> list[Job]:
    """Return the jobs, those first on whose chain of waiting jobs most work hangs."""
    weight = {job.name: job.expected_s for job in jobs}
    for _ in jobs:  # chains are short; so many rounds are always enough
        before = dict(weight)
        for job in jobs:
            for name in job.after:
                if name in weight:
                    own = next(j.expected_s for j in jobs if j.name == name)
                    weight[name] = max(weight[name], own + weight[job.name])
        if weight == before:
            break
    return sorted(jobs, key=lambda job: -weight[job.name])


@dataclass
class _Clock:
    """Guesses how much time is left from what the jobs took that are done."""

    jobs: Sequence[Job]
    workers: int

    def __post_init__(self) -> None:
        self.start = time.monotonic()
        self.done: list[Job] = []

    def line(self, job: Job) -> str:
        """Return what to say now that a job is done."""
        self.done.append(job)
        done_s = sum(j.expected_s for j in self.done)
        all_s = sum(j.expected_s for j in self.jobs)
        left_s = (time.monotonic() - self.start) * (all_s - done_s) / done_s
        return f"{len(self.done)} of {len(self.jobs)}: {job.name}; about {spell(left_s)} left"


def n_cores() -> int:
    """Return how many processors this process may use, where the system says so."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def spell(duration_s: float) -> str:
    """Return a duration in words.

    Parameters
    ----------
    duration_s
        In seconds.

    Examples
    --------
    >>> spell(42.3), spell(612.0), spell(8000.0)
    ('42 s', '10 min', '2 h 13 min')
    """
    if duration_s < 90:
        return f"{duration_s:.0f} s"
    hours, minutes = divmod(round(duration_s / 60), 60)
    return f"{hours} h {minutes:02d} min" if hours else f"{minutes} min"


@contextmanager
def _pool(workers: int) -> Iterator[ProcessPoolExecutor]:
    """Start fresh processes whose libraries use one thread each, and end them whatever happens."""
    from multiprocessing import get_context

    before = {name: os.environ.get(name) for name in _THREADS}
    os.environ.update(dict.fromkeys(_THREADS, "1"))  # read when a library is loaded
    pool = ProcessPoolExecutor(workers, get_context("spawn"), initializer=end_with_parent)
    try:
        yield pool
    except BaseException:
        for process in list((pool._processes or {}).values()):
            process.terminate()  # what it has written so far is kept, and taken up again
        raise
    finally:
        pool.shutdown(wait=True, cancel_futures=True)
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value
