"""Damage inside JSON and YAML: the text stays in order, one value, key or branch does not."""

from __future__ import annotations

import copy
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import yaml

Rng = np.random.Generator


def _nested(levels: int) -> Any:
    return [_nested(levels - 1)] if levels else "x"


STRANGE: list[Any] = [
    *(None, True, False, 0, -1, 0.5, 1e-320, 1e9, 2**63, -(2**63), 10**299, 1e308, -1e308),
    *("", " ", "x", "1", "NaN", "a\nb", "\0", "\x1b[2J", "\u202e", "\ud800", "..", "/", "ok", "2"),
    *("x" * 300, "9" * 5000, "0" * 70_000, "2026-02-30", "0001-01-01T00:00:00+05:00"),
    *([], {}, [[]], [None], [1.0, "x"], ["\ud800"], [0] * 5000, [{}] * 500, _nested(45)),
    *({"": 0}, {"a\nb": {}}, {"\ud800": 1}, {"x" * 3000: 1}, {f"k{n}": n for n in range(2000)}),
]
"""What may stand in the place of a value and should not; the texts serve as keys as well."""


def damage_document(path: Path, rng: Rng) -> None:
    """Spoil one place of a JSON or YAML file and write the rest as it was."""
    text = path.read_text(encoding="utf-8")
    is_yaml = path.suffix == ".yaml"
    document = yaml.safe_load(text) if is_yaml else json.loads(text)
    spoil(document, rng)
    text = yaml.safe_dump(document) if is_yaml else json.dumps(document, indent=1)
    path.write_text(text, encoding="utf-8")


def spoil(document: Any, rng: Rng) -> None:
    """Change, remove, move or repeat one branch of lists and mappings."""
    holder, key = _place(document, rng)
    value = holder[key]
    match int(rng.integers(7)):
        case 0 | 1 | 2:
            holder[key] = _strange(rng)
        case 3:
            del holder[key]
        case 4:
            other, name = _place(document, rng)
            holder[key] = copy.deepcopy(other[name])
        case 5 if isinstance(holder, dict):
            names = [word for word in STRANGE if isinstance(word, str)]
            holder[names[int(rng.integers(len(names)))]] = value
        case 5:
            holder *= int(rng.integers(2, 200))
        case _ if isinstance(value, (int, float)):
            holder[key] = value * float(rng.choice([-1, 0, 10, 1e3, 1e6, 1e12, 1e300]))
        case _:
            holder[key] = [value] if rng.random() < 0.5 else {"x": value}


def _strange(rng: Rng) -> Any:
    return copy.deepcopy(STRANGE[int(rng.integers(len(STRANGE)))])


def _place(document: Any, rng: Rng) -> tuple[Any, Any]:
    """Return a list or mapping and a key of it, near the top as likely as deep inside."""
    *_, last = _descent(document, rng)
    return last


def _descent(node: Any, rng: Rng) -> Iterator[tuple[Any, Any]]:
    keys = list(node) if isinstance(node, dict) else list(range(len(node)))
    key = keys[int(rng.integers(len(keys)))]
    yield node, key
    if isinstance(node[key], (dict, list)) and node[key] and rng.random() < 0.75:
        yield from _descent(node[key], rng)
