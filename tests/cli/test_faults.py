"""A fault of the program in one log never ends the others, and is never taken for a bad result."""

from __future__ import annotations

import csv
import re
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from gaia_uwb._shared.errors import ConfigError
from gaia_uwb.cli.exit_codes import BAD_INPUT, FAULT, UNRELIABLE
from gaia_uwb.config import PipelineConfig
from gaia_uwb.fleet import find_zones, reconstruct_fleet, write_tables
from gaia_uwb.fleet.manifests import ZoneLogs
from gaia_uwb.fleet.zones import reconstruct_zone
from gaia_uwb.logs.native import write_native
from gaia_uwb.simulate import PRESETS, simulate_pass

Run = Callable[..., tuple[int, str, str]]
RAW = PipelineConfig(denoiser="raw")


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three logs of different drives."""
    folder = tmp_path_factory.mktemp("made")
    for seed, name in enumerate(("first", "second", "third")):
        write_native(simulate_pass(PRESETS["lane-closure"], seed), folder / name, "parquet")
        content = f"name: {name}\n"
        (folder / name / "scene.yaml").write_text(content, encoding="utf-8")
    return folder


@pytest.fixture
def logs(made: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(made, tmp_path / "logs"))


@pytest.fixture
def bug(monkeypatch: pytest.MonkeyPatch) -> None:
    """A bug that the log `second` brings to light."""
    from gaia_uwb import pipeline
    from gaia_uwb.evaluate import scores

    prepare = pipeline.prepare

    def prepare_or_fail(scene: Any, config: Any) -> Any:
        if scene.name == "second":
            raise ValueError("not enough values\nto unpack\x1b[2J")
        return prepare(scene, config)

    monkeypatch.setattr(pipeline, "prepare", prepare_or_fail)
    monkeypatch.setattr(scores, "prepare", prepare_or_fail)


TOLD = r"a fault of the program: ValueError: not enough values\\nto unpack\\x1b\[2J"


def rows_of(out: Path) -> list[dict[str, str]]:
    text = (out / "failures.csv").read_text(encoding="utf-8")
    return list(csv.DictReader(text.splitlines()))


@pytest.mark.usefixtures("bug")
def test_of_several_logs_the_others_complete(run: Run, logs: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    code, _, err = run("reconstruct", logs, "--denoiser", "raw", "--out", out)
    assert code == FAULT
    assert (out / "first" / "report.json").exists() and (out / "third" / "report.json").exists()
    assert "Traceback" not in err
    (line,) = [line for line in err.splitlines() if "fault" in line]
    log = re.escape(str(out / "failures.log"))
    assert re.fullmatch(rf"gaia: skipped: second: {TOLD} \(traceback in {log}\)", line)
    (row,) = rows_of(out)
    assert (row["zone"], row["log"]) == ("second", "second")
    assert re.fullmatch(TOLD, row["problem"])
    assert "prepare_or_fail" in (out / "failures.log").read_text(encoding="utf-8")


@pytest.mark.usefixtures("bug")
def test_a_single_log_is_one_line(run: Run, logs: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    code, _, err = run("reconstruct", logs / "second", "--out", out)
    assert code == FAULT
    assert re.fullmatch(rf"gaia: {TOLD} \(traceback in \S*failures\.log\)\n", err)
    assert [path.name for path in out.iterdir() if not path.name.startswith(".")] == [
        "failures.log"
    ]


def test_what_was_at_fault_is_forgotten_once_it_is_mended(
    run: Run, logs: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: object) -> None:
        raise KeyError

    for source in (logs, logs / "first"):
        out = tmp_path / f"out-{source.name}"
        with monkeypatch.context() as patch:
            patch.setattr("gaia_uwb.evaluate.scores.prepare", fail)
            assert run("reconstruct", source, "--denoiser", "raw", "--out", out)[0] == FAULT
        assert (out / "failures.log").exists()
        assert run("reconstruct", source, "--denoiser", "raw", "--out", out)[0] in (0, UNRELIABLE)
        assert not (out / "failures.log").exists()


@pytest.mark.usefixtures("bug")
def test_a_fault_counts_more_than_a_bad_log(run: Run, logs: Path, tmp_path: Path) -> None:
    (logs / "first" / "ranges.parquet").write_bytes(b"nonsense")
    code, _, err = run("reconstruct", logs, "--denoiser", "raw", "--out", tmp_path / "out")
    assert code == FAULT
    assert "gaia: 2 of 3 logs were skipped" in err
    problems = [row["problem"] for row in rows_of(tmp_path / "out")]
    assert ["ranges.parquet" in problem for problem in problems] == [True, False]
    shutil.rmtree(logs / "second")
    code, _, _ = run("reconstruct", logs, "--denoiser", "raw", "--out", tmp_path / "out")
    assert code == BAD_INPUT
    assert len(rows_of(tmp_path / "out")) == 1


def test_settings_that_do_not_fit_one_log_cost_no_other(
    run: Run, logs: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from gaia_uwb.evaluate import scores

    reconstruct = scores.reconstruct_and_score

    def reconstruct_or_refuse(passes: Any, settings: Any) -> Any:
        if passes[0].name == "second":
            raise ConfigError("this model does not run here")
        return reconstruct(passes, settings)

    monkeypatch.setattr("gaia_uwb.evaluate.reconstruct_and_score", reconstruct_or_refuse)
    code, _, err = run("reconstruct", logs, "--denoiser", "raw", "--out", tmp_path / "out")
    assert code == BAD_INPUT
    assert "gaia: skipped: this model does not run here" in err
    assert (tmp_path / "out" / "third" / "report.json").exists()
    assert not (tmp_path / "out" / "failures.log").exists()


@pytest.mark.usefixtures("bug")
def test_a_zone_with_a_fault_costs_no_other_and_is_done_again(logs: Path, tmp_path: Path) -> None:
    zones = find_zones(logs)
    results = [reconstruct_zone(zone, tmp_path / "out" / zone.name, RAW) for zone in zones]
    write_tables(results, tmp_path / "out")
    assert [result.zone for result in results if result.has_fault] == ["second"]
    fault, nothing_left = rows_of(tmp_path / "out")
    assert re.fullmatch(TOLD, fault["problem"])
    assert nothing_left["problem"] == "second: none of its logs can be used"
    assert "prepare_or_fail" in (tmp_path / "out" / "failures.log").read_text(encoding="utf-8")
    done = [path.parent.name for path in (tmp_path / "out").rglob("fleet.json")]
    assert sorted(done) == ["first", "third"]


@pytest.mark.usefixtures("bug")
def test_a_log_with_a_fault_leaves_the_rest_of_its_zone(logs: Path, tmp_path: Path) -> None:
    zone = ZoneLogs("all", (str(logs / "first"), str(logs / "second")))
    result = reconstruct_zone(zone, tmp_path / "out", RAW)
    assert result.n_passes == 1
    assert result.has_fault
    assert not (tmp_path / "out" / "fleet.json").exists()


def test_the_logs_of_a_zone_without_a_result_are_told_too(
    logs: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: object) -> None:
        raise ArithmeticError("no boundary")

    bad = tmp_path / "bad"
    bad.mkdir()
    zone = ZoneLogs("zone", (str(bad),))
    problems = [each.problem for each in reconstruct_zone(zone, tmp_path / "out", RAW).failures]
    assert problems[0].startswith(f"{bad}: has no trajectory.csv")
    assert problems[1:] == ["zone: none of its logs can be used"]
    monkeypatch.setattr("gaia_uwb.pipeline.reconstruct_passes", fail)
    zone = ZoneLogs("zone", (str(bad), str(logs / "first")))
    problems = [each.problem for each in reconstruct_zone(zone, tmp_path / "out", RAW).failures]
    assert problems[1:] == ["a fault of the program: ArithmeticError: no boundary"]


def test_what_cannot_be_handed_to_a_process_is_a_failed_zone(logs: Path, tmp_path: Path) -> None:
    unsendable = PipelineConfig(denoiser="raw").model_copy(update={"denoiser": lambda: None})
    (zone, *_) = find_zones(logs)
    (result,) = reconstruct_fleet([zone], tmp_path, unsendable)
    assert result.status == "failed"
    assert result.has_fault


def test_a_fleet_with_a_fault_says_so(
    run: Run, logs: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from gaia_uwb.fleet import zones

    def in_this_process(found: Any, out: Path, config: Any, **_: object) -> Any:
        yield from (reconstruct_zone(zone, out / zone.name, config) for zone in found)

    def fail(zone: ZoneLogs, *_: object) -> Any:
        if zone.name == "second":
            raise IndexError("no such anchor")
        return zones.ZoneResult(zone.name, "ok", 1, 1, 1, 1.0, ())

    monkeypatch.setattr("gaia_uwb.fleet.reconstruct_fleet", in_this_process)
    monkeypatch.setattr(zones, "_fused", fail)
    code, out, err = run("fleet", logs, "--out", tmp_path / "out")
    assert code == FAULT
    assert "3 zones: 2 ok, 1 not ok; 1 failures" in out
    assert re.search(r"gaia: second : a fault of the program: IndexError: no such anchor \(", err)


def test_check_goes_on_behind_a_fault(
    run: Run, logs: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from gaia_uwb.evaluate import source_check

    check_scene = source_check.check_scene

    def check_or_fail(scene: Any, *rest: Any, **more: Any) -> Any:
        if scene.name == "second":
            raise ZeroDivisionError("by zero")
        return check_scene(scene, *rest, **more)

    monkeypatch.setattr(source_check, "check_scene", check_or_fail)
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    code, out, err = run("data", "check", logs)
    assert code == FAULT
    assert "first" in out and "third" in out
    assert re.search(r"a fault of the program: ZeroDivisionError: by zero \(traceback in ", err)
    assert "Traceback" not in out + err
    (log,) = tmp_path.glob("gaia-*-failures.log")
    assert "check_or_fail" in log.read_text(encoding="utf-8")


def test_a_fault_where_no_folder_is_known_is_kept_elsewhere(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: object) -> None:
        raise RuntimeError("by chance")

    monkeypatch.setattr("gaia_uwb.logs.data_folder", fail)
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    code, _, err = run("data", "list")
    (log,) = tmp_path.glob("gaia-*-failures.log")
    assert (code, err) == (
        FAULT,
        f"gaia: a fault of the program: RuntimeError: by chance (traceback in {log})\n",
    )
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "nowhere"))
    code, _, err = run("data", "list")
    assert code == FAULT
    assert err.endswith("(its traceback cannot be written: No such file or directory)\n")


class PanicError(BaseException):
    """Stands for a panic in a library that is written in Rust."""


def test_a_panic_is_a_fault_too(run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def panic(*_: object) -> None:
        raise PanicError("index out of bounds")

    monkeypatch.setattr("gaia_uwb.evaluate.scores.prepare", panic)
    code, _, err = run("reconstruct", "sim", "--out", tmp_path)
    assert code == FAULT
    assert err.startswith("gaia: a fault of the program: PanicError: index out of bounds (")
