"""The ranges of a ROS log: of one topic, or of one topic per anchor."""

from __future__ import annotations

from collections.abc import Callable, Container, Mapping, Sequence
from dataclasses import dataclass
from math import isfinite
from operator import itemgetter
from typing import Any

from gaia_uwb._shared import InputError, counted
from gaia_uwb.logs._lever_arm import TagInput, tag_of
from gaia_uwb.logs._logs import LogRows, LogTable, join
from gaia_uwb.logs._selection import Value, Wanted, as_text
from gaia_uwb.logs._tags import TagPlaces, several_tags, tags_present
from gaia_uwb.logs.bags import (
    BY_TOPIC,
    EndsError,
    FieldError,
    FieldMap,
    Fields,
    RangeFields,
    Reading,
    check_one_tag,
    choose_anchor,
    choose_tag,
    guess_ranges,
    hint_ranges,
    is_role,
    plain,
    resolve_ranges,
    values_of,
)
from gaia_uwb.logs.ros.times import Clock, MessageTimes
from gaia_uwb.logs.ros.topics import HOW, Topic, Topics
from gaia_uwb.logs.ros.trajectory import TRAJECTORIES

_LOOK_READINGS = 20_000
_ANCHOR_ROLE = 1  # of Nooploop's LinkTrack: 0 is a node, 1 an anchor, 2 a tag

Where = Mapping[str, Value | Sequence[Value]]
Seen = Mapping[tuple[str, ...], int]


@dataclass(frozen=True)
class Wish:
    """What a user wants of the ranges.

    Parameters
    ----------
    fields
        Which fields of the messages hold what; ``None`` guesses.
    clock
        Which time counts.
    where
        Field -> value that it must have, or one of several.
    missing
        Numbers that mean "no range", before they are scaled.
    tags
        Tag's id -> where it is on the vehicle, if that is given.
    """

    fields: FieldMap | None
    clock: Clock
    where: Where
    missing: Sequence[float]
    tags: Mapping[str, TagInput]


def read_ranges(log: Topics, topic: str | None, wish: Wish) -> LogTable:
    """Read the ranges, see :meth:`RosLog.ranges`."""
    names = [topic] if topic is not None else _choose(log, wish)
    return join([_Ranges(log, name, wish).read() for name in names])


def _choose(log: Topics, wish: Wish) -> list[str]:
    """Return the topics that hold ranges: one, or one per anchor where messages lack an id."""
    candidates: list[Topic] = []
    hints: dict[str, str] = {}
    undefined: InputError | None = None
    for topic in log.filled(log.all):
        channel = topic.channel
        if channel.msgtype in TRAJECTORIES:
            continue
        try:
            types = log.types.fields(channel)
            if wish.fields is not None:
                resolve_ranges(types, channel.msgtype, wish.fields)
            elif guess_ranges(types, channel.msgtype) is None:
                if hint := hint_ranges(types, channel.msgtype):
                    hints[channel.topic] = f"{channel.topic[:60]}: {hint}"
                continue
            candidates.append(topic)
        except FieldError:
            continue
        except InputError as error:
            undefined = undefined or error
    if not candidates and undefined is not None and not hints:
        raise undefined
    one_type = len({t.channel.msgtype for t in candidates}) == 1
    if wish.fields is not None and wish.fields.anchor == BY_TOPIC and one_type:
        return sorted({t.channel.topic for t in candidates})
    hint = "; ".join(list(hints.values())[:3]) or "set topic and fields"
    several = "if each is one anchor's, fields: {anchor: (topic), range: ...}" if one_type else ""
    return [log.choose(candidates, "ranges", hint=f"{hint} {HOW}", several=several)]


