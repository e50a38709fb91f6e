"""Fields that may be missing, and numbers in them that may be unknown."""

from __future__ import annotations

import numpy as np

from gaia_uwb._shared import Array, InputError, check_shape, freeze


def freeze_known(owner: object, name: str, shape: tuple[int, ...]) -> Array | None:
    """Store a field that may be missing, and NaN where a number is unknown; refuse infinity."""
    if getattr(owner, name) is None:
        return None
    values = freeze(owner, name, getattr(owner, name), np.float64)
    check_shape(name, values, shape)
    if np.isinf(values).any():
        row = int(np.argmax(np.isinf(values))) + 1
        problem = "expected finite numbers (NaN where unknown), got infinity"
        raise InputError(problem, row=row, column=name)
    return values
