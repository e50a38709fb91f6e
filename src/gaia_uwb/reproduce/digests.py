"""Checksums that say whether something kept from an earlier run still counts.

Code is compared by what it does: comments, docstrings, layout and the place of a file do not count.
What a module depends on is found by following its imports, through the faces of folders, so that no
list of files can go out of date.
"""

from __future__ import annotations

import ast
import hashlib
import json
from collections.abc import Iterable, Sequence
from dataclasses import fields, is_dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from gaia_uwb._shared import Array
from gaia_uwb.episode import Episode

_PACKAGE = Path(__file__).parents[1]
_CHUNK = 16


def digest_of(content: Any) -> str:
    """Return the checksum of anything that JSON can hold.

    Parameters
    ----------
    content
        Plain values.
    """
    text = json.dumps(content, sort_keys=True, default=str)
    return hashlib.sha256(text.encode()).hexdigest()[:_CHUNK]


def episodes_digest(episodes: Sequence[Episode]) -> str:
    """Return the checksum of all numbers of some episodes, the truth included.

    Parameters
    ----------
    episodes
        Any.
    """
    digest = hashlib.sha256()
    for episode in episodes:
        digest.update(repr((episode.name, episode.anchor_ids, episode.range_m.shape)).encode())
        arrays = [episode.t_s, episode.position_m, episode.range_m]
        arrays += [x for x in (episode.tag_up_m, episode.anchor_up_m) if x is not None]
        if episode.truth is not None:
            arrays += [episode.truth.anchor_m, episode.truth.range_m, episode.truth.nlos]
        if episode.calibration is not None:
            found = episode.calibration
            arrays += [found.bias, found.covariance]
            digest.update(repr((found.sigma_m, found.correlation)).encode())
        for part in (episode.clock, episode.own_times, episode.run_errors):
            arrays += _arrays(part)
        for array in arrays:
            digest.update(np.ascontiguousarray(array).tobytes())
    return digest.hexdigest()[:_CHUNK]


def _arrays(part: Any) -> list[Array]:
    """Return the numbers in a part of an episode, and in its parts, one by one."""
    if is_dataclass(part):
        return [x for own in fields(part) for x in _arrays(getattr(part, own.name))]
    return [np.asarray(part)] if isinstance(part, np.ndarray | float | int) else []


@lru_cache(maxsize=64)
def code_digest(*modules: str, without: tuple[str, ...] = ()) -> str:
    """Return the checksum of modules and of all modules of the package that they import.

    Parameters
    ----------
    modules
        Names inside the package, such as ``zone.sides``; a folder's name stands for all its files.
    without
        Modules or folders that are not followed, since nothing that counts depends on them.

    Raises
    ------
    ValueError
        If there is no module of a name: it would be left out without a word.
    """
    if missing := [name for name in (*modules, *without) if not _files(name)]:
        raise ValueError(f"unknown module {', '.join(missing)}")
    todo = [path for name in modules for path in _files(name)]
    found: dict[Path, str] = {}
    while todo:
        path = todo.pop()
        if path in found or _is_in(path, without):
            continue
        if path.suffix != ".py":
            found[path] = hashlib.sha256(path.read_bytes()).hexdigest()
            continue
        tree = ast.parse(path.read_text(encoding="utf-8"))
        todo += [other for name in _imported(tree) for other in _imported_files(name)]
        found[path] = hashlib.sha256(ast.dump(_bare(tree)).encode()).hexdigest()
    return hashlib.sha256("\n".join(sorted(found.values())).encode()).hexdigest()[:_CHUNK]


def _files(name: str) -> list[Path]:
    """Return a module's file, or all files of a folder that code may depend on."""
    base = _PACKAGE.joinpath(*name.split("."))
    if base.is_dir():
        kinds = {".py", ".yaml"}
        return sorted(path for path in base.iterdir() if path.suffix in kinds)
    return [
        base.with_suffix(suffix) for suffix in (".py", ".c") if base.with_suffix(suffix).is_file()
    ]


def _imported_files(name: str) -> list[Path]:
    """Return the file of ``a.b``; of ``a`` or, if that is a face, of the file that it names."""
    if found := _files(name):
        return found
    folder, _, last = name.rpartition(".")
    stub = _PACKAGE.joinpath(*folder.split("."), "__init__.pyi")
    if not stub.is_file():
        return _files(folder) if folder else []
    for node in ast.parse(stub.read_text(encoding="utf-8")).body:
        if isinstance(node, ast.ImportFrom) and last in {alias.name for alias in node.names}:
            home = ".".join(filter(None, [folder, node.module]))
            return _files(home) or _imported_files(f"{home}.{last}")
    return []


def _imported(tree: ast.AST) -> Iterable[str]:
    """Yield the names that a module takes from the package."""
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and node.module:
            words = node.module.split(".")
            if words[0] == "gaia_uwb":
                yield from (".".join([*words[1:], alias.name]) for alias in node.names)


def _is_in(path: Path, names: Sequence[str]) -> bool:
    """Tell whether a file is one of the modules, or in one of the folders."""
    parts = path.relative_to(_PACKAGE).with_suffix("").parts
    return any(tuple(name.split(".")) == parts[: name.count(".") + 1] for name in names)


def _bare(tree: ast.Module) -> ast.Module:
    """Take out the docstrings, and the places that imports name: where code lies does not count."""
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("gaia_uwb"):
            node.module = "gaia_uwb"
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
            node.body = [
                line
                for line in node.body
                if not (isinstance(line, ast.Expr) and isinstance(line.value, ast.Constant))
            ] or [ast.Pass()]
    return tree
