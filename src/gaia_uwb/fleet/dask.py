"""Many zones on the workers of a Dask scheduler, which may be other machines.

Logs and results lie on a file system that all of them share, under the same names: only names and
settings travel. Every worker is checked before the work starts, and again with every zone since it
may have joined later. Only so many zones are handed over at a time as
keep the workers busy. Dask gives the zones of a worker that dies to others.
"""

from __future__ import annotations

import asyncio
import logging
import os
import sys
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import chdir, closing, contextmanager, nullcontext
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import TYPE_CHECKING, Any

from gaia_uwb._shared import ConfigError, OutputFolder, temporary_path
from gaia_uwb.config import PipelineConfig
from gaia_uwb.fleet.manifests import ZoneLogs
from gaia_uwb.fleet.zones import KILLED, ONE_THREAD, ZoneResult, reconstruct_zone

if TYPE_CHECKING:
    from distributed import Client, Future

_ANSWER_S = 10.0
_WITHOUT_WORKERS_S = 60.0
_PACKAGE = "gaia-uwb"


@dataclass(frozen=True)
class _Terms:
    """What a worker must meet.

    Parameters
    ----------
    version
        Of gaia.
    here
        The folder that relative names start from.
    out
        The folder for all results.
    witness
        A file in it that exists as long as the work continues.
    """

    version: str
    here: Path
    out: Path
    witness: Path


def reconstruct_on_scheduler(
    zones: Sequence[ZoneLogs], out: Path, config: PipelineConfig, address: str
) -> Iterator[ZoneResult]:
    """Reconstruct zones on the workers of a Dask scheduler and yield each as it is done.

    Parameters
    ----------
    zones
        Each gets a folder of its name in ``out``.
    out
        Folder for all results; all workers see it.
    config
        All settings.
    address
        The scheduler's, such as ``tcp://host:8786``.

    Raises
    ------
    ConfigError
        If Dask is not installed, no scheduler or worker answers, or one of them is not suitable.
    """
    with _connected(address) as client, _witness(out) as witness:
        terms = _Terms(version(_PACKAGE), Path.cwd(), out, witness)
        with _lost_is_an_error(address):
            _check_all(client, address, terms)
        work = _Work(client, address, config, terms)
        killed: list[ZoneLogs] = []
        for zone, result in work.results(zones):
            if result is None:
                killed.append(zone)
            else:
                yield result
        # Dask blames whatever a dead worker held. Alone, a zone that is innocent shows that it is.
        for each in killed:
            for zone, result in work.results([each]):
                yield ZoneResult.failed(zone, KILLED) if result is None else result


@contextmanager
def _connected(address: str) -> Iterator[Client]:
    if find_spec("distributed") is None:
        raise ConfigError("--scheduler needs the extra 'fleet': pip install 'gaia-uwb[fleet]'")
    from distributed import Client

    # Dask's client waits without end for something that is not a scheduler, such as a web server.
    with ThreadPoolExecutor(1) as thread:  # this one may have a loop already, as in a notebook
        problem = thread.submit(asyncio.run, _problem_at(address)).result()
    if problem is not None:
        raise ConfigError(f"{address}: {problem}")
    # What it logs when a scheduler is lost is a traceback; here that is an error of one line.
    logger = logging.getLogger("distributed.client")
    level = logger.level
    logger.setLevel(logging.CRITICAL)
    try:
        with _lost_is_an_error(address):
            client = Client(address, timeout=_ANSWER_S, set_as_default=False)
        with closing(client):
            yield client
    finally:
        logger.setLevel(level)


async def _problem_at(address: str) -> str | None:
    """Say why there is no scheduler that answers at an address, or None."""
    from distributed import Security, rpc

    settings = Security().get_connection_args("client")
    try:
        async with (
            asyncio.timeout(_ANSWER_S),
            rpc(address, timeout=_ANSWER_S, connection_args=settings) as there,
        ):
            kind = (await there.identity()).get("type")
    except OSError:
        return f"no Dask scheduler answered within {_ANSWER_S:g} s"
    except Exception as error:  # an address that is none, or whatever an answer makes of Dask
        return f"not a Dask scheduler: {' '.join(str(error).split())[:200]}"
    return None if kind == "Scheduler" else f"this is not a Dask scheduler but a {kind}"


@contextmanager
def _witness(out: Path) -> Iterator[Path]:
    """Keep a file of a name that no other machine has by chance in the folder of results."""
    OutputFolder(out)
    path = temporary_path(out.absolute(), "witness")
    path.touch(exist_ok=False)
    try:
        yield path
    finally:
        path.unlink(missing_ok=True)


@contextmanager
def _lost_is_an_error(address: str) -> Iterator[None]:
    from distributed import CancelledError

    try:
        yield
    except (OSError, CancelledError) as error:
        raise ConfigError(
            f"{address}: lost the scheduler or its tasks; run the command again to resume"
        ) from error


def _check_all(client: Client, address: str, terms: _Terms) -> None:
    """Check the scheduler, which also reads tasks, and all workers."""
    try:
        client.wait_for_workers(1, timeout=_ANSWER_S)
    except TimeoutError as error:
        raise ConfigError(
            f"{address}: no workers yet; start one with: dask worker {address} --nthreads 1"
        ) from error
    # The version is asked by Python's own function, which a machine without gaia has as well.
    try:
        found = {address: client.run_on_scheduler(version, _PACKAGE)}
    except PackageNotFoundError as error:
        found = {address: error}
    found |= client.run(version, _PACKAGE, on_error="return")
    problems = {place: _other_version(answer, terms) for place, answer in found.items()}
    if not any(problems.values()):
        problems = client.run(_problem, terms, on_error="return")
    for place, problem in problems.items():
        if problem is not None:
            raise ConfigError(f"{place}: {problem}")


