"""Settings of many passes are those of each, as numbers where they agree."""

from __future__ import annotations

import numpy as np
import pytest

from gaia_uwb.simulate.rows import PassRows, at, each
from gaia_uwb.simulate.settings import PassConfig

CONFIG = PassConfig(
    vary={
        "drive.speed_mps": [5.0, 15.0],
        "closure.n_anchors": [4, 12],
        "closure.kind": ["lane-shift", "lane-closure", "shoulder-closure"],
    }
)
DRAWN = [
    {"drive.speed_mps": 6.0, "closure.n_anchors": 4, "closure.kind": "lane-shift"},
    {"drive.speed_mps": 9.5, "closure.n_anchors": 4, "closure.kind": "lane-closure"},
    {"drive.speed_mps": 8.0, "closure.n_anchors": 4, "closure.kind": "lane-shift"},
]


def test_what_differs_is_a_column_and_what_is_shared_a_number() -> None:
    rows = PassRows.of(CONFIG, DRAWN)
    np.testing.assert_array_equal(rows.drive.speed_mps, [[6.0], [9.5], [8.0]])
    np.testing.assert_array_equal(rows.closure.kind == "lane-shift", [[True], [False], [True]])
    assert rows.closure.n_anchors == 4
    assert type(rows.closure.n_anchors) is int
    assert rows.ranging.tail_dof is None
    assert rows.ranging.burst_lengths == CONFIG.ranging.burst_lengths


@pytest.mark.parametrize("k", [0, 1, 2])
def test_one_pass_has_numbers_only(k: int) -> None:
    for rows in (
        PassRows.of(CONFIG, DRAWN[k : k + 1]),
        PassRows.of(CONFIG, DRAWN).at(np.array([k])),
    ):
        found = rows.drive.speed_mps, rows.closure.n_anchors, rows.closure.kind
        assert list(found) == list(DRAWN[k].values())
        assert rows.road == PassRows.of(PassConfig(), [{}]).road


def test_rows_may_repeat() -> None:
    anchors = PassRows.of(CONFIG, DRAWN).at(np.array([0, 0, 2, 1]))
    assert anchors.drive.speed_mps.ravel().tolist() == [6.0, 6.0, 8.0, 9.5]
    assert anchors.at(np.array([0, 1])).drive.speed_mps == 6.0


def test_values_of_rows() -> None:
    column = np.array([[1.0], [2.0]])
    assert at(column, np.array([1, 1, 0])).tolist() == [2.0, 2.0, 1.0]
    assert at(3.0, np.array([1, 1, 0])) == 3.0
    assert each(column, 2).tolist() == [1.0, 2.0]
    assert each(3.0, 2).tolist() == [3.0, 3.0]
