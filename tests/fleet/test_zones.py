"""Many logs: the same files with any number of workers, resumed, and with failures listed."""

from __future__ import annotations

import csv
import multiprocessing
import os
import select
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

import deadly_zones
from gaia_uwb._shared.errors import InputError, SourceError
from gaia_uwb.config import PipelineConfig
from gaia_uwb.fleet import zones as fleet
from gaia_uwb.fleet.manifests import find_zones
from gaia_uwb.fleet.workers import reconstruct_fleet
from gaia_uwb.fleet.zones import reconstruct_zone, write_tables
from gaia_uwb.logs.native import write_native
from gaia_uwb.simulate import PRESETS, simulate_zone
from killed_runs import files_of, hidden_in

RAW = PipelineConfig(denoiser="raw")


@pytest.fixture(scope="module")
def logs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three zones of two passes, one of which also holds a broken log."""
    folder = tmp_path_factory.mktemp("logs")
    for zone in range(3):
        for scene in simulate_zone(PRESETS["straight"], 3, zone=zone):
            write_native(scene, folder / f"zone-{zone}" / scene.name, file_format="parquet")
    broken = folder / "zone-1" / "broken"
    broken.mkdir()
    (broken / "trajectory.csv").write_text("nonsense", encoding="utf-8")
    return folder


@pytest.fixture(scope="module")
def one(logs: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("one")
    write_tables(list(reconstruct_fleet(find_zones(logs), out, RAW)), out)
    return out


def test_failures_are_listed_and_the_rest_completes(one: Path) -> None:
    rows = list(csv.DictReader((one / "failures.csv").read_text(encoding="utf-8").splitlines()))
    assert [(row["zone"], Path(row["log"]).name) for row in rows] == [("zone-1", "broken")]
    rows = list(csv.DictReader((one / "zones.csv").read_text(encoding="utf-8").splitlines()))
    assert [row["zone"] for row in rows] == ["zone-0", "zone-1", "zone-2"]
    assert [row["n_passes"] for row in rows] == ["2", "2", "2"]
    for zone in range(3):
        assert (one / f"zone-{zone}" / "report.json").exists()


def test_a_log_that_cannot_be_named_is_listed(logs: Path, tmp_path: Path) -> None:
    (good, *_) = find_zones(logs)
    zone = replace(good, logs=(*good.logs, "x" * 300, "\0"))
    result = reconstruct_zone(zone, tmp_path, RAW)
    assert result.n_passes == 2
    problems = [failure.problem for failure in result.failures]
    assert problems[0].endswith("cannot be read: File name too long")
    assert "neither a folder" in problems[1]


def test_a_slip_in_a_manifest_does_not_walk_a_whole_disk(
    logs: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(fleet, "_MOST_FILES", 5)
    many = tmp_path / "many"
    many.mkdir()
    for k in range(6):
        (many / str(k)).touch()
    (good, *_) = find_zones(logs)
    result = reconstruct_zone(replace(good, logs=(*good.logs, str(many))), tmp_path / "out", RAW)
    (failure,) = result.failures
    assert failure.problem == f"{many}: contains more than 5 files: name the folder of one log"
    assert reconstruct_zone(good, tmp_path / "good", RAW).n_passes == 2


def test_with_the_default_denoiser_too_workers_change_no_byte(logs: Path, tmp_path: Path) -> None:
    (zone, *_) = find_zones(logs)
    zones = [replace(zone, logs=zone.logs[:1], name=name) for name in ("one", "two")]
    for workers in (1, 2):
        found = reconstruct_fleet(zones, tmp_path / str(workers), PipelineConfig(), workers=workers)
        assert [result.n_passes for result in found] == [1, 1]
    assert files_of(tmp_path / "1") == files_of(tmp_path / "2")


def test_the_number_of_workers_changes_no_byte(logs: Path, one: Path, tmp_path: Path) -> None:
    write_tables(list(reconstruct_fleet(find_zones(logs), tmp_path, RAW, workers=2)), tmp_path)
    assert files_of(tmp_path) == files_of(one)
    assert not hidden_in(tmp_path) and not hidden_in(one)


def test_what_is_done_is_not_done_again(logs: Path, one: Path) -> None:
    before = {path: path.stat().st_mtime_ns for path in one.rglob("map.html")}
    again = list(reconstruct_fleet(find_zones(logs), one, RAW))
    assert len(again) == 3
    assert {path: path.stat().st_mtime_ns for path in one.rglob("map.html")} == before


def test_results_inside_the_folder_of_logs_are_no_zone(logs: Path, tmp_path: Path) -> None:
    source = tmp_path / "drives"
    shutil.copytree(logs / "zone-0", source / "zone-0")
    (source / "loop").symlink_to("loop")
    for out in (source / "out", source / "zone-0" / "out"):
        write_tables(list(reconstruct_fleet(find_zones(source, out), out, RAW)), out)
        (zone,) = find_zones(source, out)
        assert (zone.name, len(zone.logs)) == ("zone-0", 2)
        shutil.rmtree(out)


def test_another_model_under_the_same_name_is_another_result(
    logs: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    zone = find_zones(logs)[0]
    before = fleet._digest(zone, RAW)
    assert fleet._digest(zone, RAW) == before
    monkeypatch.setattr("gaia_uwb.denoisers.denoiser_identity", lambda name: [name, "retrained"])
    assert fleet._digest(zone, RAW) != before


def test_a_file_that_a_description_names_elsewhere_belongs_to_the_log(tmp_path: Path) -> None:
    folder, table = tmp_path / "zone" / "drive", tmp_path / "ranges.csv"
    folder.mkdir(parents=True)
    table.write_text("t,anchor,range\n", encoding="utf-8")
    columns = "columns: {t_s: t, anchor_id: anchor, range_m: range}"
    (folder / "gaia.yaml").write_text(
        "trajectory: {file: drive.nmea, format: nmea}\n"
        f"ranges: [{{file: ../../ranges.csv, format: csv, {columns}}}]\n",
        encoding="utf-8",
    )
    zone = fleet.ZoneLogs("zone", (str(folder),))
    before = fleet._digest(zone, RAW)
    table.write_text("t,anchor,range\n0,A,1\n", encoding="utf-8")
    assert fleet._digest(zone, RAW) != before


def test_workers_alone_get_one_thread_each(
    logs: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("OMP_NUM_THREADS", raising=False)
    for _ in reconstruct_fleet(find_zones(logs), tmp_path, RAW):
        assert "OMP_NUM_THREADS" not in os.environ


def start_and_hold(logs: Path, folder: Path, *options: str) -> tuple[subprocess.Popen[bytes], int]:
    """Start a fleet whose zone-1 waits midway; return it and the process that waits."""
    hold, settings = folder / "hold", folder / "raw.yaml"
    hold.touch()
    settings.write_text("denoiser: raw\n", encoding="utf-8")
    command = [sys.executable, deadly_zones.__file__, "fleet", str(logs), *options]
    command += ["--config", str(settings), "--out", str(folder / "out")]
    run = subprocess.Popen(
        command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True,
        env=os.environ | {"GAIA_TEST_HOLD": str(hold)},
    )  # fmt: skip
    while (process := deadly_zones.held_process(hold)) is None:
        assert run.poll() is None, "the fleet ended without its slow zone"
        time.sleep(0.02)
    return run, process


def test_a_killed_run_goes_on(
    logs: Path, one: Path, tmp_path: Path, run: Callable[..., tuple[int, str, str]]
) -> None:
    killed, _ = start_and_hold(logs, tmp_path)
    os.killpg(killed.pid, signal.SIGKILL)
    killed.wait()
    done = [path.parent.name for path in (tmp_path / "out").rglob("fleet.json")]
    assert done == ["zone-0"]
    before = (tmp_path / "out" / "zone-0" / "map.html").stat().st_mtime_ns
    settings, out = tmp_path / "raw.yaml", tmp_path / "out"
    code, _, _ = run("fleet", logs, "--config", settings, "--out", out)
    assert code == 1  # one log is broken
    assert files_of(out) == files_of(one)
    assert (out / "zone-0" / "map.html").stat().st_mtime_ns == before


def test_a_killed_process_costs_no_zone(logs: Path, one: Path, tmp_path: Path) -> None:
    fleet_run, process = start_and_hold(logs, tmp_path, "--workers", "2")
    assert process != fleet_run.pid
    os.kill(process, signal.SIGKILL)
    assert fleet_run.wait() == 1  # one log is broken
    assert files_of(tmp_path / "out") == files_of(one)


@pytest.mark.parametrize("workers", ["1", "2"])
def test_an_interrupt_waits_for_no_zone(
    logs: Path, tmp_path: Path, workers: str, run: Callable[..., tuple[int, str, str]]
) -> None:
    fleet_run, process = start_and_hold(logs, tmp_path, "--workers", workers)
    os.killpg(fleet_run.pid, signal.SIGINT)  # to all its processes, as a terminal does
    assert fleet_run.wait(timeout=60) == 130  # the slow zone would wait for ever
    with pytest.raises(ProcessLookupError):
        os.kill(process, 0)
    assert not (tmp_path / "out" / "zone-1" / "fleet.json").exists()
    (tmp_path / "hold").unlink()
    run("fleet", logs, "--config", tmp_path / "raw.yaml", "--out", tmp_path / "out")
    assert not hidden_in(tmp_path / "out")


def test_a_killed_fleet_leaves_no_process(logs: Path, tmp_path: Path) -> None:
    fleet_run, process = start_and_hold(logs, tmp_path)
    handle = os.pidfd_open(process)
    fleet_run.kill()
    fleet_run.wait()
    ended, _, _ = select.select([handle], [], [], 60.0)  # the slow zone would wait for ever
    os.close(handle)
    assert ended


def test_whoever_wants_no_more_results_leaves_no_process(logs: Path, tmp_path: Path) -> None:
    results = reconstruct_fleet(find_zones(logs), tmp_path, RAW)
    assert next(results).zone == "zone-0"
    assert multiprocessing.active_children()
    results.close()
    assert not multiprocessing.active_children()


def test_manifests_name_log_and_zone(logs: Path, tmp_path: Path) -> None:
    manifest = tmp_path / "logs.csv"
    manifest.write_text("log,zone\nb,one\na,one\nc,two\n", encoding="utf-8")
    first, second = find_zones(manifest)
    assert (first.name, [Path(log).name for log in first.logs]) == ("one", ["a", "b"])
    assert second.name == "two"
    manifest.write_text("log,zone\na,\n", encoding="utf-8")
    with pytest.raises(InputError, match="row 2: expected a log and a zone"):
        find_zones(manifest)
    for zone in ("../x", "..", '"a\nb"', "x" * 201, "ä" * 101):
        manifest.write_text(f"log,zone\na,{zone}\n", encoding="utf-8")
        with pytest.raises(InputError, match="the name cannot be a folder name") as caught:
            find_zones(manifest)
        assert len(str(caught.value)) < 400
        assert "\n" not in str(caught.value)
    manifest.write_text(f"log,zone\n{'a' * 5000},one\n", encoding="utf-8")
    with pytest.raises(InputError, match=r"zone 'one': a log's path is too long \(5,"):
        find_zones(manifest)
    with pytest.raises(SourceError, match="neither a folder nor a manifest"):
        find_zones(tmp_path / "absent")


def test_yaml_manifests_list_the_logs_of_each_zone(tmp_path: Path) -> None:
    manifest = tmp_path / "fleet.yaml"
    manifest.write_text('two: [c]\n"1":\n- b\n- /a\n', encoding="utf-8")
    first, second = find_zones(manifest)
    assert (first.name, first.logs) == ("1", ("/a", str(tmp_path / "b")))
    assert (second.name, second.logs) == ("two", (str(tmp_path / "c"),))


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("a: [x]\nb: [y]\na: [z]", "fleet.yaml: line 3: duplicate key 'a'"),
        ("a: [x\n", "fleet.yaml: line 2: "),
        ("- x", "fleet.yaml: expected a list of logs for each zone"),
        ("7: [x]", "expected text as the name of a zone, got 7; put it in quotes"),
        ("a: x", "fleet.yaml: zone 'a': expected a list of logs, got 'x'"),
        ("a: []", "zone 'a': expected a list of logs, got []"),
        ("a: [x, 2024-05-01]", "fleet.yaml: zone 'a', log 2: expected a path, got datetime.date("),
        ("a: [x, ]\nb: [null]", "zone 'b', log 1: expected a path, got None"),
        ("a/b: [x]", "fleet.yaml: zone 'a/b': the name cannot be a folder name"),
    ],
)
def test_wrong_yaml_manifests(tmp_path: Path, text: str, problem: str) -> None:
    manifest = tmp_path / "fleet.yaml"
    manifest.write_text(text, encoding="utf-8")
    with pytest.raises(InputError) as error:
        find_zones(manifest)
    assert problem in str(error.value)
    assert "\n" not in str(error.value)


def test_an_empty_yaml_manifest_has_no_logs(tmp_path: Path) -> None:
    manifest = tmp_path / "fleet.yml"
    for text in ("", "{}"):
        manifest.write_text(text, encoding="utf-8")
        with pytest.raises(SourceError, match=r"fleet\.yml: contains no logs"):
            find_zones(manifest)
