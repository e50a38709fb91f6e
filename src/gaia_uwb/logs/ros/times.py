"""The times of a topic's messages: the header's, or the recording's."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Literal

import numpy as np

from gaia_uwb._shared import Array, Bool, Float64, counted
from gaia_uwb.logs.bags import Channel, FieldError, Fields, find_field, getter

Clock = Literal["auto", "header", "receive"]
"""Which time counts, the header's or the recording's; ``auto``: the header's if present."""

_TIME = "builtin_interfaces/msg/Time"
_SET_S = 946_684_800.0  # 2000: a clock that shows less was not set yet
_BACK_S, _AHEAD_S = 1.0, 5.0


def seconds_of(stamp: Any) -> float:
    """Return a ROS time in seconds."""
    t_s: float = stamp.sec + 1e-9 * stamp.nanosec
    return t_s


class MessageTimes:
    """Reads the times of one topic's messages in their order, and watches the header's clock.

    Parameters
    ----------
    topic
        Its name.
    clock
        Which time counts.
    path
        Field of the time, if that is not ``header.stamp``.
    """

    def __init__(self, topic: str, clock: Clock, path: str | None = None) -> None:
        self._topic = topic
        self._clock = clock
        self._path = path
        self._n_unset = 0
        self._last: tuple[float, float] | None = None
        self._n_jumps = 0
        self._first_jump = (0, 0.0)
        self._notes: dict[str, None] = {}

    def of(self, types: Fields, channel: Channel) -> Callable[[Any], float] | None:
        """Return the function to a message's own time; ``None`` for that of its recording.

        Raises
        ------
        FieldError
            If there is no such time.
        """
        if self._clock == "receive":
            return None
        wanted = self._path or "header.stamp"
        try:
            kind, content = find_field(types, channel.msgtype, wanted)
        except FieldError as error:
            if self._path is None and self._clock == "auto":
                self._notes[f"{self._topic}: no header, so the time of recording is used"] = None
                return None
            raise FieldError(f"{error}; clock: receive does without it") from error
        if kind in (3, 4) or (kind == 2 and content != _TIME):
            raise FieldError(f"{wanted} is not a time")
        get = getter(wanted)
        if kind == 2:
            return lambda message: seconds_of(get(message))
        return lambda message: float(get(message))

    def check(self, number: int, t_s: float, received_s: float) -> bool:
        """Tell whether a message's own time was set at all; note where its clock jumps.

        Parameters
        ----------
        number
            Of the message.
        t_s, received_s
            Its own time, and that of its recording.
        """
        if not self.is_set(t_s):
            return False
        if self._last is not None:
            step_s, received_step_s = t_s - self._last[0], received_s - self._last[1]
            is_jump = step_s < -_BACK_S or step_s > max(received_step_s, 0.0) + _AHEAD_S
            if is_jump and (self._last[0] < _SET_S) == (t_s < _SET_S):
                self._n_jumps += 1
                if self._n_jumps == 1:
                    self._first_jump = (number, step_s - received_step_s)
        self._last = (t_s, received_s)
        return True

    def is_set(self, t_s: float) -> bool:
        """Tell whether a header's time is another than 0, and count those that are not."""
        self._n_unset += t_s == 0
        return t_s != 0

    @property
    def n_unset(self) -> int:
        """How many messages have the time 0."""
        return self._n_unset

    def were_set(self, t_s: Float64[Array, "R"]) -> Bool[Array, "R"]:
        """Return which rows have a time of a clock that was set, where others in the log have."""
        is_set = t_s >= _SET_S
        if self._clock == "receive" or not is_set.any():
            return np.ones(len(t_s), np.bool_)
        self._n_unset += int((~is_set).sum())
        return is_set

    def notes(self) -> list[str]:
        """Return what a user should know."""
        notes = list(self._notes)
        if self._n_unset:
            messages = counted(self._n_unset, "message")
            notes.append(
                f"{self._topic}: skipped {messages} from before the header's clock was set "
                "(clock: receive would use them)"
            )
        if self._n_jumps:
            number, size_s = self._first_jump
            notes.append(
                f"{self._topic}: the header's clock jumps by {size_s:+.1f} s at message {number}"
                f"{'' if self._n_jumps == 1 else f' and {self._n_jumps - 1:,} times more'}"
                " (clock: receive takes the recording's)"
            )
        return notes
