"""From tables to the parts of a scene, the same for GAIA's own format and for described logs."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar, cast

import numpy as np

from gaia_uwb._shared import Array, Float64, InputError, Int64, shown
from gaia_uwb.logs._cells import Kind
from gaia_uwb.logs._lever_arm import tag_of
from gaia_uwb.logs._logs import check_number_of_anchors
from gaia_uwb.logs._placeholders import Drive, no_ranges
from gaia_uwb.logs._places import Places, place_kinds, to_places
from gaia_uwb.logs._plausible import check_angles, check_one_drive, check_seconds
from gaia_uwb.logs._table import Table, read_names, read_table
from gaia_uwb.logs._tags import TagPlaces, check_given, several_tags, tags_present
from gaia_uwb.scene import LocalFrame, RangeLog, Tag, Trajectory, Truth, course

_Table = TypeVar("_Table", bound=Table)

_FAR_OFF_DEG = 30.0  # a vehicle in a bend or in a crab's walk is less
_FEWEST_HEADINGS = 10


@dataclass(frozen=True)
class Anchors:
    """The anchors of the anchors table, then those that appear only in the ranges."""

    table: Table | None
    ids: tuple[str, ...]
    position_m: Float64[Array, "N 2"]
    up_m: Float64[Array, "N"] | None


def read_anchors(path: Path | None, frame: LocalFrame | None, ranged: tuple[str, ...]) -> Anchors:
    """Read the anchors table, if there is one, and append the anchors that only have ranges.

    Raises
    ------
    InputError
        If the table is wrong, or names an anchor twice.
    """
    if path is None:
        ids = tuple(sorted(ranged, key=_natural_key))
        return Anchors(None, ids, np.full((len(ids), 2), np.nan), None)
    survey, heights = place_kinds(path, Kind.OPTIONAL)
    optional = {"up_m": Kind.OPTIONAL, **heights}
    if {"up_m", "alt_m"} <= optional.keys() & set(read_names(path)):
        raise InputError("has both up_m and alt_m: keep one", source=path)
    table = read_table(path, {"anchor_id": Kind.TEXT, **survey}, optional)
    check_number_of_anchors(table)
    codes, labels = table["anchor_id"], table.labels["anchor_id"]
    listed = tuple(labels[code] for code in codes)
    if len(labels) < len(listed):
        index = next(k for k, label in enumerate(listed) if label in listed[:k])
        raise table.error(f"{shown(listed[index])} appears twice", index=index, column="anchor_id")
    places = to_places(table, frame)
    ids = listed + tuple(sorted(set(ranged) - set(listed), key=_natural_key))
    more = (0, len(ids) - len(listed))
    up_m = None if places.up_m is None else np.pad(places.up_m, more, constant_values=np.nan)
    return Anchors(
        table, ids, np.pad(places.position_m, (more, (0, 0)), constant_values=np.nan), up_m
    )


def _natural_key(anchor_id: str) -> tuple[Any, ...]:
    """Return a key that sorts ``cone-9`` before ``cone-10``."""
    words = re.split("([0-9]+)", anchor_id)
    numbers = [word.lstrip("0") for word in words[1::2]]
    words[1::2] = [f"{len(number):06d}{number}" for number in numbers]
    return (*words, anchor_id)


def ranges_of_drive(
    ranges: _Table, drive: Table, position_m: Float64[Array, "T 2"]
) -> tuple[_Table, list[str]]:
    """Leave out what is no range, and refuse ranges that cannot belong to the drive.

    Returns
    -------
    (Table, list of str)
        The ranges, and notes on what was left out.

    Raises
    ------
    InputError
        If no range is left, times do not overlap, or the unit is wrong.
    """
    check_seconds(ranges)
    none, notes = no_ranges(ranges, Drive(drive["t_s"], position_m))
    ranges = cast("_Table", ranges.take(~none)) if none.any() else ranges
    check_one_drive(ranges, drive, position_m)
    return ranges, notes


def trajectory_of(drive: Table, places: Places) -> Trajectory:
    """Return a drive's path, with the vehicle's attitude where the table has it.

    Raises
    ------
    InputError
        If an angle cannot be one in degrees.
    """
    check_angles(drive)
    heading_deg = _known(drive, "heading_deg")
    return Trajectory(
        t_s=drive["t_s"],
        position_m=places.position_m,
        up_m=places.up_m,
        heading_rad=None if heading_deg is None else _radians(90.0 - heading_deg),
        roll_rad=_radians(_known(drive, "roll_deg")),
        pitch_rad=_radians(_known(drive, "pitch_deg")),
    )


def range_log(
    ranges: Table,
    order: Int64[Array, "R"],
    ids: tuple[str, ...],
    tag: Int64[Array, "R"] | None = None,
) -> RangeLog:
    """Return the rows of a table of ranges in an order, pointing into ``ids``.

    Parameters
    ----------
    ranges, order, ids
        The table, its rows in the order of time, and the anchors.
    tag : (R,), optional
        Of each row of the table, see :func:`scene_tags`.

    Raises
    ------
    InputError
        If an angle cannot be one in degrees.
    """
    check_angles(ranges)
    index_of = {anchor_id: index for index, anchor_id in enumerate(ids)}
    indices = np.array([index_of[label] for label in ranges.labels["anchor_id"]])
    azimuth_deg = _known(ranges, "azimuth_deg")
    sigma_deg = None if azimuth_deg is None else _known(ranges, "azimuth_sigma_deg")
    return RangeLog(
        t_s=ranges["t_s"][order],
        anchor=indices[ranges["anchor_id"]][order],
        range_m=ranges["range_m"][order],
        rssi_dbm=_column(ranges, "rssi_dbm", order),
        rssi_fp_dbm=_column(ranges, "rssi_fp_dbm", order),
        tag=None if tag is None else tag[order],
        azimuth_rad=None if azimuth_deg is None else _radians(azimuth_deg[order]),
        azimuth_sigma_rad=None if sigma_deg is None else np.radians(sigma_deg[order]),
    )


def scene_tags(
    ranges: Table, places: TagPlaces
) -> tuple[tuple[Tag, ...], Int64[Array, "R"] | None, list[str]]:
    """Return the tags that took the ranges, and which of them took which.

    Parameters
    ----------
    ranges
        With ``tag_id``, where something names the tag.
    places
        Where the tags are.

    Returns
    -------
    tuple of Tag
        Those that have ranges, in the order in which they are given; empty if none is given.
    (R,) array, optional
        Which of them took each row; ``None`` if there is one at most.
    list of str
        Notes.

    Raises
    ------
    InputError
        If there are several tags, and it is not given where one is or which took a range.
    """
    given = places.given
    present = tags_present(ranges) if "tag_id" in ranges else []
    if not given:
        if len(present) > 1:
            raise ranges.error(several_tags(present, places), column="tag_id")
        return (), None, []
    check_given(ranges, present, places, "tag_id")
    if "tag_id" not in ranges and len(given) > 1:
        problem = f"names no tag, but {places.file} gives {len(given)} tags: {places.naming}"
        raise ranges.error(problem, column="tag_id")
    labels = ranges.labels.get("tag_id", ())
    own = {tag_of(label, given) for label in present} or set(given)
    read = [tag_id for tag_id in given if tag_id in own]
    notes = [f"tags: no ranges of {shown(tag_id)}" for tag_id in given if tag_id not in own]
    tags = tuple(Tag(tag_id, **dict(given[tag_id])) for tag_id in read)
    if len(given) == 1:
        return tags, None, notes
    nameless = np.array([not label for label in labels])[ranges["tag_id"]]
    if nameless.any():
        problem = "expected the tag that took the range, got nothing"
        raise ranges.error(problem, index=int(np.argmax(nameless)), column="tag_id")
    if len(read) == 1:
        return tags, None, notes
    place = {tag_id: index for index, tag_id in enumerate(read)}
    indices = np.array([place.get(tag_of(label, given) or "", 0) for label in labels], np.int64)
    return tags, indices[ranges["tag_id"]], notes


def heading_note(trajectory: Trajectory) -> list[str]:
    """Say that a heading is far off the direction of travel.

    That of a camera would be, or that of a pair of antennas across the vehicle.
    """
    if trajectory.heading_rad is None:
        return []
    try:
        off_rad = trajectory.heading_rad - course(trajectory.position_m)
    except InputError:  # the vehicle stands
        return []
    off_deg = np.degrees(np.abs(np.angle(np.exp(1j * off_rad[np.isfinite(off_rad)]))))
    if len(off_deg) < _FEWEST_HEADINGS or np.median(off_deg) < _FAR_OFF_DEG:
        return []
    return [
        f"the heading is {np.median(off_deg):.0f}° off the direction of travel (median): is it "
        "where the vehicle's front points?"
    ]


def no_heights_note(tags: tuple[Tag, ...], trajectory: Trajectory) -> list[str]:
    """Say that heights of tags are of no use where the path has none."""
    useless = trajectory.up_m is None and any(tag.up_m for tag in tags)
    return ["tags: up_m is ignored, as the trajectory has no heights"] if useless else []


def make_truth(
    ranges: Table, order: Int64[Array, "R"], anchors: Anchors, clock_offset_s: float | None
) -> Truth | None:
    """Return what was surveyed or simulated, if the place of every anchor was."""
    if not np.isfinite(anchors.position_m).all():
        return None
    return Truth(
        anchor_m=anchors.position_m,
        nlos=_column(ranges, "nlos", order),
        range_m=_column(ranges, "true_range_m", order),
        clock_offset_s=clock_offset_s,
        outlier=_column(ranges, "outlier", order),
        bias_m=_column(ranges, "true_bias_m", order),
    )


def _known(table: Table, name: str) -> Float64[Array, "R"] | None:
    """Return a column's values, ``None`` if none of them is known."""
    values = table.get(name)
    return None if values is None or np.isnan(values).all() else values


def _radians(angle_deg: Float64[Array, "R"] | None) -> Float64[Array, "R"] | None:
    """Return angles in radians, from above -pi to pi."""
    if angle_deg is None:
        return None
    around_deg = 180.0 - (180.0 - angle_deg) % 360.0
    return np.asarray(np.radians(np.round(around_deg, 10)))  # without what the last bits add


def _column(table: Table, name: str, order: Int64[Array, "R"]) -> Array | None:
    values = table.get(name)
    return None if values is None else values[order]
