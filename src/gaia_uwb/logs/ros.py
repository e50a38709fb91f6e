"""ROS logs without ROS: bags, MCAP, and ROS 2's folders and databases.

A topic that is not named is found by its type (trajectory) or its fields (ranges). More than one
candidate is an error that lists them; nothing is chosen silently.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from math import isfinite
from operator import itemgetter
from pathlib import Path
from typing import Any, Literal, NamedTuple

from gaia_uwb._shared import InputError, counted
from gaia_uwb.logs._logs import LogRows, LogTable, join
from gaia_uwb.logs.bags import (
    BY_TOPIC,
    Bag,
    Channel,
    FieldError,
    FieldMap,
    Fields,
    Reading,
    Types,
    find_field,
    getter,
    guess_ranges,
    open_log,
    resolve_ranges,
    scan,
    unpack_message,
    walk,
)

Clock = Literal["auto", "header", "receive"]
"""Which time counts, the header's or the recording's; ``auto``: the header's if present."""

_EARTH = ("sensor_msgs/msg/NavSatFix",)
_PLACES = {
    "nav_msgs/msg/Odometry": "pose.pose.position",
    "geometry_msgs/msg/PoseStamped": "pose.position",
    "geometry_msgs/msg/PoseWithCovarianceStamped": "pose.pose.position",
    "geometry_msgs/msg/PointStamped": "point",
    "geometry_msgs/msg/TransformStamped": "transform.translation",
}

_Add = Callable[[int, Any, float], None]
"""Takes a message's number, the message and its time in seconds; appends what is in it."""

_Seconds = Callable[[Any], float]
"""From a message to its own time in seconds."""


class _Topic(NamedTuple):
    """A channel in one of the log's files."""

    bag: Bag
    channel: Channel


@dataclass
class _Skipped:
    """Messages without anything usable."""

    n_no_fix: int = 0
    n_no_range: int = 0
    n_no_height: int = 0


