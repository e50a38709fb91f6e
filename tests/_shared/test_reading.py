from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import pytest

from gaia_uwb._shared.reading import open_regular, paths_below, read_regular


def make_pipe(path: Path) -> Path:
    os.mkfifo(path)
    return path


STRANGE: dict[str, Callable[[Path], Path]] = {
    "pipe": lambda folder: make_pipe(folder / "pipe"),
    "folder": lambda folder: folder,
    "device": lambda _: Path("/dev/zero"),
}


@pytest.mark.parametrize("name", STRANGE)
def test_only_regular_files_are_opened(tmp_path: Path, name: str) -> None:
    with pytest.raises(OSError, match="it is not a regular file"):
        open_regular(STRANGE[name](tmp_path))


def test_a_link_to_a_file_is_followed_and_any_name_will_do(tmp_path: Path) -> None:
    path = tmp_path / os.fsdecode(b"log\xff*?[1]")
    path.write_bytes(b"content")
    (tmp_path / "link").symlink_to(path)
    assert read_regular(tmp_path / "link", most_bytes=7) == b"content"
    with pytest.raises(OSError, match="larger than 6 bytes"):
        read_regular(path, most_bytes=6)
    with pytest.raises(OSError, match="No such file"):
        open_regular(tmp_path / "absent")
    with pytest.raises(OSError, match="null byte"):
        open_regular(Path("a\0b"))


def test_a_file_that_tells_no_size_is_bounded_by_what_is_read() -> None:
    maps = Path("/proc/self/maps")
    if not maps.is_file() or maps.stat().st_size:
        pytest.skip("left out: no file system here tells a size of 0 for what has content")
    with pytest.raises(OSError, match="larger than 10 bytes"):
        read_regular(maps, most_bytes=10)


def test_a_walk_ends_where_there_is_too_much(tmp_path: Path) -> None:
    for name in ("b", "a", "c"):
        (tmp_path / name).touch()
    assert paths_below(tmp_path, most=3) == [tmp_path / name for name in "abc"]
    assert paths_below(tmp_path, most=2) is None
    assert paths_below(Path("/"), most=50) is None
