"""The topics of a ROS log: which there are, and their messages one by one."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

from gaia_uwb._shared import InputError
from gaia_uwb.logs._logs import LogTable
from gaia_uwb.logs.bags import (
    Bag,
    Channel,
    FieldError,
    Types,
    is_packed,
    open_log,
    scan,
    unpack_message,
    walk,
)
from gaia_uwb.logs.ros.times import MessageTimes

HOW = "in gaia.yaml (docs/inputs.md)"
"""Where a user sets what cannot be guessed."""

_LONGEST_PAUSE_S = 60.0

Add = Callable[[int, Any, float], "bool | None"]
"""Takes a message's number, the message and its time in seconds; returns whether to stop."""


class Topic(NamedTuple):
    """A channel in one of the log's files."""

    bag: Bag
    channel: Channel


@dataclass
class Topics:
    """The files of one log, and what is in them.

    Parameters
    ----------
    path, msg_dir, notes
        Like those of :class:`RosLog`.
    """

    path: Path
    msg_dir: Path | None
    notes: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.types = Types(self.path, self.msg_dir)
        self._bags, self._listed = open_log(self.path)
        self.all: list[Topic] = []
        for bag in self._bags:
            scan(bag)
            self.all += [Topic(bag, channel) for channel in bag.channels.values()]

    def named(self, name: str) -> list[Topic]:
        """Return the channels of a topic, one of each file.

        Raises
        ------
        InputError
            If there are none, or of several types.
        """
        topics = [t for t in self.all if t.channel.topic == name]
        if not topics:
            problem = f"has no topic {name[:100]}; available: {self._listed_topics(self.all)}"
            raise InputError(problem, source=self.path)
        if len({t.channel.msgtype for t in topics}) > 1:
            raise self.error(name, "has messages of several types")
        return topics

    def filled(self, candidates: Iterable[Topic]) -> list[Topic]:
        """Return the topics that have messages; all of them, if none has."""
        some = list(candidates)
        return [t for t in some if has_messages(t)] or some

    def choose(
        self, candidates: Iterable[Topic], what: str, *, hint: str = "", several: str = ""
    ) -> str:
        """Return the only candidate's name.

        Parameters
        ----------
        candidates
            Channels that fit.
        what
            What they would be.
        hint, several
            What to do if there is none, and what else may be done if there are several.

        Raises
        ------
        InputError
            If there are none or several.
        """
        filled = self.filled(candidates)
        names = list(dict.fromkeys(t.channel.topic for t in filled))
        if len(names) == 1:
            return names[0]
        if names:
            problem = f"{len(names)} topics could be the {what}: {self._listed_topics(filled)}; "
            problem += f"choose one with topic {HOW}"
            problem += f"; {several}" if several else ""
        else:
            problem = f"no topic looks like the {what}; available: {self._listed_topics(self.all)}"
            problem += f"; {hint}" if hint else ""
        raise InputError(problem, source=self.path)

    def read(self, topics: Sequence[Topic], times: MessageTimes, add: Add) -> None:
        """Give each message of a topic, with its number and time, to a function.

        Raises
        ------
        InputError
            If one cannot be read: the message names it.
        """
        number, end_s = 0, None
        for bag in {id(t.bag): t.bag for t in topics}.values():
            mine = [t for t in topics if t.bag is bag]
            readers = {t.channel.key: self.types.reader(t.channel) for t in mine}
            stamps = {t.channel.key: self._stamp(t, times) for t in mine}
            for message in walk(bag, set(readers)):
                number += 1
                try:
                    channel, time_ns, data = message
                    if is_packed(message):
                        data = unpack_message(data)
                        bag.spend(len(data))
                    content = readers[channel.key](data)
                    received_s, stamp = time_ns * 1e-9, stamps[channel.key]
                    t_s = received_s if stamp is None else stamp(content)
                    if end_s is not None:
                        self._note_pause(bag, received_s - end_s)
                        end_s = None
                    if stamp is not None and not times.check(number, t_s, received_s):
                        continue
                    if add(number, content, t_s):
                        return
                except InputError:
                    raise
                except Exception as error:  # a damaged message may upset rosbags in any way
                    reason = " ".join(str(error).split())[:160] or type(error).__name__
                    topic = message.channel.topic
                    raise self.error(topic, f"cannot be read: {reason}", number) from error
            end_s = received_s if number else None
            self._note_file(bag)

    def timed(self, table: LogTable, times: MessageTimes) -> LogTable:
        """Return the rows of a table whose clock was set, and note what the clock did.

        Raises
        ------
        InputError
            If there are none.
        """
        kept = times.were_set(table["t_s"])
        for note in times.notes():
            self.note(note)
        return table if kept.all() else table.take(kept)

    def note(self, text: str) -> None:
        """Remember a note, once."""
        self.notes += [] if text in self.notes else [text]

    def never_set(self, name: str) -> InputError:
        """Return the error for a topic all of whose headers have the time 0."""
        problem = "its header has the time 0, so it was never set: use clock: receive"
        return self.error(name, problem, 1)

    def error(self, topic: str, problem: str, number: int | None = None) -> InputError:
        """Return the error that names a topic, and a message."""
        message = "" if number is None else f", message {number}"
        return InputError(problem, source=f"{self.path}, topic {topic[:100]}{message}")

    def _stamp(self, topic: Topic, times: MessageTimes) -> Callable[[Any], float] | None:
        try:
            return times.of(self.types.fields(topic.channel), topic.channel)
        except FieldError as error:
            raise self.error(topic.channel.topic, str(error)) from error

    def _note_pause(self, bag: Bag, pause_s: float) -> None:
        """Note where files that only their names make parts of one recording lie far apart."""
        if not self._listed and abs(pause_s) > _LONGEST_PAUSE_S:
            self.note(
                f"{bag.path.name}: starts {pause_s:,.0f} s after the file before it ends; another "
                "recording belongs into another folder"
            )

    def _note_file(self, bag: Bag) -> None:
        for note in (*bag.notes, *self.types.notes):
            self.note(note)
        if bag.cut_off_at is not None:
            at = f"at byte {bag.cut_off_at}"
            self.note(f"{bag.path.name}: cut off within a record {at}, read up to there")

    def _listed_topics(self, topics: Sequence[Topic]) -> str:
        some = dict.fromkeys(_describe(topic) for topic in topics)
        return ", ".join(list(some)[:20]) or "none"


def has_messages(topic: Topic) -> bool:
    """Tell whether a topic has messages, as far as the file says so."""
    counts = topic.bag.counts
    return not counts or counts.get(topic.channel.key, 0) > 0


def _describe(topic: Topic) -> str:
    return f"{topic.channel.topic[:60]} ({topic.channel.msgtype[:60]})"