class _Ranges:
    """The ranges of one topic.

    Parameters
    ----------
    log, name, wish
        The log, the topic, and what is wanted of it.
    """

    def __init__(self, log: Topics, name: str, wish: Wish) -> None:
        self._log = log
        self._name = name
        self._wish = wish
        self._topics = log.named(name)
        self._msgtype = self._topics[0].channel.msgtype
        self._types: Fields = log.types.fields(self._topics[0].channel)
        self._where = dict(wish.where)

    def read(self) -> LogTable:
        """Return their table."""
        fields = self._guess() if self._wish.fields is None else self._wish.fields
        resolved = self._resolve(self._with_tag_of_where(fields))
        if resolved.parties:
            resolved = self._resolve(self._look(resolved))
        fields, n_no_range = resolved.fields, 0
        powers = [("rssi_dbm", fields.rssi), ("rssi_fp_dbm", fields.rssi_fp)]
        columns = ["range_m", *(column for column, path in powers if path)]
        pick = _picker([1, *(k for k, (_, path) in enumerate(powers, 2) if path)])
        row_word, tagged = f"topic {self._name}, message", resolved.tag is not None
        rows = LogRows(self._log.path, ("t_s", *columns), row_word, tagged=tagged)

        def add(number: int, message: Any, t_s: float) -> None:
            nonlocal n_no_range
            for reading in resolved.readings(message, self._name):
                if isfinite(reading.range_m) and reading.anchor_id:
                    rows.add(number, (t_s, *pick(reading)), reading.anchor_id, reading.tag_id)
                else:
                    n_no_range += 1

        times = MessageTimes(self._name, self._wish.clock, fields.stamp)
        self._log.read(self._topics, times, add)
        if not len(rows):
            raise self._nothing(resolved, times)
        table = rows.table()
        self._check(resolved, table)
        self._note(resolved, n_no_range)
        return self._log.timed(table, times)

    def _guess(self) -> FieldMap:
        found = guess_ranges(self._types, self._msgtype)
        if found is None:
            there = ", ".join(name for name, _ in self._types[self._msgtype][1])
            hint = hint_ranges(self._types, self._msgtype) or "set fields"
            problem = f"no range and id found: {hint}; available: {there[:200]}"
            raise self._log.error(self._name, problem)
        return found

    def _resolve(self, fields: FieldMap) -> RangeFields:
        wanted, missing = Wanted(self._where), self._wish.missing
        try:
            return resolve_ranges(self._types, self._msgtype, fields, wanted, missing)
        except FieldError as error:
            raise self._log.error(self._name, str(error)) from error

    def _is_tag(self, text: str) -> bool:
        return tag_of(text, self._wish.tags) is not None

    def _with_tag_of_where(self, fields: FieldMap) -> FieldMap:
        """Return the fields, where the tag's is one that ``where`` chooses by."""
        if fields.tag is not None or not self._wish.tags:
            return fields
        for name, value in self._where.items():
            values = [value] if isinstance(value, Value) else value
            seen: Seen = {(as_text(each),): 1 for each in values}
            if name != fields.anchor and choose_tag([name], seen, self._is_tag):
                return fields.model_copy(update={"tag": name})
        return fields

    def _look(self, resolved: RangeFields) -> FieldMap:
        """Return the fields, where those of a guess are decided by the ids in the first readings.

        Of a LinkTrack's nodes the anchors are kept where there are others.
        """

        def add(number: int, message: Any, t_s: float) -> bool:
            for _ in resolved.readings(message, self._name):
                pass
            return resolved.n_read >= _LOOK_READINGS

        self._log.read(self._topics, MessageTimes(self._name, "receive"), add)
        fields = resolved.fields
        seen: Seen = resolved.seen
        names = [fields.anchor, *(party.name for party in resolved.parties)]
        role = next((k for k, name in enumerate(names) if is_role(name)), None)
        if role is not None and "linktrack" in plain(self._msgtype):
            roles = values_of(seen, role)
            if len(roles) > 1 and str(_ANCHOR_ROLE) in roles and names[role] not in self._where:
                self._where[names[role]] = _ANCHOR_ROLE
        fixed = self._wish.fields is not None or fields.anchor.startswith("(")
        if self._wish.tags and fields.tag is None:
            first = 1 if fixed else 0
            tag = choose_tag(names[first:], _without(seen, range(first)), self._is_tag)
            if tag is not None:
                fields = fields.model_copy(update={"tag": tag})
                seen = _without(seen, [names.index(tag)])
                names.remove(tag)
        if fixed or not seen:
            return fields
        try:
            return fields.model_copy(update={"anchor": choose_anchor(names, seen)})
        except EndsError as error:
            raise self._log.error(self._name, f"{error} {HOW}") from error

    def _check(self, resolved: RangeFields, table: LogTable) -> None:
        """Refuse the ranges of several tags of which it is not given where they are."""
        if resolved.tag is not None and not self._wish.tags:
            tags = tags_present(table)
            if len(tags) > 1:
                problem = several_tags(tags, TagPlaces({}), resolved.tag.name)
                raise self._log.error(self._name, problem)
        names = [party.name for party in resolved.parties]
        try:
            check_one_tag(resolved.fields.anchor, names, resolved.seen)
        except EndsError as error:
            raise self._log.error(self._name, f"{error} {HOW}") from error

    def _nothing(self, resolved: RangeFields, times: MessageTimes) -> InputError:
        """Return the error that says why there are no ranges."""
        if times.n_unset:
            return self._log.never_set(self._name)
        why = ""
        if resolved.n_left_out:
            why = f": where leaves out all {resolved.n_left_out:,} readings"
        elif resolved.n_missing:
            why = f": all {resolved.n_missing:,} readings stand for no range"
        return self._log.error(self._name, f"contains no ranges{why}")

    def _note(self, resolved: RangeFields, n_no_range: int) -> None:
        """Note what was taken and what was left out."""
        fields = resolved.fields
        each = "" if fields.each is None else f"{fields.each}."
        anchor = fields.anchor if fields.anchor.startswith("(") else f"{each}{fields.anchor}"
        taken = f"{self._name}: anchor: {anchor}, range: {each}{fields.range}"
        taken += "" if fields.scale == 1 else f" x {fields.scale:g}"
        taken += "" if fields.tag is None else f", tag: {fields.tag}"
        for k, party in enumerate(resolved.parties, 1):
            values = list(values_of(resolved.seen, k))
            taken += f", {party.name} is always {values[0][:40]}" if len(values) == 1 else ""
        self._log.note(f"ranges: {taken}")
        chosen = ", ".join(f"{field} {value}" for field, value in self._where.items())[:100]
        missing = ", ".join(f"{value:g}" for value in resolved.missing)[:80]
        for count, what in (
            (n_no_range, "without a range"),
            (resolved.n_left_out, f"other than of {chosen}"),
            (resolved.n_missing, f"of {missing}, which stand for no range"),
        ):
            if count:
                self._log.note(f"{self._name}: skipped {counted(count, 'reading')} {what}")


def _without(seen: Mapping[tuple[str, ...], int], places: Container[int]) -> Seen:
    """Return values of ids without those at some places."""
    kept: dict[tuple[str, ...], int] = {}
    for key, count in seen.items():
        rest = tuple(value for place, value in enumerate(key) if place not in places)
        kept[rest] = kept.get(rest, 0) + count
    return kept


def _picker(places: list[int]) -> Callable[[Reading], tuple[float, ...]]:
    """Return the function that takes the values at some places."""
    if len(places) == 1:
        return lambda reading: (reading.range_m,)
    return itemgetter(*places)
