from __future__ import annotations

import numpy as np

from gaia_uwb.learn.zone_sets import (
    _TRAINING_SEED,
    MIX,
    _as_aligned,
    training_portion,
    validation_portion,
)
from gaia_uwb.simulate import find_preset
from gaia_uwb.simulate.rows import PassRows
from gaia_uwb.simulate.setup import draw_zone
from gaia_uwb.simulate.streams import Source
from gaia_uwb.simulate.variation import layout_part


def test_a_portion_is_the_same_whenever_it_is_made_and_no_two_are_alike() -> None:
    first, again, other = (training_portion(0, k, 24) for k in (3, 3, 4))
    assert len(first) == len(again)
    for a, b in zip(first, again, strict=True):
        np.testing.assert_array_equal(a.inputs.range, b.inputs.range)
        np.testing.assert_array_equal(a.anchor_m, b.anchor_m)
    seen = {float(batch.anchor_m[0, 0, 0]) for batch in first}
    assert seen.isdisjoint(float(batch.anchor_m[0, 0, 0]) for batch in other)
    assert seen.isdisjoint(float(b.anchor_m[0, 0, 0]) for b in training_portion(1, 3, 24))


def test_all_kinds_take_part() -> None:
    batches = training_portion(0, 0, 40)
    assert sum(batch.n_episodes for batch in batches) == 40
    assert sum(MIX.values()) == 1.0


def test_no_layout_of_the_test_is_trained_on() -> None:
    config = find_preset("wild-training")
    source = Source(_TRAINING_SEED)
    for k in range(200):
        drawn = draw_zone(config, source.stream(k)).settings
        assert layout_part(PassRows.of(config, [drawn])) == "training"


def test_truth_is_in_the_frame_of_the_inputs() -> None:
    for batch in validation_portion("wild", 12):
        inputs = batch.inputs
        off = inputs.position[:, None] - batch.anchor_m[:, :, None]
        slant_m = np.sqrt((off**2).sum(axis=-1) + inputs.height_gap**2)
        # Positions carry the recording's noise of a centimetre or two.
        np.testing.assert_allclose(slant_m, batch.range_m, atol=0.15)


def test_closed_gaps_lie_between_their_ends_and_long_ones_stay_open() -> None:
    t_s = np.arange(40)[None] * 0.1
    range_m = 10 + 2 * t_s[:, None]
    range_m[0, 0, 5:9] = np.nan  # 0.5 s
    range_m[0, 0, 20:35] = np.nan  # 1.6 s
    aligned = _as_aligned(range_m, t_s, np.random.default_rng(0))[0, 0]
    # A range that grows evenly is blended into itself.
    np.testing.assert_allclose(aligned[:20], 10 + 2 * t_s[0, :20], atol=1e-9)
    assert np.isnan(aligned[20:35]).all() and np.isfinite(aligned[35:]).all()


def test_blending_takes_noise_away_but_no_level() -> None:
    rng = np.random.default_rng(0)
    t_s = np.arange(400)[None] * 0.1
    range_m = 20 + rng.normal(size=(1, 30, 400))
    aligned = _as_aligned(range_m, t_s, rng)
    assert 0.6 < aligned.std() < 0.95
    np.testing.assert_allclose(aligned.mean(axis=2), range_m.mean(axis=2), atol=0.02)
