"""Checks and read-only storage shared by the frozen data classes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gaia_uwb._shared.arrays import Array, Float64
from gaia_uwb._shared.errors import InputError


def freeze(owner: object, name: str, value: Array, dtype: type) -> Array:
    """Store ``value`` on a frozen dataclass as a read-only array of ``dtype``.

    An array that nobody can write to any more is stored as it is, so that windows of an episode
    share its memory; any other is copied.

    Raises
    ------
    InputError
        If a conversion to ``dtype`` would lose something: fractions as indices, text as numbers.
    """
    given = np.asarray(value)
    if given.size and not np.can_cast(given.dtype, dtype, casting="same_kind"):
        raise InputError(f"expected {np.dtype(dtype)} values, got {given.dtype}", column=name)
    array: Array = np.asarray(given, dtype=dtype, order="C")
    if not _is_constant(array):
        array = array.copy()
        array.flags.writeable = False
    object.__setattr__(owner, name, array)
    return array


def _is_constant(array: Array) -> bool:
    """Return whether neither the array nor the one it is a view of can be written to."""
    if array.base is None:
        return not array.flags.writeable
    return isinstance(array.base, np.ndarray) and not (
        array.flags.writeable or array.base.flags.writeable
    )


def check_shape(
    name: str, array: Array, shape: tuple[int, ...], *, source: str | None = None
) -> None:
    """Refuse an array of another shape."""
    if array.shape != shape:
        raise InputError(f"expected shape {shape}, got {array.shape}", source=source, column=name)


def check_finite(name: str, array: Array, *, source: str | None = None) -> None:
    """Refuse NaN and infinity, naming the first row that holds one."""
    finite = np.isfinite(array)
    if not finite.all():
        rows = finite.all(axis=tuple(range(1, array.ndim)))
        raise InputError(
            "expected finite numbers, got NaN or infinity",
            source=source,
            row=int(np.argmin(rows)) + 1,
            column=name,
        )


def check_increasing(
    name: str, t_s: Float64[Array, "T"], *, strictly: bool, source: str | None = None
) -> None:
    """Refuse time that goes back (or, ``strictly``, stands still), naming the first such row."""
    bad = t_s[1:] <= t_s[:-1] if strictly else t_s[1:] < t_s[:-1]
    if bad.any():
        k = int(np.argmax(bad))
        raise InputError(
            f"expected increasing time, got {t_s[k + 1]:.6f} s after {t_s[k]:.6f} s",
            source=source,
            row=k + 2,
            column=name,
        )


def check_heights(name: str, up_m: Float64[Array, "N"], n: int, *, source: str) -> None:
    """Refuse heights that are not one per anchor, or infinite; NaN stands for an unknown one."""
    check_shape(name, up_m, (n,), source=source)
    if np.isinf(up_m).any():
        raise InputError(
            "expected finite heights (NaN where unknown), got infinity",
            source=source,
            row=int(np.argmax(np.isinf(up_m))) + 1,
            column=name,
        )


def check_ids(anchor_ids: Sequence[str], *, source: str | None = None) -> None:
    """Refuse an empty list of anchors, an empty id, and a duplicate id."""
    column = "anchor_id"
    if not anchor_ids:
        raise InputError("expected at least one anchor, got none", source=source, column=column)
    seen: set[str] = set()
    for anchor_id in anchor_ids:
        if not anchor_id or anchor_id in seen:
            what = f"unique, got {anchor_id!r} twice" if anchor_id else "non-empty text"
            raise InputError(f"anchor ids must be {what}", source=source, column=column)
        seen.add(anchor_id)
