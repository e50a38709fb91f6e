"""Readings in cells of place: what is kept, and what shares a cell."""

from dataclasses import replace

import numpy as np
import pytest

from gaia_uwb.episode import RangeReadings
from gaia_uwb.locate import evidence as module
from gaia_uwb.locate.evidence import MOST_CELLS, Heard, gather
from gaia_uwb.scene import Trajectory
from known_errors import CONES_M, Errors, laps, make_drive, straight, u_turn

MOST_READINGS = 1500


def heard(drive, up_m=None):
    n = drive.n_anchors
    return Heard(drive.own_times, np.arange(n), np.full(n, np.nan) if up_m is None else up_m)


def gathered(*drives, n_cones=6):
    return list(gather([heard(drive) for drive in drives], n_cones, np.zeros(len(drives))))


def parked(n, *, east_m=0.0, rate_hz=100.0):
    """Return ``n`` readings of one cone, 5 m north of a tag that stands still."""
    t_s = np.arange(n) / rate_hz
    path = Trajectory(np.array([0.0, t_s[-1] + 1.0]), np.array([[east_m, 0.0], [east_m, 0.0]]))
    return RangeReadings(t_s, np.zeros(n, np.int64), 5.0 + 0.001 * t_s, path)


@pytest.mark.parametrize("n", [3, MOST_READINGS, MOST_READINGS + 1, 36_000])
def test_of_one_cone_in_one_drive_at_most_so_many_readings_are_kept(n):
    (found,) = gather([Heard(parked(n), np.zeros(1, np.int64), np.zeros(1))], 1, np.zeros(1))
    assert len(found.t_s) == min(n, MOST_READINGS)
    assert len(np.unique(found.t_s)) == len(found.t_s)
    between_s = np.diff(np.sort(found.t_s))  # evenly chosen, from the first to about the last
    assert found.t_s.min() == 0.0
    assert between_s.max() <= between_s.min() + 0.0101
    assert found.t_s.max() >= (n - 1 - n / MOST_READINGS) / 100.0


def test_a_cone_that_is_read_seldom_loses_nothing_to_one_that_is_read_often():
    often, seldom = parked(4000), parked(7)
    both = RangeReadings(
        np.concatenate([often.t_s, seldom.t_s]),
        np.repeat([0, 1], [4000, 7]),
        np.concatenate([often.range_m, seldom.range_m]),
        often.trajectory,
    )
    (found,) = gather([Heard(both, np.arange(2), np.zeros(2))], 2, np.zeros(1))
    assert np.bincount(found.cone).tolist() == [MOST_READINGS, 7]


def test_every_reading_is_there_once_with_its_cone_and_drive():
    drives = [
        make_drive(u_turn(), CONES_M, Errors(noise_m=0.1)),
        make_drive(straight(-3.6), CONES_M[:4], Errors(noise_m=0.1), number=1),
    ]
    (found,) = gathered(*drives)
    for number, drive in enumerate(drives):
        own = drive.own_times
        rows = found.drive == number
        got = sorted(zip(found.t_s[rows], found.cone[rows], found.range_m[rows], strict=True))
        assert got == sorted(zip(own.t_s, own.anchor, own.range_m, strict=True))
    assert np.array_equal(found.block_cone[found.cell_block[found.cell]], found.cone)
    assert np.array_equal(found.block_drive[found.cell_block[found.cell]], found.drive)


def test_cells_are_small_beside_the_distance_and_few():
    around_m = 8.0 * np.random.default_rng(0).standard_normal((1400, 2))  # all over the place
    everywhere = Trajectory(0.1 * np.arange(1400), around_m)
    (found,) = gathered(make_drive(everywhere, CONES_M[:2]), n_cones=2)
    assert np.bincount(found.cell_block).tolist() == pytest.approx([50.0, 50.0], abs=14.0)
    assert MOST_CELLS == 64
    (found,) = gathered(make_drive(straight(half_m=6.0), CONES_M[1:4]), n_cones=3)
    place_m = found.motion(np.zeros(1)).position_m
    for cell in range(len(found.cell_block)):
        own = found.cell == cell
        spread_m = np.ptp(place_m[own], axis=0).max()
        assert spread_m <= 0.2 * found.range_m[own].min() + 1e-9


def test_laps_share_cells_and_opposite_directions_do_not():
    (once,) = gathered(make_drive(laps(1), CONES_M))
    (often,) = gathered(make_drive(laps(4), CONES_M))
    assert len(often.cell_block) < 1.3 * len(once.cell_block)
    both_ways = straight(half_m=6.0).position_m
    both_ways = np.concatenate([both_ways, both_ways[::-1]])
    there = make_drive(straight(half_m=6.0), CONES_M[2:3])
    back = make_drive(Trajectory(0.1 * np.arange(len(both_ways)), both_ways), CONES_M[2:3])
    (one,), (two,) = gathered(there, n_cones=1), gathered(back, n_cones=1)
    assert len(two.cell_block) >= 2 * len(one.cell_block) - 1


def test_cones_are_gathered_a_part_at_a_time(monkeypatch):
    drive = make_drive(straight(), CONES_M)
    (whole,) = gathered(drive)
    monkeypatch.setattr(module, "_CHUNK_ROWS", 2 * len(drive.own_times.t_s) // 6)
    parts = gathered(drive)
    assert [part.cones.tolist() for part in parts] == [[0, 1], [2, 3], [4, 5]]
    assert np.array_equal(np.concatenate([part.t_s for part in parts]), whole.t_s)
    cells = np.concatenate([part.cell_block for part in parts])
    assert len(cells) == len(whole.cell_block)


def test_a_cone_that_nobody_heard_has_a_place_among_the_cones():
    drive = make_drive(straight(), CONES_M[:2])
    only = Heard(drive.own_times, np.array([1, 3]), np.full(2, np.nan))
    (found,) = gather([only], 5, np.zeros(1))
    assert found.cones.tolist() == [0, 1, 2, 3, 4]
    assert np.unique(found.cone).tolist() == [1, 3]
    (nothing,) = gather([only], 1, np.zeros(1))
    assert len(nothing.t_s) == 0


def test_where_the_tag_was_goes_by_the_clock_and_the_heights():
    path = replace(straight(speed_mps=5.0), up_m=np.full(120, 3.0))
    drive = make_drive(path, CONES_M[:2])
    up_m = np.array([1.0, np.nan])
    (found,) = gather([heard(drive, up_m)], 2, np.zeros(1))
    now, earlier = found.motion(np.zeros(1)), found.motion(np.array([0.2]))
    inside = (found.t_s > 1.0) & (found.t_s < 10.0)
    assert now.velocity_mps[inside] == pytest.approx(np.tile([5.0, 0.0], (inside.sum(), 1)))
    shift_m = now.position_m[inside] - earlier.position_m[inside]
    assert shift_m == pytest.approx(np.tile([1.0, 0.0], (inside.sum(), 1)))
    assert now.gap_m[found.cone == 0] == pytest.approx(2.0)
    assert now.gap_m[found.cone == 1] == pytest.approx(0.0)
