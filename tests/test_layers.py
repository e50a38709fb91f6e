"""Imports go one way, heavy ones happen late, and only the command line prints."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parents[1] / "src" / "gaia_uwb"

TABLE = Path(__file__).parents[1] / "docs" / "architecture.md"
FOLDERS = {"simulate", "datasets", "denoisers", "learn", "models", "reproduce", "wzdx"}


def read_layers() -> dict[str, int]:
    """Return each module's row in the table; a row may import from rows above it."""
    layers: dict[str, int] = {}
    lines = TABLE.read_text(encoding="utf-8").splitlines()
    start = lines.index("| modules | what they hold |")
    for row, line in enumerate(lines[start + 2 :]):
        if not line.startswith("| `"):
            break
        for name in re.findall(r"`(\w+)`", line.split("|")[1]):
            layers[name] = row
    return layers


LAYERS = read_layers()


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
    assert part in LAYERS, f"say in docs/architecture.md where {part} belongs"
    for other in imported_parts(path):
        if other == part and part in FOLDERS:
            continue
        assert LAYERS[other] < LAYERS[part], f"{part} must not import {other}"


def test_the_table_names_no_module_that_is_gone() -> None:
    assert set(LAYERS) - {part_of(path) for path in modules()} == {"_solver", "_tour"}


def test_prints_only_in_the_command_line() -> None:
    for path in modules():
        if part_of(path) in {"cli", "terminal", "__main__"}:
            continue
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
                assert node.func.id not in {"print", "input", "exit", "quit"}, path


def test_only_learning_and_one_figure_know_torch() -> None:
    for path in modules():
        if part_of(path) != "learn" and path != PACKAGE / "reproduce" / "inspection.py":
            text = path.read_text(encoding="utf-8")
            assert "import torch" not in text, path
            assert "from torch" not in text, path


@pytest.mark.parametrize("command", ["import gaia_uwb", "import gaia_uwb.cli"])
def test_importing_is_light(command: str) -> None:
    heavy = {"torch", "onnxruntime", "onnx", "safetensors", "pandas", "polars", "matplotlib"}
    heavy |= {"scipy", "pyproj", "shapely", "jaxtyping", "distributed"}
    code = f"{command}; import sys; print(*sorted(set(sys.modules) & {heavy!r}))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == []
