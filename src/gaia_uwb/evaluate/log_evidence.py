"""What a log holds besides one tag's ranges, and what that decides before anything is located.

On a straight road, ranges to one tag fit a cone and its mirror image alike. Here is said which of
the other evidence tells the two apart, from its geometry alone: how far apart the tags are across
the vehicle, how good the angles are, which cones range each other.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from gaia_uwb._shared import counted, some_of
from gaia_uwb.config import PipelineConfig
from gaia_uwb.scene import Scene

APART_M = 0.2
"""Tags this far apart across the vehicle tell sides: their ranges to a cone beside it differ by as
much, one way or the other, and antennas' patterns and lever arms are off by less."""

GOOD_DEG = 45.0
"""Angles with a smaller standard deviation tell sides: those of a cone beside the vehicle and of
its mirror image differ by up to 180 degrees, and there are many."""


@dataclass(frozen=True)
class Evidence:
    """One kind of evidence.

    Parameters
    ----------
    text
        What there is of it, and what it decides.
    tells_sides
        Whether it tells on which side of a straight path a cone stands.
    """

    text: str
    tells_sides: bool


def evidence_of(scene: Scene) -> tuple[Evidence, ...]:
    """Return what a log holds besides the ranges of one tag; empty where it is nothing.

    Parameters
    ----------
    scene
        The log; its truth is not used.

    Examples
    --------
    >>> from gaia_uwb.simulate import PRESETS, simulate_pass
    >>> for each in evidence_of(simulate_pass(PRESETS["two-tags"], seed=0)):
    ...     print(each.text)
    2 tags, 1.60 m apart across the vehicle: they tell sides, on a straight road, too
    """
    return (*_tags(scene), *_angles(scene), *_cone_ranges(scene))


def _tags(scene: Scene) -> Iterator[Evidence]:
    heard = range(len(scene.tags)) if scene.ranges.tag is None else np.unique(scene.ranges.tag)
    tags = [scene.tags[int(k)] for k in heard]
    if len(tags) < 2:
        return
    across_m = float(np.ptp([tag.left_m for tag in tags]))
    along_m = float(np.ptp([tag.forward_m for tag in tags]))
    if across_m >= APART_M:
        where = f"{across_m:.2f} m apart across the vehicle"
        what = "they tell sides, on a straight road, too"
    else:
        where = f"{along_m:.2f} m apart along the vehicle and {across_m:.2f} m across it"
        what = (
            "on a straight road, they tell no sides, for all of them see a cone and its mirror "
            f"image alike; tags {APART_M:g} m apart across the vehicle would"
        )
    yield Evidence(f"{len(tags)} tags, {where}: {what}", across_m >= APART_M)


def _angles(scene: Scene) -> Iterator[Evidence]:
    log = scene.ranges
    if log.azimuth_rad is None or not np.isfinite(log.azimuth_rad).any():
        return
    known = np.isfinite(log.azimuth_rad)
    start = f"angles of arrival in {known.sum():,} of {counted(len(log), 'reading')}"
    sigma_rad = (
        np.full(len(log), np.nan) if log.azimuth_sigma_rad is None else log.azimuth_sigma_rad
    )
    stated = known & np.isfinite(sigma_rad)
    if not stated.any():
        yield Evidence(f"{start}, of unknown accuracy: they tell sides if they are any good", False)
        return
    sigma_deg = float(np.degrees(np.median(sigma_rad[stated])))
    good = sigma_deg <= GOOD_DEG
    what = "they tell sides" if good else "too coarse to tell sides"
    yield Evidence(f"{start}, {sigma_deg:.0f}° in the median: {what}", good)


def _cone_ranges(scene: Scene) -> Iterator[Evidence]:
    ranges = scene.cone_ranges
    if ranges is None:
        return
    ends = np.sort(np.stack([ranges.anchor_a, ranges.anchor_b]), axis=0)
    pairs = np.unique(ends, axis=1)
    partners = np.bincount(pairs.ravel(), minlength=scene.n_anchors)
    readings = np.bincount(scene.ranges.anchor, minlength=scene.n_anchors)
    few = (readings < PipelineConfig().solver.min_ranges) & (partners > 0)
    names = [scene.anchor_ids[n] for n in np.flatnonzero(few)]
    what = "they place cones that the vehicle hardly hears"
    if names:
        what += f" (here {some_of(names)})"
    n_cones = int((partners > 0).sum())
    yield Evidence(
        f"{counted(len(ranges), 'range')} between {counted(pairs.shape[1], 'pair')} of {n_cones} "
        f"cones: {what}, and tell which cones stand on one side, but not on which",
        False,
    )
