"""Which files a ROS log consists of: one, or those that a ROS 2 folder's description names."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

from gaia_uwb._shared import InputError, YamlError, read_yaml, shown
from gaia_uwb.logs._logs import check_file
from gaia_uwb.logs.bags.container import MAX_FILE_BYTES, Bag, Message

_MAX_METADATA = 2 * 2**20
_MAX_FILES = 1000


def is_ros2_folder(folder: Path) -> bool:
    """Tell whether a folder is a ROS 2 recording."""
    return (folder / "metadata.yaml").is_file()


def open_log(path: Path) -> tuple[list[Bag], bool]:
    """Return the files of a log, and whether each message is packed.

    Raises
    ------
    InputError
        If a file is missing, empty or of another kind, or the folder's description is wrong.
    """
    is_folder = False
    with suppress(OSError):  # of what cannot be looked at, check_file says why
        is_folder = path.is_dir()
    paths, packed = _storage_files(path) if is_folder else ([path], False)
    for each in paths:
        check_file(each, MAX_FILE_BYTES)
    return [open_bag(each) for each in paths], packed


def _storage_files(folder: Path) -> tuple[list[Path], bool]:
    """Return the files that a ROS 2 folder's description names."""
    path = folder / "metadata.yaml"
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
    return paths, mode == "message"


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
    if path.suffix not in kinds:
        raise InputError("expected a .bag, .mcap or .db3 file", source=path)
    return kinds[path.suffix](path)
