"""The joint fit against what theory says: exactness, invariance, and errors as large as stated."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import binom, chi2

from gaia_uwb.config import AlignmentConfig, CalibrationConfig, PipelineConfig, SolverConfig
from gaia_uwb.episode import ErrorSizes
from gaia_uwb.locate.slow_errors import DRIVE, RADIOS
from gaia_uwb.locate.zone_fit import SIZES
from gaia_uwb.locate.zone_places import find_places
from gaia_uwb.scene import Trajectory
from known_errors import CONES_M, WORKING, Errors, laps, make_drive, straight, u_turn, with_readings

PURE = PipelineConfig(denoiser="raw", solver=SolverConfig(position_floor_m=0.0))
"""No floor, so that the fit's own covariances are looked at."""
NINETY = chi2.ppf(0.9, df=2)


def fitted(*drives, config=PURE):
    return find_places([drives], config)[0]


def error_m(places, cones_m=CONES_M):
    return np.linalg.norm(places.hypotheses.position_m[:, 0] - cones_m, axis=1)


def squared(places, cones_m=CONES_M):
    """Return the squared errors in standard deviations."""
    off_m = places.hypotheses.position_m[:, 0] - cones_m
    solved = np.linalg.solve(places.hypotheses.covariance_m2[:, 0], off_m[..., None])
    return (off_m * solved[..., 0]).sum(axis=1)


def sigma_m(places):
    """Return each better-fitting place's standard deviation in its worst direction."""
    return np.sqrt(np.linalg.eigvalsh(places.hypotheses.covariance_m2[:, 0])[:, 1])


def clock(places, number=0):
    errors = places.errors[number]
    return errors.mean[RADIOS], errors.covariance[RADIOS, RADIOS] ** 0.5


def two_ways(errors, seed, cones_m=CONES_M):
    return [
        make_drive(straight(0.0), cones_m, errors, seed=seed),
        make_drive(straight(-3.6, back=True), cones_m, errors, seed=seed, number=1),
    ]


def moved(drive, turn_rad=0.0, shift_m=(0.0, 0.0), shift_s=0.0):
    """Return a drive in another frame and with another origin of time."""
    turn = np.array([[np.cos(turn_rad), -np.sin(turn_rad)], [np.sin(turn_rad), np.cos(turn_rad)]])

    def place(position_m):
        return position_m @ turn.T + shift_m

    path = drive.own_times.trajectory
    path = Trajectory(path.t_s + shift_s, place(path.position_m), path.up_m)
    own = replace(drive.own_times, t_s=drive.own_times.t_s + shift_s, trajectory=path)
    position_m = place(drive.position_m)
    return replace(drive, t_s=drive.t_s + shift_s, position_m=position_m, own_times=own), turn


def test_exact_ranges_give_exact_places_clock_and_bias():
    errors = Errors(bias_m=0.2, growth_m=0.05, offset_s=0.15)
    found = fitted(make_drive(u_turn(), CONES_M, errors, seed=1))
    assert error_m(found).max() < 1e-4
    bias_m, growth_m, offset_s = found.errors[0].mean[:3]
    assert bias_m == pytest.approx(0.2, abs=2e-3)  # a share of it may be the cones' own delays
    assert growth_m == pytest.approx(0.05, abs=2e-3)
    assert offset_s == pytest.approx(0.15, abs=1e-3)
    assert found.hypotheses.own_bias_m == pytest.approx(0.0, abs=2e-3)
    assert found.hypotheses.converged.all()
    assert found.hypotheses.fits.all()
    assert found.outliers.max() < 1e-3


def test_what_is_switched_off_is_not_estimated():
    config = PURE.model_copy(
        update={
            "alignment": AlignmentConfig(clock_offset="off"),
            "calibration": CalibrationConfig(range_bias="off"),
        }
    )
    errors = Errors(noise_m=0.02, bias_m=0.2, offset_s=0.15)
    found = fitted(make_drive(u_turn(), CONES_M, errors), config=config)
    assert found.errors[0].mean[:4] == pytest.approx(0.0, abs=1e-6)


def test_exact_heights_are_allowed_for():
    path = u_turn()
    path = replace(path, up_m=np.linspace(3.0, 5.0, len(path.t_s)))
    up_m = np.array([0.0, 1.0, 2.0, 0.0, 1.0, -1.0])
    drive = make_drive(path, CONES_M, cones_up_m=up_m)
    assert error_m(fitted(drive)).max() < 1e-4
    # Without a height a slant range is taken as horizontal, and only that cone is worse for it.
    unknown = replace(drive, anchor_up_m=np.where(np.arange(6) == 5, np.nan, up_m))
    assert error_m(fitted(unknown))[:5].max() < 0.02
    assert error_m(fitted(unknown))[5] > 0.2


