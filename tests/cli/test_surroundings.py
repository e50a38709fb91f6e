"""Names that are not UTF-8, and settings of other programs: the same result, and no traceback."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

from gaia_uwb.logs.native import write_native
from gaia_uwb.simulate import PRESETS, simulate_pass

ODD = os.fsdecode(b"log \xff\xfe [a-z]*")


def test_odd_names_and_strangers_settings(tmp_path: Path) -> None:
    for seed, kind in enumerate(("csv", "parquet")):
        scene = simulate_pass(PRESETS["lane-closure"], seed).without_truth()
        folder = tmp_path / "logs" / ODD / f"{kind} {ODD}"
        write_native(scene, folder, kind)
        (folder / "scene.yaml").unlink()  # so that the folder names the log
    (tmp_path / "rc").write_bytes(b"text.usetex: True\nfont.family: \xff\n")
    settings = {
        "MATPLOTLIBRC": str(tmp_path / "rc"),
        "MPLBACKEND": "no such backend",
        "PYTHONIOENCODING": "ascii",
    }

    def gaia(*arguments: str) -> subprocess.CompletedProcess[bytes]:
        command = [sys.executable, "-m", "gaia_uwb", *arguments]
        return subprocess.run(
            command, capture_output=True, check=False, cwd=tmp_path, env=os.environ | settings
        )

    source = str(tmp_path / "logs" / ODD)
    checked = gaia("data", "check", source)
    assert checked.returncode in (0, 1), checked.stderr
    done = gaia("reconstruct", source, "--denoiser", "raw", "--out", f"out {ODD}", "--gis")
    assert done.returncode in (0, 1), done.stderr
    reports = sorted((tmp_path / f"out {ODD}").glob("*/report.json"))
    assert len(reports) == 2
    for report in reports:
        assert r"log \xff" in json.loads(report.read_text(encoding="utf-8"))["scene"]
    (tmp_path / "settings.yaml").write_text("denoiser: raw\n", encoding="utf-8")
    fleet = gaia(
        "fleet", str(tmp_path / "logs"), "--config", "settings.yaml", "--out", f"fleet {ODD}"
    )
    assert fleet.returncode in (0, 1), fleet.stderr
    assert b"failed" not in fleet.stdout
    for run in (checked, done, fleet):
        assert b"Traceback" not in run.stderr
