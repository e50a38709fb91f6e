"""A work zone that is kept: what all drives past it say, on disk, and how a new one changes it.

>>> import tempfile
>>> from gaia_uwb.kept import Zone
>>> from gaia_uwb.simulate import PRESETS, simulate_zone
>>> near, far = simulate_zone(PRESETS["lane-closure"], seed=3)
>>> with tempfile.TemporaryDirectory() as folder:
...     zone = Zone.create(folder + "/zone", frame=near.frame)
...     zone.add(near)
...     zone.add(far)
...     result = Zone.open(folder + "/zone").result()
>>> result.status.value, len(result.anchors)
('ok', 8)

Drives are folded in the order in which they ended. One that comes late, or is taken out, has the
zone folded again from its drives, which are kept for that: so the same drives give the same bytes,
in whatever order they came.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from gaia_uwb._shared import ConfigError, InputError
from gaia_uwb.config import ChangesConfig, PipelineConfig, make_config
from gaia_uwb.denoisers import make_denoiser
from gaia_uwb.episode import DriveErrors, Episode
from gaia_uwb.kept.beginning import begin
from gaia_uwb.kept.changes import ConeState, Stay
from gaia_uwb.kept.folder import ZoneFolder
from gaia_uwb.kept.folds import fold
from gaia_uwb.kept.open_drive import OpenDrive
from gaia_uwb.kept.results import folded_result
from gaia_uwb.kept.scatter import OwnPlaces
from gaia_uwb.kept.state import FULL, Counts, Folded, Past
from gaia_uwb.locate import DriveBlock, in_frame, vehicle_of
from gaia_uwb.pipeline import as_only_pass, prepare_pass, reconstruct_passes
from gaia_uwb.reconstruction import Reconstruction
from gaia_uwb.scene import LocalFrame, Scene, tag_scenes

SHOWN = 4
"""Drives that are shown with a result: the newest."""


@dataclass(frozen=True)
class KeptDrive:
    """A drive that went into a zone.

    Parameters
    ----------
    name
        Of its log.
    started_s, ended_s
        When, in seconds; since 1970 where the log has dates.
    digest
        Of its readings.
    readings, block
        Names of the files that hold its prepared readings and what they say; the latter is empty
        as long as the zone is fitted as a whole.
    left_out
        Whether it contradicts the zone, so that it does not count.
    """

    name: str
    started_s: float
    ended_s: float
    digest: str
    readings: str
    block: str = ""
    left_out: bool = False


@dataclass(frozen=True)
class KeptCone:
    """A cone of a kept zone, and what has become of it.

    Parameters
    ----------
    state
        What is known of it now.
    stays
        Where it stood, from first to last; there it stands now, or did when it was last heard.
    """

    state: ConeState
    stays: tuple[Stay, ...]


class Zone:
    """A zone that is kept in a folder.

    Parameters
    ----------
    folder
        That holds it; see :meth:`create` and :meth:`open`.
    """

    def __init__(self, folder: str | Path) -> None:
        self._folder = ZoneFolder(Path(folder))
        content = self._folder.read()
        self._frame: LocalFrame | None = content["frame"]
        self._config = make_config(content["config"], source=str(folder))
        self._changes = ChangesConfig(**content["changes"])
        self._drives, self._folded = _drives_of(content)

    @classmethod
    def create(
        cls,
        folder: str | Path,
        *,
        frame: LocalFrame | None = None,
        config: PipelineConfig = PipelineConfig(),
        changes: ChangesConfig = ChangesConfig(),
    ) -> Zone:
        """Make a zone without drives.

        Parameters
        ----------
        folder
            New, or empty.
        frame
            The local frame of all results; None for drives that are not tied to WGS84.
        config
            All settings; they stay.
        changes
            What counts as a change of its cones.

        Raises
        ------
        ConfigError
            If the folder holds something or cannot be written to, or the denoiser changes ranges
            without knowing the path: what it removes is not known drive by drive.
        """
        denoiser = make_denoiser(config.denoiser)
        if not (denoiser.keeps_ranges or denoiser.uses_pose) or config.solver.kind != "robust":
            problem = "a kept zone is located from the measured ranges by the robust solver"
            raise ConfigError(f"{config.denoiser}: {problem}")
        settings = {"config": config.model_dump(mode="json"), "changes": changes.model_dump()}
        kept = {"frame": frame, **settings}
        ZoneFolder(Path(folder)).create({**kept, "drives": [], "folded": None})
        return cls(folder)

    @classmethod
    def open(cls, folder: str | Path) -> Zone:
        """Open a zone that is there.

        Parameters
        ----------
        folder
            That :meth:`create` made.

        Raises
        ------
        InputError
            If there is none, or it cannot be read.
        """
        return cls(folder)

    @property
    def folder(self) -> Path:
        """Where the zone is kept."""
        return self._folder.path

    @property
    def frame(self) -> LocalFrame | None:
        """The local frame of all results."""
        return self._frame

    @property
    def config(self) -> PipelineConfig:
        """All settings."""
        return self._config

    @property
    def drives(self) -> tuple[KeptDrive, ...]:
        """The drives that went in, in the order in which they ended."""
        return self._drives

    def cones(self) -> dict[str, KeptCone]:
        """Return what is known of each cone's changes, by its id.

        Up to four drives are compared as passes are: of them nothing is known here.
        """
        if self._folded is None:
            return {}
        place_m = self._folded.places_m
        return {
            name: KeptCone(
                watched.state(self._folded.ended_s, self._changes),
                (*watched.before, Stay(place_m[name], watched.from_s, watched.heard_s)),
            )
            for name, watched in self._folded.watched.items()
        }

    @property
    def counts(self) -> Counts:
        """How often the zone's past had to be worked on again."""
        return Counts() if self._folded is None else self._folded.counts

    def add(self, scenes: Scene | Sequence[Scene], *, ended_s: float | None = None) -> None:
        """Fold drives in.

        Parameters
        ----------
        scenes
            Logs of drives past the zone; their truth is not used.
        ended_s
            When the drive ended, in seconds since 1970; by default the log's last reading says.

        Raises
        ------
        InputError
            If a log cannot be used, is not tied to the Earth as the zone is, or is in already.
        """
        logs = [scenes] if isinstance(scenes, Scene) else list(scenes)
        with self._folder.alone():
            self._drives, self._folded = _drives_of(self._folder.read())
            new: list[KeptDrive] = []
            for scene in logs:
                self._check(scene, [*self._drives, *new])
                new.append(self._prepared(scene, ended_s))
            self._become(sorted([*self._drives, *new], key=_order))

    def start(self, name: str, *, vehicle: str = "") -> OpenDrive:
        """Begin a drive whose readings come in batches.

        Parameters
        ----------
        name, vehicle
            Of the drive, and of who drives.
        """
        return OpenDrive(self, name, vehicle)

    def withdraw(self, name: str) -> None:
        """Take a drive out, as if it had never been added.

        Parameters
        ----------
        name
            Of the drive.

        Raises
        ------
        InputError
            If there is no such drive.
        """
        with self._folder.alone():
            self._drives, self._folded = _drives_of(self._folder.read())
            left = [drive for drive in self._drives if drive.name != name]
            if len(left) == len(self._drives):
                raise InputError(f"has no drive {name!r}", source=self.folder)
            self._become(left)

    def result(self) -> Reconstruction:
        """Return what all drives say, as :func:`gaia_uwb.reconstruct` of all of them would.

        Returns
        -------
        Reconstruction
            With up to four passes it is the same. Of more, the newest four are shown.

        Raises
        ------
        InputError
            If there is no drive yet.
        """
        if not self._drives:
            raise InputError("has no drives yet", source=self.folder)
        if self._folded is None:
            episodes = [each for drive in self._drives for each in self._episodes(drive)]
            if len(episodes) == 1:
                episodes = [as_only_pass(episodes[0], self._config)]
            return reconstruct_passes(episodes, self._config)
        shown = []
        for drive in [each for each in self._drives if not each.left_out][-SHOWN:]:
            errors = self._said(drive)["errors"]
            shown += list(zip(self._episodes(drive), errors, strict=True))
        return folded_result(self._folded, shown, self._config, self._changes)

    def _check(self, scene: Scene, drives: Sequence[KeptDrive]) -> None:
        """Refuse a log that cannot be of this zone, or is in already."""
        if (scene.frame is None) is not (self._frame is None):
            tied = "not tied to WGS84, but the zone is"
            problem = tied if scene.frame is None else "tied to WGS84, but the zone is not"
            raise InputError(problem, source=scene.name)
        digest = _digest(scene)
        for drive in drives:
            if drive.digest == digest or drive.name == scene.name:
                raise InputError(f"is in the zone already, as {drive.name}", source=scene.name)

    def _prepared(self, scene: Scene, ended_s: float | None) -> KeptDrive:
        """Prepare a log and keep its readings."""
        here = scene if self._frame is None else in_frame(scene, self._frame)
        blind = here.without_truth()
        episodes = [prepare_pass(each, self._config) for each in tag_scenes(blind)]
        log = scene.ranges
        last_s = float(log.t_s[-1])
        ended_s = last_s if ended_s is None else ended_s
        return KeptDrive(
            name=scene.name,
            started_s=ended_s - (last_s - float(log.t_s[0])),
            ended_s=ended_s,
            digest=_digest(scene),
            readings=self._folder.save("drive", episodes),
        )

    def _become(self, drives: list[KeptDrive]) -> None:
        """Fold what is to be folded, and write the zone."""
        before = list(self._drives)
        folded = self._folded
        if drives[: len(before)] != before:  # something came late or was taken out: begin again
            before, folded = [], None
            drives = [replace(drive, block="", left_out=False) for drive in drives]
        if folded is None and len(drives) > FULL:
            folded = self._begun(drives)
            before = drives[:FULL]
        if folded is not None:
            for number in range(len(before), len(drives)):
                folded = self._folded_in(folded, drives, number)
        settings = {
            "config": self._config.model_dump(mode="json"),
            "changes": self._changes.model_dump(),
        }
        kept = {"frame": self._frame, **settings}
        content = {**kept, "drives": [vars(drive) for drive in drives], "folded": folded}
        named = [name for drive in drives for name in (drive.readings, drive.block) if name]
        self._folder.replace(content, named)
        self._drives, self._folded = tuple(drives), folded

    def _begun(self, drives: list[KeptDrive]) -> Folded:
        """Add up the first drives."""
        first = [self._episodes(drive) for drive in drives[:FULL]]
        ended_s = [drive.ended_s for drive in drives[:FULL]]
        folded, *said = begin(first, self._config, ended_s)
        for number, (block, own, errors) in enumerate(zip(*said, strict=True)):
            self._say(drives, number, block, own, errors)
        return folded

    def _folded_in(self, folded: Folded, drives: list[KeptDrive], number: int) -> Folded:
        """Fold one drive in, and keep what it says."""
        count = [k for k in range(number) if not drives[k].left_out]
        past = Past(
            len(count),
            lambda k: self._episodes(drives[count[k]]),
            lambda k: self._said(drives[count[k]])["block"],
        )
        vehicles = self._vehicles(folded, drives)
        episodes, ended_s = self._episodes(drives[number]), drives[number].ended_s
        done = fold(folded, episodes, vehicles, past, self._config, ended_s, self._changes)
        if done is None:
            drives[number] = replace(drives[number], left_out=True)
            return folded
        self._say(drives, number, done.block, done.own, done.errors)
        for k, block in done.refolded.items():
            said = self._said(drives[count[k]])
            self._say(drives, count[k], block, said["own"], said["errors"])
        return done.zone

    def _vehicles(self, folded: Folded, drives: Sequence[KeptDrive]) -> list[Episode]:
        """Return one episode for each tag of each vehicle that was there before."""
        found: dict[str, Episode] = {}
        for drive in [each for each in drives if not each.left_out]:
            for episode in self._episodes(drive):
                found.setdefault(vehicle_of(episode), episode)
            if set(folded.sums.vehicles) <= set(found):
                break
        return [found[name] for name in folded.sums.vehicles]

    def _say(
        self,
        drives: list[KeptDrive],
        number: int,
        block: DriveBlock,
        own: OwnPlaces,
        errors: tuple[DriveErrors, ...],
    ) -> None:
        """Keep what a drive says."""
        content = {"block": block, "own": own, "errors": errors}
        drives[number] = replace(drives[number], block=self._folder.save("block", content))

    def _said(self, drive: KeptDrive) -> Mapping[str, Any]:
        said: Mapping[str, Any] = self._folder.load(drive.block)
        return said

    def _episodes(self, drive: KeptDrive) -> list[Episode]:
        episodes: list[Episode] = self._folder.load(drive.readings)
        return episodes


def _drives_of(content: Mapping[str, Any]) -> tuple[tuple[KeptDrive, ...], Folded | None]:
    """Return the drives of a zone as it is now: others may have changed it."""
    return tuple(KeptDrive(**each) for each in content["drives"]), content["folded"]


def _order(drive: KeptDrive) -> tuple[float, str]:
    return drive.ended_s, drive.name


def _digest(scene: Scene) -> str:
    """Return a fingerprint of a log's readings."""
    log = scene.ranges
    parts = [log.t_s.tobytes(), log.range_m.tobytes(), log.anchor.tobytes()]
    return hashlib.sha256(b"".join([*parts, "\n".join(scene.anchor_ids).encode()])).hexdigest()[:24]
