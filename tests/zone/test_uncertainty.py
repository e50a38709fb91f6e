import numpy as np
import pytest
import shapely

from gaia_uwb.evaluate.rigid_alignment import rotation_matrix
from gaia_uwb.zone.polygons import convex_hull, polygon_area
from gaia_uwb.zone.uncertainty import Levels, boundary_uncertainty

RECTANGLE_M = np.array([[0.0, 0.0], [40.0, 0.0], [40.0, 8.0], [0.0, 8.0], [20.0, 4.0]])
NOMINAL = Levels(inner=0.9, outer=0.9)


def draw(corners_m=RECTANGLE_M, sigma_m=0.3, n=600, seed=0):
    noise_m = np.random.default_rng(seed).standard_normal((n, len(corners_m), 2))
    return corners_m + sigma_m * noise_m


def find(place_m, combination=None, levels=NOMINAL):
    if combination is None:
        combination = np.zeros(len(place_m), dtype=np.int64)
    return boundary_uncertainty(place_m, combination, levels)


def geometry(region):
    return shapely.union_all([shapely.Polygon(first, holes) for first, *holes in region.polygons])


def shares(found, place_m):
    """Return how many zones hold the whole inner region, and lie wholly in the outer one."""
    zones = [shapely.convex_hull(shapely.MultiPoint(each)).buffer(1e-3) for each in place_m]
    inner, outer = geometry(found.inner), geometry(found.outer).buffer(2e-3)
    return (
        np.mean([inner.is_empty or zone.covers(inner) for zone in zones]),
        np.mean([outer.covers(zone) for zone in zones]),
    )


@pytest.mark.parametrize("turn_rad", [0.0, 0.7])
def test_both_statements_hold_for_scenes_that_nobody_has_seen(turn_rad) -> None:
    turn = rotation_matrix(turn_rad)
    found = find(draw() @ turn.T + [4e5, 5e6])
    inner, outer = shares(found, draw(seed=1) @ turn.T + [4e5, 5e6])
    assert 0.84 <= inner <= 0.95
    assert 0.84 <= outer <= 0.96


def test_regions_are_tight() -> None:
    found = find(draw(sigma_m=0.05))
    zone = shapely.convex_hull(shapely.MultiPoint(RECTANGLE_M))
    assert geometry(found.inner).hausdorff_distance(zone) < 0.7
    assert geometry(found.outer).hausdorff_distance(zone) < 0.3
    assert found.inner.area_m2 == pytest.approx(geometry(found.inner).area)
    assert found.probability == 0.9


def test_an_open_side_leaves_two_pieces_outside_and_nothing_inside() -> None:
    place_m = draw(RECTANGLE_M + np.array([0.0, 10.0]))
    side = (np.arange(len(place_m)) % 2 == 0).astype(np.int64)
    place_m[side == 1, :, 1] *= -1.0
    found = find(place_m, side)
    assert found.inner.polygons == ()
    assert found.inner.area_m2 == 0.0
    assert len(found.outer.polygons) == 2
    assert shares(found, place_m)[1] == pytest.approx(0.9, abs=0.02)


def test_an_unlikely_side_is_left_out_of_the_outer_region() -> None:
    place_m = draw(RECTANGLE_M + np.array([0.0, 10.0]))
    side = (np.arange(len(place_m)) % 100 == 0).astype(np.int64)
    place_m[side == 1, :, 1] *= -1.0
    found = find(place_m, side)
    assert geometry(found.outer).bounds[1] > 5.0
    assert found.inner.area_m2 > 0.6 * 320.0


def test_a_higher_share_costs_area() -> None:
    place_m = draw()
    strict, usual = (find(place_m, levels=Levels(p, p)) for p in (0.98, 0.8))
    assert strict.inner.area_m2 < usual.inner.area_m2 < 320.0
    assert 320.0 < usual.outer.area_m2 < strict.outer.area_m2


def test_rings_run_the_right_way_round() -> None:
    for region in (find(draw()).inner, find(draw()).outer):
        for first, *_ in region.polygons:
            assert shapely.LinearRing(first).is_ccw


def test_the_map_counts_the_scenes_that_hold_a_place() -> None:
    place_m = draw(n=300)
    found = find(place_m).map
    rows, columns = found.probability.shape
    assert max(rows, columns) == 64
    zones = [shapely.Polygon(convex_hull(each)) for each in place_m]
    for row, column in ((0, 5), (3, 30), (rows // 2, columns // 2), (rows - 2, columns - 2)):
        east_m, north_m = found.origin_m + (np.array([column, row]) + 0.5) * found.cell_m
        inside = np.mean([zone.covers(shapely.Point(east_m, north_m)) for zone in zones])
        assert found.probability[row, column] == pytest.approx(inside, abs=0.01)
    mean_m2 = np.mean([polygon_area(convex_hull(each)) for each in place_m])
    assert found.probability.sum() * found.cell_m**2 == pytest.approx(mean_m2, rel=0.02)


def test_scenes_that_agree_to_the_last_bit() -> None:
    found = find(np.repeat(RECTANGLE_M[None], 50, axis=0))
    assert found.inner.area_m2 == pytest.approx(320.0, rel=0.01)
    assert found.outer.area_m2 == pytest.approx(320.0, rel=0.01)


def test_a_thin_zone_of_cones_in_a_row() -> None:
    row_m = np.stack([np.linspace(0.0, 80.0, 9), np.zeros(9)], axis=1)
    found = find(draw(row_m, sigma_m=0.05))
    assert found.inner.area_m2 < 2.0
    assert geometry(found.outer).covers(shapely.LineString(row_m[1:-1]))
    assert found.outer.area_m2 < 60.0
