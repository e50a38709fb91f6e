"""Imports go one way, heavy ones happen late, and only the command line prints."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parents[1] / "src" / "gaia_uwb"

# A module imports only from lower layers; inside a folder, modules share their layer.
LAYERS: dict[str, int] = {
    "_typing": 0, "errors": 0,
    "_checks": 1,
    "config": 2, "estimate": 2, "scene": 2,
    "_solver": 3, "episode": 3,
    "bootstrap": 4, "layout_prior": 4, "multilateration": 4, "projection": 4,
    "spikes": 4, "tour": 4,
    "batch": 5, "geometry": 5, "readings": 5,
    "calibration": 6, "clock": 6, "locate": 6, "metrics": 6,
    "alignment": 7, "sides": 7,
    "datasets": 8, "denoisers": 8, "simulate": 8,
    "pipeline": 9, "sources": 9,
    "evaluate": 10, "files": 10, "geojson": 10, "map_page": 10, "plots": 10,
    "report": 11,
    "__init__": 12,
    "cli": 13,
    "__main__": 14,
}  # fmt: skip
FOLDERS = {"simulate", "datasets", "denoisers"}


def modules() -> list[Path]:
    return sorted(PACKAGE.rglob("*.py"))


def part_of(path: Path) -> str:
    """Return the name in LAYERS: the folder, else the module."""
    relative = path.relative_to(PACKAGE)
    return relative.parts[0] if len(relative.parts) > 1 else relative.stem


def imported_parts(path: Path) -> set[str]:
    parts = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        names: list[str] = []
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.module:
            names = [f"{node.module}.{alias.name}" for alias in node.names]
        for name in names:
            words = name.split(".")
            if words[0] == "gaia_uwb" and len(words) > 1:
                parts.add(words[1] if words[1] in LAYERS else "__init__")
    return parts


@pytest.mark.parametrize("path", modules(), ids=lambda p: str(p.relative_to(PACKAGE)))
def test_imports_only_from_lower_layers(path: Path) -> None:
    part = part_of(path)
    assert part in LAYERS, f"say in LAYERS where {part} belongs"
    for other in imported_parts(path):
        if other == part and part in FOLDERS:
            continue
        assert LAYERS[other] < LAYERS[part], f"{part} must not import {other}"


def test_prints_only_in_the_command_line() -> None:
    for path in modules():
        if part_of(path) in {"cli", "__main__"}:
            continue
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
                assert node.func.id not in {"print", "input", "exit", "quit"}, path


@pytest.mark.parametrize("command", ["import gaia_uwb", "import gaia_uwb.cli"])
def test_importing_is_light(command: str) -> None:
    heavy = {"torch", "pandas", "polars", "matplotlib", "scipy", "pyproj", "shapely", "jaxtyping"}
    code = f"{command}; import sys; print(*sorted(set(sys.modules) & {heavy!r}))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == []
