"""Places of all cones: zones in a batch, one drive or several, hints, and cones hardly heard."""

from dataclasses import fields, replace

import numpy as np
import pytest

from gaia_uwb.config import AlignmentConfig, PipelineConfig, SolverConfig
from gaia_uwb.episode import ClockOffset
from gaia_uwb.locate.hypotheses import Hypotheses
from gaia_uwb.locate.slow_errors import RADIOS
from gaia_uwb.locate.zone_places import find_places, readings_of, with_clock, with_run_errors
from known_errors import CONES_M, WORKING, Errors, laps, make_drive, straight, u_turn, with_readings

PURE = PipelineConfig(denoiser="raw", solver=SolverConfig(position_floor_m=0.0))


def fitted(*drives, config=PURE):
    return find_places([drives], config)[0]


def error_m(places, cones_m=CONES_M):
    return np.linalg.norm(places.hypotheses.position_m[:, 0] - cones_m, axis=1)


def there_and_back(seed=0, cones_m=CONES_M, back_m=CONES_M):
    return [
        make_drive(straight(0.0), cones_m, WORKING, seed=seed),
        make_drive(straight(-3.6, back=True), back_m, WORKING, seed=seed, number=1),
    ]


def assert_same(one, other, tolerance=1e-8):
    assert one.anchor_ids == other.anchor_ids
    for field in fields(Hypotheses):
        a, b = getattr(one.hypotheses, field.name), getattr(other.hypotheses, field.name)
        if a is None:
            assert b is None
        else:
            assert b == pytest.approx(a, rel=tolerance, abs=tolerance, nan_ok=True), field.name
    for a, b in zip(one.errors, other.errors, strict=True):
        assert b.mean == pytest.approx(a.mean, rel=tolerance, abs=tolerance)
        assert b.covariance == pytest.approx(a.covariance, rel=tolerance, abs=tolerance)


def without(drive, anchor, but_for=0):
    """Return a drive without the readings of one cone, ``but_for`` some of the first."""
    own = drive.own_times.anchor == anchor
    return with_readings(drive, ~own | (np.cumsum(own) <= but_for))


def test_many_zones_at_once_are_each_as_if_alone():
    zones = [
        [make_drive(u_turn(), CONES_M, WORKING, seed=0)],
        [make_drive(straight(), CONES_M[:3], WORKING, seed=1)],
        there_and_back(2, CONES_M, CONES_M[:4]),
        [make_drive(laps(2), CONES_M[:2] + 500.0, WORKING, seed=5)],
        [without(make_drive(u_turn(), CONES_M[:3], WORKING, seed=6), 1)],
    ]
    for zone, places in zip(zones, find_places(zones, PURE), strict=True):
        assert_same(find_places([zone], PURE)[0], places)


def test_a_zone_without_hints_does_not_care_for_those_of_another():
    zones = [
        [make_drive(u_turn(), CONES_M, WORKING, seed=0)],
        [make_drive(straight(), CONES_M[:3], WORKING, seed=1)],
    ]
    one, _ = find_places(zones, PURE, near=[{}, {"cone-0": CONES_M[0]}])
    assert_same(find_places(zones[:1], PURE)[0], one)


def test_one_of_the_places_is_sought_near_the_hint():
    drive = make_drive(u_turn(), CONES_M, WORKING, seed=0)
    free = fitted(drive)
    hints = {"cone-1": CONES_M[1] + [0.5, -0.3], "somebody-else": np.zeros(2)}
    (near,) = find_places([[drive]], PURE, near=[hints])
    assert near.hypotheses.position_m[:, 0] == pytest.approx(
        free.hypotheses.position_m[:, 0], abs=1e-3
    )


