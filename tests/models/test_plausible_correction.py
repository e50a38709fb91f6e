"""What counts as a correction too far: a moved anchor does, a few mended ranges do not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from gaia_uwb.models.plausible_correction import largest_median_correction_m, plausible_correction_m
from tiny_models import make_run


def test_a_few_wrong_ranges_move_no_median_and_a_mistaken_layout_does() -> None:
    valid = np.ones((64, 3), dtype=bool)
    mended_m = np.full((64, 3), 0.1)
    mended_m[:20, 1] = -40.0
    assert largest_median_correction_m(mended_m, valid) == pytest.approx(0.1)
    mistaken_m = mended_m.copy()
    mistaken_m[:, 2] = -1.5
    assert largest_median_correction_m(mistaken_m, valid) == pytest.approx(1.5)


def test_missing_ranges_and_rare_anchors_say_nothing() -> None:
    valid = np.ones((64, 2), dtype=bool)
    valid[5:, 1] = False
    correction_m = np.where(valid, 0.2, np.nan)
    correction_m[:5, 1] = 9.0
    assert largest_median_correction_m(correction_m, valid) == pytest.approx(0.2)
    assert largest_median_correction_m(correction_m, np.zeros_like(valid)) == 0.0


def test_what_is_plausible_comes_from_the_errors_of_the_training_windows() -> None:
    runs = [make_run(seed, n_steps=32) for seed in range(50)]  # every range is 0.3 m too long
    assert plausible_correction_m(runs) == pytest.approx(0.375)
    far = replace(runs[0], range_m=runs[0].range_m + 5.0)
    assert plausible_correction_m([*runs[:9], far]) > 2.0
    assert plausible_correction_m([*runs * 3, far]) == pytest.approx(0.375)


def test_errors_with_a_tail_are_not_taken_for_mistakes() -> None:
    run = make_run(0, n_steps=32)
    shifts_m = np.random.default_rng(1).gamma(9.0, 0.3, 2000)  # like the stress preset's: 1 to 7 m
    runs = [replace(run, range_m=run.range_m + shift) for shift in shifts_m]
    limit_m = plausible_correction_m(runs[:1000])
    assert np.mean(shifts_m[1000:] + 0.3 > limit_m) < 0.005
