"""Checksums that say whether something kept from an earlier run still counts.

Code is compared by what it does: comments, docstrings and layout do not count. What a module
depends on is found by following its imports, so that no list of files can go out of date.
"""

from __future__ import annotations

import ast
import hashlib
import json
from collections.abc import Iterable, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

import gaia_uwb
from gaia_uwb.episode import Episode

_PACKAGE = Path(gaia_uwb.__file__).parent
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
        for array in arrays:
            digest.update(np.ascontiguousarray(array).tobytes())
    return digest.hexdigest()[:_CHUNK]


@lru_cache(maxsize=64)
def code_digest(*modules: str, without: tuple[str, ...] = ()) -> str:
    """Return the checksum of modules and of all modules of the package that they import.

    Parameters
    ----------
    modules
        Names inside the package, such as ``locate``; a folder's name stands for all its files.
    without
        Modules that are not followed, since nothing that counts depends on them.
    """
    todo = [path for name in modules for path in _files(name)]
    found: dict[Path, str] = {}
    while todo:
        path = todo.pop()
        if path in found or _module(path) in without:
            continue
        if path.suffix != ".py":
            found[path] = hashlib.sha256(path.read_bytes()).hexdigest()
            continue
        tree = ast.parse(path.read_text(encoding="utf-8"))
        todo += [other for name in _imported(tree) for other in _imported_files(name)]
        found[path] = hashlib.sha256(ast.dump(_bare(tree)).encode()).hexdigest()
    lines = sorted(f"{path.relative_to(_PACKAGE)} {value}" for path, value in found.items())
    return hashlib.sha256("\n".join(lines).encode()).hexdigest()[:_CHUNK]


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
    """Return the file of ``a.b``, or of ``a`` where ``b`` is a name inside it."""
    base = _PACKAGE.joinpath(*name.split("."))
    if base.is_dir():
        return [base / "__init__.py"]
    if found := _files(name):
        return found
    parent = name.rpartition(".")[0]
    return _imported_files(parent) if parent else []


def _imported(tree: ast.AST) -> Iterable[str]:
    """Yield the names that a module takes from the package."""
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and node.module:
            words = node.module.split(".")
            if words[0] == "gaia_uwb":
                yield from (".".join([*words[1:], alias.name]) for alias in node.names)


def _module(path: Path) -> str:
    parts = path.relative_to(_PACKAGE).with_suffix("").parts
    return ".".join(part for part in parts if part != "__init__")


def _bare(tree: ast.Module) -> ast.Module:
    """Take the docstrings out of a module."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
            node.body = [
                line
                for line in node.body
                if not (isinstance(line, ast.Expr) and isinstance(line.value, ast.Constant))
            ] or [ast.Pass()]
    return tree
