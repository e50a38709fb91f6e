"""Drives past work zones of every form, on straight roads, in bends and in S-curves.

Like ``roads.py``, by code of its own, and with the same radios. Seeds go through the shapes of the
road, the forms and the kinds of drives in turn.

>>> case = road_form(0)
>>> case.road, case.form, case.kind, len(case.drives)
('straight', 'row left', 'single', 1)
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from gaia_uwb.scene import LocalFrame, Scene
from roads import (
    KINDS,
    LANE_M,
    WITH_PATTERNS,
    Lasting,
    Line,
    Numbers,
    Radios,
    Road,
    driven,
    lanes,
    measured,
)

ROADS = ("straight", "bend", "s-curve")
FORMS = ("row left", "row right", "row with gap", "both rows", "works between", "closed lane")
NAMES = {
    "row left": "one-row",
    "row right": "one-row",
    "row with gap": "one-row",
    "both rows": "lane-between",
    "works between": "works-between",
    "closed lane": "area",
}
"""Form here -> what it is called in a result."""


@dataclass(frozen=True)
class SCurve:
    """A lane's line of two arcs that bend to different sides.

    Parameters
    ----------
    first
        The first arc.
    bend_m
        Where the second begins, in metres along the line.
    """

    first: Road
    bend_m: float

    def place(self, along_m: Numbers, left_m: Numbers | float) -> Numbers:
        """Return the places (n, 2) at a station and an offset to the left of the line."""
        along_m = np.asarray(along_m)
        left_m = np.broadcast_to(left_m, along_m.shape)
        turned = self.first.curvature_per_m * self.bend_m
        second = Road(self.first.heading_rad + turned, -self.first.curvature_per_m)
        start = self.first.place(np.array([self.bend_m]), 0.0)
        after = start + second.place(along_m - self.bend_m, left_m)
        before = self.first.place(along_m, left_m)
        return np.where((along_m < self.bend_m)[:, None], before, after)


@dataclass(frozen=True)
class RoadForm:
    """Drives past one zone, with what is true of it.

    Parameters
    ----------
    name
        Of the case.
    road, form, kind
        One of :data:`ROADS`, of :data:`FORMS`, and of ``roads.KINDS``.
    drives
        The drives, with their truth.
    line
        The first lane's line.
    along_m, left_m
        Of the cones on it.
    """

    name: str
    road: str
    form: str
    kind: str
    drives: tuple[Scene, ...]
    line: Line
    along_m: Numbers
    left_m: Numbers


def road_form(seed: int, *, radios: Radios = WITH_PATTERNS) -> RoadForm:
    """Return the drives past the zone of a seed.

    Parameters
    ----------
    seed
        Of everything that is drawn; it also counts through roads, forms and kinds.
    radios
        The errors.
    """
    rng = np.random.default_rng([20261206, seed])
    road = ROADS[seed % 3]
    form = FORMS[seed // 3 % 6]
    kind = KINDS[(seed + seed // 18) % 4]
    side = {"row left": 1, "row right": -1}.get(form) or int(rng.choice([-1, 1]))
    away_m = -side * LANE_M
    span_m = max(abs(lane_m) for lane_m, _ in lanes(kind, away_m))
    along_m, left_m = _cones(form, side, span_m, rng)
    line = _line(road, along_m, rng)
    cones = line.place(along_m, left_m)
    frame = LocalFrame(48.1 + rng.normal(0, 0.2), 11.6 + rng.normal(0, 0.2), 510.0)
    delays_m = radios.delay_m * rng.normal(size=len(cones))
    patterns_m = radios.cone_pattern_m * rng.normal(size=(len(cones), 2))
    start_m, stop_m = along_m.min() - 100.0, along_m.max() + 100.0
    name = f"road-form-{seed}"
    drives = []
    for number, (lane_m, direction) in enumerate(lanes(kind, away_m)):
        path = driven(line, start_m, stop_m, lane_m, direction, rng)
        own_s = radios.offset_s + radios.clock_spread_s * rng.normal()
        lasting = Lasting(delays_m, patterns_m, radios.tag_pattern_m * rng.normal(size=4))
        drive = replace(radios, offset_s=own_s)
        drives.append(measured(f"{name}-{number}", path, cones, lasting, frame, drive, rng))
    return RoadForm(name, road, form, kind, tuple(drives), line, along_m, left_m)


def _line(road: str, along_m: Numbers, rng: np.random.Generator) -> Line:
    heading_rad, radius_m = rng.uniform(0, 2 * np.pi), rng.uniform(300.0, 1500.0)
    curvature_per_m = float(rng.choice([-1, 1]) / radius_m)
    if road == "straight":
        return Road(heading_rad, 0.0)
    if road == "bend":
        return Road(heading_rad, curvature_per_m)
    middle_m = along_m.min() + np.ptp(along_m) * rng.uniform(0.3, 0.7)
    return SCurve(Road(heading_rad, curvature_per_m), float(middle_m))


def _cones(
    form: str, side: int, span_m: float, rng: np.random.Generator
) -> tuple[Numbers, Numbers]:
    """Return station and offset of the cones; the other row is beyond all lanes that are driven."""
    n = int(rng.integers(20, 41))
    spacing_m, near_m = rng.uniform(8.0, 18.0), rng.uniform(1.9, 2.4)
    if form not in ("both rows", "works between"):
        along_m = spacing_m * np.arange(n)
        if form == "row with gap":
            along_m += spacing_m * rng.uniform(3.0, 6.0) * (np.arange(n) >= n * 2 // 3)
        wide_m = rng.uniform(3.3, 3.8) if form == "closed lane" else rng.uniform(2.3, 3.2)
        n_out = int(rng.integers(2, 5)) if form == "closed lane" else 0
        left_m = side * _row(n, near_m, wide_m, n_out, rng)
    else:
        rows_n = (n - n // 2, n // 2)
        wide_m = rng.uniform(3.3, 4.5)
        far_m = wide_m if form == "works between" else span_m
        first_m = side * _row(rows_n[0], near_m, 2.5 * (form == "both rows"), 0, rng)
        other_side = side if form == "works between" else -side
        second_m = other_side * (far_m + _row(rows_n[1], near_m, 0.0, 0, rng))
        along_m = np.concatenate([spacing_m * np.arange(each) for each in rows_n])
        along_m[rows_n[0] :] += rng.uniform(0.0, spacing_m)
        left_m = np.concatenate([first_m, second_m])
    return along_m + rng.normal(0, 0.4, n), left_m + rng.normal(0, 0.08, n)


def _row(n: int, near_m: float, wide_m: float, n_out: int, rng: np.random.Generator) -> Numbers:
    """Return distances from the lane: a taper, a line along it, and a taper of a few cones."""
    n_in = int(rng.integers(5, 9))
    away = np.clip(1.0 - np.arange(n) / n_in, 0.0, 1.0)
    if n_out:
        away += np.clip(1.0 - np.arange(n)[::-1] / n_out, 0.0, 1.0)
    return np.asarray(near_m + wide_m * away)
