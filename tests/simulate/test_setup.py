"""Passes that are set up together have their own zones, anchors and drives."""

from __future__ import annotations

import numpy as np

from gaia_uwb.simulate import PRESETS
from gaia_uwb.simulate.rows import PassRows
from gaia_uwb.simulate.setup import draw_zone, lay_out, set_up
from gaia_uwb.simulate.streams import Source


def test_a_setting_of_several_passes_is_that_of_each() -> None:
    config = PRESETS["wild"]
    streams = [Source(4).stream(k) for k in range(6)]
    draws = [draw_zone(config, stream) for stream in streams]
    together = lay_out(PassRows.of(config, [draw.settings for draw in draws]), draws, streams)
    t_s = np.linspace(0, 6.4, 20)
    tag_m = together.drive.position_m(np.tile(t_s, (6, 1)))
    range_m, cut = together.see(tag_m[together.passes])
    for k in range(6):
        alone, own = set_up(config, 4, k), together.passes == k
        assert alone.anchors == together.anchors[k : k + 1]
        np.testing.assert_array_equal(alone.anchor_m, together.anchor_m[own])
        np.testing.assert_array_equal(alone.anchor_up_m, together.anchor_up_m[own])
        places_m = alone.drive.position_m(t_s[None])
        np.testing.assert_allclose(places_m[0], tag_m[k], rtol=0, atol=1e-9)
        expected_m, expected_cut = alone.see(places_m[alone.passes])
        np.testing.assert_allclose(range_m[own], expected_m, rtol=0, atol=1e-9)
        np.testing.assert_array_equal(cut[own], expected_cut)
    assert cut.any()
