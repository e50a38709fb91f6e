"""Which files a ROS log consists of: one, or those of a folder, by its description or their names.

A recorder that was killed writes no ``metadata.yaml``. Then the files of a recording are told by
their names: ``drive_0.mcap``, ``drive_1.mcap`` and so on.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

from gaia_uwb._shared import InputError, YamlError, read_yaml, shown
from gaia_uwb.logs._logs import check_file
from gaia_uwb.logs.bags.container import MAX_FILE_BYTES, Bag, Message

METADATA = "metadata.yaml"
"""Name of the description in a ROS 2 recording's folder."""

ROS_FILES = (".bag", ".bag.active", ".mcap", ".db3")
"""Endings of ROS logs that are one file."""

_MAX_METADATA = 2 * 2**20
_MAX_FILES = 1000
_PART = re.compile(r"(.*?)(?:\d{4}(?:-\d\d){5})?_(\d{1,4})(\.[a-z0-9.]+)", re.ASCII | re.DOTALL)
"""A recording's name (ROS 1 adds the date at which each part starts), number and ending."""


def is_ros_file(path: Path) -> bool:
    """Tell by its name whether a file is a ROS log."""
    return path.name.endswith(ROS_FILES)


def is_ros2_folder(folder: Path) -> bool:
    """Tell whether a folder is one recording by its description."""
    return (folder / METADATA).is_file()


def is_killed_recording(folder: Path) -> bool:
    """Tell whether the files of a folder are the parts of a recording, numbered from 0."""
    return len(_parts(folder)) > 1


def open_log(path: Path) -> tuple[list[Bag], bool]:
    """Return the files of a log, and whether it is certain that they are one recording.

    Raises
    ------
    InputError
        If a file is missing, empty or of another kind, or the folder's description is wrong.
    """
    is_folder = False
    with suppress(OSError):  # of what cannot be looked at, check_file says why
        is_folder = path.is_dir()
    bags, note = [], ""
    paths = [path]
    if is_folder and (path / METADATA).exists():
        paths = _described_files(path)
    elif is_folder:
        paths = _parts(path) or _only_file(path)
        note = f"{path.name}: no {METADATA}; read {', '.join(each.name for each in paths)[:200]}"
    for each in paths:
        check_file(each, MAX_FILE_BYTES)
        bags.append(open_bag(each))
    bags[0].notes += [note] if note else []
    return bags, not note


def _parts(folder: Path) -> list[Path]:
    """Return the files of a recording without a description, in their order; none if unclear."""
    try:
        matches = {path: _PART.fullmatch(path.name) for path in _ros_files(folder)}
    except OSError:
        return []
    numbers = {path: int(match[2]) for path, match in matches.items() if match is not None}
    kinds = {(match[1], match[3]) for match in matches.values() if match is not None}
    if len(kinds) != 1 or not len(matches) == len(numbers) == len(set(numbers.values())):
        return []
    clear = 0 in numbers.values() and len(numbers) <= _MAX_FILES
    return sorted(numbers, key=numbers.__getitem__) if clear else []


def _ros_files(folder: Path) -> list[Path]:
    """Return the ROS logs in a folder; hidden files are what a file system keeps for itself."""
    files = folder.iterdir()
    return sorted(path for path in files if is_ros_file(path) and not path.name.startswith("."))


def _only_file(folder: Path) -> list[Path]:
    """Return the only ROS log in a folder without a description.

    Raises
    ------
    InputError
        If there are none or several.
    """
    try:
        files = _ros_files(folder)
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror or error}", source=folder) from error
    if len(files) != 1:
        there = ", ".join(path.name for path in files[:5]) or "none"
        problem = f"has no {METADATA}, and its ROS logs are not the parts of one: {there}"
        raise InputError(problem, source=folder)
    return files


def _described_files(folder: Path) -> list[Path]:
    """Return the files that a ROS 2 folder's description names."""
    path = folder / METADATA
    check_file(path, _MAX_METADATA)
    try:
        content = read_yaml(path, most_bytes=_MAX_METADATA)
        information = content["rosbag2_bagfile_information"]
        names = [str(name) for name in information["relative_file_paths"]]
        mode = str(information.get("compression_mode") or "").lower()
    except (OSError, YamlError) as error:
        raise InputError(f"cannot be read: {error}", source=path) from error
    except (KeyError, TypeError, AttributeError) as error:
        raise InputError("is not a description of a ROS 2 recording", source=path) from error
    if mode == "file":
        problem = "its files are compressed: decompress them with 'ros2 bag convert'"
        raise InputError(problem, source=path)
    if not 0 < len(names) <= _MAX_FILES:
        raise InputError(f"expected 1 to {_MAX_FILES:,} files, got {len(names):,}", source=path)
    paths = [folder / Path(name).name for name in names]
    twice = next((each for k, each in enumerate(paths) if each in paths[:k]), None)
    if twice is not None:
        raise InputError(f"lists {shown(twice.name)} more than once", source=path)
    return paths


def scan(bag: Bag) -> None:
    """Find a file's channels.

    Raises
    ------
    InputError
        If it cannot be read or has none.
    """
    try:
        bag.scan()
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror or error}", source=bag.path) from error
    if not bag.channels:
        at = "" if bag.cut_off_at is None else f" and is cut off at byte {bag.cut_off_at:,}"
        raise InputError(f"contains no topics{at}", source=bag.path)


def walk(bag: Bag, wanted: set[int]) -> Iterator[Message]:
    """Yield a file's messages of the wanted channels.

    Raises
    ------
    InputError
        If it cannot be read.
    """
    try:
        yield from bag.walk(wanted)
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror or error}", source=bag.path) from error


def open_bag(path: Path) -> Bag:
    """Return the reader of a file, chosen by its ending, not yet scanned.

    Raises
    ------
    InputError
        If the ending is none of ``.bag``, ``.mcap``, ``.db3``.
    """
    from gaia_uwb.logs.bags.mcap import McapBag
    from gaia_uwb.logs.bags.ros1 import Ros1Bag
    from gaia_uwb.logs.bags.sqlite import SqliteBag

    kinds: dict[str, type[Bag]] = {".bag": Ros1Bag, ".mcap": McapBag, ".db3": SqliteBag}
    kinds[".active"] = Ros1Bag  # what a recorder of ROS 1 is still writing
    if path.suffix in {".zst", ".zstd", ".gz", ".xz", ".bz2"}:
        raise InputError("is compressed as a whole: decompress it first", source=path)
    if path.suffix not in kinds:
        raise InputError("expected a .bag, .mcap or .db3 file", source=path)
    return kinds[path.suffix](path)
