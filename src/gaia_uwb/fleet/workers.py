"""Many zones: in several processes of this machine, or on the workers of a Dask scheduler."""

from __future__ import annotations

import multiprocessing
import os
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from pathlib import Path

from gaia_uwb.config import PipelineConfig
from gaia_uwb.fleet.dask import reconstruct_on_scheduler
from gaia_uwb.fleet.zones import KILLED, ONE_THREAD, ZoneLogs, ZoneResult, reconstruct_zone


def reconstruct_fleet(
    zones: Sequence[ZoneLogs],
    out: Path,
    config: PipelineConfig,
    *,
    workers: int = 1,
    scheduler: str | None = None,
) -> Iterator[ZoneResult]:
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
                        with _one_thread():  # a process is started here when one is needed
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
                        yield job.result()
        # A process was killed, and the pool with it. What it held starts again, each zone alone,
        # so that one that always ends so takes no other with it.
        for zone in killed:
            yield _alone(zone, out, config)


def _processes(workers: int) -> ProcessPoolExecutor:
    # Processes are started afresh: a fork would copy other libraries' threads half-way.
    return ProcessPoolExecutor(workers, mp_context=multiprocessing.get_context("spawn"))


def _alone(zone: ZoneLogs, out: Path, config: PipelineConfig) -> ZoneResult:
    """Reconstruct one zone in a process of its own."""
    with _processes(1) as pool:
        try:
            with _one_thread():
                job = pool.submit(reconstruct_zone, zone, out / zone.name, config)
            return job.result()
        except BrokenProcessPool:
            return ZoneResult.failed(zone, KILLED)


@contextmanager
def _one_thread() -> Iterator[None]:
    """Give numerical libraries of new processes one thread each."""
    before: Mapping[str, str | None] = {name: os.environ.get(name) for name in ONE_THREAD}
    os.environ.update(dict.fromkeys(ONE_THREAD, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value
