"""What changes in a kept zone: moved, silent and new cones, and drives that contradict it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from gaia_uwb.config import ChangesConfig, PipelineConfig, SolverConfig
from gaia_uwb.kept.beginning import begin
from gaia_uwb.kept.changes import ConeState, far_apart, is_lying, silence
from gaia_uwb.kept.folds import fold
from gaia_uwb.kept.results import folded_result
from gaia_uwb.kept.state import FULL, Past
from known_errors import CONES_M, WORKING, make_drive, straight

PURE = PipelineConfig(denoiser="raw", solver=SolverConfig(position_floor_m=0.0))
LANES = ((0.0, False), (-3.6, True), (1.0, True), (-3.0, False))
CHANGES = ChangesConfig()
MOVED_M = CONES_M + np.array([[0.0, 0.0]] * 2 + [[1.0, 0.0]] + [[0.0, 0.0]] * 3)


def drive(number, cones_m=CONES_M, kept=slice(None), shift_m=(0.0, 0.0)):
    north_m, back = LANES[number % len(LANES)]
    path = straight(north_m, back=back)
    ids = tuple(np.array([f"cone-{k}" for k in range(len(cones_m))])[kept].tolist())
    return make_drive(path, cones_m[kept] - np.array(shift_m), WORKING, number=number, ids=ids)


class Kept:
    """A zone in memory, to which drives are added an hour apart."""

    def __init__(self, config=CHANGES):
        self.config = config
        self.episodes, self.blocks = [drive(number) for number in range(FULL)], []
        drives = [[each] for each in self.episodes]
        self.zone, self.blocks, *_ = begin(drives, PURE, [3600.0 * n for n in range(FULL)])

    def add(self, number, **how):
        episode = drive(number, **how)
        past = Past(len(self.blocks), lambda k: [self.episodes[k]], lambda k: self.blocks[k])
        at_s = 3600.0 * number
        first = [self.episodes[0]]
        done = fold(self.zone, [episode], first, past, PURE, at_s, self.config)
        if done is None:
            return False
        for k, block in done.refolded.items():
            self.blocks[k] = block
        self.episodes.append(episode)
        self.blocks.append(done.block)
        self.zone, self.errors = done.zone, done.errors
        return True

    def states(self):
        return {
            name: each.state(self.zone.ended_s, self.config)
            for name, each in self.zone.watched.items()
        }

    def result(self):
        return folded_result(self.zone, [(self.episodes[-1], self.errors[0])], PURE, self.config)


@pytest.fixture
def kept():
    return Kept()


def test_a_moved_cone_is_suspected_at_once_and_moved_by_a_second_drive(kept):
    kept.add(4, cones_m=MOVED_M)
    assert kept.states()["cone-2"] is ConeState.MAYBE_MOVED
    assert list(kept.states().values()).count(ConeState.PRESENT) == 5
    assert np.hypot(*(kept.zone.places_m["cone-2"] - CONES_M[2])) < 0.4
    result = kept.result()
    assert [fix.status.value for fix in result.anchors].count("moved") == 1
    assert result.status.value == "unreliable"
    kept.add(5, cones_m=MOVED_M)
    assert set(kept.states().values()) == {ConeState.PRESENT}
    (stay,) = kept.zone.watched["cone-2"].before
    assert (stay.from_s, stay.to_s) == (0.0, 3 * 3600.0)
    assert kept.zone.watched["cone-2"].from_s == 4 * 3600.0
    off_m = kept.zone.places_m["cone-2"] - MOVED_M[2]
    shift_m = np.mean([kept.zone.places_m[f"cone-{k}"] - CONES_M[k] for k in (0, 1, 3, 4)], axis=0)
    assert np.hypot(*(off_m - shift_m)) < 0.25
    assert kept.result().status.value == "ok"
    kept.add(6, cones_m=MOVED_M)
    assert set(kept.states().values()) == {ConeState.PRESENT}


def test_one_drive_alone_moves_nothing(kept):
    kept.add(4, cones_m=MOVED_M)
    kept.add(5)
    assert set(kept.states().values()) == {ConeState.PRESENT}
    assert kept.zone.watched["cone-2"].before == ()
    off_m = [kept.zone.places_m[f"cone-{k}"] - CONES_M[k] for k in range(6)]
    assert np.hypot(*(off_m[2] - np.mean(off_m, axis=0))) < 0.15


@pytest.mark.parametrize("shift_m", [(1.5, 0.0), (0.0, 1.5)], ids=["along", "across"])
def test_a_drive_that_contradicts_the_zone_is_left_out(kept, shift_m):
    before = kept.zone
    assert kept.add(4, shift_m=shift_m) is False
    assert kept.zone is before


def test_a_cone_that_two_drives_should_have_heard_is_silent_and_then_gone(kept):
    others = [0, 1, 2, 4, 5]
    kept.add(4, kept=others)
    assert kept.states()["cone-3"] is ConeState.PRESENT
    kept.add(5, kept=others)
    assert kept.states()["cone-3"] is ConeState.SILENT
    assert kept.zone.watched["cone-3"].silent_from_s == 4 * 3600.0
    result = kept.result()
    assert len(result.anchors) == 6
    assert any("cone-3: silent" in note for note in result.notes)
    kept.add(40, kept=others)
    assert kept.states()["cone-3"] is ConeState.GONE
    assert len(kept.result().anchors) == 5
    kept.add(41)
    assert kept.states()["cone-3"] is ConeState.PRESENT


def test_silent_cones_leave_the_boundary_where_the_settings_say_so():
    kept = Kept(ChangesConfig(silent_cones="drop"))
    for number in (4, 5):
        kept.add(number, kept=[0, 1, 2, 4, 5])
    assert [fix.anchor_id for fix in kept.result().anchors] == [
        f"cone-{k}" for k in (0, 1, 2, 4, 5)
    ]


def test_a_new_cone_is_new_until_a_second_drive_hears_it(kept):
    more_m = np.concatenate([CONES_M, [[-2.0, 8.0]]])
    kept.add(4, cones_m=more_m)
    assert kept.states()["cone-6"] is ConeState.NEW
    assert kept.zone.watched["cone-6"].from_s == 4 * 3600.0
    kept.add(5, cones_m=more_m)
    assert kept.states()["cone-6"] is ConeState.PRESENT


def test_evidence_ages_by_the_square_root_of_time():
    still, creeping = (Kept(ChangesConfig(drift_m_per_day=drift)) for drift in (0.0, 1.0))
    for each in (still, creeping):
        each.add(4 + 24 * 4)
        each.add(4 + 24 * 4)
    sums = still.zone.sums
    aged = sums.aged(0.04)
    side = int(still.zone.estimates.loss[0].argmin())
    some = np.diag([0.0, 0.0, 1e3, 1e3, 1e3])  # what is known of delays and patterns
    covariance, more = (
        np.linalg.inv(each.own_matrix[0, side] + some)[:2, :2] for each in (sums, aged)
    )
    np.testing.assert_allclose(more - covariance, 0.04 * np.eye(2), atol=0.01)
    wide = [each.zone.estimates.places_m2[:, 0, 0, 0].mean() for each in (still, creeping)]
    assert wide[1] > wide[0]
    np.testing.assert_allclose(aged.weight, sums.weight)


def test_estimates_stay_where_evidence_ages(kept):
    before = kept.zone.estimates
    after = replace(kept.zone, sums=kept.zone.sums.aged(1e-4)).estimates
    side = before.loss.argmin(axis=1)
    rows = np.arange(len(side))
    np.testing.assert_allclose(after.own[rows, side, :2], before.own[rows, side, :2], atol=0.02)


def test_places_are_far_apart_only_beyond_chance_and_half_a_metre():
    narrow, wide = 0.01 * np.eye(2), np.eye(2)
    zero = np.zeros(2)
    assert far_apart(zero, np.array([0.7, 0.0]), narrow, CHANGES)
    assert not far_apart(zero, np.array([0.7, 0.0]), wide, CHANGES)
    assert not far_apart(zero, np.array([0.4, 0.0]), 1e-4 * np.eye(2), CHANGES)
    assert not far_apart(zero, np.full(2, np.nan), narrow, CHANGES)


@pytest.mark.parametrize(
    ("n_suspects", "n_known", "off_m", "expected"),
    [
        (2, 3, 0.0, True),
        (1, 2, 0.0, False),
        (2, 2, 0.0, False),
        (1, 6, 0.0, False),
        (0, 6, 9.0, True),
    ],
)
def test_what_makes_a_drive_suspected(n_suspects, n_known, off_m, expected):
    off = np.array([off_m, 0.0])
    assert is_lying(n_suspects, n_known, off, np.eye(2), CHANGES) is expected


def test_a_cone_out_of_reach_is_not_silent():
    episode = drive(0)
    places_m = {f"cone-{k}": place_m for k, place_m in enumerate(CONES_M)}
    places_m |= {"far": np.array([0.0, 500.0]), "near": np.array([0.0, 5.0])}
    found = silence([episode], places_m)
    assert list(found) == ["near"]
    assert 1.0 < found["near"] <= 5.0
