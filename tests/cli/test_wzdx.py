"""``gaia wzdx``: what it writes and checks, its exit codes, one clear line on bad input."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import TypeAlias

import pytest
import typer

from factories import make_reconstruction
from gaia_uwb._shared.errors import ConfigError, GaiaError
from gaia_uwb._shared.files import visible
from gaia_uwb.cli.wzdx import wzdx_app
from gaia_uwb.logs.native import write_native
from gaia_uwb.outputs.geojson import boundary_geojson
from gaia_uwb.outputs.report import make_report
from gaia_uwb.simulate import PRESETS, simulate_pass
from wzdx_cases import FEED_YAML, OFFICIAL, official_schemas

Run: TypeAlias = Callable[..., tuple[int, list[str]]]
DATE = ("--update-date", "2026-11-22T10:00:00Z")


@pytest.fixture
def run(capsys: pytest.CaptureFixture[str]) -> Run:
    def run_here(*arguments: object) -> tuple[int, list[str]]:
        code = wzdx_app([str(word) for word in arguments], standalone_mode=False)
        shown = capsys.readouterr()
        assert shown.err == ""
        return code or 0, shown.out.splitlines()

    return run_here


@pytest.fixture
def config(tmp_path: Path) -> Path:
    path = tmp_path / "feed.yaml"
    path.write_text(FEED_YAML)
    return path


@pytest.fixture
def results(tmp_path: Path) -> Path:
    folder = tmp_path / "results"
    folder.mkdir()
    result = make_reconstruction()
    (folder / "report.json").write_text(json.dumps(make_report(result)))
    (folder / "boundary.geojson").write_text(json.dumps(boundary_geojson(result)))
    return folder


def test_results_become_feeds_that_are_valid(
    run: Run, config: Path, results: Path, tmp_path: Path
) -> None:
    code, lines = run("write", results, "--config", config, "--out", tmp_path / "out", *DATE)
    assert code == 0
    assert lines[0].startswith("WorkZoneFeed: $.features[0].geometry.coordinates: warning: ")
    assert "runs towards 90 degrees, but the direction is westbound" in lines[0]
    assert "a drive: 4 cones along 4 m" in lines
    feeds = sorted(visible(tmp_path / "out"))
    code, lines = run("validate", *feeds)
    assert code == 0
    assert lines[-1].endswith("work-zone-feed.geojson: valid, 1 warning")
    first = [path.read_bytes() for path in feeds]
    run("write", results, "--config", config, "--out", tmp_path / "out", *DATE)
    assert [path.read_bytes() for path in feeds] == first


def test_official_schemas_are_checked(
    run: Run, config: Path, results: Path, tmp_path: Path
) -> None:
    official_schemas()
    arguments = ("--config", config, "--out", tmp_path / "out", "--schemas", OFFICIAL)
    assert run("write", results, *arguments, *DATE)[0] == 0
    feed = tmp_path / "out" / "device-feed.geojson"
    feed.write_text(feed.read_text().replace('"is_moving": false', '"is_moving": 1'))
    code, lines = run("validate", feed, "--schemas", OFFICIAL)
    assert code == 2
    assert any("is_moving: official schema: 1 is not of type 'boolean'" in line for line in lines)


def test_a_log_is_reconstructed_first(run: Run, config: Path, tmp_path: Path) -> None:
    log = tmp_path / "log"
    write_native(simulate_pass(PRESETS["lane-closure"], seed=0), log, file_format="csv")
    code, lines = run("write", log, "--config", config, "--out", tmp_path / "out")
    assert code == 0
    assert any("8 cones along" in line for line in lines)


def test_unreliable_results_are_written_and_said(
    run: Run, config: Path, results: Path, tmp_path: Path
) -> None:
    report = json.loads((results / "report.json").read_text())
    reason = {"kind": "clock", "text": "the clocks:\x1b[31m\nunknown"}
    report |= {"status": "unreliable", "reasons": [reason]}
    (results / "report.json").write_text(json.dumps(report))
    code, lines = run("write", results, "--config", config, "--out", tmp_path / "out", *DATE)
    assert code == 1
    assert "  unreliable: the clocks:\\x1b[31m\\nunknown" in lines
    feed = json.loads((tmp_path / "out" / "device-feed.geojson").read_text())
    statuses = {f["properties"]["core_details"]["device_status"] for f in feed["features"]}
    assert statuses == {"warning"}


def test_cwz_is_asked_for_by_an_option(
    run: Run, config: Path, results: Path, tmp_path: Path
) -> None:
    arguments = ("--config", config, "--out", tmp_path / "out", "--profile", "cwz-1.0")
    with pytest.raises(ConfigError, match=r"CWZ 1\.0 requires update_frequency_s"):
        run("write", results, *arguments)
    assert not (tmp_path / "out").exists()


def test_invalid_feeds_are_listed_line_by_line(run: Run, tmp_path: Path) -> None:
    path = tmp_path / "bad\nname.json"
    path.write_text('{"type": "FeatureCollection", "features": [{"id": "a\\nb"}]}')
    code, lines = run("validate", path)
    assert code == 2
    assert all("bad\\nname.json: " in line for line in lines)
    assert lines[-1].endswith("invalid, 4 errors")


@pytest.mark.parametrize("content", [b"{", b"\xff", b"[" * 10**6, b'{"a":NaN}', b'{"a":1,"a":1}'])
def test_unreadable_feeds_are_one_line(run: Run, tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "bad.json"
    path.write_bytes(content)
    with pytest.raises(GaiaError) as caught:  # which `gaia` makes one line and exit code 2
        run("validate", path)
    assert len(str(caught.value).splitlines()) == 1


@pytest.mark.parametrize(
    ("arguments", "problem"),
    [
        (("--update-date", "today"), "--update-date: expected a date like"),
        (("--schemas", "nowhere"), "expected a folder with the official schemas"),
    ],
)
def test_wrong_options(
    run: Run, config: Path, results: Path, tmp_path: Path, arguments: tuple[str, ...], problem: str
) -> None:
    with pytest.raises(ConfigError, match=problem):
        run("write", results, "--config", config, "--out", tmp_path / "out", *arguments)
    assert not (tmp_path / "out").exists()


def test_several_logs_are_not_one_zone(run: Run, config: Path, tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="contains 3 logs; a feed describes one"):
        run("write", "sim:lane-closure/0/3", "--config", config, "--out", tmp_path / "out")


def test_the_command_is_registered_as_a_group() -> None:
    assert isinstance(wzdx_app, typer.Typer)
