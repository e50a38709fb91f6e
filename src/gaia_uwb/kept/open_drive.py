"""A drive that is still going on: readings and positions come in batches."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Protocol, runtime_checkable

import numpy as np

from gaia_uwb._shared import Array, Float64, InputError
from gaia_uwb.config import PipelineConfig
from gaia_uwb.pipeline import reconstruct
from gaia_uwb.reconstruction import Reconstruction
from gaia_uwb.scene import LocalFrame, RangeLog, Scene, Trajectory


@runtime_checkable
class TakesDrives(Protocol):
    """What a drive needs of the zone past which it goes."""

    @property
    def frame(self) -> LocalFrame | None:
        """The local frame of its results."""

    @property
    def config(self) -> PipelineConfig:
        """All of its settings."""

    def add(self, scenes: Scene, *, ended_s: float | None = None) -> None:
        """Fold a drive in."""


@dataclass
class OpenDrive:
    """A drive past a kept zone, of which more is to come.

    It has a result of its own at any time, and is folded into the zone once, when it ends. Until
    then it is in memory only.

    Parameters
    ----------
    zone
        It goes past.
    name, vehicle
        Of the drive, and of who drives.

    Examples
    --------
    >>> import tempfile
    >>> from gaia_uwb.kept import Zone
    >>> zone = Zone.create(tempfile.mkdtemp() + "/zone")
    >>> drive = zone.start("tuesday-1")
    >>> drive.add_poses(t_s=[0.0, 1.0], position_m=[[0.0, 0.0], [10.0, 0.0]])
    >>> drive.add_ranges(t_s=[0.2, 0.7], anchor_ids=["cone-1", "cone-1"], range_m=[9.2, 6.1])
    >>> len(drive.scene().ranges)
    2
    """

    zone: TakesDrives
    name: str
    vehicle: str = ""
    _ranges: list[tuple[float, str, float]] = field(default_factory=list, repr=False)
    _poses: list[tuple[float, float, float]] = field(default_factory=list, repr=False)

    def add_ranges(
        self,
        *,
        t_s: Sequence[float] | Float64[Array, "R"],
        anchor_ids: Sequence[str],
        range_m: Sequence[float] | Float64[Array, "R"],
    ) -> None:
        """Take a batch of ranges, in any order.

        Parameters
        ----------
        t_s
            In the radios' clock.
        anchor_ids
            Of each range.
        range_m
            Slant ranges, in metres.

        Raises
        ------
        InputError
            If they are not equally many.
        """
        self._check(len(t_s), len(anchor_ids), len(range_m))
        numbers = zip(map(float, t_s), anchor_ids, map(float, range_m), strict=True)
        self._ranges.extend(numbers)

    def add_poses(
        self,
        *,
        t_s: Sequence[float] | Float64[Array, "n"],
        position_m: Sequence[Sequence[float]] | Float64[Array, "n 2"],
    ) -> None:
        """Take a batch of positions of the tag's antenna, in any order.

        Parameters
        ----------
        t_s
            In the positions' clock.
        position_m : (n, 2)
            East and north in the zone's frame.

        Raises
        ------
        InputError
            If they are not equally many.
        """
        self._check(len(t_s), len(position_m))
        for at_s, (east_m, north_m) in zip(t_s, position_m, strict=True):
            self._poses.append((float(at_s), float(east_m), float(north_m)))

    def scene(self) -> Scene:
        """Return the drive as far as it has come.

        Raises
        ------
        InputError
            If there are no ranges or fewer than two positions yet.
        """
        if not self._ranges or len(self._poses) < 2:
            raise InputError("has no ranges or fewer than two positions yet", source=self.name)
        poses = np.array(sorted(dict.fromkeys(self._poses)))
        poses = poses[np.diff(poses[:, 0], prepend=-np.inf) > 0.0]
        ranges = sorted(dict.fromkeys(self._ranges))
        ids = tuple(dict.fromkeys(sorted(name for _, name, _ in ranges)))
        index = {name: n for n, name in enumerate(ids)}
        log = RangeLog(
            np.array([t_s for t_s, _, _ in ranges]),
            np.array([index[name] for _, name, _ in ranges], dtype=np.int64),
            np.array([range_m for _, _, range_m in ranges]),
        )
        path = Trajectory(poses[:, 0], poses[:, 1:])
        return Scene(self.name, path, log, ids, frame=self.zone.frame, vehicle=self.vehicle)

    def result(self) -> Reconstruction:
        """Return what this drive says by itself, as far as it has come."""
        return reconstruct(self.scene(), self.zone.config)

    def end(self, *, ended_s: float | None = None) -> None:
        """Fold the drive into its zone.

        Parameters
        ----------
        ended_s
            As in :meth:`Zone.add`.
        """
        self.zone.add(self.scene(), ended_s=ended_s)

    def _check(self, *counts: int) -> None:
        if len(set(counts)) > 1:
            raise InputError(f"expected as many of each, got {counts}", source=self.name)
