"""``vehicle.yaml``: what stays the same from one drive of a vehicle to the next.

.. code-block:: yaml

    name: truck 7
    tags:
      1: {forward_m: 1.8, left_m: 0.6, up_m: 0.4, delay_m: {value: 0.12, sigma: 0.03}}
      2: {forward_m: 1.8, left_m: -0.6, up_m: 0.4}
    clock_offset_s: {value: 0.04, sigma: 0.01}
    range_bias_m: {value: 0.2, sigma: 0.05}
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Annotated

from pydantic import BeforeValidator, Field, ValidationError

from gaia_uwb._shared import MAX_BYTES, ConfigError, InputError, read_yaml, replace_file
from gaia_uwb.config import (
    LONGEST_NAME,
    Known,
    Settings,
    TagPrior,
    VehiclePrior,
    settings_problems,
)
from gaia_uwb.logs._lever_arm import MAX_TAGS, TagInput, ids_as_text
from gaia_uwb.logs._logs import check_file
from gaia_uwb.scene import Scene, Tag

_MOVED_M = 0.3  # from where a log says that an antenna is: one of both is wrong


class VehicleTag(TagInput):
    """A tag on the vehicle."""

    delay_m: Known | None = None
    """By how much its ranges are too long, more than those of the vehicle as a whole."""
    lever_sigma_m: float | None = Field(default=None, gt=0, le=10)
    """Standard deviation of its lever arm, forward and left; by default that of a tape measure."""

    @property
    def place(self) -> TagInput:
        """Where its antenna is, as a log would give it."""
        return TagInput(**{name: getattr(self, name) for name in TagInput.model_fields})


class Vehicle(Settings):
    """The content of ``vehicle.yaml``."""

    name: str = Field(min_length=1, max_length=LONGEST_NAME)
    """What the vehicle is called."""
    tags: Annotated[
        dict[str, VehicleTag], BeforeValidator(ids_as_text), Field(max_length=MAX_TAGS)
    ] = Field(default_factory=dict)
    """Tag's id -> where its antenna is, from the point whose path the logs hold."""
    clock_offset_s: Known | None = None
    """Radio clock minus trajectory clock."""
    range_bias_m: Known | None = None
    """Measured minus true ranges, at 10 m."""

    @property
    def prior(self) -> VehiclePrior:
        """What a reconstruction takes as known."""
        return VehiclePrior(
            clock_offset_s=self.clock_offset_s,
            range_bias_m=self.range_bias_m,
            tags={
                tag_id: TagPrior(delay_m=tag.delay_m, lever_sigma_m=tag.lever_sigma_m)
                for tag_id, tag in self.tags.items()
            },
        )

    def tags_for(self, given: Mapping[str, TagInput]) -> dict[str, TagInput]:
        """Return where the tags of a log are: as it says, and where it does not, as known here.

        Parameters
        ----------
        given
            Tag's id -> where its antenna is, as the log gives it. A log that gives one tag has one.

        Examples
        --------
        >>> truck = Vehicle(name="truck 7", tags={"1": VehicleTag(forward_m=1.8)})
        >>> truck.tags_for({})
        {'1': TagInput(forward_m=1.8, left_m=0.0, up_m=0.0, own_clock=False)}
        """
        if len(given) == 1:
            return dict(given)
        return {tag_id: tag.place for tag_id, tag in self.tags.items()} | dict(given)

    def drove(self, scene: Scene) -> Scene:
        """Return a log as one of this vehicle's.

        Where its drives have told where an antenna is, that counts, not what the log says. Where
        both are far apart, that is a problem of the log.

        Parameters
        ----------
        scene
            The log.

        Examples
        --------
        >>> from gaia_uwb.simulate import PRESETS, simulate_pass
        >>> moved = VehicleTag(left_m=0.83, lever_sigma_m=0.01)
        >>> truck = Vehicle(name="truck 7", tags={"tag-1": moved})
        >>> drive = truck.drove(simulate_pass(PRESETS["two-tags"], seed=0))
        >>> drive.vehicle, [tag.left_m for tag in drive.tags]
        ('truck 7', [0.83, -0.8])
        """
        tags = tuple(self._calibrated(tag) for tag in scene.tags)
        apart = tuple(
            f"tag {old.tag_id}: the log puts it {old.forward_m:g} m forward and {old.left_m:g} m "
            f"left, but {self.name} was calibrated with {new.forward_m:g} and {new.left_m:g} m: is "
            "it this vehicle, and was the tag moved?"
            for old, new in zip(scene.tags, tags, strict=True)
            if math.hypot(new.forward_m - old.forward_m, new.left_m - old.left_m) > _MOVED_M
        )
        return replace(scene, vehicle=self.name, tags=tags, problems=(*scene.problems, *apart))

    def _calibrated(self, tag: Tag) -> Tag:
        known = self.tags.get(tag.tag_id)
        if known is None or known.lever_sigma_m is None:
            return tag
        return replace(tag, forward_m=known.forward_m, left_m=known.left_m, up_m=known.up_m)


def read_vehicle(path: str | Path) -> Vehicle:
    """Read the description of a vehicle.

    Parameters
    ----------
    path
        The YAML file.

    Returns
    -------
    Vehicle
        What it holds.

    Raises
    ------
    InputError
        If the file cannot be read.
    ConfigError
        If a key is unknown or missing, or a value is impossible: the message names the key.
    """
    path = Path(path)
    check_file(path, MAX_BYTES)
    try:
        return Vehicle.model_validate(read_yaml(path))
    except ValidationError as error:
        raise ConfigError(f"{path}: {settings_problems(error)}") from error
    except (OSError, ValueError) as error:
        raise InputError(f"cannot be read: {error}", source=path) from error


def vehicle_text(vehicle: Vehicle) -> str:
    """Return the description of a vehicle as the YAML text that :func:`read_vehicle` reads.

    Parameters
    ----------
    vehicle
        What to write.
    """
    import yaml

    content = vehicle.model_dump(exclude_none=True, exclude_defaults=True)
    return yaml.safe_dump(content, sort_keys=False, allow_unicode=True)


def write_vehicle(vehicle: Vehicle, path: str | Path) -> None:
    """Write the description of a vehicle; :func:`read_vehicle` gives back an equal one.

    Parameters
    ----------
    vehicle
        What to write.
    path
        The YAML file; one that is there is replaced.

    Raises
    ------
    ConfigError
        If the file cannot be written.

    Examples
    --------
    >>> import tempfile
    >>> truck = Vehicle(name="truck 7", tags={"1": VehicleTag(forward_m=1.8)})
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_vehicle(truck, f"{folder}/vehicle.yaml")
    ...     read_vehicle(f"{folder}/vehicle.yaml") == truck
    True
    """
    replace_file(Path(path), vehicle_text(vehicle))
