from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from gaia_uwb._shared.errors import InputError
from gaia_uwb.episode import Episode, EpisodeTruth
from gaia_uwb.evaluate.bounds import cramer_rao_m, wrong_sides_probability


def drive(sway_m: float, sigma_m: float = 0.1, n_steps: int = 400, seed: int = 0) -> Episode:
    """Return a drive with white noise of a known size past two anchors."""
    rng = np.random.default_rng(seed)
    along_m = np.linspace(-20, 20, n_steps)
    path_m = np.stack([along_m, sway_m * np.sin(along_m / 4)], axis=1)
    anchor_m = np.array([[0.0, 6.0], [9.0, 4.0]])
    range_m = np.linalg.norm(path_m[:, None] - anchor_m, axis=-1)
    shape = range_m.shape
    return Episode(
        name="drive",
        anchor_ids=("a", "b"),
        t_s=0.1 * np.arange(n_steps),
        position_m=path_m,
        range_m=range_m + sigma_m * rng.standard_normal(shape),
        valid=np.ones(shape, dtype=bool),
        truth=EpisodeTruth(
            anchor_m,
            range_m,
            nlos=np.zeros(shape, dtype=bool),
            outlier=np.zeros(shape, dtype=bool),
            bias_m=np.zeros(shape),
        ),
    )


def least_squares_error_m(episode: Episode) -> np.ndarray:
    """Return the errors of the maximum likelihood estimate, started at the truth."""
    assert episode.truth is not None
    place = episode.truth.anchor_m.copy()
    for _ in range(8):
        off = place - episode.position_m[:, None]
        distance = np.linalg.norm(off, axis=-1)
        unit = off / distance[..., None]
        normal = np.einsum("tni,tnj->nij", unit, unit)
        right = np.einsum("tni,tn->ni", unit, episode.range_m - distance)
        place = place + np.linalg.solve(normal, right[..., None])[..., 0]
    return np.linalg.norm(place - episode.truth.anchor_m, axis=1)


def test_least_squares_reaches_the_bound_with_white_noise() -> None:
    errors = np.stack([least_squares_error_m(drive(0.3, seed=seed)) for seed in range(300)])
    rms_m = np.sqrt((errors**2).mean(axis=0))
    np.testing.assert_allclose(rms_m / cramer_rao_m(drive(0.3)), 1.0, atol=0.12)


def test_ranges_without_sight_are_worth_little_and_missing_ones_nothing() -> None:
    whole = drive(0.3)
    truth = whole.truth
    assert truth is not None
    nlos = np.zeros(whole.valid.shape, dtype=bool)
    nlos[::2] = True
    bias_m = np.where(nlos, np.random.default_rng(0).normal(1, 2, nlos.shape), 0.0)
    hidden = replace(whole, truth=replace(truth, nlos=nlos, bias_m=bias_m),
                     range_m=whole.range_m + bias_m)  # fmt: skip
    half = replace(whole, valid=~nlos, range_m=np.where(nlos, np.nan, whole.range_m))
    assert (cramer_rao_m(hidden) > 1.3 * cramer_rao_m(whole)).all()
    np.testing.assert_allclose(cramer_rao_m(hidden), cramer_rao_m(half), rtol=0.06)


def test_an_anchor_without_ranges_has_no_bound() -> None:
    episode = drive(0.3)
    valid = episode.valid.copy()
    valid[:, 1] = False
    bare = replace(episode, valid=valid, range_m=np.where(valid, episode.range_m, np.nan))
    assert np.isfinite(cramer_rao_m(bare)[0]) and np.isinf(cramer_rao_m(bare)[1])


def test_a_straight_path_tells_no_side_and_a_winding_one_does() -> None:
    assert wrong_sides_probability(drive(0.0)) == pytest.approx(0.5, abs=1e-6)
    assert wrong_sides_probability(drive(1.0)) < 1e-6
    # More noise, more wrong sides.
    found = [wrong_sides_probability(drive(0.02, sigma_m)) for sigma_m in (0.02, 0.1, 0.5)]
    assert found == sorted(found) and found[0] < 0.1 < found[2]


def test_data_whose_errors_nobody_knows_are_refused() -> None:
    episode = drive(0.1)
    assert episode.truth is not None
    for truth in (None, replace(episode.truth, bias_m=None)):
        with pytest.raises(InputError, match="truth of the ranges' errors"):
            cramer_rao_m(replace(episode, truth=truth))
