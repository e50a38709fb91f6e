"""The library's front door, and the names that it has."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import gaia_uwb
from gaia_uwb import PipelineConfig, SourceError, api, pipeline
from gaia_uwb.datasets.native import write_native
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


def test_several_logs_are_not_one() -> None:
    with pytest.raises(SourceError, match=r"holds 7 logs, so name one of .*/4 and 2 more"):
        gaia_uwb.read("sim:lane-closure/0/7")


def test_every_public_name_is_there() -> None:
    assert gaia_uwb.__all__ == sorted(gaia_uwb.__all__, key=lambda name: (name.islower(), name))
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
