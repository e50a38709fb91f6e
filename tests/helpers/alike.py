"""Whether two results are the same, for tests of what must change nothing."""

from __future__ import annotations

from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np


def assert_same(one: Any, other: Any) -> None:
    """Assert that two data classes hold the same to the last bit, and NaN where NaN is."""
    assert type(one) is type(other)
    for field in fields(one):
        a, b = getattr(one, field.name), getattr(other, field.name)
        if is_dataclass(a):
            assert_same(a, b)
        else:
            np.testing.assert_array_equal(a, b, err_msg=field.name)
