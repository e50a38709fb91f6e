"""GAIA's own format: a folder with two tables, and up to three more files.

==================  ================================================================================
``trajectory.csv``  ``t_s`` and ``east_m,north_m[,up_m]`` or ``lat,lon[,alt_m]``; optional:
                    ``heading_deg`` (clockwise from north), ``roll_deg,pitch_deg`` (as in REP 103)
``ranges.csv``      ``t_s,anchor_id,range_m[,rssi_dbm][,rssi_fp_dbm]``; of several tags also
                    ``tag_id``; with angles of arrival ``azimuth_deg[,azimuth_sigma_deg]``
                    (counter-clockwise from the vehicle's front); and, where a simulator knows them,
                    ``true_range_m,nlos,outlier,true_bias_m``
``anchors.csv``     optional: ``anchor_id[,up_m]`` and, where surveyed, ``east_m,north_m`` or
                    ``lat,lon[,alt_m]``
``cone_ranges.csv`` optional: ``anchor_a,anchor_b,range_m[,t_s]``, ranges between cones
``scene.yaml``      optional: ``name``, ``frame`` (``lat_deg``, ``lon_deg``, ``alt_m``),
                    ``clock_offset_s`` (the true one, where a simulator knows it), ``where``
                    (column -> value of the ranges that count), ``missing`` (lengths that mean
                    "no range"), ``vehicle`` (its name) and ``tags`` (id -> ``forward_m``,
                    ``left_m``, ``up_m`` and ``own_clock``)
==================  ================================================================================

Each table may be ``.parquet`` instead of ``.csv``. Seconds, metres, degrees, dBm; text is UTF-8.
Times may also be dates, in ``t_s`` or in two columns ``date`` and ``time``.
Positions are those of the tag's antenna or, with ``tags``, of the point of the vehicle from which
these count. Without ``frame``, a trajectory in ``lat,lon`` takes its
first sample as the local frame's origin. Heights (``up_m``) count from that origin; ``alt_m``, from
the ellipsoid, may stand for them everywhere. What is not known is an empty cell: a height, a
surveyed place, a range, an angle, and the place of the tag before there is a fix.

What was surveyed or simulated (places and the four columns above) becomes the scene's truth, which
only scores read. Rows may come in any order, as logs merge several radios; they are sorted by time,
and of rows that repeat a time (of an anchor) the first is kept. Columns that are not named above
are ignored.
"""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Literal

import numpy as np
from pydantic import Field, ValidationError

from gaia_uwb._shared import (
    ConfigError,
    InputError,
    OutputFolder,
    SourceError,
    name_of,
    read_yaml,
    replace_file,
    temporary_path,
)
from gaia_uwb.config import LONGEST_NAME, Settings, settings_problems
from gaia_uwb.logs import _plausible
from gaia_uwb.logs._cells import Kind
from gaia_uwb.logs._cones import ENDS, Cones, cones_in
from gaia_uwb.logs._dates import column_seconds
from gaia_uwb.logs._lever_arm import Tags
from gaia_uwb.logs._logs import check_number_of_anchors
from gaia_uwb.logs._native_files import scene_tables, scene_yaml, table_bytes
from gaia_uwb.logs._places import first_place, only_fixes, place_kinds, to_places
from gaia_uwb.logs._scenes import (
    Anchors,
    heading_note,
    make_truth,
    no_heights_note,
    range_log,
    ranges_of_drive,
    read_anchors,
    scene_tags,
    trajectory_of,
)
from gaia_uwb.logs._selection import Missing, Where
from gaia_uwb.logs._table import Table, holds_dates, read_names, read_table
from gaia_uwb.logs._tags import TagPlaces, choose_rows, drop_missing, tag_columns
from gaia_uwb.logs._tidy import tidy
from gaia_uwb.logs.vehicle import Vehicle
from gaia_uwb.scene import LocalFrame, Scene

_SCENE_FILE = "scene.yaml"
_DATE_AND_TIME = ("date", "time")
_TABLES = ("trajectory", "ranges", "anchors", "cone_ranges")
_SUFFIXES = (".csv", ".parquet")

LOG_FILES = (*(table + suffix for table in _TABLES for suffix in _SUFFIXES), _SCENE_FILE)
"""Every name that a file of a log in this format can have."""
_TRUTH = {
    "true_range_m": Kind.OPTIONAL,
    "nlos": Kind.FLAG,
    "outlier": Kind.FLAG,
    "true_bias_m": Kind.OPTIONAL,
}


class _FrameContent(Settings):
    lat_deg: float = Field(ge=-90, le=90)
    lon_deg: float = Field(ge=-180, le=180)
    alt_m: float = Field(default=0.0, ge=-1e5, le=1e5)


