"""Message types of a bag: from its own definitions, from ``.msg`` files, or ROS's standard types.

The library rosbags compiles a type's definition into code that reads its messages. A definition
that comes with a log is a stranger's, so what it may ask for is limited before that.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from gaia_uwb._shared import ConfigError, InputError, paths_below, read_regular
from gaia_uwb.logs._logs import check_file
from gaia_uwb.logs.bags.container import Channel

_TYPE_NAME = re.compile(r"[A-Za-z]\w{0,99}/msg/[A-Za-z]\w{0,99}", re.ASCII)
_MAX_DEFINITION = 256 * 1024
_MAX_TYPES = 500
_MAX_FIELDS = 5000
_MAX_ARRAY = 1000  # of texts and messages: rosbags writes a line of code for each
_MAX_FILES = 2000
_MAX_PATHS = 20_000  # files and folders among which these are looked for

Reader = Callable[[bytes], Any]
Fields = Mapping[str, Any]
"""Type -> (constants, [(field, description)]), as rosbags describes types."""


class Types:
    """Types of one bag's channels.

    Parameters
    ----------
    path
        The bag, for messages.
    msg_dir
        Folder with ``.msg`` files of types that the bag lacks: ``package/msg/Name.msg``, at any
        depth.

    Raises
    ------
    InputError
        If the folder cannot be read.
    ConfigError
        If rosbags is not installed.
    """

    def __init__(self, path: Path, msg_dir: Path | None = None) -> None:
        try:
            import rosbags.typesys  # noqa: F401
        except ImportError as error:
            problem = f"{path}: ROS logs need the extra 'ros': pip install 'gaia-uwb[ros]'"
            raise ConfigError(problem) from error
        self.notes: list[str] = []
        self._path = path
        self._given = {} if msg_dir is None else _read_msg_dir(msg_dir)
        self._fields: dict[tuple[str, str | None], Fields] = {}
        self._readers: dict[tuple[str, str | None, str], Reader] = {}

    def fields(self, channel: Channel) -> Fields:
        """Return the description of a channel's type and those it uses.

        Raises
        ------
        InputError
            If the type has no definition, or one that cannot be used.
        """
        key = (channel.msgtype, channel.definition)
        if key not in self._fields:
            with self._of(channel):
                self._fields[key] = self._find(channel)
        return self._fields[key]

    def reader(self, channel: Channel) -> Reader:
        """Return the function from bytes to a message.

        Raises
        ------
        InputError
            Like :meth:`fields`; and if the encoding is unknown.
        """
        key = (channel.msgtype, channel.definition, channel.encoding)
        if key not in self._readers:  # rosbags compiles one, and a log may have hundreds of files
            self._readers[key] = self._compile(channel)
        return self._readers[key]

    def _compile(self, channel: Channel) -> Reader:
        if channel.encoding not in {"ros1", "cdr"}:
            raise self._error(
                channel, f"has messages in the unsupported encoding {channel.encoding[:20]!r}"
            )
        layouts = {"": self.fields(channel)}
        if not channel.definition and channel.msgtype not in self._given:
            layouts |= _older_layouts(channel.msgtype)
        with self._of(channel):
            readers = {name: _reader(types, channel) for name, types in layouts.items()}
        return _FirstThatFits(readers, channel, self.notes).read

    @contextmanager
    def _of(self, channel: Channel) -> Iterator[None]:
        """Turn whatever a stranger's definition does to rosbags into one line."""
        try:
            yield
        except InputError:
            raise
        except Exception as error:
            reason = " ".join(str(error).split())[:120] or type(error).__name__
            raise self._error(channel, f"has a definition that cannot be used: {reason}") from error

    def _find(self, channel: Channel) -> Fields:
        """Return a type's description from the bag, the given folder, or ROS's standard types."""
        from rosbags.typesys import Stores, get_typestore

        name = channel.msgtype
        if not _TYPE_NAME.fullmatch(name):
            raise self._error(channel, "is not a valid type name")
        stock = get_typestore(Stores.LATEST).fielddefs
        if channel.definition:
            types = _parse(channel.definition, name)
        elif name in self._given or name in stock:
            types = {**stock, **self._given}
        else:
            problem = f"has no definition in the bag: give a msg_dir with {name}.msg"
            raise self._error(channel, problem)
        for other in ("builtin_interfaces/msg/Time", "builtin_interfaces/msg/Duration"):
            types.setdefault(other, stock[other])
        wanted = _used(types, name)
        _check(wanted, name)
        return wanted

    def _error(self, channel: Channel, problem: str) -> InputError:
        source = f"{self._path}, topic {channel.topic}"
        return InputError(f"its type {channel.msgtype[:100]} {problem}", source=source)


class _FirstThatFits:
    """Reads a topic's messages in the first layout of their type that fits the first message.

    A recording of ROS 2 before Iron does not hold its types, and some of them have changed since.

    Parameters
    ----------
    readers
        Name of a release of ROS 2 -> how it reads a message; the newest has no name.
    channel
        The topic.
    notes
        Where to say that an older layout was taken.
    """

    def __init__(self, readers: Mapping[str, Reader], channel: Channel, notes: list[str]) -> None:
        self._readers = readers
        self._channel = channel
        self._notes = notes
        self._chosen: Reader | None = None

    def read(self, data: bytes) -> Any:
        """Return a message."""
        if self._chosen is None:
            self._chosen = self._choose(data)
        return self._chosen(data)

    def _choose(self, data: bytes) -> Reader:
        for name, reader in self._readers.items():
            with suppress(Exception):  # rosbags may be upset in any way
                reader(data)
                if name:
                    topic, msgtype = self._channel.topic[:60], self._channel.msgtype[:60]
                    self._notes.append(f"{topic}: {msgtype} read with the layout of {name}")
                return reader
        return next(iter(self._readers.values()))


