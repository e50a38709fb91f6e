"""``gaia simulate``: logs, tables of episodes and presets, as a user makes them."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest

from gaia_uwb._shared.files import visible
from gaia_uwb.logs.episodes import read_episodes
from gaia_uwb.logs.native import read_native, write_native
from gaia_uwb.simulate import PRESETS, simulate_episode, simulate_pass, simulate_zone
from gaia_uwb.simulate.presets import load_preset


def test_simulate_and_read_back(run, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    code, out, _ = run("simulate", "--episodes", 2, "--seed", 5, "--out", tmp_path / "passes")
    assert code == 0
    assert "2 passes" in out
    assert sorted(p.name for p in visible(tmp_path / "passes")) == [
        "pass-0",
        "pass-1",
        "simulation.yaml",
    ]
    code, out, _ = run("data", "check", tmp_path / "passes" / "pass-1")
    assert code == 0
    assert "cone" in out


def test_vehicles_of_one_zone_have_clocks_of_their_own(run, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    arguments = ("simulate", "--preset", "two-tags", "--vehicles", "van-7,van-9")
    code, _, err = run(*arguments, "--lanes=0,3.6", "--out", tmp_path / "zone")
    assert (code, err) == (0, "")
    scenes = simulate_zone(PRESETS["two-tags"], 0, vehicles=("van-7", "van-9"))
    for k, scene in enumerate(scenes):
        read = read_native(tmp_path / "zone" / f"pass-{k}")
        assert read.tags == scene.tags
        kept = np.isin(scene.ranges.t_s, read.ranges.t_s)
        assert kept.mean() > 0.99  # what is no range, a reader leaves out
        assert (read.ranges.tag == scene.ranges.tag[kept]).all()
    assert scenes[0].truth.clock_offset_s != scenes[1].truth.clock_offset_s
    assert "--lanes=0,3.6 --vehicles van-7,van-9" in (tmp_path / "zone/simulation.yaml").read_text()
    code, _, err = run(*arguments, "--out", tmp_path / "other")
    assert code == 2
    assert "--vehicles: expected --lanes beside it" in err


@pytest.mark.parametrize("preset", ["angles", "cone-ranges"])
def test_a_log_keeps_angles_and_ranges_among_cones(run, tmp_path: Path, preset: str) -> None:  # type: ignore[no-untyped-def]
    assert run("simulate", "--preset", preset, "--out", tmp_path / "pass")[0] == 0
    scene, read = simulate_pass(PRESETS[preset], 0), read_native(tmp_path / "pass")
    assert (scene.cone_ranges is None) == (read.cone_ranges is None) == (preset == "angles")
    assert (scene.ranges.azimuth_rad is None) == (read.ranges.azimuth_rad is None)
    if scene.cone_ranges is not None:
        range_m = scene.cone_ranges.range_m
        assert (read.cone_ranges.range_m == range_m[range_m > 0]).all()
    else:
        kept = np.isin(scene.ranges.t_s, read.ranges.t_s)
        assert abs(read.ranges.azimuth_rad - scene.ranges.azimuth_rad[kept]).max() < 1e-9


def test_simulate_episodes_of_a_part(run, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    out = tmp_path / "episodes"
    arguments = ("simulate", "--preset", "stress", "--episodes", 3, "--as", "episodes")
    code, _, err = run(*arguments, "--split", "test", "--out", out)
    assert (code, err) == (0, "")
    assert sorted(p.name for p in visible(out)) == ["episodes-000000.parquet", "simulation.yaml"]
    config = load_preset(out / "simulation.yaml")
    assert config.split == "test"
    for k, episode in enumerate(read_episodes(out)):
        expected = simulate_episode(config, 0, episode=k)
        assert episode.name == expected.name
        assert (episode.range_m == expected.range_m).all()
    assert k == 2
    code, _, err = run(*arguments, "--out", out)
    assert code == 2
    assert "already contains episodes from a different command" in err


def test_episodes_of_a_killed_run_are_gone_on_with(  # type: ignore[no-untyped-def]
    run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("gaia_uwb.logs.episodes._EPISODES_IN_A_PART", 3)
    arguments = ("simulate", "--preset", "stress", "--episodes", 8, "--as", "episodes", "--out")
    whole, killed = tmp_path / "whole", tmp_path / "killed"
    assert run(*arguments, whole)[0] == 0
    killed.mkdir()
    for name in (".gaia-files", "simulation.yaml", "episodes-000000.parquet"):
        shutil.copy(whole / name, killed)
    kept = (killed / "episodes-000000.parquet").stat().st_mtime_ns
    code, text, _ = run(*arguments, killed)
    assert code == 0
    assert "wrote 8 passes" in text
    assert "3 of them existed already" in text
    assert (killed / "episodes-000000.parquet").stat().st_mtime_ns == kept
    contents = [
        {path.name: path.read_bytes() for path in visible(folder)} for folder in (whole, killed)
    ]
    assert len(contents[0]) == 4
    assert contents[0] == contents[1]


def test_errors_of_logs_become_a_preset(run, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    code, out, err = run("simulate", "--calibrate-from", "sim", "--out", tmp_path / "fit")
    assert (code, err) == (0, "")
    preset = tmp_path / "fit" / "calibrated.yaml"
    assert str(preset) in out
    assert [path.name for path in visible(tmp_path / "fit")] == ["calibrated.yaml"]
    code, _, err = run("simulate", "--preset", preset, "--out", tmp_path / "pass")
    assert (code, err) == (0, "")


def test_errors_need_a_survey(run, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    log = simulate_pass(PRESETS["lane-closure"], seed=0).without_truth()
    write_native(log, tmp_path / "log", file_format="csv")
    code, _, err = run("simulate", "--calibrate-from", tmp_path / "log", "--out", tmp_path)
    assert code == 2
    assert "expected surveyed anchors" in err
    assert err.count("\n") == 1