class _SceneContent(Settings):
    name: str | None = Field(default=None, max_length=LONGEST_NAME)
    frame: _FrameContent | None = None
    clock_offset_s: float | None = None
    where: Where = Field(default_factory=dict)
    missing: Missing = Field(default_factory=list)
    vehicle: str = Field(default="", max_length=LONGEST_NAME)
    tags: Tags = Field(default_factory=dict)

    def tag_places(self) -> TagPlaces:
        """Return where the tags are, and where that is to be written."""
        return TagPlaces(self.tags, _SCENE_FILE, _SCENE_FILE, "add a column tag_id")

    def of_vehicle(self, vehicle: Vehicle | None) -> _SceneContent:
        """Return it with the tags of a vehicle where it gives none."""
        tags = self.tags if vehicle is None else vehicle.tags_for(self.tags)
        return self.model_copy(update={"tags": tags})


def is_native(folder: Path) -> bool:
    """Tell whether a folder holds a trajectory table, as every scene in this format does."""
    return any((folder / f"trajectory{suffix}").is_file() for suffix in _SUFFIXES)


def read_native(folder: str | Path, *, vehicle: Vehicle | None = None) -> Scene:
    """Read a scene in GAIA's own format.

    Parameters
    ----------
    folder
        Folder with the files that this module's text describes.
    vehicle
        Who drove, if that is known: its tags are where they are on it.

    Returns
    -------
    Scene
        With notes on what was tolerated on the way, and problems that spoil a result.

    Raises
    ------
    SourceError
        If there is no such folder.
    InputError
        If a table is missing, or a file does not hold what it must hold: the message names the
        file, the row and the column.
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise SourceError(f"{folder}: no such folder")
    content = _read_scene_file(folder / _SCENE_FILE).of_vehicle(vehicle)
    path = tidy(_read_trajectory(_need(folder, "trajectory")))
    drive = path.table
    _plausible.check_timeline(drive)
    frame = LocalFrame(**dict(content.frame)) if content.frame else first_place(drive)
    trajectory = trajectory_of(drive, to_places(drive, frame))
    log = tidy(_read_ranges(_need(folder, "ranges"), content))
    ranges, left_out = ranges_of_drive(log.table, drive, trajectory.position_m)
    cones = _read_cone_ranges(_find(folder, "cone_ranges"))
    ranged = tuple(dict.fromkeys((*ranges.labels["anchor_id"], *cones.labels)))
    anchors = read_anchors(_find(folder, "anchors"), frame, ranged)
    tags, tag, tag_notes = scene_tags(ranges, content.tag_places())
    order = np.argsort(ranges["t_s"], kind="stable")
    scene = Scene(
        name=name_of(folder) if content.name is None else content.name,
        trajectory=trajectory,
        ranges=range_log(ranges, order, anchors.ids, tag),
        anchor_ids=anchors.ids,
        anchor_up_m=anchors.up_m,
        frame=frame,
        truth=make_truth(ranges, order, anchors, content.clock_offset_s),
        tags=tags,
        cone_ranges=cones.ranges(anchors.ids),
        vehicle=content.vehicle,
    )
    tag_notes += [*heading_note(trajectory), *no_heights_note(tags, trajectory), *cones.notes]
    notes = (*path.notes, *log.notes, *left_out, *_notes(scene, drive, ranges, anchors), *tag_notes)
    scene = replace(scene, notes=notes, problems=(*path.problems, *log.problems))
    return scene if vehicle is None else vehicle.drove(scene)


def write_native(
    scene: Scene, folder: str | Path, file_format: Literal["csv", "parquet"] = "csv"
) -> None:
    """Write a scene in GAIA's own format; :func:`read_native` gives back an equal one.

    What a reader leaves out (ranges of 0 m and less), its notes and ``trajectory.lever_m`` are not
    in what comes back. Angles are written in degrees, to 10
    decimals.

    All files are written under temporary names and then renamed, the trajectory last: a folder
    without one is not a scene, so an interruption never leaves half of one. A scene that this
    function wrote there before is replaced; other files stay.

    Parameters
    ----------
    scene
        What to write.
    folder
        Where; created if missing, with the folders above it.
    file_format
        Of the tables.

    Raises
    ------
    ConfigError
        If the folder cannot be written, or holds files of a log that somebody else wrote.

    Examples
    --------
    >>> import tempfile
    >>> from gaia_uwb.scene import RangeLog, Scene, Trajectory
    >>> drive = Trajectory(np.array([0.0, 1.0]), np.array([[0.0, 0.0], [10.0, 0.5]]))
    >>> log = RangeLog(np.array([0.2]), np.array([0]), np.array([12.5]))
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_native(Scene("pass", drive, log, ("cone-1",)), folder)
    ...     print((Path(folder) / "ranges.csv").read_text(), end="")
    t_s,anchor_id,range_m
    0.2,cone-1,12.5
    """
    folder = Path(folder)
    output = OutputFolder(folder)
    output.claim(LOG_FILES)
    new = temporary_path(folder, "scene")
    try:
        new.mkdir()
        replace_file(new / _SCENE_FILE, scene_yaml(scene))
        for table, columns in scene_tables(scene).items():
            replace_file(new / f"{table}.{file_format}", table_bytes(columns, file_format))
        with output.alone():
            for name in LOG_FILES:  # the trajectory goes first and comes last
                output.remove(name)
            for path in sorted(new.iterdir()):
                path.rename(folder / path.name)
    except OSError as error:
        raise ConfigError(f"{folder}: cannot be written: {error.strerror or error}") from error
    finally:
        shutil.rmtree(new, ignore_errors=True)


def _find(folder: Path, table: str) -> Path | None:
    """Return the file that holds a table, if there is one."""
    paths = [folder / f"{table}{suffix}" for suffix in _SUFFIXES]
    found = [path for path in paths if os.path.lexists(path)]
    if len(found) > 1:
        raise InputError(f"has both {found[0].name} and {found[1].name}: keep one", source=folder)
    if found and not found[0].is_file():
        raise InputError("is not a regular file", source=found[0])
    return found[0] if found else None


def _need(folder: Path, table: str) -> Path:
    path = _find(folder, table)
    if path is None:
        raise InputError(f"has no {table}.csv or {table}.parquet", source=folder)
    return path


def _read_scene_file(path: Path) -> _SceneContent:
    if not path.exists():
        return _SceneContent()
    try:
        content = read_yaml(path)
        return _SceneContent.model_validate({} if content is None else content)
    except ValidationError as error:
        raise InputError(settings_problems(error), source=path) from error
    except (OSError, ValueError) as error:
        raise InputError(f"cannot be read: {error}", source=path) from error


def _read_trajectory(path: Path) -> Table:
    places, heights = place_kinds(path, Kind.OPTIONAL)
    if not places:
        names = ", ".join(map(repr, read_names(path)))
        problem = f"expected the columns east_m,north_m or lat,lon, got {names[:200]}"
        raise InputError(problem, source=path)
    attitude = dict.fromkeys(_plausible.ATTITUDE, Kind.OPTIONAL)
    table, notes = only_fixes(_read_timed(path, places, heights | attitude))
    table = replace(table, remarks=(*table.remarks, *notes))
    _plausible.check_seconds(table)
    return table


def _read_ranges(path: Path, content: _SceneContent) -> Table:
    needed = {"anchor_id": Kind.TEXT, "range_m": Kind.OPTIONAL}
    signal = dict.fromkeys(("rssi_dbm", "rssi_fp_dbm", *_plausible.ARRIVAL), Kind.OPTIONAL)
    tags = tag_columns(read_names(path))
    choices = {name: Kind.ANYTHING for name in content.where if name not in needed}
    known = {**dict.fromkeys(tags, Kind.ANYTHING), **signal, **_TRUTH}
    table = _read_timed(path, {**choices, **needed}, known)
    check_number_of_anchors(table)
    table, tag = choose_rows(table, content.where, tags, content.tag_places())
    if tag is not None:
        columns = {**table.columns, "tag_id": table[tag]}
        labels = {**table.labels, "tag_id": table.labels[tag]}
        table = replace(table, columns=columns, labels=labels)
    return drop_missing(table, content.missing)


def _read_cone_ranges(path: Path | None) -> Cones:
    if path is None:
        return Cones()
    kinds = {**dict.fromkeys(ENDS, Kind.TEXT), "range_m": Kind.OPTIONAL}
    names = set(read_names(path))
    timed = "t_s" in names or set(_DATE_AND_TIME) <= names
    table = _read_timed(path, kinds, {}) if timed else read_table(path, kinds)
    return cones_in(table)


def _read_timed(path: Path, required: dict[str, Kind], optional: dict[str, Kind]) -> Table:
    """Read a table with times: seconds, or dates and times of day, in one column or two."""
    names = set(read_names(path))
    times = _DATE_AND_TIME if "t_s" not in names and set(_DATE_AND_TIME) <= names else ("t_s",)
    if times == ("t_s",) and not ("t_s" in names and holds_dates(path, "t_s")):
        return read_table(path, {"t_s": Kind.NUMBER, **required}, optional)
    table = read_table(path, {**dict.fromkeys(times, Kind.TEXT), **required}, optional)
    columns = {**table.columns, "t_s": column_seconds(table, times)}
    remark = f"{path.name}: dates and times without a zone are taken as UTC"
    return replace(table, columns=columns, remarks=(*table.remarks, remark))


def _notes(scene: Scene, drive: Table, ranges: Table, anchors: Anchors) -> Iterator[str]:
    """Yield what a user should know about files that were read without an error."""
    for table in (drive, ranges, anchors.table):
        if table is not None and table.unknown:
            yield f"{table.path.name}: ignored columns: {', '.join(table.unknown)}"
    for table in (drive, ranges, anchors.table):
        yield from () if table is None else table.remarks
    n_listed = 0 if anchors.table is None else len(anchors.table)
    if anchors.table is not None and n_listed < scene.n_anchors:
        missing = ", ".join(anchors.ids[n_listed:])
        yield f"{anchors.table.path.name}: lacks {missing}: heights unknown"
    n_surveyed = int(np.isfinite(anchors.position_m).all(axis=1).sum())
    labelled = sorted(_TRUTH.keys() & set(ranges.columns))
    if 0 < n_surveyed < scene.n_anchors:
        yield f"only {n_surveyed} of {scene.n_anchors} cones are surveyed: results cannot be scored"
    elif labelled and not n_surveyed:
        yield f"{ranges.path.name}: {', '.join(labelled)} ignored, as no cone is surveyed"
