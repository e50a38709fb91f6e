"""The trajectory of a ROS log: positions of one topic, or of a frame in ``/tf``."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import isfinite
from typing import Any

import numpy as np

from gaia_uwb._shared import counted
from gaia_uwb.logs._logs import LogRows, LogTable
from gaia_uwb.logs.bags import Link, Transforms, getter
from gaia_uwb.logs.ros.attitude import attitude
from gaia_uwb.logs.ros.times import Clock, MessageTimes, seconds_of
from gaia_uwb.logs.ros.topics import HOW, Topic, Topics, has_messages

_EARTH = ("sensor_msgs/msg/NavSatFix",)
_PLACES = {
    "nav_msgs/msg/Odometry": "pose.pose.position",
    "geometry_msgs/msg/PoseStamped": "pose.position",
    "geometry_msgs/msg/PoseWithCovarianceStamped": "pose.pose.position",
    "geometry_msgs/msg/PointStamped": "point",
    "geometry_msgs/msg/TransformStamped": "transform.translation",
}
_TURNS = {
    "nav_msgs/msg/Odometry": "pose.pose.orientation",
    "geometry_msgs/msg/PoseStamped": "pose.orientation",
    "geometry_msgs/msg/PoseWithCovarianceStamped": "pose.pose.orientation",
    "geometry_msgs/msg/TransformStamped": "transform.rotation",
}
_TURN = ("qx", "qy", "qz", "qw")
_TRANSFORMS = ("tf2_msgs/msg/TFMessage", "tf/msg/tfMessage")
_STATIC = "_static"
_ABSURD_M = 1e9

TRAJECTORIES = (*_EARTH, *_PLACES, *_TRANSFORMS)
"""The types of messages that can be a trajectory."""


@dataclass
class _Skipped:
    """Messages without anything usable."""

    n_no_fix: int = 0
    n_no_height: int = 0


def read_trajectory(log: Topics, topic: str | None, clock: Clock, frames: Link | None) -> LogTable:
    """Read the trajectory, see :meth:`RosLog.trajectory`."""
    name = _choose(log, frames) if topic is None else topic
    topics = log.named(name)
    msgtype = topics[0].channel.msgtype
    if msgtype in _TRANSFORMS:
        return _read_transforms(log, topics, clock, frames)
    if msgtype not in TRAJECTORIES:
        raise log.error(name, f"has the type {msgtype[:100]}; {_known()}")
    if frames is not None:
        raise log.error(name, f"has no frames to choose from: it has the type {msgtype[:100]}")
    return _read_positions(log, topics, clock)


def _choose(log: Topics, frames: Link | None) -> str:
    """Return the name of the topic that holds the trajectory; ``/tf`` if no other does."""
    trees = [t for t in log.all if t.channel.msgtype in _TRANSFORMS]
    trees = [t for t in trees if not t.channel.topic.endswith(_STATIC)]
    fitting = [t for t in log.all if t.channel.msgtype in {*_EARTH, *_PLACES}]
    if trees and (frames is not None or not any(map(has_messages, fitting))):
        fitting = trees
    return log.choose(fitting, "trajectory", hint=_known())


def _known() -> str:
    names = dict.fromkeys(msgtype.split("/")[-1] for msgtype in TRAJECTORIES[:-1])
    return f"a trajectory is one of {', '.join(names)}"


def _read_positions(log: Topics, topics: Sequence[Topic], clock: Clock) -> LogTable:
    """Read messages with one position each."""
    name, msgtype = topics[0].channel.topic, topics[0].channel.msgtype
    on_earth = msgtype in _EARTH
    places = ("lat", "lon", "alt_m") if on_earth else ("east_m", "north_m", "up_m")
    turns = msgtype in _TURNS
    columns = ("t_s", *places, *(_TURN if turns else ()))
    rows = LogRows(log.path, columns, f"topic {name}, message")
    skipped, times = _Skipped(), MessageTimes(name, clock)
    place = None if on_earth else getter(_PLACES[msgtype])
    turn = getter(_TURNS[msgtype]) if turns else None

    def add(number: int, message: Any, t_s: float) -> None:
        values = _fix(message) if place is None else _xyz(place(message))
        if values is None or not (isfinite(values[0]) and isfinite(values[1])):
            skipped.n_no_fix += 1
            return
        skipped.n_no_height += not isfinite(values[2])
        rows.add(number, (t_s, *values, *(() if turn is None else _xyzw(turn(message)))))

    log.read(topics, times, add)
    log.note(f"trajectory: {name} ({msgtype.split('/')[-1]})")
    if not len(rows):
        if times.n_unset:
            raise log.never_set(name)
        why = "no message has a fix" if skipped.n_no_fix else "there are no messages"
        raise log.error(name, f"contains no positions: {why}")
    table = _with_attitude(log, name, rows.table()) if turns else rows.table()
    if skipped.n_no_fix:
        log.note(f"{name}: skipped {counted(skipped.n_no_fix, 'message')} without a fix")
    if skipped.n_no_height:
        positions = counted(skipped.n_no_height, "position")
        log.note(f"{name}: heights ignored, as {positions} had none")
        kept = {k: v for k, v in table.columns.items() if k not in {"alt_m", "up_m"}}
        table = replace(table, columns=kept)
    return log.timed(table, times)


def _with_attitude(log: Topics, name: str, table: LogTable) -> LogTable:
    """Return a table with heading, roll and pitch in the place of quaternions."""
    found = attitude(np.column_stack([table[column] for column in _TURN]))
    if found:
        log.note(f"{name}: heading, roll and pitch from the orientation")
    kept = {key: values for key, values in table.columns.items() if key not in _TURN}
    return replace(table, columns={**kept, **found})


def _read_transforms(
    log: Topics, topics: Sequence[Topic], clock: Clock, frames: Link | None
) -> LogTable:
    """Read where a frame moved in another; fixed links may stand in a topic of their own."""
    name = topics[0].channel.topic
    tree, skipped = Transforms(), _Skipped()
    times, received = MessageTimes(name, clock), MessageTimes(name, "receive")

    def add(number: int, message: Any, t_s: float, *, fixed: bool = False) -> None:
        for each in message.transforms:
            by_header = clock != "receive" and not fixed
            own_s = seconds_of(each.header.stamp) if by_header else t_s
            shift, turn = each.transform.translation, each.transform.rotation
            place, quaternion = _xyz(shift), (turn.x, turn.y, turn.z, turn.w)
            if not _is_pose(place, quaternion):
                skipped.n_no_fix += 1
            elif not by_header or times.is_set(own_s):
                link = Link(each.header.frame_id, each.child_frame_id)
                tree.add(number, link, (own_s, *place, *quaternion))

    def add_fixed(number: int, message: Any, t_s: float) -> None:
        add(number, message, t_s, fixed=True)

    fixed = [t for t in log.all if t.channel.topic == name + _STATIC]
    log.read(topics, received, add)
    log.read([t for t in fixed if t.channel.msgtype in _TRANSFORMS], received, add_fixed)
    found = tree.guess() if frames is None else frames
    path = None if found is None else tree.path(found)
    if found is None or path is None:
        if times.n_unset and not tree.moving():
            raise log.never_set(name)
        problem = "it is not clear which frame moved in which"
        if frames is not None:
            problem = f"no chain of frames leads from {frames.parent[:60]} to {frames.child[:60]}"
        how = f"set frames: {{parent: ..., child: ...}} {HOW}"
        raise log.error(name, f"{problem}: {how}; available: {tree.listed()}")
    rows, numbers = path
    if not len(rows):
        raise log.error(name, "contains no positions: its frames have no times in common")
    log.note(f"trajectory: {name}, frame {found.child[:60]} in {found.parent[:60]}")
    if skipped.n_no_fix:
        log.note(f"{name}: skipped {counted(skipped.n_no_fix, 'transform')} that are no pose")
    table = LogTable(
        path=log.path,
        columns=dict(zip(("t_s", "east_m", "north_m", "up_m"), rows.T, strict=True)),
        labels={},
        unknown=(),
        number=numbers,
        origin=np.zeros(len(rows), np.int64),
        origins=(f"{log.path}, topic {name}, message",),
    )
    return log.timed(table, times)


def _is_pose(place: tuple[float, ...], quaternion: tuple[float, ...]) -> bool:
    """Tell whether numbers can be a place on Earth and a turn."""
    return all(abs(x) < _ABSURD_M for x in place) and all(abs(x) <= 1.1 for x in quaternion)


def _fix(message: Any) -> tuple[float, float, float] | None:
    """Return a NavSatFix's latitude, longitude (degrees) and height (metres), if it has a fix."""
    if message.status.status < 0:
        return None
    return message.latitude, message.longitude, message.altitude


def _xyz(place: Any) -> tuple[float, float, float]:
    return place.x, place.y, place.z


def _xyzw(turn: Any) -> tuple[float, float, float, float]:
    return turn.x, turn.y, turn.z, turn.w
