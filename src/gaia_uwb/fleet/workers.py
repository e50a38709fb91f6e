"""Many zones: in several processes of this machine, or on the workers of a Dask scheduler."""

from __future__ import annotations

import multiprocessing
import os
from collections.abc import Generator, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from pathlib import Path

from gaia_uwb._shared import end_with_parent, without_interrupts
from gaia_uwb.config import PipelineConfig
from gaia_uwb.fleet.dask import reconstruct_on_scheduler
from gaia_uwb.fleet.manifests import ZoneLogs
from gaia_uwb.fleet.zones import KILLED, ONE_THREAD, ZoneResult, reconstruct_zone


def reconstruct_fleet(
    zones: Sequence[ZoneLogs],
    out: Path,
    config: PipelineConfig,
    *,
    workers: int = 1,
    scheduler: str | None = None,
) -> Generator[ZoneResult, None, None]:
    """Reconstruct many zones and yield each as it is done; the results are the same everywhere.

    Parameters
    ----------
    zones
        Each gets a folder of its name in ``out``.
    out
        Folder for all results.
    config
        All settings.
    workers
        Number of processes; a script that asks for several needs ``if __name__ == "__main__":``.
    scheduler
        Address of a Dask scheduler, such as ``tcp://host:8786``: its workers do the work instead.

    Raises
    ------
    ConfigError
        If the scheduler or one of its workers cannot do the work.
    """
    if scheduler is None:
        yield from _in_processes(zones, out, config, workers)
    else:
        yield from reconstruct_on_scheduler(zones, out, config, scheduler)


def _in_processes(
    zones: Sequence[ZoneLogs], out: Path, config: PipelineConfig, workers: int
) -> Iterator[ZoneResult]:
    waiting = list(reversed(zones))
    while waiting:
        killed: list[ZoneLogs] = []
        with _processes(workers) as pool:
            running: dict[Future[ZoneResult], ZoneLogs] = {}
            while running or (waiting and not killed):
                while waiting and not killed and len(running) < 2 * workers:
                    zone = waiting[-1]
                    try:
                        with _as_worker():  # a process is started here when one is needed
                            job = pool.submit(reconstruct_zone, zone, out / zone.name, config)
                    except BrokenProcessPool:  # told when the next result is asked for
                        break
                    running[job] = waiting.pop()
                if not running:
                    break
                for job in wait(running, return_when=FIRST_COMPLETED).done:
                    zone = running.pop(job)
                    if isinstance(job.exception(), BrokenProcessPool):
                        killed.append(zone)
                    else:
                        yield _result(zone, job)
        # A process was killed, and the pool with it. What it held starts again, each zone alone,
        # so that one that always ends so takes no other with it.
        for zone in killed:
            yield _alone(zone, out, config)


@contextmanager
def _processes(workers: int) -> Iterator[ProcessPoolExecutor]:
    """Give a pool of processes that end with the block: at once if the work is broken off."""
    # Processes are started afresh: a fork would copy other libraries' threads half-way.
    spawn = multiprocessing.get_context("spawn")
    others = set(multiprocessing.active_children())
    pool = ProcessPoolExecutor(workers, mp_context=spawn, initializer=end_with_parent)
    try:
        yield pool
    except BaseException:  # Ctrl-C, or whoever took the results wants no more
        # A file is renamed when it is whole, so none is left half-written.
        for process in set(multiprocessing.active_children()) - others:
            process.kill()
        raise
    finally:
        pool.shutdown(cancel_futures=True)


def _result(zone: ZoneLogs, job: Future[ZoneResult]) -> ZoneResult:
    """Return a job's result; one that could not even be handed over is a failed zone."""
    error = job.exception()
    return job.result() if error is None else ZoneResult.failed(zone, error)


def _alone(zone: ZoneLogs, out: Path, config: PipelineConfig) -> ZoneResult:
    """Reconstruct one zone in a process of its own."""
    with _processes(1) as pool:
        try:
            with _as_worker():
                job = pool.submit(reconstruct_zone, zone, out / zone.name, config)
            wait([job])
        except BrokenProcessPool:
            return ZoneResult.failed(zone, KILLED)
        killed = isinstance(job.exception(), BrokenProcessPool)
        return ZoneResult.failed(zone, KILLED) if killed else _result(zone, job)


@contextmanager
def _as_worker() -> Iterator[None]:
    """Give numerical libraries of new processes one thread each, and leave Ctrl-C to this one."""
    before: Mapping[str, str | None] = {name: os.environ.get(name) for name in ONE_THREAD}
    os.environ.update(dict.fromkeys(ONE_THREAD, "1"))
    try:
        with without_interrupts():
            yield
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value