@pytest.mark.parametrize(
    ("turn_rad", "shift_m"),
    [(0.0, (1234.5, -77.7)), (0.0, (4e4, -3e4)), (np.pi / 2, (0.0, 0.0)), (0.7, (10.0, 5.0))],
)
def test_another_frame_turns_and_shifts_places_and_covariances(turn_rad, shift_m):
    drive = make_drive(u_turn(), CONES_M, WORKING, seed=3)
    other, turn = moved(drive, turn_rad, shift_m)
    one, two = fitted(drive), fitted(other)
    back_m = (two.hypotheses.position_m[:, 0] - shift_m) @ turn
    # Cells of readings lie along the axes of the frame, so this holds but for a part of a sigma.
    off_m = np.linalg.norm(back_m - one.hypotheses.position_m[:, 0], axis=1)
    assert (off_m / sigma_m(one)).max() < 0.2
    back_m2 = turn.T @ two.hypotheses.covariance_m2[:, 0] @ turn
    own_m2 = one.hypotheses.covariance_m2[:, 0]
    assert np.abs(back_m2 - own_m2).max() < 0.1 * own_m2.max()


def test_another_origin_of_time_changes_nothing():
    drive = make_drive(u_turn(), CONES_M, WORKING, seed=3)
    one, two = fitted(drive), fitted(moved(drive, shift_s=1.75e9)[0])
    assert np.abs(one.hypotheses.position_m - two.hypotheses.position_m).max() < 1e-5
    assert clock(one) == pytest.approx(clock(two), abs=1e-5)


def test_neither_order_of_readings_nor_names_matter():
    drive = make_drive(u_turn(), CONES_M, WORKING, seed=3)
    own, rng = drive.own_times, np.random.default_rng(0)
    rows, column = rng.permutation(len(own.t_s)), np.array([4, 0, 5, 2, 1, 3])
    position = np.argsort(column)  # anchor k is now in column position[k]
    other = replace(
        drive,
        anchor_ids=tuple("zyxwvu"),
        range_m=drive.range_m[:, column],
        valid=drive.valid[:, column],
        own_times=replace(
            own,
            t_s=own.t_s[rows],
            anchor=position[own.anchor[rows]],
            range_m=own.range_m[rows],
        ),
    )
    one, two = fitted(drive), fitted(other)
    assert two.anchor_ids == tuple("zyxwvu")
    a, b = one.hypotheses, two.hypotheses
    assert b.position_m[position] == pytest.approx(a.position_m, abs=1e-6)
    assert b.covariance_m2[position] == pytest.approx(a.covariance_m2, rel=1e-5, abs=1e-9)
    assert b.log_odds[position] == pytest.approx(a.log_odds, rel=1e-5, abs=1e-6)


def test_opposite_directions_resolve_an_unknown_clock():
    errors = replace(WORKING, offset_s=0.3)
    for seed in range(2):
        found = fitted(*two_ways(errors, seed))
        for number in (0, 1):
            offset_s, sigma_s = clock(found, number)
            assert sigma_s < 0.01
            assert abs(offset_s - 0.3) < 3.5 * sigma_s
        assert error_m(found).max() < 0.2


def test_a_drive_with_a_clock_of_its_own_learns_it_from_the_cones():
    config = PURE.model_copy(update={"alignment": AlignmentConfig(drive_offset_sigma_s=0.5)})
    drives = [
        make_drive(u_turn(), CONES_M, WORKING, seed=2),
        make_drive(straight(-3.6), CONES_M, replace(WORKING, offset_s=-0.3), seed=2, number=1),
    ]
    found = fitted(*drives, config=config)
    for number, offset_s in enumerate((0.1, -0.3)):
        assert clock(found, number)[0] == pytest.approx(offset_s, abs=0.03)
    assert error_m(found).max() < 0.2


@pytest.mark.parametrize("offset_s", [0.0, 0.3])
@pytest.mark.parametrize("n_drives", [1, 2])
def test_one_direction_at_one_speed_says_nothing_of_the_clock(n_drives, offset_s):
    errors = Errors(noise_m=0.06, offset_s=offset_s)
    drives = [
        make_drive(straight(-3.6 * k), CONES_M, errors, seed=4, number=k) for k in range(n_drives)
    ]
    found = fitted(*drives)
    for number in range(n_drives):
        assert clock(found, number)[1] == pytest.approx(0.5, rel=0.05)  # what was known before
    assert sigma_m(found).min() > 2.0  # and so do the places along the road: 0.5 s at 5 m/s


