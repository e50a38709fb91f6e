"""One ROS log, and what is read of it.

A topic that is not named is found by its type (trajectory) or its fields (ranges). More than one
candidate is an error that lists them; nothing is chosen silently.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from gaia_uwb.logs._lever_arm import TagInput
from gaia_uwb.logs._logs import LogTable
from gaia_uwb.logs._selection import Value
from gaia_uwb.logs.bags import FieldMap, Link
from gaia_uwb.logs.ros.ranges import Wish, read_ranges
from gaia_uwb.logs.ros.times import Clock
from gaia_uwb.logs.ros.topics import Topics
from gaia_uwb.logs.ros.trajectory import read_trajectory


class RosLog:
    """A ROS log: one file, or the folder of one recording.

    Parameters
    ----------
    path
        A ``.bag``, ``.mcap`` or ``.db3`` file, or a folder of the files of one recording.
    msg_dir
        Folder with the ``.msg`` files of types that the log lacks.

    Raises
    ------
    InputError
        If it cannot be read.
    ConfigError
        If rosbags is not installed.
    """

    def __init__(self, path: Path, msg_dir: Path | None = None) -> None:
        self._topics = Topics(path, msg_dir)

    @property
    def notes(self) -> list[str]:
        """What was taken, and what was left out, so far."""
        return self._topics.notes

    def trajectory(
        self, topic: str | None = None, clock: Clock = "auto", frames: Link | None = None
    ) -> LogTable:
        """Read the trajectory.

        Parameters
        ----------
        topic
            Which; ``None`` uses the only one of a fitting type, and ``/tf`` if there is none.
        clock
            Which time counts.
        frames
            In ``/tf``: which frame moved in which; ``None`` uses the only chain that moves.

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
        return read_trajectory(self._topics, topic, clock, frames)

    def ranges(
        self,
        topic: str | None = None,
        fields: FieldMap | None = None,
        clock: Clock = "auto",
        *,
        where: Mapping[str, Value | Sequence[Value]] | None = None,
        missing: Sequence[float] = (),
        tags: Mapping[str, TagInput] | None = None,
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
        where
            Field -> value that it must have, or one of several.
        missing
            Numbers that mean "no range", before they are scaled.
        tags
            Tag's id -> where it is on the vehicle, if that is given.

        Returns
        -------
        LogTable
            ``t_s`` in seconds, ``anchor_id``, ``range_m`` in metres, ``rssi_dbm`` and
            ``rssi_fp_dbm`` in dBm where the messages have them, and ``tag_id`` where it is given
            where the tags are.

        Raises
        ------
        InputError
            If there is no such topic, more than one, or a message that cannot be read; or if the
            ranges are of several tags of which it is not given where they are.
        """
        wish = Wish(fields, clock, dict(where or {}), missing, tags or {})
        return read_ranges(self._topics, topic, wish)
