"""Plain YAML is read; what PyYAML would take quietly, slowly or fatally is one line."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from datetime import date
from pathlib import Path
from typing import Any

import pytest
import yaml
from hypothesis import given, strategies as st

from gaia_uwb._shared.strict_yaml import YamlError, parse_yaml, read_yaml

PLAIN = st.recursive(
    st.none() | st.booleans() | st.integers(-(2**63), 2**63) | st.text() | st.floats(-1e9, 1e9),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(), inner, max_size=3),
    max_leaves=8,
)


@given(value=PLAIN)
def test_reads_what_pyyaml_writes(value: object) -> None:
    assert parse_yaml(yaml.safe_dump(value)) == value


def test_plain_values() -> None:
    text = "a: 1\nb: [x, 0.5, true, null]\nday: 2026-01-01\n"
    assert parse_yaml(text) == {"a": 1, "b": ["x", 0.5, True, None], "day": date(2026, 1, 1)}
    assert parse_yaml("") is None


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("a: 1\nb: 2\na: 3", "line 3: duplicate key 'a'"),
        ("a:\n  - {b: 1, 'b': 2}", "line 2: duplicate key 'b'"),
        ("1: x\n1.0: y", "line 2: duplicate key 1.0"),
        ("a: &x [1]\nb: *x", "line 2: YAML aliases are not allowed: write out the value of *x"),
        (
            "a: !!bool x",
            "line 1: YAML tags are not allowed: write a plain value, not tag:yaml.org,2002:bool",
        ),
        ("a: 1\n---\nb: 1", "line 2: expected one document, got a second one"),
        ("[" * 100_000, "line 1: nested too deeply"),
        ("a: [", "line 2: did not find expected node content"),
        ("a: 2026-13-45", "line 1: 2026-13-45: month must be in 1..12"),
        ("a: 0x" + "f" * 5000, "line 1: number too long: 5,002 characters"),
        ("? [1]\n: 2", "line 1: expected a name as the key"),
        ("? {a: 1}\n: 2", "line 1: expected a name as the key"),
    ],
)
def test_what_is_not_plain_names_its_line(text: str, line: str) -> None:
    with pytest.raises(YamlError) as caught:
        parse_yaml(text)
    assert str(caught.value) == line


@pytest.mark.parametrize("text", ["\x00", "a: \ud800", "%YAML 9.9\n---\na"])
def test_what_is_no_yaml_is_one_line(text: str) -> None:
    with pytest.raises(YamlError) as caught:
        parse_yaml(text)
    assert "\n" not in str(caught.value)


def test_files(tmp_path: Path) -> None:
    path = tmp_path / "a.yaml"
    path.write_bytes(b"\xef\xbb\xbfa: 1")  # an editor's byte order mark
    assert read_yaml(path) == {"a": 1}
    path.write_bytes(b"a: 1\nb: \xff")
    with pytest.raises(YamlError, match="line 2: expected UTF-8 text, got the byte 0xff"):
        read_yaml(path)
    with pytest.raises(YamlError, match="larger than 5 bytes"):
        read_yaml(path, most_bytes=5)
    with pytest.raises(YamlError, match=r"^No such file or directory$"):
        read_yaml(tmp_path / "none.yaml")


def test_the_worst_text_of_full_size_is_refused_after_a_look_at_its_beginning(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    levels = ["a0: &a0 [x]"]
    levels += [f"a{k}: &a{k} [{', '.join([f'*a{k - 1}'] * 9)}]" for k in range(1, 12)]
    texts = ["\n".join(levels), "1:" * 100_000, "{a: " * 60_000, "? " * 100_000, "- " * 100_000]
    parse, looked_at = yaml.parse, []

    def counted(*given: Any, **named: Any) -> Iterator[yaml.Event]:
        for event in parse(*given, **named):
            looked_at.append(event)
            yield event

    monkeypatch.setattr(yaml, "parse", counted)
    monkeypatch.setattr(yaml, "load", lambda *_, **__: pytest.fail("something is built of it"))
    for text in texts:
        looked_at.clear()
        with pytest.raises(YamlError):
            parse_yaml(text)
        assert 1 <= len(looked_at) < 150, text[:20]


def test_the_slow_parser_is_as_strict() -> None:
    code = """
import yaml
del yaml.CSafeLoader
from gaia_uwb._shared.strict_yaml import YamlError, parse_yaml
assert parse_yaml("a: [1, x]") == {"a": [1, "x"]}
for text in ("a: 1\\na: 2", "[" * 100_000, "a: &x 1\\nb: *x"):
    try:
        parse_yaml(text)
    except YamlError as error:
        print(error)
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines() == [
        "line 2: duplicate key 'a'",
        "line 1: nested too deeply",
        "line 2: YAML aliases are not allowed: write out the value of *x",
    ]
