"""Zones on a real scheduler with real workers: the files of processes, whatever dies."""

from __future__ import annotations

import fcntl
import json
import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path

import pytest
from typer.testing import CliRunner

import deadly_zones
from gaia_uwb._shared.errors import ConfigError
from gaia_uwb._shared.files import visible
from gaia_uwb.cli.commands import app
from gaia_uwb.config import PipelineConfig
from gaia_uwb.fleet import dask as fleet_dask
from gaia_uwb.fleet.manifests import find_zones
from gaia_uwb.fleet.workers import reconstruct_fleet
from gaia_uwb.fleet.zones import KILLED, ZoneResult, write_tables
from gaia_uwb.logs.native import write_native
from gaia_uwb.simulate import PRESETS, simulate_zone
from killed_runs import files_of

distributed = pytest.importorskip("distributed", reason="needs Dask: install gaia-uwb[fleet]")

RAW = PipelineConfig(denoiser="raw")
TIMEOUT_S = 400.0  # machines of tests are busy


@dataclass(frozen=True)
class Cluster:
    """A scheduler with two workers; the slow zone waits midway as long as ``hold`` is there."""

    address: str
    folder: Path
    hold: Path

    def client(self) -> distributed.Client:
        return distributed.Client(self.address, timeout=TIMEOUT_S, set_as_default=False)

    @contextmanager
    def workers(self, *options: str) -> Iterator[None]:
        command = ["worker", self.address, "--preload", "deadly_zones", *options]
        with daemon(self.folder, self.hold, *command):
            yield


@contextmanager
def daemon(folder: Path, hold: Path, *arguments: str) -> Iterator[None]:
    """Keep a process of Dask's running, with another working folder than the tests have."""
    helpers = Path(__file__).parents[1] / "helpers"
    path = os.pathsep.join([str(helpers), os.environ.get("PYTHONPATH", "")])
    settings = {
        "PYTHONPATH": path,
        "GAIA_TEST_HOLD": str(hold),
        "DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES": "1",
        "DASK_TEMPORARY_DIRECTORY": str(folder),
    }
    command = [sys.executable, "-m", "dask", *arguments, "--no-dashboard"]
    with (folder / f"{arguments[0]}.log").open("ab") as log:
        process = subprocess.Popen(
            command, cwd=folder, env=os.environ | settings, stdout=log, stderr=log
        )
    try:
        yield
    finally:
        process.terminate()
        try:
            process.wait(timeout=60)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()


@pytest.fixture(scope="module")
def cluster(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Cluster]:
    folder = tmp_path_factory.mktemp("cluster")
    about, hold = folder / "scheduler.json", folder / "hold"
    options = ["--host", "127.0.0.1", "--port", "0", "--scheduler-file", str(about)]
    with ExitStack() as stack:
        stack.enter_context(daemon(folder, hold, "scheduler", *options))
        wait_for(lambda: about.exists() and about.read_text(encoding="utf-8").endswith("}"))
        address = json.loads(about.read_text(encoding="utf-8"))["address"]
        found = Cluster(address, folder, hold)
        stack.enter_context(found.workers("--nworkers", "2", "--nthreads", "1"))
        with found.client() as client:
            client.wait_for_workers(2, timeout=TIMEOUT_S)
        yield found


def wait_for(condition: Callable[[], bool]) -> None:
    deadline = time.monotonic() + TIMEOUT_S
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.05)


