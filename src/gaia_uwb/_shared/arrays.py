"""Array types for annotations: ``Float64[Array, "T N"]`` gives the element type and the shape.

Axes, the same in the whole package: B episodes, T steps of a timeline, N anchors, R ranges of a
log, P solver problems; 2 is (east, north), 3 is (east, north, up), all in metres.

The tests execute these annotations (jaxtyping and beartype, see ``tests/conftest.py``). Outside
the tests nobody evaluates them, so jaxtyping is a tool of development and costs a user no start-up
time: unless something has loaded it already, the names below are empty placeholders.
"""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

Array: TypeAlias = np.ndarray[Any, np.dtype[Any]]

if TYPE_CHECKING or "jaxtyping" in sys.modules:
    from jaxtyping import Bool, Float32, Float64, Int64
else:

    class _Placeholder:
        """Stand for jaxtyping's names where annotations are never evaluated."""

        def __class_getitem__(cls, item: object) -> type:
            return cls

    Bool = Float32 = Float64 = Int64 = _Placeholder

__all__ = ["Array", "Bool", "Float32", "Float64", "Int64"]
