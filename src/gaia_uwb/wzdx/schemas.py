"""The official JSON schemas, from a folder that the user names; nothing is downloaded.

The schemas refer to each other and to GeoJSON's by absolute addresses, so the folder must hold them
all: those of WZDx 4.2 or CWZ 1.0, and ``LineString.json``, ``MultiPoint.json`` and ``Point.json``
of geojson.org. Each is known by its ``$id``, so names and sub-folders do not matter.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gaia_uwb._shared import ConfigError
from gaia_uwb.wzdx.dates import parse_date
from gaia_uwb.wzdx.problems import Problem, json_path
from gaia_uwb.wzdx.strict_json import read_json
from gaia_uwb.wzdx.words import Profile

if TYPE_CHECKING:
    from jsonschema import Draft7Validator
    from jsonschema.exceptions import ValidationError

_MOST_FILES = 1000
_LONGEST_TEXT = 200
_TAGS = ("event_type", "device_type", "type")  # members that tell the branches of a choice apart
_ADDRESSES: dict[Profile, str] = {"wzdx-4.2": "/wzdx/main/schemas/4.2/", "cwz-1.0": "/schemas/1.0/"}


class OfficialSchemas:
    """The schemas of one folder.

    Parameters
    ----------
    folder
        Holds ``*.json`` files, in sub-folders too; those without an ``$id`` are skipped.

    Raises
    ------
    ConfigError
        If jsonschema is not installed, or the folder does not exist or contains no schema.
    InputError
        If a file is not JSON.
    """

    def __init__(self, folder: Path) -> None:
        if find_spec("jsonschema") is None:
            raise ConfigError("schemas need jsonschema: pip install 'gaia-uwb[feeds]'")
        if not folder.is_dir():
            raise ConfigError(f"{folder}: expected a folder with the official schemas")
        self.folder = folder
        self._schemas: dict[str, Any] = {}
        for path in sorted(folder.rglob("*.json"))[:_MOST_FILES]:
            schema = read_json(path)
            if isinstance(schema, dict) and isinstance(schema.get("$id"), str):
                self._schemas[schema["$id"]] = schema
        if not self._schemas:
            raise ConfigError(f"{folder}: contains no JSON schema with an $id")
        self._validators: dict[str, Draft7Validator] = {}

    def problems(self, document: Any, kind: str, profile: Profile) -> Iterator[Problem]:
        """Yield what the schema of a feed finds wrong with it.

        Parameters
        ----------
        document
            Plain JSON values.
        kind
            ``WorkZoneFeed`` or ``DeviceFeed``.
        profile
            The specification that it follows.

        Raises
        ------
        ConfigError
            If the folder does not hold that schema, or one that it refers to.
        """
        from jsonschema.exceptions import SchemaError
        from referencing.exceptions import Unresolvable

        validator = self._validator(kind, profile)
        try:
            for error in validator.iter_errors(document):
                for cause in _causes(error):
                    path = json_path(*cause.absolute_path)
                    yield Problem(path, f"official schema: {_shortened(cause.message)}")
        except Unresolvable as error:
            problem = f"{self.folder}: lacks a schema that {kind} refers to: {error}"
            raise ConfigError(problem) from error
        except SchemaError as error:
            raise ConfigError(
                f"{self.folder}: {kind} is not a valid schema: {error.message}"
            ) from error

    def _validator(self, kind: str, profile: Profile) -> Draft7Validator:
        from jsonschema import Draft7Validator, FormatChecker
        from referencing import Registry
        from referencing.jsonschema import DRAFT7

        ends = f"{_ADDRESSES[profile]}{kind}.json"
        address = next((a for a in self._schemas if a.endswith(ends)), None)
        if address is None:
            raise ConfigError(
                f"{self.folder}: contains no schema of a {kind} of {profile} (.../{ends})"
            )
        if address not in self._validators:
            resources = [(a, DRAFT7.create_resource(s)) for a, s in self._schemas.items()]
            formats = FormatChecker(formats=())
            formats.checks("date-time", raises=ValueError)(_is_date)
            self._validators[address] = Draft7Validator(
                self._schemas[address],
                registry=Registry().with_resources(resources),
                format_checker=formats,
            )
        return self._validators[address]


def _is_date(value: object) -> bool:
    if isinstance(value, str):
        parse_date(value)
    return True


def _causes(error: ValidationError) -> Iterator[ValidationError]:
    """Look into a choice: of its branches only the one that the document means counts."""
    branches: dict[Any, list[ValidationError]] = {}
    for inner in error.context or ():
        branches.setdefault(inner.relative_schema_path[0], []).append(inner)
    meant = [inner for inner in branches.values() if not any(map(_is_other_branch, inner))]
    if len(meant) != 1:
        yield error
        return
    for inner in meant[0]:
        yield from _causes(inner)


def _is_other_branch(error: ValidationError) -> bool:
    path: Sequence[str | int] = error.absolute_path
    return error.validator in ("const", "enum") and bool(path) and path[-1] in _TAGS


def _shortened(text: str) -> str:
    if len(text) <= _LONGEST_TEXT:
        return text
    return f"{text[: _LONGEST_TEXT // 2]} ... {text[-_LONGEST_TEXT // 2 :]}"
