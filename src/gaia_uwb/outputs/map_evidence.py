"""What the map shows of evidence besides ranges to one tag: angles, and ranges between cones."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence

import numpy as np

from gaia_uwb._shared import Array, Float64, InputError, Int64
from gaia_uwb.episode import Episode
from gaia_uwb.scene import heading

_MOST_ANGLES = 30_000  # in the page


def map_evidence(passes: Sequence[Episode], every: int) -> dict[str, object]:
    """Return the evidence as the page's scripts take it.

    Parameters
    ----------
    passes
        In the order in which they stand on the page's timeline, with the same anchors.
    every
        Every how many steps the timeline of the page has one.

    Returns
    -------
    dict
        ``ties``: both cones' places in the list of cones, median range in centimetres and how many
        there are. ``bearings``: for each cone pairs of a step of the timeline and the direction of
        arrival there, in degrees counter-clockwise from east.
    """
    return {"ties": _ties(passes), "bearings": _bearings(passes, every)}


def _ties(passes: Sequence[Episode]) -> list[list[int]]:
    found: dict[tuple[int, int], list[float]] = defaultdict(list)
    drives = set()
    for episode in passes:
        ranges = episode.cone_ranges
        if ranges is None or (episode.drive and episode.drive in drives):  # the tags' are the same
            continue
        drives.add(episode.drive)
        ends = np.sort(np.stack([ranges.anchor_a, ranges.anchor_b]), axis=0).T
        for (a, b), range_m in zip(ends.tolist(), ranges.range_m.tolist(), strict=True):
            found[a, b].append(range_m)
    return [
        [a, b, round(100.0 * float(np.median(ranges_m))), len(ranges_m)]
        for (a, b), ranges_m in sorted(found.items())
    ]


def _bearings(passes: Sequence[Episode], every: int) -> list[list[tuple[int, int]]]:
    first, parts = 0, []
    for episode in passes:
        parts.append(_of_pass(episode, first, every))
        first += episode.n_steps
    step, anchor, degrees = (np.concatenate(column) for column in zip(*parts, strict=True))
    thin = slice(None, None, len(step) // _MOST_ANGLES + 1)
    bearings: list[list[tuple[int, int]]] = [[] for _ in passes[0].anchor_ids]
    for k, n, angle in zip(step[thin], anchor[thin], degrees[thin], strict=True):
        bearings[n].append((int(k), int(angle)))
    return bearings


def _of_pass(
    episode: Episode, first: int, every: int
) -> tuple[Int64[Array, "R"], Int64[Array, "R"], Int64[Array, "R"]]:
    """Return step on the page, anchor and direction of a pass's angles; one for a step and cone."""
    nothing = np.zeros(0, dtype=np.int64)
    readings = episode.own_times
    if readings is None or readings.azimuth_rad is None:
        return nothing, nothing, nothing
    known = np.flatnonzero(np.isfinite(readings.azimuth_rad))
    t_s, path = readings.t_s[known], readings.trajectory
    try:
        front_rad: Float64[Array, "R"] = np.interp(t_s, path.t_s, np.unwrap(heading(path)))
    except InputError:  # the vehicle stood
        return nothing, nothing, nothing
    degrees = np.degrees(front_rad + readings.azimuth_rad[known]).round().astype(np.int64) % 360
    after = np.clip(np.searchsorted(episode.t_s, t_s), 1, episode.n_steps - 1)
    nearer = t_s - episode.t_s[after - 1] < episode.t_s[after] - t_s
    step = (first + after - nearer) // every
    anchor = readings.anchor[known]
    _, row = np.unique(np.stack([step, anchor]), axis=1, return_index=True)
    return step[row], anchor[row], degrees[row]