def test_a_zone_of_one_drive_is_the_case_of_one():
    """A second drive that heard next to nothing changes next to nothing."""
    drive = make_drive(u_turn(), CONES_M, WORKING, seed=0)
    other = make_drive(u_turn(), CONES_M, WORKING, seed=0, number=1)
    silent = with_readings(other, np.zeros(len(other.own_times.t_s), dtype=np.bool_))
    one, two = fitted(drive), fitted(drive, silent)
    a, b = one.hypotheses, two.hypotheses
    sigma_m = np.sqrt(np.linalg.eigvalsh(a.covariance_m2[:, 0])[:, 1])
    off_m = np.linalg.norm(a.position_m[:, 0] - b.position_m[:, 0], axis=1)
    assert (off_m / sigma_m).max() < 0.1
    assert b.covariance_m2[:, 0] == pytest.approx(a.covariance_m2[:, 0], rel=0.1, abs=1e-5)
    assert b.n_ranges.tolist() == a.n_ranges.tolist()


def test_two_lanes_resolve_the_sides_that_one_leaves_open():
    drives = there_and_back(3)
    mirrored_m = CONES_M * [1.0, -1.0]
    alone = fitted(drives[0])
    either = np.minimum(error_m(alone), error_m(alone, mirrored_m))
    # Along the road a single straight drive says little: its clock is unknown.
    across_m = np.abs(np.abs(alone.hypotheses.position_m[..., 1]) - CONES_M[:, None, 1])
    assert across_m.max() < 0.2
    assert either.max() < 3.0
    both = fitted(*drives)
    assert error_m(both).max() < 0.2
    places_m = both.hypotheses.position_m
    is_one = np.hypot(*(places_m[:, 0] - places_m[:, 1]).T) < 0.1
    assert (is_one | (both.hypotheses.log_odds > 20.0)).all()


