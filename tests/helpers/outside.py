"""What a user sees: while testing, annotations refuse wrong shapes before our own checks can."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import jaxtyping


@contextmanager
def annotations_off() -> Iterator[None]:
    """Stop the execution of annotations, as it is outside the tests."""
    jaxtyping.config.update("jaxtyping_disable", True)
    try:
        yield
    finally:
        jaxtyping.config.update("jaxtyping_disable", False)
