"""The outdoor UWB data set: eight walks around four anchors (``outdoor_static.py``: the rest).

*Comprehensive outdoor UWB dataset: static and dynamic measurements in LOS/NLOS environments*,
Scientific Data (2025), https://doi.org/10.1038/s41597-025-05887-9; files at
https://doi.org/10.5281/zenodo.15226105 under Apache-2.0.

**The frame.** ``trajectory.csv`` and the surveyed anchors share a frame whose axes lie along a
parked car, turned clockwise from east and north by 19.0 to 19.7 degrees, a little differently in
each run. ``gnss.csv`` has the same samples in latitude and longitude, of an antenna 0.185 m behind
the tag: with that lever arm, one rotation and one shift bring the two together to 1.2 mm in all
eight runs. The scene is turned back by that rotation: its axes really point east, north and up, and
its :class:`~gaia_uwb.scene.LocalFrame` is the place on Earth of the survey's origin. Distances and
shapes are the data set's own.

**Heights** count from the ground at the anchors. The GNSS antenna is assumed to be as high as the
tag's, which the data set does not say, so ``alt_m`` of the frame may be off by a metre.

**Times** are seconds since the trajectory's first sample. Ranges outside the trajectory's time are
kept: alignment drops them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from gaia_uwb._shared import Array, Float64, Int64, SourceError
from gaia_uwb.logs import _plausible
from gaia_uwb.logs._cells import Kind
from gaia_uwb.logs._logs import LogTable
from gaia_uwb.logs._table import Table, read_table
from gaia_uwb.projection import to_geodetic, to_local
from gaia_uwb.scene import LocalFrame, RangeLog, Scene, Trajectory, Truth

RUNS = ("LOS/A/1", "LOS/A/2", "LOS/B/3", "LOS/B/4", "NLOS/A/1", "NLOS/A/2", "NLOS/B/3", "NLOS/B/4")
"""Visibility, trajectory and case of each run."""

ANCHOR_IDS = ("3", "5", "9", "12")

TAG_HEIGHT_M = 1.0
"""Height of the tag's antenna above the trajectory's z: the authors' own
``localization_error_analysis.py`` adds it before it compares heights."""

GNSS_LEVER_ARM_M = 0.185
"""How far the tag is ahead of the GNSS antenna (fitted, the same in all runs)."""

_MAX_FRAME_MISFIT_M = 0.01
_LATEST_NS = 2**62  # the year 2116
_PATH_NAMES = {"t_s": "timestamp", "east_m": "x", "north_m": "y", "up_m": "z"}
_FIX_NAMES = {
    "t_s": "field.header.stamp",
    "lat": "field.latitude",
    "lon": "field.longitude",
    "alt_m": "field.altitude",
}
_RANGE_NAMES = {
    "t_s": "field.stamp",
    "east_m": "field.x",
    "north_m": "field.y",
    "up_m": "field.z",
    "range_m": "field.distanceFromTag",
}
"""Our names of the columns, for the checks that are common to all logs."""

_RANGE_COLUMNS = {
    "field.stamp": Kind.INTEGER,
    "field.x": Kind.NUMBER,
    "field.y": Kind.NUMBER,
    "field.z": Kind.NUMBER,
    "field.distanceFromTag": Kind.NUMBER,
    "field.rssi": Kind.OPTIONAL,
    "field.rssi_fp": Kind.OPTIONAL,
}
_TRAJECTORY_COLUMNS = dict.fromkeys(("timestamp", "x", "y", "z", "heading_degrees"), Kind.NUMBER)
_GNSS_COLUMNS = {
    "field.header.stamp": Kind.INTEGER,
    "field.latitude": Kind.NUMBER,
    "field.longitude": Kind.NUMBER,
    "field.altitude": Kind.NUMBER,
}


def select_runs(part: str) -> tuple[str, ...]:
    """Return the runs that a part names: ``NLOS/B/4``, ``NLOS/B``, ``NLOS``, or nothing for all.

    Raises
    ------
    SourceError
        If no run has that name.

    Examples
    --------
    >>> from gaia_uwb.logs.outdoor_uwb import select_runs
    >>> select_runs("LOS/B")
    ('LOS/B/3', 'LOS/B/4')
    """
    words = part.split("/") if part else []
    runs = tuple(run for run in RUNS if run.split("/")[: len(words)] == words)
    if not runs:
        raise SourceError(f"outdoor-uwb has no part {part!r}; available: {', '.join(RUNS)}")
    return runs


def load(folder: Path, part: str = "") -> list[Scene]:
    """Read runs of the data set.

    Parameters
    ----------
    folder
        The data set's folder (the one that holds ``Dynamic_measurements``).
    part
        Which runs, see :func:`select_runs`.

    Returns
    -------
    list of Scene
        One per run, with the surveyed anchors and the folder's NLOS label as truth.

    Raises
    ------
    SourceError
        If no run has that name.
    InputError
        If a file is missing or does not hold what it must hold.
    """
    return [_load_run(folder, run) for run in select_runs(part)]


def _load_run(folder: Path, run: str) -> Scene:
    visibility, trajectory, case = run.split("/")
    place = (
        folder / "Dynamic_measurements" / visibility / f"Trajectory_{trajectory}" / f"Case_{case}"
    )
    drive = read_table(place / "trajectory.csv", _TRAJECTORY_COLUMNS)
    gnss = read_table(place / "gnss.csv", _GNSS_COLUMNS)
    # Stamps are written like 1.7300175266251697e+18: floats, 128 ns off the whole number at worst.
    stamp_ns = _stamps(drive, "timestamp")
    start_ns = int(stamp_ns[0])
    anchors = [read_table(place / f"A{anchor_id}.csv", _RANGE_COLUMNS) for anchor_id in ANCHOR_IDS]
    _check(drive, stamp_ns, gnss, anchors)
    to_east_north, frame = _find_frame(drive, stamp_ns, gnss)
    survey_m = np.array([[float(a[f"field.{axis}"][0]) for axis in "xyz"] for a in anchors])
    log = _merge(anchors, start_ns)
    return Scene(
        name=f"outdoor-uwb:{run}",
        trajectory=Trajectory(
            t_s=_seconds(stamp_ns, start_ns),
            position_m=np.column_stack([drive["x"], drive["y"]]) @ to_east_north.T,
            up_m=drive["z"] + TAG_HEIGHT_M,
        ),
        ranges=log,
        anchor_ids=ANCHOR_IDS,
        anchor_up_m=survey_m[:, 2],
        frame=frame,
        truth=Truth(
            anchor_m=survey_m[:, :2] @ to_east_north.T,
            nlos=np.full(len(log), visibility == "NLOS"),
        ),
    )


def _stamps(table: Table, column: str) -> Int64[Array, "R"]:
    """Return times in whole nanoseconds, such that their differences fit into 64 bits."""
    stamps = table[column]
    wrong = ~((stamps >= 0) & (stamps <= _LATEST_NS))
    if wrong.any():
        index = int(np.argmax(wrong))
        problem = f"expected nanoseconds since 1970, got {stamps[index]:g}"
        raise table.error(problem, index=index, column=column)
    return np.asarray(stamps, dtype=np.int64)


def _check(
    drive: Table, stamp_ns: Int64[Array, "T"], gnss: Table, anchors: Sequence[Table]
) -> None:
    """Refuse what cannot be one walk in seconds, metres and degrees, like any other log."""
    start_ns = int(stamp_ns[0])
    path = _under_our_names(drive, _PATH_NAMES, _seconds(stamp_ns, start_ns))
    _plausible.check_timeline(path)
    _plausible.check_site(path)
    fix_ns = _stamps(gnss, "field.header.stamp")
    _plausible.check_geodetic(_under_our_names(gnss, _FIX_NAMES, _seconds(fix_ns, start_ns)))
    position_m = np.column_stack([drive["x"], drive["y"]])
    for anchor in anchors:
        read_s = _seconds(_stamps(anchor, "field.stamp"), start_ns)
        ranges = _under_our_names(anchor, _RANGE_NAMES, read_s)
        _plausible.check_site(ranges)
        _plausible.check_one_drive(ranges, path, position_m)


def _under_our_names(table: Table, names: Mapping[str, str], t_s: Float64[Array, "R"]) -> LogTable:
    """Return the columns that the common checks look at; errors still name the file's own."""
    columns = {ours: table[its] for ours, its in names.items() if ours != "t_s"}
    return LogTable(
        path=table.path,
        columns={"t_s": t_s, **columns},
        labels={},
        unknown=(),
        number=np.arange(len(table), dtype=np.int64) + 2,
        origin=np.zeros(len(table), np.int64),
        origins=(f"{table.path}, row",),
        names=names,
    )


