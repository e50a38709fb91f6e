"""The library's front door, and the names that it has."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import gaia_uwb
from gaia_uwb import PipelineConfig, api, pipeline
from gaia_uwb._shared.errors import InputError, SourceError
from gaia_uwb.api import load_scenes, read
from gaia_uwb.config import Known
from gaia_uwb.evaluate.source_check import check_source
from gaia_uwb.logs.native import write_native
from gaia_uwb.logs.vehicle import Vehicle
from gaia_uwb.scene import RangeLog, Scene, Trajectory
from gaia_uwb.simulate import PRESETS, simulate_pass, simulate_zone


def test_a_scene_a_folder_and_a_name_give_the_same(tmp_path: Path) -> None:
    scene = simulate_pass(PRESETS["lane-closure"], seed=3)
    write_native(scene, tmp_path, file_format="parquet")
    expected = pipeline.reconstruct(scene)
    for log in (scene, tmp_path, str(tmp_path), "sim:lane-closure/3"):
        result = api.reconstruct(log)
        for ours, theirs in zip(result.anchors, expected.anchors, strict=True):
            np.testing.assert_allclose(ours.position_m, theirs.position_m, atol=1e-6)


def test_settings_and_data_folder_are_handed_on(tmp_path: Path) -> None:
    result = api.reconstruct("sim", PipelineConfig(denoiser="raw"))
    assert result.config.denoiser == "raw"
    with pytest.raises(SourceError, match=f"not in {tmp_path}"):
        api.reconstruct("outdoor-uwb:NLOS/B/4", data_dir=tmp_path)


def test_a_vehicle_that_is_known_is_taken_for_every_log(tmp_path: Path) -> None:
    clock = Known(value=0.2, sigma=0.005)
    van = Vehicle(name="van 7", clock_offset_s=clock)
    scene = read("sim:lane-closure")
    write_native(scene, tmp_path / "log")
    for log in (scene, tmp_path / "log", "sim:lane-closure"):
        result = api.reconstruct(log, PipelineConfig(denoiser="raw"), vehicle=van)
        assert result.episode.vehicle == "van 7"
        assert result.config.vehicles["van 7"].clock_offset_s == clock


def test_several_logs_are_not_one() -> None:
    with pytest.raises(SourceError, match=r"contains 7 logs; choose one of .*/4 and 2 more"):
        gaia_uwb.read("sim:lane-closure/0/7")


def test_every_public_name_is_there() -> None:
    assert gaia_uwb.__all__ == sorted(set(gaia_uwb.__all__))
    for name in gaia_uwb.__all__:
        assert getattr(gaia_uwb, name).__name__ == name
    assert {"read", "reconstruct", "__version__"} <= set(dir(gaia_uwb))
    with pytest.raises(AttributeError, match="no_such_name"):
        _ = gaia_uwb.no_such_name


def test_no_public_name_is_that_of_a_module() -> None:
    # Whoever imports the module first would find it under the name instead.
    modules = {path.stem for path in Path(gaia_uwb.__file__).parent.iterdir()}
    assert not modules & set(gaia_uwb.__all__)


def test_reading_a_log_loads_no_plots_and_no_networks() -> None:
    code = (
        "import sys, gaia_uwb; gaia_uwb.read('sim'); "
        "print(*{'torch', 'onnxruntime', 'matplotlib', 'scipy'} & set(sys.modules))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == []


def test_a_list_of_logs_is_one_zone(tmp_path: Path) -> None:
    near, far = simulate_zone(PRESETS["straight"], seed=3)
    write_native(far, tmp_path, file_format="parquet")
    config = PipelineConfig(denoiser="raw")
    result = api.reconstruct([near, tmp_path], config)
    assert [episode.name for episode, _ in result.passes] == [near.name, far.name]
    assert api.reconstruct([near], config).name == near.name


def make_scene(name: str) -> Scene:
    t_s = np.arange(10.0)
    return Scene(
        name=name,
        trajectory=Trajectory(t_s, np.column_stack([t_s, t_s**2])),
        ranges=RangeLog(t_s, np.zeros(10, dtype=np.int64), 50.0 - t_s),
        anchor_ids=("cone-1",),
    )


def test_a_folder_with_a_scene(tmp_path: Path) -> None:
    write_native(make_scene("pass"), tmp_path / "log")
    assert [scene.name for scene in load_scenes(str(tmp_path / "log"))] == ["pass"]


def test_a_folder_with_scenes_in_it(tmp_path: Path) -> None:
    for k in (1, 0):
        write_native(make_scene(f"pass {k}"), tmp_path / f"pass-{k}")
    (tmp_path / "other").mkdir()
    assert [scene.name for scene in load_scenes(str(tmp_path))] == ["pass 0", "pass 1"]


def test_what_is_hidden_is_no_log(tmp_path: Path) -> None:
    write_native(make_scene("pass"), tmp_path / ".gaia-0-1-2-scene")
    with pytest.raises(InputError, match=r"has no trajectory\.csv"):
        load_scenes(str(tmp_path))


def test_the_simulator() -> None:
    (scene,) = load_scenes("sim")
    assert scene.truth is not None
    with pytest.raises(SourceError, match="no-such-preset"):
        load_scenes("sim:no-such-preset")


def test_a_registered_name_comes_before_a_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    write_native(make_scene("mine"), Path("sim"))
    assert load_scenes("sim")[0].name != "mine"
    assert load_scenes("./sim")[0].name == "mine"
    assert load_scenes(Path("sim"))[0].name == "mine"
    assert read(Path("sim")).name == "mine"


def test_a_data_set_that_is_not_here(tmp_path: Path) -> None:
    with pytest.raises(
        SourceError, match=f"not in {tmp_path}; fetch it with 'gaia data fetch outd"
    ):
        load_scenes("outdoor-uwb:NLOS/B/4", data_dir=tmp_path)
    with pytest.raises(SourceError, match="fetch it"):
        check_source("outdoor-uwb", data_dir=tmp_path)


@pytest.mark.parametrize(
    ("source", "message"),
    [
        ("nothing", "nothing: neither a folder nor one of outdoor-uwb, sim"),
        ("outdoor", "neither a folder nor one of outdoor-uwb, sim"),
        ("nothing:part", "nothing:part: neither a folder nor one of"),
        ("x" * 300, "cannot be read: File name too long"),
        (__file__, "is a file; give the folder with trajectory and ranges"),
    ],
)
def test_names_that_lead_nowhere(source: str, message: str) -> None:
    for function in (load_scenes, check_source):
        with pytest.raises(SourceError) as caught:
            function(source)
        assert message in str(caught.value)


def test_an_empty_folder(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"has no trajectory\.csv"):
        load_scenes(str(tmp_path))


def test_checks_each_scene_and_goes_on_after_a_bad_one(tmp_path: Path) -> None:
    for k in range(2):
        write_native(make_scene(f"pass {k}"), tmp_path / f"pass-{k}")
    (tmp_path / "pass-0" / "ranges.csv").write_text("t_s,anchor_id,range_m\n0,a,x\n")
    bad, good = check_source(str(tmp_path))
    assert not bad.readable
    assert (
        "ranges.csv, row 2, column range_m: expected a number or nothing, got 'x'"
        in bad.problems[0]
    )
    assert good.readable
    assert good.name == "pass 1"


def test_checks_the_simulator() -> None:
    (report,) = check_source("sim")
    assert report.readable


def test_a_data_set_that_cannot_be_read(tmp_path: Path) -> None:
    (tmp_path / "outdoor-uwb").mkdir()
    (report,) = check_source("outdoor-uwb", data_dir=tmp_path)
    assert not report.readable
    assert "trajectory.csv: cannot be read: No such file" in report.problems[0]


@pytest.mark.real_data
def test_loads_and_checks_the_real_data(outdoor_dir: Path) -> None:
    scenes = load_scenes("outdoor-uwb:LOS/B", data_dir=outdoor_dir)
    assert [scene.name for scene in scenes] == ["outdoor-uwb:LOS/B/3", "outdoor-uwb:LOS/B/4"]
    reports = check_source("outdoor-uwb", data_dir=outdoor_dir)
    assert [report.name for report in reports][-1] == "outdoor-uwb, static files"
    assert all(not report.problems for report in reports)
    anchors = [anchor for report in reports for anchor in report.anchors]
    shares = [anchor.n_kept / anchor.n_readings for anchor in anchors]
    assert len(shares) == 32
    assert min(shares) > 0.9


def test_an_empty_name_is_not_the_working_folder() -> None:
    with pytest.raises(SourceError, match="got nothing"):
        load_scenes("")
