"""Every command as a user runs it: outputs, exit codes, one clear line on bad input."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from gaia_uwb.cli.exit_codes import INTERRUPTED
from gaia_uwb.cli.reconstruct import _folders
from gaia_uwb.logs.native import write_native
from gaia_uwb.simulate import PRESETS, simulate_pass
from surveyed import make_runs

FILES = (
    "report.json",
    "cones.csv",
    "clean-ranges.parquet",
    "boundary.geojson",
    "plot.png",
    "report.md",
    "map.html",
    "config.yaml",
)


def gaia(*arguments: object) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "gaia_uwb", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, check=False)


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("log") / "my-log"
    write_native(
        simulate_pass(PRESETS["lane-closure"], seed=0).without_truth(), folder, file_format="csv"
    )
    return folder


def test_reconstruct_writes_everything(run, log: Path, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    code, out, err = run("reconstruct", log, "--out", tmp_path / "out")
    assert (code, err) == (0, "")
    report = json.loads((tmp_path / "out" / "report.json").read_text(encoding="utf-8"))
    assert report["status"] == "ok"
    assert report["metrics"] is None
    assert len(report["anchors"]) == 8
    for name in FILES:
        assert (tmp_path / "out" / name).stat().st_size > 100
        assert name in out


def test_survey_gives_metrics(run, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    code, out, _ = run("reconstruct", "sim", "--out", tmp_path)
    report = json.loads((tmp_path / "report.json").read_text(encoding="utf-8"))
    assert code == 0
    assert report["metrics"]["polygon_iou"]["value"] > 0.8
    assert "against the survey" in out


def test_straight_path_is_unreliable_and_says_why(run, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    code, out, _ = run("reconstruct", "sim:straight/4", "--out", tmp_path)
    report = json.loads((tmp_path / "report.json").read_text(encoding="utf-8"))
    assert code == 1
    assert report["status"] == "unreliable"
    assert "ambiguous" in {reason["kind"] for reason in report["reasons"]}
    assert "mirror" in out
    assert f"  boundary: unreliable, {report['boundary']['area_m2']:.1f} m²" in out
    page = (tmp_path / "report.md").read_text(encoding="utf-8")
    assert "`--side`" in page
    for words in (out, page):
        assert not re.search(r"boundary:? ok\b", words)


def test_a_side_that_was_stated_is_not_asked_for(run, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    run("reconstruct", "sim:stress/1", "--side", "left", "--out", tmp_path)
    page = (tmp_path / "report.md").read_text(encoding="utf-8")
    assert "How to improve the result" in page
    assert "state it (`--side`)" not in page


def test_a_check_and_a_reconstruction_count_the_same_readings(
    run, log: Path, tmp_path: Path
) -> None:  # type: ignore[no-untyped-def]
    out = run("reconstruct", log, "--out", tmp_path)[1]
    report = json.loads((tmp_path / "report.json").read_text(encoding="utf-8"))
    (checked,) = json.loads(run("data", "check", log, "--json")[1])["reports"]
    names = {"in_log": "n_readings", "kept": "n_kept", "spikes": "n_spikes",
             "in_gaps": "n_in_gaps", "outside": "n_outside"}  # fmt: skip
    assert len(checked["anchors"]) == 8
    for mine, theirs in zip(report["anchors"], checked["anchors"], strict=True):
        assert mine["readings"] == {name: theirs[other] for name, other in names.items()}
        assert mine["n_ranges"] == theirs["n_kept"]
    (each,) = report["passes"]
    counts = each["readings"]
    assert (
        f"  {counts['in_log']} readings in the log: {counts['kept']} kept, {counts['spikes']} "
        f"dropped as spikes, {counts['in_gaps']} in gaps, {counts['outside']} outside the path"
    ) in out.splitlines()


def test_terminal_and_report_state_the_same_uncertainty_and_its_level(
    run, log: Path, tmp_path: Path
) -> None:  # type: ignore[no-untyped-def]
    _, out, _ = run("reconstruct", log, "--out", tmp_path)
    on_screen = dict(re.findall(r"^  (cone-\d): .* ± (\d+\.\d\d) m \(90 %\), ", out, re.MULTILINE))
    lines = (tmp_path / "report.md").read_text(encoding="utf-8").splitlines()
    rows = [[cell.strip() for cell in line.split("|")[1:-1]] for line in lines if line[:1] == "|"]
    radius = rows[0].index("90 % radius (m)")
    in_report = {row[0]: row[radius] for row in rows[2:] if row[radius]}
    assert len(on_screen) == 8
    assert on_screen == in_report
    found = re.search(r"clock offset .* ± (\d+\.\d\d\d) s \(90 %\): ", out)
    assert found is not None
    assert f"± {found[1]} s (90 %)" in "\n".join(lines)


def test_a_second_lane_settles_the_sides_from_the_shell(run, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    zone, one = tmp_path / "zone", tmp_path / "one"
    arguments = ("simulate", "--preset", "straight", "--seed", 3, "--lanes=0,3.6")
    code, out, _ = run(*arguments, "--out", zone)
    assert (code, f"wrote 2 passes to {zone}\n") == (0, out)
    assert run("reconstruct", zone / "pass-0", "--out", one)[0] == 1
    code, out, err = run(
        "reconstruct", zone / "pass-1", zone / "pass-0", "--out", tmp_path / "both"
    )
    assert (code, err) == (0, "")
    report = json.loads((tmp_path / "both" / "report.json").read_text(encoding="utf-8"))
    assert (report["status"], report["scene"]) == ("ok", "sim-3-0-pass-0 and 1 more")
    assert max(anchor["mirror_probability"] for anchor in report["anchors"]) < 1e-3
    assert report["clock_offset"] is None
    assert [each["name"] for each in report["passes"]] == ["sim-3-0-pass-0", "sim-3-0-pass-1"]
    for each in report["passes"]:
        assert each["clock_offset"]["applied"]
        assert f"pass {each['name']}: {each['n_ranges']} ranges" in out
    assert report["metrics"]["wrong_side_share"]["value"] == 0.0
    for name in FILES:
        assert (tmp_path / "both" / name).stat().st_size > 100


def test_a_folder_of_logs_is_fused_when_asked(run, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    zone = tmp_path / "zone"
    run("simulate", "--preset", "straight", "--seed", 3, "--lanes=0,3.6", "--out", zone)
    names = ["sim-3-0-pass-0", "sim-3-0-pass-1"]
    run("reconstruct", zone, "--denoiser", "raw", "--out", tmp_path / "each")
    assert sorted(path.parent.name for path in (tmp_path / "each").glob("*/report.json")) == names
    code, _, _ = run(
        "reconstruct", zone, "--one-zone", "--denoiser", "raw", "--out", tmp_path / "fused"
    )
    assert code == 0
    report = json.loads((tmp_path / "fused" / "report.json").read_text(encoding="utf-8"))
    assert len(report["passes"]) == 2
    passes = (zone / "pass-0", zone / "pass-1")
    run("reconstruct", *passes, "--each-alone", "--denoiser", "raw", "--out", tmp_path / "alone")
    for name in names:
        assert (tmp_path / "alone" / name / "report.json").exists()
    code, _, err = run("reconstruct", zone, zone / "pass-0", "--out", tmp_path / "twice")
    assert code == 2
    assert "the same drive as sim-3-0-pass-0" in err


def test_whole_runs_are_scored_with_their_edges(run, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    for length, is_scored in (("whole", True), (64, False)):
        options = ("--methods", "raw", "--length", length, "--out", tmp_path / str(length))
        _, out, _ = run("evaluate", "sim", *options)
        assert ("edge_error_mean" in out) is is_scored


def test_evaluate(run, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    code, out, _ = run(
        "evaluate", "sim", "--methods", "raw,kalman", "--length", 64, "--out", tmp_path
    )
    assert code == 0
    results = json.loads((tmp_path / "results.json").read_text(encoding="utf-8"))
    assert [row["method"] for row in results["rows"]] == ["raw", "kalman"]
    assert results["protocol"]["length"] == "64"
    assert (tmp_path / "episodes.csv").exists()
    assert "kalman" in out


def test_settings_file_and_options(run, log: Path, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    settings = tmp_path / "settings.yaml"
    settings.write_text("denoiser: raw\nalignment: {clock_offset: 'off'}\n", encoding="utf-8")
    run("reconstruct", log, "--config", settings, "--solver", "wls", "--out", tmp_path / "out")
    used = json.loads((tmp_path / "out" / "report.json").read_text(encoding="utf-8"))["config"]
    assert used["denoiser"] == "raw"
    assert used["alignment"]["clock_offset"] == "off"
    assert used["solver"]["kind"] == "wls"


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (("reconstruct",), "SOURCE"),
        (("reconstruct", "sim", "--magic"), "--magic"),
        (("reconstruct", "sim", "--solver", "magic"), "magic"),
        (("reconstruct", "no-such-thing"), "no-such-thing"),
        (("reconstruct", "sim", "--denoiser", "magic"), "magic"),
        (("reconstruct", "sim:nowhere"), "nowhere"),
        (("evaluate", "sim", "--methods", "raw,raw"), "raw,raw"),
        (("evaluate", "sim", "--length", "long"), "long"),
        (("evaluate", "sim", "--true-nlos-labels"), "wls"),
        (("simulate", "--preset", "moon", "--out", "passes"), "moon"),
        (("reconstruct", "sim", "--config", "absent.yaml"), "absent.yaml"),
        (("data", "fetch", "moon-uwb"), "moon-uwb"),
        (("reconstruct", "outdoor-uwb", "--data-dir", "empty"), "gaia data fetch"),
    ],
)
def test_bad_usage_is_one_line(
    run,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,  # type: ignore[no-untyped-def]
    arguments: tuple[str, ...],
    says: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    code, _, err = run(*arguments)
    assert code == 2
    assert err.count("\n") == 1
    assert err.startswith("gaia: ")
    assert says in err


def edit(folder: Path, table: str, line: int, text: str) -> None:
    path = folder / table
    lines = path.read_text(encoding="utf-8").splitlines()
    lines[line - 1] = text
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


BAD_LOGS = {
    "empty file": (lambda f: (f / "ranges.csv").write_text("", encoding="utf-8"), "ranges.csv"),
    "header only": (
        lambda f: (f / "ranges.csv").write_text("t_s,anchor_id,range_m\n", "utf-8"),
        "ranges.csv",
    ),
    "not a number": (lambda f: edit(f, "ranges.csv", 5, "1.0,cone-1,abc"), "row 5"),
    "NaN": (lambda f: edit(f, "ranges.csv", 5, "nan,cone-1,1.0"), "row 5"),
    "no height": (lambda f: edit(f, "trajectory.csv", 9, "0.55,0.0,0.0,"), "row 9"),
    "not UTF-8": (
        lambda f: (f / "ranges.csv").write_bytes(b"t_s,anchor_id,range_m\n1.0,\xff,2.0\n"),
        "ranges.csv",
    ),
    "no trajectory": (lambda f: (f / "trajectory.csv").unlink(), "trajectory"),
}


@pytest.mark.parametrize("name", BAD_LOGS)
def test_bad_log_is_one_line_and_nothing_is_written(
    run, log: Path, tmp_path: Path, name: str
) -> None:  # type: ignore[no-untyped-def]
    spoil, says = BAD_LOGS[name]
    folder = tmp_path / "log"
    shutil.copytree(log, folder)
    spoil(folder)
    code, _, err = run("reconstruct", folder, "--out", tmp_path / "out")
    assert code == 2, err
    assert err.count("\n") == 1
    assert says in err
    assert "Traceback" not in err
    assert list((tmp_path / "out").iterdir()) == []


def scaled(folder: Path, table: str, column: str, change) -> None:  # type: ignore[no-untyped-def]
    import polars as pl

    path = folder / table
    pl.read_csv(path).with_columns(change(pl.col(column))).write_csv(path)


@pytest.mark.parametrize(
    ("table", "column", "change", "says"),
    [
        ("ranges.csv", "range_m", lambda c: c * 1000.0, "millimetres"),
        ("ranges.csv", "t_s", lambda c: c + 3600.0, "clocks"),
    ],
    ids=["millimetres", "clocks an hour apart"],
)
def test_wrong_units_and_clocks(
    run,
    log: Path,
    tmp_path: Path,  # type: ignore[no-untyped-def]
    table: str,
    column: str,
    change,
    says: str,
) -> None:
    folder = tmp_path / "log"
    shutil.copytree(log, folder)
    scaled(folder, table, column, change)
    code, _, err = run("reconstruct", folder, "--out", tmp_path / "out")
    assert code == 2
    assert says in err
    assert err.count("\n") == 1


def test_parked_vehicle_is_refused(run, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    code, _, err = run("reconstruct", "sim:parked", "--out", tmp_path)
    assert code == 2
    assert "moves" in err
    assert err.count("\n") == 1


def test_one_anchor_is_located_without_a_boundary(run, log: Path, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    import polars as pl

    folder = tmp_path / "log"
    shutil.copytree(log, folder)
    ranges = pl.read_csv(folder / "ranges.csv")
    ranges.filter(pl.col("anchor_id") == "cone-4").write_csv(folder / "ranges.csv")
    (folder / "anchors.csv").unlink()
    code, out, _ = run("reconstruct", folder, "--out", tmp_path / "out")
    assert code == 1
    assert "fewer than two cones" in out


def test_unwritable_output_is_told_before_the_work(run, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    (tmp_path / "file").write_text("in the way", encoding="utf-8")
    code, _, err = run("reconstruct", "sim", "--out", tmp_path / "file" / "out")
    assert code == 2
    assert "file" in err


def test_table5_needs_the_data_set(run, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    code, _, err = run("reproduce", "table5", "--data-dir", tmp_path, "--out", tmp_path / "out")
    assert code == 2
    begun, *problem = err.splitlines()
    assert begun == "== table5"
    assert len(problem) == 1
    assert "outdoor-uwb" in problem[0]


def test_table5_writes_the_table(  # type: ignore[no-untyped-def]
    run, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr("gaia_uwb.api.load_scenes", lambda *_, **__: make_runs())
    code, out, err = run("reproduce", "table5", "--quick", "--out", tmp_path)
    assert code == 0
    assert "6 of 6: errors fitted to" in err
    assert "QUICK" in out and "results.json" in out
    assert "as printed" in (tmp_path / "simulator-check.md").read_text(encoding="utf-8")
    assert (tmp_path / "results.json").stat().st_size > 1000


def test_interrupt_is_one_line(run, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    def stop(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("gaia_uwb.evaluate.scores.prepare", stop)
    code, _, err = run("reconstruct", "sim", "--out", tmp_path)
    assert code == INTERRUPTED
    assert err == "gaia: interrupted\n"


def test_a_failed_run_leaves_no_report_of_an_earlier_one(run, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    run("reconstruct", "sim", "--out", tmp_path)
    (tmp_path / "map.html").unlink()
    (tmp_path / "map.html").mkdir()
    code, _, err = run("reconstruct", "sim", "--out", tmp_path)
    assert code == 2
    assert "map.html" in err
    assert not (tmp_path / "report.json").exists()


def test_module_and_version_from_the_shell() -> None:
    done = gaia("--version")
    assert done.returncode == 0
    assert done.stdout.startswith("gaia 0.")
    assert "reconstruct" in gaia("--help").stdout


@pytest.mark.real_data
def test_real_run_from_the_shell(outdoor_dir: Path, tmp_path: Path) -> None:
    done = gaia("reconstruct", "outdoor-uwb:NLOS/B/4", "--data-dir", outdoor_dir, "--out", tmp_path)
    assert done.returncode in (0, 1), done.stderr
    report = json.loads((tmp_path / "report.json").read_text(encoding="utf-8"))
    assert report["metrics"]["anchor_mae"]["value"] < 0.15
    assert report["uncertainty_note"]


def test_ids_cannot_steer_the_terminal(run, log: Path, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    folder = tmp_path / "log"
    shutil.copytree(log, folder)
    for table in ("ranges.csv", "anchors.csv"):
        text = (folder / table).read_text(encoding="utf-8")
        text = text.replace("cone-1,", "\x1b[31mred\u202e,")
        text = text.replace("cone-2,", '"two\n  boundary: ok, 9999 m²",')
        (folder / table).write_text(text, encoding="utf-8")
    for arguments in (("data", "check", folder), ("reconstruct", folder, "--out", tmp_path / "o")):
        _, out, err = run(*arguments)
        assert "\\x1b[31mred\\u202e" in out
        assert "\x1b" not in out + err
        assert "two\\n  boundary: ok" in out
        assert "\n  boundary: ok, 9999" not in out


def test_scenes_of_one_name_do_not_overwrite_each_other(tmp_path: Path) -> None:
    names = ["..", "../a/b", "same", "same", "nul\0", ""]
    folders = _folders(tmp_path, names)
    assert len(set(folders)) == len(names)
    assert all(folder.parent == tmp_path and "\0" not in folder.name for folder in folders)
    assert _folders(tmp_path, ["LOS/A/1", "LOS/A/2"])[0] == tmp_path / "LOS-A-1"
    assert _folders(tmp_path, ["any/name"]) == [tmp_path]
    assert _folders(tmp_path, ["any/name"], several=True) == [tmp_path / "any-name"]


def test_one_bad_log_of_several_is_left_out(run, log: Path, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    logs = tmp_path / "logs"
    for name in ("a", "b", "c", "d"):
        shutil.copytree(log, logs / name)
        (logs / name / "scene.yaml").write_text(f"name: {name}\n", encoding="utf-8")
    (logs / "b" / "ranges.csv").write_text("t_s,anchor_id,range_m\n1,x,far\n", encoding="utf-8")
    drive = logs / "c" / "trajectory.csv"  # readable, but parked
    rows = drive.read_text(encoding="utf-8").splitlines()
    parked = [",".join([row.split(",")[0], *rows[1].split(",")[1:]]) for row in rows[1:]]
    drive.write_text("\n".join([rows[0], *parked]), encoding="utf-8")
    code, out, err = run("reconstruct", logs, "--out", tmp_path / "out")
    assert code == 2
    lines = [line for line in err.splitlines() if line.startswith("gaia: ")]
    assert lines[0].startswith("gaia: skipped: ")
    assert "row 2, column range_m: expected a number or nothing, got 'far'" in lines[0]
    assert lines[1].startswith("gaia: skipped: c: the vehicle hardly moves")
    assert lines[2:] == ["gaia: 2 of 4 logs were skipped"]
    assert "a: " in out
    assert "d: " in out
    for name in ("a", "d"):
        assert (tmp_path / "out" / name / "report.json").is_file()
    assert not (tmp_path / "out" / "c" / "report.json").exists()


def test_check_says_what_a_log_can_tell(run, log: Path, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    code, out, err = run("data", "check", log, "--json")
    (report,) = json.loads(out)["reports"]
    assert (code, err) == (0, "")
    assert report["drive"]["rate_hz"] == pytest.approx(8.0)
    assert {"clock", "three_share", "anchors"} <= set(report["observability"])
    code, out, _ = run("data", "check", "sim:straight")
    assert code == 0
    assert "note: the path is straight" in out
    code, out, _ = run("data", "check", "sim:parked")
    assert code == 1
    assert re.search("PROBLEM: .*: the vehicle hardly moves", out)
    (tmp_path / "trajectory.csv").write_text("nonsense", encoding="utf-8")
    code, out, _ = run("data", "check", tmp_path, "--json")
    (report,) = json.loads(out)["reports"]
    assert code == 2
    assert (report["readable"], report["observability"]) == (False, None)
    assert len(report["problems"]) == 1
