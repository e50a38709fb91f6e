"""A denoiser that an installed package brings is one like ours."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

MINE = """
from gaia_uwb.denoisers import ColumnDenoiser, ColumnRanges, Options
import numpy as np

class MineOptions(Options):
    sigma_m: float = 0.3

class Mine(ColumnDenoiser):
    Options = MineOptions

    def denoise(self, columns):
        sigma_m = np.where(np.isfinite(columns.range_m), self.options.sigma_m, np.nan)
        return ColumnRanges(columns.range_m, sigma_m)

class Short(ColumnDenoiser):
    def __call__(self, episodes):
        from gaia_uwb import DenoisedRanges
        nothing = np.full((1, 1), np.nan)
        return [DenoisedRanges(nothing, nothing, np.isfinite(nothing)) for _ in episodes]

    def denoise(self, columns):
        raise NotImplementedError

no_class = 7
"""
ENTRY_POINTS = """
[gaia_uwb.denoisers]
mine = mine:Mine
short = mine:Short
no-class = mine:no_class
broken = not_there:Nothing
raw = mine:Mine
"""


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder into which pip has installed a tiny package."""
    folder = tmp_path_factory.mktemp("package")
    wheel = folder / "mine-1.2-py3-none-any.whl"
    info = "mine-1.2.dist-info"
    files = {
        "mine.py": MINE,
        f"{info}/METADATA": "Metadata-Version: 2.1\nName: mine\nVersion: 1.2\n",
        f"{info}/WHEEL": "Wheel-Version: 1.0\nRoot-Is-Purelib: true\nTag: py3-none-any\n",
        f"{info}/entry_points.txt": ENTRY_POINTS,
    }
    record = "".join(f"{name},,\n" for name in [*files, f"{info}/RECORD"])
    with zipfile.ZipFile(wheel, "w") as archive:
        for name, text in {**files, f"{info}/RECORD": record}.items():
            archive.writestr(name, text)
    pip = [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--no-index"]
    subprocess.run([*pip, "--target", str(folder / "site"), str(wheel)], check=True)
    return folder / "site"


def gaia(installed: Path, *arguments: object) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "gaia_uwb", *map(str, arguments)],
        env={**os.environ, "PYTHONPATH": str(installed)},
        capture_output=True,
        text=True,
        check=False,
    )


def test_it_reconstructs_and_is_scored_beside_ours(installed: Path, tmp_path: Path) -> None:
    for name in ("mine", "raw"):
        done = gaia(installed, "reconstruct", "sim", "--denoiser", name, "--out", tmp_path / name)
        assert done.returncode in {0, 1}, done.stderr
    report, ours = (json.loads((tmp_path / n / "report.json").read_text()) for n in ("mine", "raw"))
    assert report["config"]["denoiser"] == "mine"
    assert report["anchors"] != ours["anchors"], "our own names cannot be taken"
    done = gaia(installed, "evaluate", "sim", "--methods", "raw,mine", "--out", tmp_path / "scores")
    assert done.returncode == 0, done.stderr
    rows = json.loads((tmp_path / "scores" / "results.json").read_text())["rows"]
    assert [row["method"] for row in rows] == ["raw", "mine"]


@pytest.mark.parametrize(
    ("name", "problem"),
    [
        (
            "yours",
            "no denoiser is called 'yours'; available: raw, .*, broken, mine, no-class, short",
        ),
        ("broken", "denoiser 'broken' of mine 1.2 cannot be loaded .ModuleNotFoundError: .*"),
        ("no-class", "denoiser 'no-class' of mine 1.2: mine:no_class is not a subclass of .*"),
        ("short", "denoiser 'short': expected ranges of shapes .*, got .*1, 1.*"),
        ("mine:stress", "denoiser 'mine': model: .*; its options are sigma_m"),
    ],
)
def test_what_is_wrong_with_it_is_said_in_one_line(
    installed: Path, tmp_path: Path, name: str, problem: str
) -> None:
    done = gaia(installed, "reconstruct", "sim", "--denoiser", name, "--out", tmp_path / "out")
    assert done.returncode == 2
    assert re.fullmatch(f"gaia: {problem}\n", done.stderr), done.stderr
    assert not (tmp_path / "out" / "report.json").exists()


def test_its_version_is_part_of_its_identity(installed: Path) -> None:
    code = "from gaia_uwb.denoisers import denoiser_identity; print(denoiser_identity('mine'))"
    done = subprocess.run(
        [sys.executable, "-c", code], env={**os.environ, "PYTHONPATH": str(installed)},
        capture_output=True, text=True, check=True,
    )  # fmt: skip
    assert done.stdout.strip() == "['mine', {'sigma_m': 0.3}, 'mine', '1.2']"
