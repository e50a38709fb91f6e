from __future__ import annotations

import errno

import pytest

from gaia_uwb._shared.errors import InputError
from gaia_uwb._shared.problems import faults_text, problem_of


@pytest.mark.parametrize(
    ("error", "text"),
    [
        (InputError("is empty", source="ranges.csv"), "ranges.csv: is empty"),
        (MemoryError(), "not enough memory for this log"),
        (OSError(errno.ENOSPC, "No space left on device", "out"), "out: No space left on device"),
        (OSError("timed out"), "file system: timed out"),
    ],
)
def test_what_the_input_is_to_blame_for_is_no_fault(error: Exception, text: str) -> None:
    found = problem_of(error)
    assert (found.text, found.is_fault) == (text, False)


def test_a_fault_is_one_line_with_its_traceback() -> None:
    try:
        {}["cone"]
    except KeyError as error:
        found = problem_of(error)
    assert found.text == "a fault of the program: KeyError: 'cone'"
    assert found.is_fault
    assert "test_problems.py" in found.traceback
    assert faults_text([("zone\n1", found.traceback)]).startswith("zone\\n1\nTraceback")
    assert "\n" not in problem_of(ValueError("a\nb\x1b" + "c" * 5000)).text
