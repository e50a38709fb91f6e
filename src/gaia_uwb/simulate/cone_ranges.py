"""Ranges that the radios on the cones measure among themselves."""

from __future__ import annotations

import numpy as np

from gaia_uwb._shared import Array, Float64, Int64
from gaia_uwb.scene import ConeRanges
from gaia_uwb.simulate.ranging import simulate_rows
from gaia_uwb.simulate.rows import SectionRows
from gaia_uwb.simulate.setup import Setting
from gaia_uwb.simulate.streams import RowStreams, Source

_RADIO = 1 << 20  # of the cones' streams: beyond that of any tag


def simulate_cone_ranges(
    setting: Setting, ranging: SectionRows, source: Source, episode: int
) -> ConeRanges | None:
    """Let each cone of one pass range its neighbours, with the errors that tags have.

    Parameters
    ----------
    setting
        One pass.
    ranging
        Settings of its ranging.
    source, episode
        Random numbers of the batch, and the number of the pass.

    Returns
    -------
    ConeRanges or None
        None if the settings ask for none, or none arrived.
    """
    a, b = _pairs(setting.anchor_m, ranging.cone_neighbours)
    n = int(setting.config.drive.duration_s * ranging.cone_rate_hz)
    if not (len(a) and n):
        return None
    up_m = setting.anchor_up_m
    flat_m = np.hypot(*(setting.anchor_m[a] - setting.anchor_m[b]).T)
    true_m = np.repeat(np.hypot(flat_m, up_m[a] - up_m[b])[:, None], n, axis=1)
    place_m = np.repeat(setting.anchor_m[a][:, None], n, axis=1)
    count = (len(a),)
    cut = setting.obstacles.cut(place_m, up_m[a][:, None], setting.anchor_m[b], up_m[b], count)
    streams = RowStreams([source.stream(episode, radio=_RADIO)], count)
    reports = simulate_rows(true_m, cut, 1 / ranging.cone_rate_hz, ranging, streams)
    pair, k = np.nonzero(reports.answered)
    if not len(pair):
        return None
    # The pairs take turns.
    t_s = (k + pair / len(a)) / ranging.cone_rate_hz
    order = np.argsort(t_s, kind="stable")
    return ConeRanges(
        a[pair][order],
        b[pair][order],
        np.round(reports.range_m[pair, k][order], 6),
        np.round(t_s[order] + ranging.clock_offset_s, 6),
    )


def _pairs(
    anchor_m: Float64[Array, "N 2"], neighbours: int
) -> tuple[Int64[Array, "M"], Int64[Array, "M"]]:
    """Return each pair of which one is among the other's nearest, once."""
    apart_m = np.hypot(*(anchor_m[:, None] - anchor_m).transpose(2, 0, 1))
    np.fill_diagonal(apart_m, np.inf)
    n = len(anchor_m)
    nearest = np.argsort(apart_m, axis=1, kind="stable")[:, : min(neighbours, n - 1)]
    one = np.repeat(np.arange(n), nearest.shape[1])
    pairs = np.unique(np.sort(np.stack([one, nearest.ravel()]), axis=0), axis=1)
    return pairs[0].astype(np.int64), pairs[1].astype(np.int64)
