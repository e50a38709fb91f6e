"""Annotations are executed while testing, and cost nothing where nobody tests."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest
from jaxtyping import TypeCheckError

from gaia_uwb.alignment.spikes import gate_spikes
from gaia_uwb.episode import bias_basis


def test_shapes_are_executed_in_the_tests() -> None:
    with pytest.raises(TypeCheckError):
        gate_spikes(np.zeros(3), np.zeros(4))


def test_dtypes_are_executed_in_the_tests() -> None:
    with pytest.raises(TypeCheckError):
        bias_basis(np.zeros(3, dtype=np.float32))


def test_annotations_are_placeholders_outside_the_tests() -> None:
    code = (
        "import sys; from gaia_uwb._shared.arrays import Array, Float64; "
        "Float64[Array, 'T N']; assert 'jaxtyping' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
