"""What of a source counts, in ``gaia.yaml``: ``where`` keeps rows, ``missing`` names placeholders.

>>> as_text(1.0), as_text("tag-1 "), as_text(True)
('1', 'tag-1', '1')
>>> Wanted({"tag_id": [1, "2"]}).accepts("tag_id", 2)
True
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Annotated, Any

from pydantic import BeforeValidator, Field, PlainValidator

Value = str | int | float | bool


def _check_wanted(value: object) -> object:
    """Refuse in one line what is neither a value nor a list of values."""
    values = value if isinstance(value, list) else [value]
    if not values or not all(isinstance(each, Value) for each in values):
        raise ValueError("expected a value, or a list of values")
    return value


def _as_list(value: object) -> object:
    return [value] if isinstance(value, (int, float)) else value


Where = dict[
    Annotated[str, Field(min_length=1)],
    Annotated[Value | list[Value], PlainValidator(_check_wanted)],
]
"""Field -> the value that it must have, or one of several."""

Missing = Annotated[list[float], BeforeValidator(_as_list), Field(max_length=100)]
"""Numbers (or one) that stand for "no range", as the source holds them, before they are scaled."""


def as_text(value: Any) -> str:
    """Return a value as ids are written: without spaces around it, whole numbers without decimals.

    Examples
    --------
    >>> as_text(3.0), as_text(2.5)
    ('3', '2.5')
    """
    if isinstance(value, str):
        return value.strip()
    number = float(value)
    return str(int(number)) if number.is_integer() else repr(number)


class Wanted:
    """The values that fields must have.

    Parameters
    ----------
    where
        As in ``gaia.yaml``.
    """

    def __init__(self, where: Mapping[str, Value | Sequence[Value]]) -> None:
        self._texts = {
            field: frozenset(map(as_text, [value] if isinstance(value, Value) else value))
            for field, value in where.items()
        }

    @property
    def fields(self) -> tuple[str, ...]:
        """The fields that are asked for."""
        return tuple(self._texts)

    def accepts(self, field: str, value: Any) -> bool:
        """Tell whether a field's value is one that is wanted; a field not asked for has all."""
        return field not in self._texts or as_text(value) in self._texts[field]


def is_missing(value: float, missing: Sequence[float]) -> bool:
    """Tell whether a number is a placeholder; also if it was written with 24 bits of precision.

    Examples
    --------
    >>> is_missing(65.53500366210938, [0.0, 65.535])
    True
    """
    return any(abs(value - each) <= 1e-7 * abs(each) for each in missing)