def test_readings_that_stop_short_of_the_ends_say_nothing_of_the_clock():
    drive = make_drive(straight(), CONES_M, Errors(noise_m=0.06, offset_s=0.3), seed=4)
    t_s, end_s = drive.own_times.t_s, drive.own_times.trajectory.t_s[-1]
    found = fitted(with_readings(drive, (t_s > 1.5) & (t_s < end_s - 1.5)))
    assert clock(found)[1] == pytest.approx(0.5, rel=0.01)
    assert sigma_m(found).min() > 2.0
    mirrored_m = CONES_M * [1.0, -1.0]  # what a straight road leaves open
    assert np.minimum(squared(found), squared(found, mirrored_m)).max() < NINETY


COVERED = {
    "white": (Errors(noise_m=0.08), 0.2),
    "slow": (Errors(noise_m=0.03, field_m=0.05), 0.3),
    "delays": (Errors(noise_m=0.05, delay_m=0.15), 0.16),
    "outliers": (Errors(noise_m=0.05, outlier_share=0.3, outlier_m=3.0), 0.14),
    "all": (WORKING, 0.3),
}


@pytest.mark.parametrize("kind", COVERED)
def test_nine_of_ten_cones_stand_in_their_90_percent_ellipses(kind):
    (errors, worst_m), cones_m, path = COVERED[kind], CONES_M[1:5], u_turn(half_m=15.0)
    zones = [[make_drive(path, cones_m, errors, seed=seed)] for seed in range(6)]
    zones += [two_ways(errors, 100 + seed, cones_m) for seed in range(6)]
    found = find_places(zones, PURE)
    assert max(error_m(places, cones_m).max() for places in found) < worst_m
    inside = np.array([squared(places, cones_m) < NINETY for places in found])
    assert np.sum(inside) >= binom.ppf(0.005, np.size(inside), 0.9)


def test_more_laps_are_no_surer_than_delays_and_patterns_leave_them():
    errors = replace(WORKING, noise_m=0.1, delay_m=0.05, pattern_m=0.03, outlier_share=0.0)
    cones_m = CONES_M[1:5]

    def zones(n):
        return [[make_drive(laps(n), cones_m, errors, seed=seed)] for seed in range(4)]

    once, often = find_places(zones(1), PURE), find_places(zones(4), PURE)
    inside = np.array([squared(places, cones_m) < NINETY for places in often])
    assert np.sum(inside) >= binom.ppf(0.005, np.size(inside), 0.9)
    one_m, many_m = (np.mean([sigma_m(each) for each in found]) for found in (once, often))
    assert many_m > 0.02  # patterns of 3 cm; the noise of four laps alone leaves 4 mm
    assert many_m > 0.5 * one_m


def test_sizes_of_errors_are_found():
    errors = replace(WORKING, field_m=0.03)
    found = find_places([[make_drive(laps(2), CONES_M, errors, seed=s)] for s in range(3)], PURE)
    sizes = [places.errors[0].sizes for places in found]
    mean = {name: np.mean([getattr(each, name) for each in sizes]) for name in SIZES}
    # Student-t with four degrees of freedom: of Gaussian noise, the scale is a little smaller.
    assert 0.04 < mean["noise_m"] < 0.065
    assert mean["outlier_share"] == pytest.approx(0.05, abs=0.03)
    assert mean["field_m"] == pytest.approx(0.03, rel=0.4)


def test_sizes_that_a_run_found_hold_in_its_windows():
    drive = make_drive(u_turn(), CONES_M, WORKING, seed=2)
    places = fitted(drive)
    window = replace(drive, errors=places.errors[0]).window(40, 100)
    assert window.run_errors is places.errors[0]
    sizes = fitted(window).errors[0].sizes
    assert isinstance(sizes, ErrorSizes)
    for name in SIZES:
        assert np.array_equal(getattr(sizes, name), getattr(places.errors[0].sizes, name))


def test_errors_that_cones_share_are_a_part_of_their_covariances():
    found = fitted(*two_ways(WORKING, 1)).hypotheses
    shared_m2 = found.shared_m @ np.swapaxes(found.shared_m, -1, -2)
    assert found.shared_m.shape == (6, 2, 2, RADIOS + 2 * DRIVE)
    left_m2 = found.covariance_m2 - shared_m2
    assert np.linalg.eigvalsh(left_m2).min() > 0.0
