from __future__ import annotations

import numpy as np

from gaia_uwb.simulate.roaming import simulate_roaming


def test_an_episode_made_alone_is_that_of_the_batch() -> None:
    together = list(simulate_roaming(3, range(12), 64).episodes())
    for k in (0, 7):
        (alone,) = simulate_roaming(3, [k], 64).episodes()
        np.testing.assert_array_equal(alone.range_m, together[k].range_m)
        np.testing.assert_array_equal(alone.position_m, together[k].position_m)


def test_ranges_err_by_what_the_truth_says() -> None:
    for episode in simulate_roaming(0, range(40), 64).episodes():
        truth = episode.truth
        assert truth is not None
        assert truth.bias_m is not None and truth.outlier is not None
        gap_m = np.linalg.norm(episode.position_m[:, None] - truth.anchor_m, axis=-1)
        up_m = episode.height_gap_m()
        # Positions are noisy by up to 3 cm: the true range is that of the true path.
        np.testing.assert_allclose(np.hypot(gap_m, up_m), truth.range_m, atol=0.2)
        clean = episode.valid & ~truth.outlier & ~truth.nlos
        if clean.sum() > 30:
            left_m = (episode.range_m - truth.range_m - truth.bias_m)[clean]
            assert abs(np.median(left_m)) < 0.2
            assert np.quantile(np.abs(left_m), 0.7) < 3 * (0.15 + 0.001 * truth.range_m.max())


def test_there_is_a_bit_of_everything() -> None:
    episodes = list(simulate_roaming(1, range(400), 64).episodes())
    speed_mps, bent, nearest_m, counts = [], [], [], set()
    for episode in episodes:
        assert episode.truth is not None
        step_m = np.diff(episode.position_m, axis=0)
        duration_s = float(episode.t_s[-1])
        speed_mps.append(np.linalg.norm(step_m, axis=1).sum() / duration_s)
        off_m = episode.position_m - episode.position_m.mean(axis=0)
        widths_m = np.linalg.svd(off_m, compute_uv=False) / np.sqrt(len(off_m))
        bent.append(widths_m[1] / widths_m[0])
        nearest_m.append(episode.truth.range_m.min())
        counts.add(episode.n_anchors)
    assert np.quantile(speed_mps, 0.02) < 1.2 and np.quantile(speed_mps, 0.98) > 25
    assert np.mean(np.array(bent) < 0.01) > 0.15 and np.mean(np.array(bent) > 0.2) > 0.05
    assert np.quantile(nearest_m, 0.1) < 3 and np.quantile(nearest_m, 0.9) > 12
    assert counts == set(range(3, 13))


def test_radios_that_average_err_alike_in_neighbouring_readings() -> None:
    def likeness(averaged: int) -> float:
        found = []
        for episode in simulate_roaming(5, range(60), 128, averaged=averaged).episodes():
            truth = episode.truth
            assert truth is not None and truth.bias_m is not None and truth.outlier is not None
            left_m = np.where(
                episode.valid & ~truth.outlier, episode.range_m - truth.range_m - truth.bias_m, 0.0
            )
            found.append((left_m[1:] * left_m[:-1]).sum() / (left_m**2).sum())
        return float(np.mean(found))

    assert likeness(8) > likeness(1) + 0.3