def _find_frame(
    drive: Table, stamp_ns: Int64[Array, "T"], gnss: Table
) -> tuple[Float64[Array, "2 2"], LocalFrame]:
    """Return the rotation from the trajectory's axes to east and north, and the origin's place."""
    fixes = [gnss[f"field.{name}"] for name in ("latitude", "longitude", "altitude")]
    start = LocalFrame(*(float(values[0]) for values in fixes))
    fix_m, _ = to_local(start, *fixes)
    heading_rad = np.radians(drive["heading_degrees"])
    ahead = np.column_stack([np.cos(heading_rad), np.sin(heading_rad)])
    antenna_m = np.column_stack([drive["x"], drive["y"]]) - GNSS_LEVER_ARM_M * ahead
    fix_m = fix_m[_nearest(gnss["field.header.stamp"], stamp_ns)]
    # The best rotation and shift in the plane, in closed form: fix = rotation @ antenna + shift.
    a, f = antenna_m - antenna_m.mean(axis=0), fix_m - fix_m.mean(axis=0)
    angle_rad = np.arctan2((a[:, 0] * f[:, 1] - a[:, 1] * f[:, 0]).sum(), (a * f).sum())
    cos, sin = np.cos(angle_rad), np.sin(angle_rad)
    rotation = np.array([[cos, -sin], [sin, cos]])
    misfit_m = np.hypot(*(a @ rotation.T - f).T).max()
    if misfit_m > _MAX_FRAME_MISFIT_M:
        problem = f"fits gnss.csv only to within {misfit_m:.3f} m, expected {_MAX_FRAME_MISFIT_M} m"
        raise drive.error(problem)
    shift_m = fix_m.mean(axis=0) - rotation @ antenna_m.mean(axis=0)
    lat_deg, lon_deg, alt_m = to_geodetic(start, shift_m[None], np.array([-TAG_HEIGHT_M]))
    return rotation, LocalFrame(float(lat_deg[0]), float(lon_deg[0]), float(alt_m[0]))