@pytest.fixture(scope="module")
def logs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three zones of a pass, one of which also holds a broken log, and one that kills workers."""
    folder = tmp_path_factory.mktemp("logs")
    for k, name in enumerate(["zone-0", deadly_zones.SLOW, "zone-2", deadly_zones.KILLER]):
        scene, _ = simulate_zone(PRESETS["straight"], 3, zone=k)
        write_native(scene, folder / name / "pass", file_format="parquet")
    broken = folder / "zone-2" / "broken"
    broken.mkdir()
    (broken / "trajectory.csv").write_text("nonsense", encoding="utf-8")
    return folder


def command(logs: Path, out: Path, address: str) -> list[str]:
    """Return a command that is called beside the logs, which it names as seen from there."""
    settings = out.parent / "raw.yaml"
    settings.write_text("denoiser: raw\n", encoding="utf-8")
    options = ["--config", str(settings), "--out", str(out), "--scheduler", address]
    return [sys.executable, "-m", "gaia_uwb", "fleet", logs.name, *options]


def held_by(cluster: Cluster) -> int:
    """Return the process that waits in the slow zone."""
    wait_for(lambda: deadly_zones.held_process(cluster.hold) is not None)
    process = deadly_zones.held_process(cluster.hold)
    assert process is not None
    return process


def test_killed_workers_cost_no_zone_and_change_no_byte(
    logs: Path, cluster: Cluster, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out, expected = tmp_path / "out", tmp_path / "expected"
    cluster.hold.touch()
    run = subprocess.Popen(command(logs, out, cluster.address), cwd=logs.parent)
    os.kill(held_by(cluster), signal.SIGKILL)
    # The killer has no result, but what it wrote before it was killed; the others are done.
    assert run.wait(timeout=TIMEOUT_S) == 1
    cluster.hold.unlink()

    monkeypatch.chdir(logs.parent)
    zones = {zone.name: zone for zone in find_zones(Path(logs.name))}
    killer = zones.pop(deadly_zones.KILLER)
    results = list(reconstruct_fleet(list(zones.values()), expected, RAW))
    write_tables([*results, ZoneResult.failed(killer, KILLED)], expected)
    found = {name: content for name, content in files_of(out).items() if killer.name not in name}
    assert not (out / killer.name / "fleet.json").exists()
    assert found == files_of(expected)

    before = {path: path.stat().st_mtime_ns for path in out.rglob("map.html")}
    again = reconstruct_fleet(list(zones.values()), out, RAW, scheduler=cluster.address)
    assert {result.zone for result in again} == set(zones)
    assert {path: path.stat().st_mtime_ns for path in out.rglob("map.html")} == before


def test_an_interrupt_takes_back_what_was_handed_over(
    logs: Path, cluster: Cluster, tmp_path: Path
) -> None:
    cluster.hold.touch()
    run = subprocess.Popen(
        command(logs, tmp_path / "out", cluster.address),
        cwd=logs.parent,
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        held_by(cluster)
        run.send_signal(signal.SIGINT)
        _, said = run.communicate(timeout=TIMEOUT_S)
        assert (run.returncode, said) == (130, "gaia: interrupted\n")
        with cluster.client() as client:
            wait_for(lambda: not client.run_on_scheduler(deadly_zones.number_of_tasks))
    finally:
        cluster.hold.unlink()
    assert [path.name for path in (tmp_path / "out").glob(".*")] == [".gaia-files"]


def problem_of(logs: Path, out: Path, address: str) -> str:
    zones = find_zones(logs)[:1]
    with pytest.raises(ConfigError) as error:
        list(reconstruct_fleet(zones, out, RAW, scheduler=address))
    assert list(out.glob("zone-*")) == []
    return str(error.value)


def tell_workers(
    client: distributed.Client, function: Callable[..., None], *arguments: object
) -> None:
    """Call a function on every worker; again, where a busy machine has closed a connection."""
    for _ in range(5):
        try:
            client.run(function, *arguments)
        except distributed.comm.CommClosedError:
            time.sleep(1.0)
        else:
            return
    client.run(function, *arguments)


@pytest.mark.parametrize(
    ("found", "problem"),
    [("9.9", "has gaia 9.9, expected 0.1.0: install"), (None, "has no gaia, expected 0.1.0")],
)
def test_workers_have_the_same_gaia(
    logs: Path, cluster: Cluster, tmp_path: Path, found: str | None, problem: str
) -> None:
    with cluster.client() as client:
        tell_workers(client, deadly_zones.pretend_version, found)
        try:
            said = problem_of(logs, tmp_path, cluster.address)
        finally:
            tell_workers(client, deadly_zones.take_back)
    assert said.startswith("tcp://127.0.0.1:")
    assert problem in said


def test_workers_use_one_thread(logs: Path, cluster: Cluster, tmp_path: Path) -> None:
    with cluster.client() as client:
        tell_workers(client, deadly_zones.set_variable, "OMP_NUM_THREADS", "4")
        try:
            said = problem_of(logs, tmp_path, cluster.address)
        finally:
            tell_workers(client, deadly_zones.set_variable, "OMP_NUM_THREADS", "1")
        assert "start it with OMP_NUM_THREADS=1 set" in said
        with cluster.workers("--nthreads", "3", "--nworkers", "1"):
            client.wait_for_workers(3, timeout=TIMEOUT_S)
            said = problem_of(logs, tmp_path, cluster.address)
        assert "start it with --nworkers 3 --nthreads 1" in said
        wait_for(lambda: len(client.nthreads()) == 2)


@contextmanager
def seen_by_this_process_only(folder: Path) -> Iterator[Path]:
    opened = os.open(folder, os.O_RDONLY)
    private = fcntl.fcntl(opened, fcntl.F_DUPFD, 700)
    try:
        yield Path(f"/proc/self/fd/{private}")
    finally:
        os.close(private)
        os.close(opened)


@pytest.mark.skipif(not Path("/proc/self/fd").exists(), reason="needs Linux's /proc")
def test_workers_see_logs_and_results(logs: Path, cluster: Cluster, tmp_path: Path) -> None:
    with seen_by_this_process_only(logs) as unseen:
        said = problem_of(unseen, tmp_path, cluster.address)
    assert "tcp://127.0.0.1:" in said
    assert f"cannot see a log: {unseen}/zone-0/pass must be on a file system that all" in said
    with seen_by_this_process_only(tmp_path) as unseen:
        said = problem_of(logs, unseen, cluster.address)
        assert f"cannot see the output folder: {unseen} must be on" in said
    assert list(visible(tmp_path)) == []


def test_nobody_answers(logs: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fleet_dask, "_ANSWER_S", 0.5)
    said = problem_of(logs, tmp_path, "tcp://127.0.0.1:1")
    assert said == "tcp://127.0.0.1:1: no Dask scheduler answered within 0.5 s"
    with socket.create_server(("127.0.0.1", 0)) as silent:
        address = f"tcp://127.0.0.1:{silent.getsockname()[1]}"
        assert "no Dask scheduler answered" in problem_of(logs, tmp_path, address)
    assert "not a Dask scheduler: " in problem_of(logs, tmp_path, "nonsense")


def test_the_extra_is_named(logs: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fleet_dask, "find_spec", lambda name: None)
    said = problem_of(logs, tmp_path, "tcp://127.0.0.1:1")
    assert said == "--scheduler needs the extra 'fleet': pip install 'gaia-uwb[fleet]'"


def test_workers_of_two_kinds_are_refused(logs: Path) -> None:
    options = ["--workers", "2", "--scheduler", "tcp://127.0.0.1:1"]
    done = CliRunner().invoke(app, ["fleet", str(logs), *options])
    assert str(done.exception) == "--workers cannot be combined with --scheduler"