def test_a_cone_that_one_of_two_drives_heard_is_located_by_it():
    drives = there_and_back(3, CONES_M, CONES_M[:5])
    places = fitted(*drives)
    assert places.anchor_ids == tuple(f"cone-{k}" for k in range(6))
    n = [len(drive.own_times.t_s) // drive.n_anchors for drive in drives]
    assert places.hypotheses.n_ranges.tolist() == [sum(n)] * 5 + [n[0]]
    mirrored_m = CONES_M[5] * [1.0, -1.0]
    off_m = places.hypotheses.position_m[5] - np.stack([CONES_M[5], mirrored_m])
    crossed_m = places.hypotheses.position_m[5] - np.stack([mirrored_m, CONES_M[5]])
    nearest_m = min(np.hypot(*off_m.T).max(), np.hypot(*crossed_m.T).max())
    assert nearest_m < 0.25  # both its places: the first drive alone leaves its side open
    assert places.hypotheses.log_odds[5] < 8.0
    assert places.hypotheses.log_odds[:5].min() > 20.0


@pytest.mark.parametrize("min_ranges", [4, 30])
def test_fewer_readings_than_asked_for_locate_nothing(min_ranges):
    config = PURE.model_copy(
        update={"solver": SolverConfig(min_ranges=min_ranges, position_floor_m=0.0)}
    )
    drive = make_drive(u_turn(), CONES_M[:3], WORKING, seed=0)
    few = fitted(without(drive, 1, but_for=min_ranges - 1), config=config).hypotheses
    assert np.isnan(few.position_m[1]).all()
    assert np.isnan(few.covariance_m2[1]).all()
    assert (few.n_ranges[1], few.log_odds[1]) == (min_ranges - 1, 0.0)
    assert np.isfinite(few.position_m[[0, 2]]).all()
    assert few.fits.all()
    enough = fitted(without(drive, 1, but_for=min_ranges), config=config).hypotheses
    assert np.isfinite(enough.position_m[1]).all()


@pytest.mark.parametrize("from_origin_m", [0.0, 1000.0])
def test_cones_that_are_hardly_heard_change_nothing(from_origin_m):
    drive = make_drive(u_turn(), np.tile(CONES_M, (6, 1)) + from_origin_m, WORKING)
    path = drive.own_times.trajectory
    path = replace(path, position_m=path.position_m + from_origin_m)
    drive = replace(
        drive,
        position_m=drive.position_m + from_origin_m,
        own_times=replace(drive.own_times, trajectory=path),
    )
    silent = drive
    for anchor in range(6, 36):
        drive, silent = without(drive, anchor, but_for=3), without(silent, anchor)
    one, other = fitted(drive), fitted(silent)
    for name in ("noise_m", "outlier_share"):
        a, b = (getattr(each.errors[0].sizes, name) for each in (one, other))
        assert a == pytest.approx(b, rel=1e-6)


def test_nothing_heard_is_nothing_located():
    drive = make_drive(straight(), CONES_M[:2])
    silent = with_readings(drive, np.zeros(len(drive.own_times.t_s), dtype=np.bool_))
    found = fitted(silent)
    assert np.isnan(found.hypotheses.position_m).all()
    assert found.hypotheses.n_ranges.tolist() == [0, 0]
    assert found.unexplained() == ()


def test_ranges_that_no_place_explains_are_named():
    drive = make_drive(u_turn(), CONES_M, WORKING, seed=2)
    own = drive.own_times
    rng = np.random.default_rng(0)
    wild_m = np.where(own.anchor == 3, rng.uniform(2.0, 30.0, len(own.t_s)), own.range_m)
    assert fitted(drive).unexplained() == ()
    assert fitted(replace(drive, own_times=replace(own, range_m=wild_m))).unexplained() == (
        "cone-3",
    )


def test_a_denoisers_ranges_are_readings_at_the_steps():
    drive = make_drive(u_turn(), CONES_M, Errors(), seed=1)
    steps = np.linalg.norm(drive.position_m[:, None] - CONES_M, axis=-1)
    valid = np.ones(steps.shape, dtype=np.bool_)
    denoised = replace(drive, range_m=steps, valid=valid, own_times=None)
    assert len(readings_of(denoised).t_s) == steps.size
    assert error_m(fitted(denoised)).max() < 1e-3


def test_a_window_of_one_step_has_readings():
    drive = make_drive(u_turn(), CONES_M, Errors(), seed=1)
    one = replace(drive, own_times=None).window(5, 6)
    assert len(readings_of(one).t_s) == one.valid.sum()
    assert np.isnan(fitted(one).hypotheses.position_m).all()


def test_a_run_gets_the_clock_that_was_found_with_its_cones():
    drive = make_drive(u_turn(), CONES_M, replace(WORKING, offset_s=0.3), seed=2)
    config = PipelineConfig()
    aligned = replace(drive, clock=ClockOffset(0.25, 0.1, True, "a first look"))
    own = drive.own_times
    aligned = replace(aligned, own_times=replace(own, t_s=own.t_s - 0.25))
    places = fitted(aligned)
    run = with_run_errors(aligned, places, config)
    assert run.clock.applied
    assert run.clock.offset_s == pytest.approx(0.3, abs=0.01)
    assert run.clock.sigma_s < 0.02
    assert run.errors.mean[RADIOS] == pytest.approx(0.0, abs=1e-9)  # relative to that clock
    assert np.array_equal(run.range_m, drive.range_m, equal_nan=True)
    off = PipelineConfig(alignment=AlignmentConfig(clock_offset="off"))
    assert with_clock(aligned, places.errors[0], off) is aligned
    bare = replace(drive, clock=None)
    assert with_clock(bare, places.errors[0], config) is bare  # no clock, nothing to correct


def test_a_clock_that_nothing_determines_is_said_to_be_unknown():
    drive = make_drive(straight(), CONES_M, Errors(noise_m=0.06), seed=4)
    t_s, end_s = drive.own_times.t_s, drive.own_times.trajectory.t_s[-1]
    inner = with_readings(drive, (t_s > 1.5) & (t_s < end_s - 1.5))
    inner = replace(inner, clock=ClockOffset(0.0, 0.5, False, "unknown"))
    clock = with_run_errors(inner, fitted(inner), PipelineConfig()).clock
    assert clock.sigma_s == pytest.approx(0.5, rel=0.05)
    assert "too straight" in clock.reason