def _nearest(sorted_ns: Int64[Array, "G"], wanted_ns: Int64[Array, "T"]) -> Int64[Array, "T"]:
    """Return the index of the stamp nearest to each wanted one."""
    after = np.clip(np.searchsorted(sorted_ns, wanted_ns), 1, len(sorted_ns) - 1)
    before_is_nearer = wanted_ns - sorted_ns[after - 1] < sorted_ns[after] - wanted_ns
    return after - before_is_nearer


def _seconds(stamp_ns: Int64[Array, "R"], start_ns: int) -> Float64[Array, "R"]:
    """Subtract as integers: a float holds nanoseconds since 1970 to no better than 256 ns."""
    return (stamp_ns - start_ns) / 1e9


def _merge(anchors: list[Table], start_ns: int) -> RangeLog:
    """Return the readings of all anchors in the order of time."""

    def column(name: str) -> Array:
        return np.concatenate([table[f"field.{name}"] for table in anchors])

    t_s = _seconds(column("stamp"), start_ns)
    order = np.argsort(t_s, kind="stable")
    anchor = np.repeat(np.arange(len(anchors)), [len(table) for table in anchors])
    return RangeLog(
        t_s=t_s[order],
        anchor=anchor[order],
        range_m=column("distanceFromTag")[order],
        rssi_dbm=column("rssi")[order],
        rssi_fp_dbm=column("rssi_fp")[order],
    )