def _reader(types: Fields, channel: Channel) -> Reader:
    from rosbags.typesys import Stores, get_typestore

    msgtype = channel.msgtype
    store = get_typestore(Stores.EMPTY)
    store.register(dict(types))
    store.get_msgdef(msgtype)
    read = store.deserialize_ros1 if channel.encoding == "ros1" else store.deserialize_cdr
    return lambda data: read(data, msgtype)


def _older_layouts(name: str) -> dict[str, Fields]:
    """Return the layouts that one of ROS's own types had in earlier releases, the latest first."""
    from rosbags.typesys import Stores, get_typestore

    layouts: dict[str, Fields] = {}
    known = [_used(get_typestore(Stores.LATEST).fielddefs, name)]
    for store in sorted(Stores, key=lambda store: store.value, reverse=True):
        types = get_typestore(store).fielddefs
        if store.value.startswith("ros2") and name in types:
            used = _used(types, name)
            if used not in known:
                known.append(used)
                layouts[f"ROS 2 {store.value.removeprefix('ros2_').title()}"] = used
    return layouts


def _parse(definition: str, name: str) -> dict[str, Any]:
    from rosbags.typesys import get_types_from_msg

    if len(definition) > _MAX_DEFINITION:
        raise ValueError(f"it is too long: {len(definition):,} characters")
    return dict(get_types_from_msg(definition, name))


def _read_msg_dir(folder: Path) -> dict[str, Any]:
    """Return the types of all ``.msg`` files below a folder."""
    if not folder.is_dir():
        raise InputError("no such folder (msg_dir)", source=folder)
    paths = paths_below(folder, most=_MAX_PATHS)
    if paths is None:
        problem = f"contains more than {_MAX_PATHS:,} files: name the folder of the .msg files"
        raise InputError(problem, source=folder)
    types: dict[str, Any] = {}
    for count, path in enumerate(path for path in paths if path.suffix == ".msg"):
        if count == _MAX_FILES:
            raise InputError(f"contains more than {_MAX_FILES:,} .msg files", source=folder)
        package = path.parent.parent if path.parent.name == "msg" else path.parent
        name = f"{package.resolve().name}/msg/{path.stem}"
        try:
            check_file(path, _MAX_DEFINITION)
            content = read_regular(path, most_bytes=_MAX_DEFINITION)
            types |= _parse(content.decode(), name)
        except InputError:
            raise
        except Exception as error:  # a definition may upset rosbags in any way
            reason = " ".join(str(error).split())[:120]
            raise InputError(f"is not a message definition: {reason}", source=path) from error
    if not types:
        raise InputError("contains no .msg files", source=folder)
    return types


def _used(types: Mapping[str, Any], name: str) -> dict[str, Any]:
    """Return a type and all that it uses."""
    used: dict[str, Any] = {}
    queue = [name]
    while queue:
        current = queue.pop()
        if current in used:
            continue
        if current not in types:
            raise ValueError(f"{current} is used but not defined")
        used[current] = types[current]
        for _, description in types[current][1]:
            kind, content = description
            inner = content[0] if kind in (3, 4) else description
            if inner[0] == 2:
                queue.append(inner[1])
    return used


def _check(types: Mapping[str, Any], name: str) -> None:
    """Refuse definitions from which a short message could take long or much memory to read."""
    if len(types) > _MAX_TYPES or sum(len(fields) for _, fields in types.values()) > _MAX_FIELDS:
        raise ValueError("it has too many types or fields")
    for type_name, (_, fields) in types.items():
        if not _TYPE_NAME.fullmatch(type_name):
            raise ValueError("it has an invalid type name")
        for field, (kind, content) in fields:
            if kind not in (3, 4):
                continue
            inner, length = content
            if kind == 3 and length > _MAX_ARRAY and (inner[0] == 2 or inner[1][0] == "string"):
                raise ValueError(f"{field} has too many elements: {length:,}")
            if inner[0] == 2 and not _size(types, inner[1], ()):
                raise ValueError(f"{field} is an array of empty elements")
    _size(types, name, ())


def _size(
    types: Mapping[str, Any], name: str, above: tuple[str, ...], empty: set[str] | None = None
) -> int:
    """Return 1 if a message of this type takes any bytes, else 0."""
    empty = set() if empty is None else empty  # types that are known to take none
    if name in above:
        raise ValueError(f"{name} contains itself")
    if len(above) > 50:
        raise ValueError("its types are nested too deeply")
    for _, (kind, content) in types[name][1]:
        if kind in (1, 4) or (kind == 3 and content[0][0] == 1 and content[1]):
            return 1
        inner = content if kind == 2 else content[0][1] if kind == 3 and content[1] else None
        if inner is not None and inner not in empty and _size(types, inner, (*above, name), empty):
            return 1
    empty.add(name)
    return 0
