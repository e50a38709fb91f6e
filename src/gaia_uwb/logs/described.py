"""Logs that are not in GAIA's own format: ROS logs, and folders with a ``gaia.yaml``.

Each file is read by its format's reader into a table of our columns; what follows is the same for
all of them and the same as for GAIA's own format: sort, check that it can be one drive in seconds
and metres, project, and move to the tag's antenna.
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from gaia_uwb._shared import InputError, name_of
from gaia_uwb.logs import _plausible
from gaia_uwb.logs._cones import Cones, cones_in
from gaia_uwb.logs._lever_arm import LeverArm, tag_text
from gaia_uwb.logs._logs import LogTable, join
from gaia_uwb.logs._places import first_place, only_fixes, to_places
from gaia_uwb.logs._scenes import (
    heading_note,
    make_truth,
    no_heights_note,
    range_log,
    ranges_of_drive,
    read_anchors,
    scene_tags,
    trajectory_of,
)
from gaia_uwb.logs._stamps import DAY_S
from gaia_uwb.logs._tags import TagPlaces
from gaia_uwb.logs._tidy import tidy
from gaia_uwb.logs.bags import Link, is_killed_recording, is_ros2_folder, is_ros_file
from gaia_uwb.logs.input_description import (
    FILE_NAME,
    CsvRanges,
    CsvTrajectory,
    FrameInput,
    GuessedTrajectory,
    InputDescription,
    KittiTrajectory,
    NmeaTrajectory,
    PlainTrajectory,
    RosRanges,
    RosTrajectory,
    RtklibTrajectory,
    SerialRanges,
    TrajectoryInput,
    read_description,
)
from gaia_uwb.logs.native import is_native
from gaia_uwb.logs.ros import RosLog
from gaia_uwb.logs.vehicle import Vehicle
from gaia_uwb.scene import LocalFrame, Scene, Trajectory, antenna_path

_DATED_S = 10 * DAY_S  # times from which on count from 1970, not from midnight or from a start
_QUOTED = re.compile("['\"`].*['\"`]", re.DOTALL)
_NAMED = 10  # columns in one note


def is_described(path: Path) -> bool:
    """Tell whether a path is a log that :func:`read_described` reads."""
    if path.is_dir():
        if (path / FILE_NAME).is_file() or is_ros2_folder(path):
            return True
        return not is_native(path) and is_killed_recording(path)
    return is_ros_file(path) and path.is_file()


def read_described(path: Path, *, vehicle: Vehicle | None = None) -> Scene:
    """Read a ROS log, or a folder with a ``gaia.yaml``.

    Parameters
    ----------
    path
        A ``.bag``, ``.mcap`` or ``.db3`` file, a ROS 2 folder, or a folder with a ``gaia.yaml``.
    vehicle
        Who drove, if that is known: its tags are where they are on it, unless the log says so.

    Returns
    -------
    Scene
        With notes on what was tolerated on the way, and problems that spoil a result.

    Raises
    ------
    InputError
        If data are wrong: the message names the file and the line or message.
    ConfigError
        If ``gaia.yaml`` is wrong, or the extra ``ros`` is not installed.
    """
    if path.is_dir() and (path / FILE_NAME).is_file():
        try:
            return _read(path, read_description(path / FILE_NAME), vehicle)
        except InputError as error:
            raise _without_quotes(error, named_elsewhere(path)) from error
    ros = {"file": name_of(path), "format": "ros"}
    name = Path(name_of(path).removesuffix(".active")).stem
    description = InputDescription.model_validate(
        {"name": name, "trajectory": ros, "ranges": [ros]}
    )
    return _read(path.resolve().parent, description, vehicle, shown=path)


def _read(
    folder: Path,
    description: InputDescription,
    vehicle: Vehicle | None,
    shown: Path | None = None,
) -> Scene:
    """Return what a log holds, with the tags of a vehicle where it gives no lever arm."""
    if vehicle is None:
        return _Reader(folder, description, shown).scene()
    if description.lever_arm == LeverArm():
        tags = vehicle.tags_for(description.tags)
        description = description.model_copy(update={"tags": tags})
    return vehicle.drove(_Reader(folder, description, shown).scene())


def named_elsewhere(folder: Path) -> list[Path]:
    """Return the files and folders outside a log's folder that its ``gaia.yaml`` names.

    Parameters
    ----------
    folder
        The log's folder.

    Raises
    ------
    InputError, ConfigError
        If there is a ``gaia.yaml`` that cannot be read or is wrong.
    """
    if not (folder / FILE_NAME).is_file():
        return []
    named = [folder / name for name in read_description(folder / FILE_NAME).names()]
    inside = Path(os.path.realpath(folder))
    return [path for path in named if inside not in Path(os.path.realpath(path)).parents]


def _without_quotes(error: InputError, elsewhere: list[Path]) -> InputError:
    """Return an error that quotes nothing of a file outside the log's folder.

    A stranger's description may name any file of the user's, and messages are passed on.
    """
    source = str(error.source)
    if not any(source.startswith(str(path)) for path in elsewhere):
        return error
    problem = _QUOTED.sub("'...'", error.problem)
    return InputError(problem, source=error.source, row=error.row, column=error.column)


class _Reader:
    """Reads what one description names.

    Parameters
    ----------
    folder
        Where its files are.
    description
        What it says.
    shown
        The path as the user named it, if that is the only file.
    """

    def __init__(
        self, folder: Path, description: InputDescription, shown: Path | None = None
    ) -> None:
        self._folder = folder
        self._description = description
        self._shown = shown
        self._notes: list[str] = []
        self._problems: list[str] = []
        self._unused: dict[Path, tuple[str, ...]] = {}  # columns of a file
        self._logs: dict[tuple[Path, str | None], RosLog] = {}

    def scene(self) -> Scene:
        """Return what the files hold."""
        given = self._description
        drive = self._drive()
        ranges = self._ranges(float(np.median(drive["t_s"])))
        frame, trajectory = self._trajectory(drive)
        ranges, notes = ranges_of_drive(ranges, drive, trajectory.position_m)
        self._notes += notes
        cones = self._cones()
        table = None if given.anchors is None else self._anchors_file(given.anchors)
        ranged = tuple(dict.fromkeys((*ranges.labels["anchor_id"], *cones.labels)))
        anchors = read_anchors(table, frame, ranged)
        tags, tag, notes = scene_tags(ranges, TagPlaces(given.tags))
        self._notes += [*notes, *heading_note(trajectory), *no_heights_note(tags, trajectory)]
        self._notes += cones.notes
        order = ranges["t_s"].argsort(kind="stable")
        return Scene(
            name=given.name if given.name is not None else name_of(self._folder),
            trajectory=trajectory,
            ranges=range_log(ranges, order, anchors.ids, tag),
            anchor_ids=anchors.ids,
            anchor_up_m=anchors.up_m,
            frame=frame,
            truth=make_truth(ranges, order, anchors, None),
            notes=(*dict.fromkeys(self._notes), *self._ignored()),
            problems=tuple(self._problems),
            tags=tags,
            cone_ranges=cones.ranges(anchors.ids),
            vehicle=given.vehicle,
        )

    def _ignored(self) -> Iterator[str]:
        """Yield which columns of the files nothing was taken from."""
        for path, names in self._unused.items():
            if names:
                more = f" and {len(names) - _NAMED} more" if len(names) > _NAMED else ""
                yield f"{path.name}: ignored columns: {', '.join(names[:_NAMED])}{more}"

    def _drive(self) -> LogTable:
        given = self._description.trajectory
        if isinstance(given, GuessedTrajectory):
            given = self._guessed(given)
        table, notes = self._drive_of(given)
        self._notes += notes
        table, notes = only_fixes(self._tidy(table))
        self._notes += notes
        _plausible.check_seconds(table)
        _plausible.check_timeline(table)
        return table

    def _drive_of(self, given: TrajectoryInput) -> tuple[LogTable, list[str]]:
        """Return a trajectory as its format's reader gives it, and the reader's notes."""
        from gaia_uwb.logs import csv_map, trajectories

        path = self._path(given.file)
        match given:
            case RosTrajectory():
                log = self._ros(given)
                wanted = given.frames
                frames = None if wanted is None else Link(wanted.parent, wanted.child)
                table, notes = log.trajectory(given.topic, given.clock, frames), log.notes
            case NmeaTrajectory():
                table, notes = trajectories.read_nmea(
                    path, given.stamps, given.clock, given.checksums
                )
            case RtklibTrajectory():
                table, notes = trajectories.read_rtklib(path, given.clock)
            case KittiTrajectory():
                times = self._path(given.times)
                table, notes = trajectories.read_kitti(path, times, given.axes)
            case PlainTrajectory():
                read: Callable[[Path], tuple[LogTable, list[str]]]
                read = getattr(trajectories, f"read_{given.format}")
                table, notes = read(path)
            case CsvTrajectory():
                try:
                    table, notes = csv_map.read_trajectory(path, given.columns, given.stamps)
                except InputError as error:
                    raise _or_other_format(error, path) from error
        return table, notes

    def _guessed(self, given: GuessedTrajectory) -> TrajectoryInput:
        """Return the description of a trajectory whose file tells its format."""
        from gaia_uwb.logs.trajectories import guess_format

        found = guess_format(self._path(given.file))
        self._notes.append(f"{given.file}: read as {found}")
        trajectory = {"file": given.file, "format": found}
        return self._description.model_validate(
            {**dict(self._description), "trajectory": trajectory}
        ).trajectory

    def _ranges(self, drive_s: float) -> LogTable:
        """Return the ranges; a time of the drive dates stamps that lack a date or a year."""
        near_s = drive_s if drive_s > _DATED_S else None
        tables = []
        for given in self._description.ranges:
            tables.append(self._tidy(self._ranges_of(given, near_s)))
        return self._tidy(join(tables), merged=True)

    def _tidy(self, table: LogTable, *, merged: bool = False) -> LogTable:
        """Return the rows in the order of time, and remember what was noted and found."""
        tidied = tidy(table, merged=merged)
        if not merged:  # one file may hold both the trajectory and the ranges
            before = self._unused.get(table.path, table.unknown)
            self._unused[table.path] = tuple(name for name in before if name in table.unknown)
        self._notes += tidied.notes
        self._problems += tidied.problems
        return tidied.table

    def _ranges_of(
        self, given: RosRanges | CsvRanges | SerialRanges, near_s: float | None
    ) -> LogTable:
        from gaia_uwb.logs import csv_map
        from gaia_uwb.logs.serial import read_serial

        tags = self._description.tags if given.tag_id is None else {}
        match given:
            case RosRanges():
                log = self._ros(given)
                table = log.ranges(
                    given.topic,
                    given.fields,
                    given.clock,
                    where=given.where,
                    missing=given.missing,
                    tags=tags,
                )
                notes = log.notes
            case CsvRanges():
                path = self._path(given.file)
                table, notes = csv_map.read_ranges(
                    path,
                    given.columns,
                    given.stamps,
                    where=given.where,
                    missing=given.missing,
                    tags=tags,
                )
            case SerialRanges():
                table, notes = read_serial(
                    self._path(given.file),
                    given.format,
                    given.stamps,
                    where=given.where,
                    missing=given.missing,
                    near_s=near_s,
                    tags=tags,
                )
        self._notes += notes
        return table if given.tag_id is None else _of_one_tag(table, tag_text(given.tag_id))

    def _cones(self) -> Cones:
        """Return the ranges between cones."""
        from gaia_uwb.logs import csv_map

        given = self._description.cone_ranges
        if given is None:
            return Cones()
        table = csv_map.read_cone_ranges(self._path(given.file), given.columns, given.stamps)
        self._unused.setdefault(table.path, table.unknown)
        return cones_in(table)

    def _trajectory(self, drive: LogTable) -> tuple[LocalFrame | None, Trajectory]:
        """Return the local frame, if there is one, and the path of the tag's antenna.

        With ``tags``, it is the path that the log holds.
        """
        given: FrameInput | None = self._description.frame
        frame = LocalFrame(**dict(given)) if given else first_place(drive)
        places = to_places(drive, frame)
        trajectory = trajectory_of(drive, places)
        arm: LeverArm = self._description.lever_arm
        if arm.up_m and places.up_m is None:
            self._notes.append("lever_arm: up_m is ignored, as the trajectory has no heights")
        if arm == LeverArm():
            return frame, trajectory
        try:
            return frame, antenna_path(trajectory, **dict(arm))
        except InputError as error:
            raise drive.error(error.problem, column="lever_arm") from error

    def _ros(self, given: RosTrajectory | RosRanges) -> RosLog:
        """Return a ROS log; one that holds both trajectory and ranges is scanned once."""
        msg_dir = None if given.msg_dir is None else self._folder / given.msg_dir
        path = self._path(given.file)
        key = (path, given.msg_dir)
        if key not in self._logs:
            self._logs[key] = RosLog(path, msg_dir)
        return self._logs[key]

    def _path(self, name: str) -> Path:
        """Return a file that the description names."""
        return self._folder / name if self._shown is None else self._shown

    def _anchors_file(self, name: str) -> Path:
        path = self._path(name)
        if not path.is_file():
            raise InputError("no such file (anchors)", source=path)
        return path


def _of_one_tag(table: LogTable, tag_id: str) -> LogTable:
    """Return ranges as those of one tag."""
    columns = {**table.columns, "tag_id": np.zeros(len(table), np.int64)}
    return replace(table, columns=columns, labels={**table.labels, "tag_id": (tag_id,)})


def _or_other_format(error: InputError, path: Path) -> InputError:
    """Return what is wrong with a table, and which format the file has if it is none."""
    from gaia_uwb.logs.trajectories import guess_format

    try:
        found = guess_format(path)
    except InputError:
        return error
    is_table = found in {"tum", "euroc"} and not error.problem.startswith("missing")
    if is_table or found in {"csv", "ros"}:
        return error
    problem = f"{error.problem}; this is {found}: format: {found} reads it"
    return InputError(problem, source=error.source, row=error.row, column=error.column)
