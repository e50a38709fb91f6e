from __future__ import annotations

import pytest

from gaia_uwb.logs._selection import Wanted, is_missing
from gaia_uwb.logs.input_description import SerialRanges


@pytest.mark.parametrize(
    ("wanted", "held", "accepted"),
    [(1, "1", True), ("1", 1, True), (1.0, 1, True), (2, 1, False), ([2, "a "], " a", True)],
)
def test_values_are_compared_as_they_are_written(
    wanted: object, held: object, accepted: bool
) -> None:
    given = SerialRanges.model_validate({"file": "a", "where": {"tag": wanted}})
    assert Wanted(given.where).accepts("tag", held) is accepted
    assert Wanted(given.where).accepts("other", held)


@pytest.mark.parametrize("wrong", [None, [], [None], {"a": 1}, [[1]]])
def test_what_is_no_value_is_said_once(wrong: object) -> None:
    with pytest.raises(ValueError, match="expected a value, or a list of values") as caught:
        SerialRanges.model_validate({"file": "a", "where": {"tag": wrong}})
    assert str(caught.value).count("where") == 1


@pytest.mark.parametrize("given", [0, 0.0, [0], [65535, 0]])
def test_one_number_or_several_are_missing(given: object) -> None:
    missing = SerialRanges.model_validate({"file": "a", "missing": given}).missing
    assert is_missing(0.0, missing)
    assert not is_missing(1e-9, missing)
