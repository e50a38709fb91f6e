"""The tree of frames in ``/tf``: where a frame moved, seen from another.

Every transform says where a child stands in its parent. The place of ``base_link`` in ``map`` is
then a chain, such as map -> odom -> base_link, of which some links move and others are fixed.
"""

from __future__ import annotations

from array import array
from collections import deque
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from gaia_uwb._shared import Array, Float64
from gaia_uwb.logs._table import MAX_ROWS

_MOST_LINKS = 1000
_MOVES_M = 0.5
_STANDING = {"map", "odom", "world", "earth", "global", "site"}
_OPPOSITE = np.array([-1.0, -1.0, -1.0, 1.0])  # a quaternion times this turns back
_WIDTH = 9  # time, place, quaternion, number of the message


class Link(NamedTuple):
    """A child's frame in its parent's."""

    parent: str
    child: str


class _Step(NamedTuple):
    """A link on the way from a parent to a child; upward if it is passed from its child."""

    link: Link
    upward: bool


class Transforms:
    """The transforms of a log, collected one by one."""

    def __init__(self) -> None:
        self._links: dict[Link, array[float]] = {}
        self._n = 0

    def add(self, number: int, link: Link, values: Sequence[float]) -> None:
        """Add one transform.

        Parameters
        ----------
        number
            Number of its message.
        link
            Its frames; a slash in front does not count.
        values
            Time in seconds, x, y, z in metres, and the quaternion x, y, z, w.

        Raises
        ------
        ValueError
            If there are too many.
        """
        link = Link(link.parent.lstrip("/"), link.child.lstrip("/"))
        if link not in self._links:
            if len(self._links) >= _MOST_LINKS:
                raise ValueError(f"more than {_MOST_LINKS:,} pairs of frames")
            self._links[link] = array("d")
        self._n += 1
        if self._n > MAX_ROWS:
            raise ValueError(f"more than {MAX_ROWS:,} transforms: split the log")
        self._links[link].extend((*values, float(number)))

    def listed(self) -> str:
        """Return the pairs of frames, for a message."""
        some = [f"{parent[:40]} -> {child[:40]}" for parent, child in list(self._links)[:20]]
        return ", ".join(some) or "none"

    def moving(self) -> list[Link]:
        """Return the links along which a child moves by more than half a metre."""
        return [
            link
            for link in self._links
            if np.ptp(self._rows(link)[:, 1:4], axis=0).max() > _MOVES_M
        ]

    def guess(self) -> Link | None:
        """Return the frames of the only chain in which something moves; ``None`` if unclear.

        Some programs publish where the map is, seen from the vehicle: then the names decide.
        """
        moving = self.moving()
        parents, children = {link.parent for link in moving}, {link.child for link in moving}
        tops, ends = parents - children, children - parents
        if len(tops) != 1 or len(ends) != 1:
            return None
        found = Link(tops.pop(), ends.pop())
        if found.child in _STANDING and found.parent not in _STANDING:
            found = Link(found.child, found.parent)
        chain = self._chain(found)
        if chain is None or not set(moving) <= {step.link for step in chain}:
            return None
        return found

    def path(self, wanted: Link) -> tuple[Float64[Array, "R 4"], Array] | None:
        """Return where a frame was in another.

        Parameters
        ----------
        wanted
            The frames; there may be any number of links between them.

        Returns
        -------
        (R, 4) array
            Time in seconds, x, y, z in metres, at the times of the link that came most often and
            where all moving links are known.
        (R,) array
            Numbers of the messages.
        None
            If no chain of links leads from parent to child.
        """
        chain = self._chain(Link(wanted.parent.lstrip("/"), wanted.child.lstrip("/")))
        if chain is None:
            return None
        tables = [self._rows(step.link) for step in chain]
        leading = max(range(len(chain)), key=lambda k: len(tables[k]))
        t_s = tables[leading][:, 0]
        numbers = tables[leading][:, -1].astype(np.int64)
        known = np.ones(len(t_s), np.bool_)
        position = np.zeros((len(t_s), 3))
        for step, table in zip(reversed(chain), reversed(tables), strict=True):
            place, turn, inside = _at(table, t_s)
            if step.upward:
                position = _turned(position - place, turn * _OPPOSITE)
            else:
                position = place + _turned(position, turn)
            known &= inside
        return np.column_stack([t_s, position])[known], numbers[known]

    def _chain(self, wanted: Link) -> list[_Step] | None:
        """Return the shortest way from a parent to a child."""
        beside: dict[str, list[_Step]] = {}
        for link in self._links:
            beside.setdefault(link.child, []).append(_Step(link, upward=False))
            beside.setdefault(link.parent, []).append(_Step(link, upward=True))
        queue, seen = deque([(wanted.child, list[_Step]())]), {wanted.child}
        while queue:
            frame, chain = queue.popleft()
            if frame == wanted.parent and chain:
                return chain
            for step in beside.get(frame, []):
                onward = step.link.child if step.upward else step.link.parent
                if onward not in seen:
                    seen.add(onward)
                    queue.append((onward, [step, *chain]))
        return None

    def _rows(self, link: Link) -> Float64[Array, "R 9"]:
        """Return a link's transforms in the order of time."""
        rows = np.frombuffer(self._links[link], np.float64).reshape(-1, _WIDTH)
        return (
            rows
            if (np.diff(rows[:, 0]) >= 0).all()
            else rows[np.argsort(rows[:, 0], kind="stable")]
        )


def _at(
    table: Float64[Array, "R 9"], t_s: Float64[Array, "T"]
) -> tuple[Float64[Array, "T 3"], Float64[Array, "T 4"], Array]:
    """Return place and turn of a link at some times, and where they are known.

    A link that came once, or never moved, is fixed. Between two transforms, the place and the
    quaternion are interpolated linearly.
    """
    times, table = table[:, 0], table[:, 1:8]
    if len(table) == 1 or not np.ptp(table, axis=0).any():
        every = np.broadcast_to(table[0], (len(t_s), 7))
        return every[:, :3], every[:, 3:], np.ones(len(t_s), np.bool_)
    inside = (t_s >= times[0]) & (t_s <= times[-1])
    after = np.clip(np.searchsorted(times, t_s), 1, len(times) - 1)
    step_s = times[after] - times[after - 1]
    share = np.divide(t_s - times[after - 1], step_s, out=np.ones_like(t_s), where=step_s > 0)
    share = np.clip(share, 0.0, 1.0)[:, None]
    a, b = table[after - 1], table[after]
    same_way = (a[:, 3:] * b[:, 3:]).sum(axis=1, keepdims=True) >= 0
    turn = (1 - share) * a[:, 3:] + share * np.where(same_way, b[:, 3:], -b[:, 3:])
    return (1 - share) * a[:, :3] + share * b[:, :3], turn, inside


def _turned(position: Float64[Array, "T 3"], turn: Float64[Array, "T 4"]) -> Float64[Array, "T 3"]:
    """Return points turned by quaternions (x, y, z, w), which need not have the length 1."""
    length = np.linalg.norm(turn, axis=1, keepdims=True)
    unit = np.divide(
        turn, length, out=np.tile([0.0, 0.0, 0.0, 1.0], (len(turn), 1)), where=length > 0
    )
    axis, w = unit[:, :3], unit[:, 3:]
    first = 2 * np.cross(axis, position)
    turned: Array = position + w * first + np.cross(axis, first)
    return turned
