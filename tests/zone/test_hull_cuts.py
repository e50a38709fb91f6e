import numpy as np
import pytest

from gaia_uwb.zone.hull_cuts import CutHulls, chords, scene_hulls
from gaia_uwb.zone.polygons import convex_hull, polygon_area


@pytest.mark.parametrize("n", [3, 5, 12, 60])
def test_hulls_of_many_scenes_are_those_of_each(n):
    scenes = np.random.default_rng(n).normal(0.0, 5.0, (50, n, 2))
    for found, scene in zip(scene_hulls(scenes), scenes, strict=True):
        alone = convex_hull(scene)
        assert set(map(tuple, found)) == set(map(tuple, alone))
        assert polygon_area(found) == pytest.approx(polygon_area(alone))


def test_points_in_one_place_or_on_a_line_have_a_flat_hull():
    same, line = np.ones((4, 2)), np.array([[0.0, 0], [3, 3], [1, 1], [2, 2]])
    for found in scene_hulls(np.stack([same, line])):
        assert polygon_area(found) == pytest.approx(0.0, abs=1e-12)
    assert np.ptp(scene_hulls(line[None])[0], axis=0).tolist() == [3.0, 3.0]


def test_chords_are_where_a_line_is_inside():
    hulls = scene_hulls(np.random.default_rng(0).normal(0.0, 5.0, (20, 7, 2)))
    line = np.linspace(-12.0, 12.0, 25)
    low, high = chords(hulls, line)
    for k, hull in enumerate(hulls):
        reached = (line >= hull[:, 0].min()) & (line <= hull[:, 0].max())
        assert np.array_equal(np.isfinite(low[:, k]), reached)
        area_m2 = np.trapezoid(np.where(reached, high[:, k] - low[:, k], 0.0), line)
        assert area_m2 == pytest.approx(polygon_area(hull), rel=0.1)


def test_counts_are_of_hulls_that_hold_a_stretch():
    square = np.array([[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [0.0, 4.0]])
    cut = CutHulls.across(scene_hulls(np.stack([square, square + np.array([0.0, 1.0]), square])))
    middle = int(np.argmin(abs(cut.line - 2.0)))
    assert cut.end[middle].tolist() == [0.0, 0.0, 1.0, 4.0, 4.0, 5.0]
    assert cut.count[middle].tolist() == [1, 2, 3, 2, 1, 0]
    (interval,) = cut.intervals(cut.count >= 3)[middle]
    assert interval.tolist() == [1.0, 4.0]


def test_the_inner_level_is_the_lowest_whose_region_a_share_of_the_hulls_holds():
    square = np.array([[0.0, 0.0], [9.0, 0.0], [9.0, 9.0], [0.0, 9.0]])
    hulls = scene_hulls(square + np.random.default_rng(2).normal(0.0, 0.5, (40, 4, 2)))
    cut = CutHulls.across(hulls)
    low, high = chords(hulls, cut.line)

    def holding(level):
        held = np.ones(40, dtype=bool)
        for interval, enter, leave in zip(cut.intervals(cut.count > level), low, high, strict=True):
            for start, stop in interval:
                held &= (enter <= start) & (leave >= stop)
        return held.mean()

    level = cut.inner_level(0.8)
    assert holding(level) >= 0.8 > holding(level - 1)