@dataclass
class RosLog:
    """A ROS log: one file, or the folder of a ROS 2 recording.

    Parameters
    ----------
    path
        A ``.bag``, ``.mcap`` or ``.db3`` file, or a folder with ``metadata.yaml``.
    msg_dir
        Folder with the ``.msg`` files of types that the log lacks.

    Raises
    ------
    InputError
        If it cannot be read.
    ConfigError
        If rosbags is not installed.
    """

    path: Path
    msg_dir: Path | None = None
    notes: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        self._types = Types(self.path, self.msg_dir)
        self._bags, self._packed = open_log(self.path)
        self._topics: list[_Topic] = []
        for bag in self._bags:
            scan(bag)
            self._topics += [_Topic(bag, channel) for channel in bag.channels.values()]

    def trajectory(self, topic: str | None = None, clock: Clock = "auto") -> LogTable:
        """Read the trajectory.

        Parameters
        ----------
        topic
            Which; ``None`` uses the only one of a fitting type.
        clock
            Which time counts.

        Returns
        -------
        LogTable
            ``t_s`` in seconds and ``lat``, ``lon`` in degrees with ``alt_m`` in metres, or
            ``east_m``, ``north_m``, ``up_m`` in metres.

        Raises
        ------
        InputError
            If there is no such topic, more than one, or a message that cannot be read.
        """
        fitting = [t for t in self._topics if t.channel.msgtype in {*_EARTH, *_PLACES}]
        name = self._choose(fitting, "trajectory") if topic is None else topic
        topics = self._named(name)
        msgtype = topics[0].channel.msgtype
        if msgtype not in {*_EARTH, *_PLACES}:
            known = ", ".join(t.split("/")[-1] for t in (*_EARTH, *_PLACES))
            problem = f"has the type {msgtype[:100]}; a trajectory is one of {known}"
            raise self._error(name, problem)
        on_earth = msgtype in _EARTH
        places = ("lat", "lon", "alt_m") if on_earth else ("east_m", "north_m", "up_m")
        rows = LogRows(self.path, ("t_s", *places), f"topic {name}, message")
        skipped = _Skipped()
        place = None if on_earth else getter(_PLACES[msgtype])

        def add(number: int, message: Any, t_s: float) -> None:
            values = _fix(message) if place is None else _xyz(place(message))
            if values is None or not (isfinite(values[0]) and isfinite(values[1])):
                skipped.n_no_fix += 1
                return
            skipped.n_no_height += not isfinite(values[2])
            rows.add(number, (t_s, *values))

        self._read(topics, clock, None, add)
        return self._drive(rows, skipped, name)

    def ranges(
        self, topic: str | None = None, fields: FieldMap | None = None, clock: Clock = "auto"
    ) -> LogTable:
        """Read the ranges.

        Parameters
        ----------
        topic
            Which; ``None`` uses the only one with an id and a range among its fields.
        fields
            Which fields of the messages hold what; ``None`` guesses.
        clock
            Which time counts.

        Returns
        -------
        LogTable
            ``t_s`` in seconds, ``anchor_id``, ``range_m`` in metres, and ``rssi_dbm`` and
            ``rssi_fp_dbm`` in dBm where the messages have them.

        Raises
        ------
        InputError
            If there is no such topic, more than one, or a message that cannot be read.
        """
        names = [topic] if topic is not None else self._choose_ranges(fields)
        tables = [self._ranges_of(name, fields, clock) for name in names]
        if len(tables) > 1:
            self.notes.append(f"{self.path.name}: ranges from {', '.join(names)[:200]}")
        return join(tables)

    def _ranges_of(self, name: str, fields: FieldMap | None, clock: Clock) -> LogTable:
        topics = self._named(name)
        channel = topics[0].channel
        types = self._types.fields(channel)
        found = guess_ranges(types, channel.msgtype) if fields is None else fields
        if found is None:
            there = ", ".join(field_name for field_name, _ in types[channel.msgtype][1])
            raise self._error(name, f"no range and id found: set fields; available: {there[:200]}")
        try:
            getters = resolve_ranges(types, channel.msgtype, found)
        except FieldError as error:
            raise self._error(name, str(error)) from error
        powers = [("rssi_dbm", found.rssi), ("rssi_fp_dbm", found.rssi_fp)]
        columns = ["range_m", *(column for column, path in powers if path)]
        pick = _picker([1, *(k for k, (_, path) in enumerate(powers, 2) if path)])
        rows = LogRows(self.path, ("t_s", *columns), f"topic {name}, message")
        skipped = _Skipped()

        def add(number: int, message: Any, t_s: float) -> None:
            for reading in getters.readings(message, name):
                if isfinite(reading.range_m) and reading.anchor_id:
                    rows.add(number, (t_s, *pick(reading)), reading.anchor_id)
                else:
                    skipped.n_no_range += 1

        self._read(topics, clock, found.stamp, add)
        if not len(rows):
            raise self._error(name, "contains no ranges")
        if skipped.n_no_range:
            readings = counted(skipped.n_no_range, "reading")
            self.notes.append(f"{name}: skipped {readings} without a range")
        return rows.table()

    def _read(self, topics: list[_Topic], clock: Clock, stamp: str | None, add: _Add) -> None:
        """Give each message of a topic, with its number and time, to a function."""
        number = 0
        for bag in dict.fromkeys(id(t.bag) for t in topics):
            mine = [t for t in topics if id(t.bag) == bag]
            readers = {t.channel.key: self._types.reader(t.channel) for t in mine}
            stamps = {t.channel.key: self._stamp(t.channel, clock, stamp) for t in mine}
            for message in walk(mine[0].bag, set(readers)):
                number += 1
                try:
                    channel, time_ns, data = message
                    if self._packed:
                        data = unpack_message(data)
                        mine[0].bag.spend(len(data))
                    content = readers[channel.key](data)
                    seconds = stamps[channel.key]
                    t_s = time_ns * 1e-9 if seconds is None else seconds(content)
                    add(number, content, t_s)
                except InputError:
                    raise
                except Exception as error:  # a damaged message may upset rosbags in any way
                    reason = " ".join(str(error).split())[:160] or type(error).__name__
                    topic = message.channel.topic
                    raise self._error(topic, f"cannot be read: {reason}", number) from error
            self._note_cut_off(mine[0].bag)

    def _note_cut_off(self, bag: Bag) -> None:
        note = (
            f"{bag.path.name}: cut off within a record at byte {bag.cut_off_at}, read up to there"
        )
        if bag.cut_off_at is not None and note not in self.notes:
            self.notes.append(note)

    def _stamp(self, channel: Channel, clock: Clock, path: str | None) -> _Seconds | None:
        """Return the function to a message's own time; ``None`` for that of its recording."""
        if clock == "receive":
            return None
        types: Fields = self._types.fields(channel)
        wanted = path or "header.stamp"
        try:
            kind, content = find_field(types, channel.msgtype, wanted)
        except FieldError as error:
            if path is None and clock == "auto":
                note = f"{channel.topic}: no header, so the time of recording is used"
                self.notes += [] if note in self.notes else [note]
                return None
            raise self._error(channel.topic, f"{error}; clock: receive does without it") from error
        if kind in (3, 4) or (kind == 2 and content != "builtin_interfaces/msg/Time"):
            raise self._error(channel.topic, f"{wanted} is not a time")
        get = getter(wanted)
        if kind == 2:
            return lambda message: _seconds(get(message))
        return lambda message: float(get(message))

    def _choose(self, candidates: list[_Topic], what: str) -> str:
        """Return the only candidate's name."""
        filled = [t for t in candidates if t.bag.counts.get(t.channel.key, 1)] or candidates
        names = list(dict.fromkeys(t.channel.topic for t in filled))
        if len(names) == 1:
            return names[0]
        listed = ", ".join(_describe(t) for t in (filled or self._topics)[:20])
        if names:
            problem = f"{len(names)} topics could be the {what}: {listed}; choose one with topic"
        else:
            problem = f"no topic looks like the {what}; available: {listed or 'none'}"
        raise InputError(f"{problem} in gaia.yaml (docs/inputs.md)", source=self.path)

    def _choose_ranges(self, fields: FieldMap | None) -> list[str]:
        """Return the topics that hold ranges: one, or one per anchor where messages lack an id."""
        candidates, undefined = [], None
        for topic in self._topics:
            if topic.channel.msgtype in {*_EARTH, *_PLACES}:
                continue
            try:
                types = self._types.fields(topic.channel)
                if fields is not None:
                    resolve_ranges(types, topic.channel.msgtype, fields)
                elif guess_ranges(types, topic.channel.msgtype) is None:
                    continue
                candidates.append(topic)
            except FieldError:
                continue
            except InputError as error:
                undefined = undefined or error
        if not candidates and undefined is not None:
            raise undefined
        by_topic = fields is not None and fields.anchor == BY_TOPIC
        if by_topic and len({t.channel.msgtype for t in candidates}) == 1:
            return sorted({t.channel.topic for t in candidates})
        return [self._choose(candidates, "ranges")]

    def _named(self, name: str) -> list[_Topic]:
        topics = [t for t in self._topics if t.channel.topic == name]
        if not topics:
            there = ", ".join(_describe(t) for t in self._topics[:20]) or "none"
            raise InputError(f"has no topic {name[:100]}; available: {there}", source=self.path)
        if len({t.channel.msgtype for t in topics}) > 1:
            raise self._error(name, "has messages of several types")
        return topics

    def _drive(self, rows: LogRows, skipped: _Skipped, name: str) -> LogTable:
        if not len(rows):
            why = "no message has a fix" if skipped.n_no_fix else "there are no messages"
            raise self._error(name, f"contains no positions: {why}")
        if skipped.n_no_fix:
            messages = counted(skipped.n_no_fix, "message")
            self.notes.append(f"{name}: skipped {messages} without a fix")
        table = rows.table()
        if skipped.n_no_height:
            positions = counted(skipped.n_no_height, "position")
            self.notes.append(f"{name}: heights ignored, as {positions} had none")
            kept = {k: v for k, v in table.columns.items() if k not in {"alt_m", "up_m"}}
            table = replace(table, columns=kept)
        return table

    def _error(self, topic: str, problem: str, number: int | None = None) -> InputError:
        message = "" if number is None else f", message {number}"
        return InputError(problem, source=f"{self.path}, topic {topic[:100]}{message}")


def _describe(topic: _Topic) -> str:
    return f"{topic.channel.topic[:60]} ({topic.channel.msgtype[:60]})"


def _picker(places: list[int]) -> Callable[[Reading], tuple[float, ...]]:
    """Return the function that takes the values at some places."""
    if len(places) == 1:
        return lambda reading: (reading.range_m,)
    return itemgetter(*places)


def _seconds(stamp: Any) -> float:
    """Return a ROS time in seconds."""
    t_s: float = stamp.sec + 1e-9 * stamp.nanosec
    if not t_s:
        raise ValueError("its header has the time 0, so it was never set: use clock: receive")
    return t_s


def _fix(message: Any) -> tuple[float, float, float] | None:
    """Return a NavSatFix's latitude, longitude (degrees) and height (metres), if it has a fix."""
    if message.status.status < 0:
        return None
    return message.latitude, message.longitude, message.altitude


def _xyz(place: Any) -> tuple[float, float, float]:
    return place.x, place.y, place.z
