r"""Read YAML as people write settings: small, plain, and with every key once.

PyYAML silently keeps the last of two equal keys, follows aliases into structures that grow
without bound, and its fast parser overruns the stack on deep nesting. Here each of these is an
error that names the line.

>>> from gaia_uwb._shared.strict_yaml import parse_yaml
>>> parse_yaml("frame: {lat_deg: 48.1, lon_deg: 11.5}")
{'frame': {'lat_deg': 48.1, 'lon_deg': 11.5}}
>>> parse_yaml("name: a\nname: b")
Traceback (most recent call last):
gaia_uwb._shared.strict_yaml.YamlError: line 2: duplicate key 'name'
"""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

from gaia_uwb._shared.reading import open_regular
from gaia_uwb._shared.text import shown

MAX_BYTES = 2**18
"""Settings are smaller than this."""

_MAX_DEPTH = 50
_MAX_DIGITS = 40


class YamlError(ValueError):
    """A text is not YAML, or not plain enough; the message is one line."""


def read_yaml(path: Path, *, most_bytes: int = MAX_BYTES) -> Any:
    """Read a YAML file.

    Parameters
    ----------
    path
        The file, in UTF-8.
    most_bytes
        A larger file is refused before it is read.

    Returns
    -------
    Any
        Plain values; None for an empty file.

    Raises
    ------
    YamlError
        If the file cannot be read, is not a regular file, too large or not UTF-8, or is not what
        :func:`parse_yaml` takes.
    """
    try:
        with open_regular(path) as file:
            content = file.read(most_bytes + 1)
    except OSError as error:
        raise YamlError(error.strerror or str(error)) from error
    if len(content) > most_bytes:
        raise YamlError(f"larger than {most_bytes:,} bytes")
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        problem = f"line {line}: expected UTF-8 text, got the byte 0x{content[error.start]:02x}"
        raise YamlError(problem) from error
    return parse_yaml(text)


def parse_yaml(text: str) -> Any:
    """Return the plain values that a YAML text holds.

    Parameters
    ----------
    text
        One document, without aliases and with each key once.

    Raises
    ------
    YamlError
        If it is anything else: the message names the line.
    """
    import yaml

    try:
        _check_plain(text)
        return yaml.load(text, Loader=_loader())  # noqa: S506  # a safe loader's child
    except YamlError:
        raise
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        where = "" if mark is None else f"line {mark.line + 1}: "
        problem = " ".join(str(error.problem or error.context).split())
        raise YamlError(f"{where}{problem[:200]}") from error
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        # A ValueError: no Unicode; a RecursionError: the slow parser, on a long line of brackets.
        raise YamlError(" ".join(str(error).split())[:200]) from error


def _check_plain(text: str) -> None:
    """Refuse nesting, aliases and tags, without recursion and before anything is built."""
    import yaml

    depth = documents = 0
    event: Any
    for event in yaml.parse(text, Loader=_loader()):
        if isinstance(event, yaml.AliasEvent):
            name = str(event.anchor)[:40]
            raise _error(
                event.start_mark, f"YAML aliases are not allowed: write out the value of *{name}"
            )
        if getattr(event, "tag", None) is not None:
            raise _error(
                event.start_mark,
                f"YAML tags are not allowed: write a plain value, not {event.tag[:40]}",
            )
        documents += isinstance(event, yaml.DocumentStartEvent)
        if documents > 1:
            raise _error(event.start_mark, "expected one document, got a second one")
        depth += isinstance(event, yaml.CollectionStartEvent)
        depth -= isinstance(event, yaml.CollectionEndEvent)
        if depth > _MAX_DEPTH:
            raise _error(event.start_mark, "nested too deeply")


def _error(mark: Any, problem: str) -> YamlError:
    return YamlError(f"line {mark.line + 1}: {problem}")


@cache
def _loader() -> Any:
    """Return the strict loader's class; PyYAML is imported when the first file is read."""
    import yaml

    base: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)

    class StrictLoader(base):  # type: ignore[misc]
        """Constructs plain values, each key once and no endless numbers."""

    def mapping(loader: Any, node: Any) -> Any:
        loader.flatten_mapping(node)
        found: dict[Any, Any] = {}
        yield found
        for key_node, value_node in node.value:
            key = loader.construct_object(key_node, deep=True)
            if isinstance(key, (list, dict, set)):
                raise _error(key_node.start_mark, "expected a name as the key")
            if key in found:
                raise _error(key_node.start_mark, f"duplicate key {shown(key)}")
            found[key] = loader.construct_object(value_node, deep=True)

    def scalar(loader: Any, node: Any) -> Any:
        if len(node.value) > _MAX_DIGITS:
            raise _error(node.start_mark, f"number too long: {len(node.value):,} characters")
        try:
            return base.yaml_constructors[node.tag](loader, node)
        except ValueError as error:  # like the 13th month
            raise _error(node.start_mark, f"{node.value}: {error}") from error

    StrictLoader.add_constructor("tag:yaml.org,2002:map", mapping)
    for kind in ("int", "float", "timestamp"):
        StrictLoader.add_constructor(f"tag:yaml.org,2002:{kind}", scalar)
    return StrictLoader
