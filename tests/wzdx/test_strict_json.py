"""Files that anybody may send: one clear line, in bounded time."""

from __future__ import annotations

import bz2
import gzip
import json
import lzma
import os
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, strategies as st

from gaia_uwb._shared.errors import InputError
from gaia_uwb.wzdx.strict_json import DEEPEST, LARGEST_BYTES, parse_json, read_json


@pytest.mark.parametrize(
    ("content", "problem"),
    [
        (b"", "the file is empty"),
        (b"\xef\xbb\xbf \n", "the file is empty"),
        (b" " * 3000 + b"hello", "Expecting value.*there is 'hello'"),
        (b"{'a': 1}", "Expecting property name"),
        (b'{"a": 1', "ends too early, in line 1: is it cut off"),
        (b'{"a":\n "half of a te', "ends too early, in line 2: is it cut off"),
        (b'{"a": 1} x', "Extra data"),
        (b'{"a": "\xe9"}', "can't decode byte 0xe9"),
        (b'{"a": 1}\n{"a": 2}\n', "several JSON texts.* the second begins in line 2"),
        (b"[1]\n[2]", "several JSON texts.* the second begins in line 2"),
        (b'\x1e{"a": 1}\n\x1e{"a": 2}\n', "several JSON texts.*RFC 8142"),
        (b'jsonp({"a": 1});', "Expecting value.*there is 'jsonp"),
        ('{"a": 1}'.encode("utf-16"), "UTF-16 or UTF-32, but JSON is in UTF-8"),
        ('{"a": 1}'.encode("utf-16-be"), "UTF-16 or UTF-32"),
        ('{"a": 1}'.encode("utf-32-le"), "UTF-16 or UTF-32"),
        (gzip.compress(b"{}", mtime=0), r"compressed \(gzip\): unpack it first"),
        (bz2.compress(b"{}"), r"compressed \(bzip2\)"),
        (lzma.compress(b"{}"), r"compressed \(xz\)"),
        (b"PK\x03\x04\x14\0", r"compressed \(zip\)"),
        (b"\n <!DOCTYPE HTML>\n<title>502</title>", "it is HTML: perhaps the error page"),
        (b'\xef\xbb\xbf<?xml version="1.0"?><HTML xmlns="">', "it is HTML"),
        (b'<?xml version="1.0"?><Error>AccessDenied</Error>', "it is XML"),
        (b'{"a": NaN}', "NaN is not a JSON number"),
        (b"[-Infinity]", "-Infinity is not"),
        (b"[1e999]", "too large"),
        (b"[" + b"9" * 399 + b"]", "too large"),
        (b"[" + b"9" * 5000 + b"]", "too large"),
        (b'{"a": {"b": 1, "b": 1}}', "duplicate key 'b'"),
        (b"[" * (DEEPEST + 1) + b"1" + b"]" * (DEEPEST + 1), "nested deeper than 50"),
        (b"[" * 1_000_000, "nested deeper than 50"),
        (b'{"a":' * 1_000_000, "nested deeper than 50"),
    ],
)
def test_one_clear_line(tmp_path: Path, content: bytes, problem: str) -> None:
    path = tmp_path / "feed.json"
    path.write_bytes(content)
    with pytest.raises(InputError, match=problem) as caught:
        read_json(path)
    assert "\n" not in str(caught.value)
    assert str(caught.value).startswith(f"{path}: not usable JSON: ")


def test_files_that_are_none(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="No such file"):
        read_json(tmp_path / "nowhere.json")
    with pytest.raises(InputError, match="is not a regular file"):
        read_json(tmp_path)
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(InputError, match="is not a regular file"):
        read_json(tmp_path / "pipe")
    with (tmp_path / "huge.json").open("wb") as file:
        file.truncate(LARGEST_BYTES + 1)
    with pytest.raises(InputError, match="larger than 25 MB"):
        read_json(tmp_path / "huge.json")


def nested(levels: int) -> Any:
    value: Any = 1
    for k in range(levels):
        value = [value] if k % 2 else {"a": value, "b": 2}
    return value


def test_depth_up_to_the_limit_is_read() -> None:
    assert parse_json(json.dumps(nested(DEEPEST)).encode()) == nested(DEEPEST)
    with pytest.raises(ValueError, match="nested deeper"):
        parse_json(json.dumps(nested(DEEPEST + 1)).encode())


def test_a_byte_order_mark_is_no_harm() -> None:
    assert parse_json(b'\xef\xbb\xbf{"a": 1}') == {"a": 1}


@given(
    st.recursive(
        st.none() | st.booleans() | st.integers(-(10**17), 10**17) | st.text()
        | st.floats(allow_nan=False, allow_infinity=False),
        lambda inner: st.lists(inner) | st.dictionaries(st.text(), inner),
        max_leaves=10,
    )
)  # fmt: skip
def test_what_json_writes_is_read_back(value: Any) -> None:
    assert parse_json(json.dumps(value).encode()) == value


@given(st.binary(max_size=60))
def test_any_bytes_are_read_or_refused(content: bytes) -> None:
    try:
        parse_json(content)
    except ValueError as error:
        assert "\n" not in str(error)
