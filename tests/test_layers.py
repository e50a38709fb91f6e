"""Imports go one way and through faces, heavy ones are late, only the command line prints."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PACKAGE = ROOT / "src" / "gaia_uwb"
TABLE = ROOT / "docs" / "architecture.md"
MOST_ROWS, MOST_LOOSE_FILES = 15, 14


def read_layers() -> dict[str, int]:
    """Return each folder's or file's row in the table; a row may import from rows above it."""
    layers: dict[str, int] = {}
    lines = TABLE.read_text(encoding="utf-8").splitlines()
    start = lines.index("| folders and files | what they hold |")
    for row, line in enumerate(lines[start + 2 :]):
        if not line.startswith("| `"):
            break
        for name in re.findall(r"`(\w+)`", line.split("|")[1]):
            assert name not in layers, f"{name} is twice in the table"
            layers[name] = row
    return layers


LAYERS = read_layers()
FOLDERS = sorted(path.parent for path in PACKAGE.rglob("__init__.py") if path.parent != PACKAGE)
FACES = {".".join(("gaia_uwb", *path.relative_to(PACKAGE).parts)): path for path in FOLDERS}


def modules() -> list[Path]:
    return sorted([*PACKAGE.rglob("*.py"), PACKAGE / "__init__.pyi"])


def users() -> list[Path]:
    """Return all code but the tests, which look inside."""
    folders = (PACKAGE, ROOT / "benchmarks", ROOT / "tools")
    return sorted(path for folder in folders for path in folder.rglob("*.py"))


def name_of(path: Path) -> str:
    return str(path.relative_to(PACKAGE if PACKAGE in path.parents else ROOT))


def part_of(path: Path) -> str:
    """Return the name in LAYERS: the folder, else the module."""
    relative = path.relative_to(PACKAGE)
    return relative.parts[0] if len(relative.parts) > 1 else relative.stem


@cache
def parsed(path: Path) -> ast.Module:
    return ast.parse(path.read_text(encoding="utf-8"))


def module_of(path: Path) -> str:
    parts = path.relative_to(PACKAGE).with_suffix("").parts
    return ".".join(("gaia_uwb", *(part for part in parts if part != "__init__")))


def imports(path: Path) -> list[tuple[str, str]]:
    """Return (module, name) of all that a file takes from the package, late imports included."""
    found: list[tuple[str, str]] = []
    for node in ast.walk(parsed(path)):
        if isinstance(node, ast.Import):
            found += [(alias.name, "") for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            module = node.module or ""
            if node.level:  # of a stub; it stands in its folder
                module = f"{module_of(path)}.{module}" if module else module_of(path)
            found += [(module, alias.name) for alias in node.names]
    return [each for each in found if each[0].split(".")[0] == "gaia_uwb"]


def imported_parts(path: Path) -> set[str]:
    parts = set()
    for module, name in imports(path):
        words = [*module.split(".")[1:], name]
        parts.add(words[0] if words[0] in LAYERS else "__init__")
    return parts


def test_imports_only_from_lower_layers() -> None:
    upward = []
    for path in modules():
        part = part_of(path)
        assert part in LAYERS, f"say in docs/architecture.md where {part} belongs"
        others = imported_parts(path) - {part}
        upward += [(name_of(path), other) for other in others if LAYERS[other] >= LAYERS[part]]
    assert upward == []


def test_the_table_is_short_and_names_nothing_that_is_gone() -> None:
    assert set(LAYERS) == {part_of(path) for path in modules()}
    assert len(set(LAYERS.values())) <= MOST_ROWS
    assert len(list(PACKAGE.glob("*.py"))) <= MOST_LOOSE_FILES


@pytest.mark.parametrize("folder", [PACKAGE, *FOLDERS], ids=name_of)
def test_no_circle_among_the_files_of_a_folder(folder: Path) -> None:
    here = "gaia_uwb" if folder == PACKAGE else module_of(folder / "__init__.py")
    files = {path.stem: path for path in folder.glob("*.py") if path.stem != "__init__"}
    needs: dict[str, set[str]] = {}
    for stem, path in files.items():
        named = {f"{module}.{name}" for module, name in imports(path)}
        inside = {word.removeprefix(f"{here}.").split(".")[0] for word in named if here in word}
        needs[stem] = inside & set(files) - {stem}
    while ready := {stem for stem, others in needs.items() if not others & set(needs)}:
        needs = {stem: others for stem, others in needs.items() if stem not in ready}
    assert not needs, "these files import each other in a circle"


def test_from_outside_a_folder_only_its_face_is_imported() -> None:
    wrong = []
    for path in users():
        for module, name in imports(path):
            above = [face for face in FACES if f"{module}.".startswith(f"{face}.")]
            outside = [face for face in above if FACES[face] not in path.parents]
            if outside:
                face = min(outside, key=len)
                if module != face:
                    wrong.append(f"{name_of(path)}: import {name} from {face}, not from {module}")
                elif name not in faces_names(FACES[face]):
                    wrong.append(f"{name_of(path)}: {face} does not hand out {name}")
    assert wrong == []


@cache
def faces_names(folder: Path) -> set[str]:
    tree = parsed(folder / "__init__.pyi")
    nodes = [node for node in tree.body if isinstance(node, ast.ImportFrom)]
    return {alias.name for node in nodes for alias in node.names}


@pytest.mark.parametrize("folder", FOLDERS, ids=name_of)
def test_a_face_says_what_happens_there_and_hands_out_names_late(folder: Path) -> None:
    tree = parsed(folder / "__init__.py")
    assert ast.get_docstring(tree)
    assert [ast.unparse(node) for node in tree.body[1:]] == [
        "import lazy_loader",
        "__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)",
    ]
    names = faces_names(folder)
    assert not any(name.startswith("_") for name in names)
    assert not names & {path.stem for path in folder.glob("*.py")}, "a file would hide a name"
    for node in parsed(folder / "__init__.pyi").body:
        assert isinstance(node, ast.ImportFrom)
        assert all(alias.asname == alias.name for alias in node.names), "a stub says: X as X"


@pytest.mark.parametrize("face", ["gaia_uwb", *FACES])
def test_every_name_of_a_face_is_there(face: str) -> None:
    if face.startswith("gaia_uwb.learn"):
        pytest.importorskip("torch")
    module = __import__(face, fromlist=["*"])
    for name in module.__all__:
        assert getattr(module, name) is not None


def test_prints_only_in_the_command_line() -> None:
    for path in modules():
        if part_of(path) in {"cli", "__main__"}:
            continue
        for node in ast.walk(parsed(path)):
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
                assert node.func.id not in {"print", "input", "exit", "quit"}, path


def test_only_training_and_one_figure_know_torch() -> None:
    for path in modules():
        if part_of(path) != "learn" and name_of(path) != "reproduce/inspection.py":
            text = path.read_text(encoding="utf-8")
            assert "import torch" not in text, path
            assert "from torch" not in text, path


@pytest.mark.parametrize("command", ["import gaia_uwb", "import gaia_uwb.cli.commands"])
def test_importing_is_light(command: str) -> None:
    heavy = {"torch", "onnxruntime", "onnx", "safetensors", "pandas", "polars", "matplotlib"}
    heavy |= {"scipy", "pyproj", "shapely", "jaxtyping", "distributed", "numpy", "yaml", "pydantic"}
    heavy |= {"hashlib", "socket", "tempfile"}  # 10 ms, which every call of gaia --help would pay
    code = f"{command}; import sys; print(*sorted(set(sys.modules) & {heavy!r}))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == []


def test_files_named_in_prose_are_there() -> None:
    gone = []
    for path in [*users(), *ROOT.glob("*.md"), *ROOT.glob("docs/**/*.md")]:
        for name in re.findall(r"`((?:\w+/)*\w+\.(?:py|c))`", path.read_text(encoding="utf-8")):
            if not any(f"/{each}".endswith(f"/{name}") for each in CODE_FILES):
                gone.append((name_of(path), name))
    assert gone == []


OTHERS_FILES = {"localization_error_analysis.py"}
"""Files of other projects that our prose names."""
CODE_FILES = OTHERS_FILES | {
    file.relative_to(ROOT).as_posix()
    for folder in ("src", "tests", "benchmarks", "tools")
    for file in (ROOT / folder).rglob("*.*")
}
