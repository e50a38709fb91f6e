"""Drives folded in one by one, against the fit of all of them together."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from gaia_uwb.config import PipelineConfig, SolverConfig
from gaia_uwb.kept.beginning import begin
from gaia_uwb.kept.folds import fold
from gaia_uwb.kept.results import fused_of
from gaia_uwb.kept.state import FULL, Past
from gaia_uwb.kept.sums import ZoneSums
from gaia_uwb.locate import find_places, fuse, zone_places
from known_errors import CONES_M, WORKING, make_drive, straight

PURE = PipelineConfig(denoiser="raw", solver=SolverConfig(position_floor_m=0.0))
LANES = ((0.0, False), (-3.6, True), (1.0, True), (-3.0, False))


def drive(number, seed=0, cones_m=CONES_M, errors=WORKING):
    north_m, back = LANES[number % len(LANES)]
    path = straight(north_m + 0.1 * number, back=back)
    return make_drive(path, cones_m, errors, seed=seed, number=number)


def folded(episodes, config=PURE):
    """Return the zone and the blocks of its drives, added one after another."""
    zone, blocks, _, _ = begin([[each] for each in episodes[:FULL]], config)
    for number in range(FULL, len(episodes)):
        past = Past(number, lambda k: [episodes[k]], lambda k: blocks[k])
        done = fold(zone, [episodes[number]], [episodes[0]], past, config)
        zone = done.zone
        for k, block in done.refolded.items():
            blocks[k] = block
        blocks.append(done.block)
    return zone, blocks


def together(episodes, monkeypatch):
    """Return the fit of all drives, as far as its steps lead: they usually end sooner."""
    with monkeypatch.context() as patch:
        patch.setattr(zone_places, "STILL", 0.003)
        patch.setattr(zone_places, "_MOST_EXTRA", 150)
        return find_places([episodes], PURE)[0].hypotheses


def apart_m(found, expected):
    return np.hypot(*(found.position_m[:, 0] - expected.position_m[:, 0]).T)


def sigma_m(found):
    return np.sqrt(np.linalg.eigvalsh(found.covariance_m2[:, 0])[:, ::-1])


@pytest.fixture(scope="module")
def seven():
    return [drive(number) for number in range(7)]


@pytest.fixture(scope="module")
def zone(seven):
    return folded(seven)[0]


def test_places_and_their_errors_are_those_of_one_fit(seven, zone, monkeypatch):
    unscaled = replace(zone, scatter=zone.scatter.nothing())
    found, expected = fused_of(unscaled, [], PURE).hypotheses, together(seven, monkeypatch)
    assert np.median(apart_m(found, expected)) < 0.002
    assert apart_m(found, expected).max() < 0.1 * sigma_m(expected).max()
    ratio = sigma_m(found) / sigma_m(expected)
    assert abs(np.median(ratio) - 1.0) < 0.015
    np.testing.assert_allclose(ratio, 1.0, atol=0.03)


def test_no_cone_changes_its_side(seven, zone):
    found, expected = fused_of(zone, [], PURE).hypotheses, fuse(seven, PURE).hypotheses
    apart = np.hypot(*(expected.position_m[:, 0] - expected.position_m[:, 1]).T)
    assert (apart_m(found, expected) < 0.05 * apart).all()
    sure = np.hypot(*(found.position_m[:, 0] - found.position_m[:, 1]).T) > 1.0
    assert sure.sum() >= 5
    ratio = found.log_odds[sure] / expected.log_odds[sure]
    assert (ratio > 0.5).all() and (ratio < 2.0).all()


def test_readings_and_scatter_are_those_of_one_fit(seven, zone):
    found, expected = fused_of(zone, [], PURE), fuse(seven, PURE)
    assert found.hypotheses.n_ranges.tolist() == expected.hypotheses.n_ranges.tolist()
    assert found.hypotheses.fits.all()
    assert found.error_scale == pytest.approx(expected.error_scale, abs=0.1)
    np.testing.assert_allclose(found.hypotheses.centre_m, expected.hypotheses.centre_m, atol=1e-6)


def test_blocks_at_one_point_are_the_estimators_own_system(seven):
    """The zone of four drives is at rest where the fit of the four is."""
    zone, blocks, _, _ = begin([[each] for each in seven[:FULL]], PURE)
    found = fused_of(zone, [], PURE).hypotheses
    expected = fuse(seven[:FULL], PURE).hypotheses
    assert np.median(apart_m(found, expected)) < 0.1 * sigma_m(expected).max()
    again = ZoneSums.of(blocks, *_by_cone(zone))
    np.testing.assert_array_equal(again.information, zone.sums.information)


def _by_cone(zone):
    sums = zone.sums
    return [
        dict(zip(sums.anchor_ids, values, strict=True))
        for values in (sums.weight, sums.reference_m)
    ]


def test_sides_that_one_lane_leaves_open_are_told_by_another():
    one_lane = [replace_lane(number, 0.0) for number in range(FULL + 1)]
    zone, _ = folded(one_lane)
    odds = fused_of(zone, [], PURE).hypotheses.log_odds
    assert np.median(odds) < 10.0
    zone, _ = folded([*one_lane, replace_lane(FULL + 1, -3.6)])
    found = fused_of(zone, [], PURE).hypotheses
    assert (found.log_odds > 20.0).all()
    np.testing.assert_allclose(found.position_m[:, 0, 1], CONES_M[:, 1], atol=0.3)


def replace_lane(number, north_m):
    return make_drive(straight(north_m), CONES_M, WORKING, seed=1, number=number)


def test_a_cone_that_is_new_is_located_from_the_drives_that_heard_it(monkeypatch):
    few = [drive(number, cones_m=CONES_M[:5]) for number in range(5)]
    episodes = [*few, *(drive(number) for number in (5, 6))]
    zone, _ = folded(episodes)
    found, expected = fused_of(zone, [], PURE).hypotheses, together(episodes, monkeypatch)
    assert zone.sums.anchor_ids[-1] == "cone-5"
    assert apart_m(found, expected)[-1] < 0.2 * sigma_m(expected)[-1, 0]


def test_places_that_moved_far_have_their_blocks_taken_anew(monkeypatch):
    episodes = [drive(number) for number in range(6)]
    zone, blocks = folded(episodes[:5])
    wrong = {name: place_m + 0.5 for name, place_m in zone.points_m[1].items()}
    points_m = (zone.points_m[0], wrong, *zone.points_m[2:])
    past = Past(5, lambda k: [episodes[k]], lambda k: blocks[k])
    done = fold(replace(zone, points_m=points_m), [episodes[5]], [episodes[0]], past, PURE)
    assert done.zone.counts.refolded == zone.counts.refolded + 1
    assert list(done.refolded) == [1]