def _other_version(found: str | Exception, terms: _Terms) -> str | None:
    if found == terms.version:
        return None
    if isinstance(found, PackageNotFoundError):
        has = "no gaia"
    elif isinstance(found, Exception):
        return str(found)
    else:
        has = f"gaia {found}"
    return f"has {has}, expected {terms.version}: install the same version"


def _problem(terms: _Terms, dask_worker: Any) -> str | None:
    """Say why the worker that this runs on is not suitable, or None.

    Libraries that it has not loaded yet get one thread.
    """
    if other := _other_version(version(_PACKAGE), terms):
        return other
    if dask_worker.state.nthreads > 1:
        n_threads = dask_worker.state.nthreads
        return (
            f"would work on {n_threads} zones at a time in one process: start it with "
            f"--nworkers {n_threads} --nthreads 1"
        )
    folder = terms.witness.parent
    if not terms.witness.exists():
        return f"cannot see the output folder: {_shared(folder)}"
    if not os.access(folder, os.W_OK):
        return f"cannot write to {folder}"
    too_late = [
        f"{variable}=1"
        for variable, library in ONE_THREAD.items()
        if os.environ.get(variable) != "1" and library in sys.modules
    ]
    if too_late:
        return f"libraries may use many threads there: start it with {' '.join(too_late)} set"
    os.environ.update(dict.fromkeys(ONE_THREAD, "1"))
    return None


def _shared(path: Path | str) -> str:
    return f"{path} must be on a file system that all workers share, under the same path"


def reconstruct_as_worker(
    zone: ZoneLogs, logs: Sequence[str], config: PipelineConfig, terms: _Terms
) -> ZoneResult:
    """Reconstruct a zone as a Dask task.

    Parameters
    ----------
    zone
        The zone.
    logs
        Those of its logs that the machine that hands out the work can see.
    config
        All settings.
    terms
        What the worker must meet.

    Raises
    ------
    ConfigError
        If it does not, or cannot see the logs; no zone should then be worked on here.
    """
    from distributed import get_worker

    worker = get_worker()
    problem = _problem(terms, worker)
    if problem is None:
        # Relative names go into results, so they must be the same, and mean the same, everywhere.
        # The worker's only thread for tasks is this one.
        with chdir(terms.here) if terms.here.is_dir() else nullcontext():
            unseen = next((log for log in logs if not Path(log).exists()), None)
            if unseen is None:
                return reconstruct_zone(zone, terms.out / zone.name, config)
        problem = f"cannot see a log: {_shared(terms.here / unseen)}"
    raise ConfigError(f"{worker.address}: {problem}")


@dataclass(frozen=True)
class _Work:
    """Hands out zones and collects what comes of them."""

    client: Client
    address: str
    config: PipelineConfig
    terms: _Terms

    def results(self, zones: Sequence[ZoneLogs]) -> Iterator[tuple[ZoneLogs, ZoneResult | None]]:
        """Yield each zone with its result, or with None if too many workers died that held it."""
        waiting = list(reversed(zones))
        running: dict[Future[ZoneResult], ZoneLogs] = {}
        done: SimpleQueue[Future[ZoneResult]] = SimpleQueue()
        while waiting or running:
            with _lost_is_an_error(self.address):
                n_workers = len(self.client.nthreads())
                while waiting and len(running) < max(1, 2 * n_workers):
                    job = self._submit(waiting[-1])
                    running[job] = waiting.pop()
                    job.add_done_callback(done.put)
                job = self._next(done)
                if job.status == "error":
                    result, error = None, job.exception()
                else:
                    try:
                        result, error = job.result(timeout=_ANSWER_S), None
                    except TimeoutError:  # its worker died with it: it is done again elsewhere
                        job.add_done_callback(done.put)
                        continue
            zone = running.pop(job)
            yield zone, result if error is None else self._failed(zone, error)

    def _submit(self, zone: ZoneLogs) -> Future[ZoneResult]:
        logs = [log for log in zone.logs if Path(log).exists()]
        return self.client.submit(
            reconstruct_as_worker, zone, logs, self.config, self.terms, pure=False
        )

    def _next(self, done: SimpleQueue[Future[ZoneResult]]) -> Future[ZoneResult]:
        """Wait for a job that is done; without workers, not for ever."""
        n_lonely = 0
        while n_lonely * _ANSWER_S < _WITHOUT_WORKERS_S:
            try:
                return done.get(timeout=_ANSWER_S)
            except Empty:
                n_lonely = 0 if self.client.nthreads() else n_lonely + 1
        raise ConfigError(
            f"{self.address}: no workers for {_WITHOUT_WORKERS_S:g} s; run the command again "
            "to resume"
        )

    def _failed(self, zone: ZoneLogs, error: BaseException) -> ZoneResult | None:
        """Return the result of a zone whose task raised an error; None where it was killed."""
        from distributed import KilledWorker

        if isinstance(error, ConfigError):  # a worker that is not suitable, for no zone
            raise error
        return None if isinstance(error, KilledWorker) else ZoneResult.failed(zone, error)
