"""What ``gaia.yaml`` says: which files hold the trajectory and the ranges, and how to read them.

>>> from gaia_uwb.logs import InputDescription
>>> description = InputDescription.model_validate({
...     "trajectory": {"file": "drive.nmea", "format": "nmea"},
...     "ranges": [{"file": "tag.log", "format": "dwm1001"}],
... })
>>> description.ranges[0].format
'dwm1001'
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal, get_args

from pydantic import Discriminator, Field, Tag, ValidationError, model_validator

from gaia_uwb._shared import MAX_BYTES, ConfigError, InputError, read_yaml
from gaia_uwb.config import LONGEST_NAME, Settings, settings_problems
from gaia_uwb.logs._lever_arm import LeverArm, Tags
from gaia_uwb.logs._logs import check_file
from gaia_uwb.logs._selection import Missing, Value, Where
from gaia_uwb.logs._stamps import StampOptions
from gaia_uwb.logs.bags import FieldMap, is_ros_file
from gaia_uwb.logs.csv_columns import ConeColumns, RangeColumns, TrajectoryColumns

FILE_NAME = "gaia.yaml"
"""Name of the description within the folder of a log."""

_MAX_RANGE_FILES = 100


class _File(Settings):
    file: str = Field(min_length=1)
    """Path, relative to the description's folder."""


class _Ros(_File):
    format: Literal["ros"] = "ros"
    topic: str | None = None
    """Name of the topic; ``None`` uses the only one that fits."""
    clock: Literal["auto", "header", "receive"] = "auto"
    """Which time counts, the header's or the recording's; ``auto``: the header's if present."""
    msg_dir: str | None = None
    """Folder with ``.msg`` files of types that the log lacks."""


class Frames(Settings):
    """Two frames of ``/tf``."""

    parent: str = Field(min_length=1)
    """The frame that stands still, such as ``map``."""
    child: str = Field(min_length=1)
    """The frame that moves, such as ``base_link`` or that of the tag."""


class RosTrajectory(_Ros):
    """A trajectory in a ROS log."""

    frames: Frames | None = None
    """In ``/tf``: which frame moved in which; ``None`` uses the only chain that moves."""


class _OfOneTag(Settings):
    tag_id: Value | None = None
    """Whose ranges these are, where each tag has a log of its own; ``None``: as the log says."""


class RosRanges(_Ros, _OfOneTag):
    """Ranges in a ROS log."""

    fields: FieldMap | None = None
    """Which fields of the messages hold what; ``None`` guesses."""
    where: Where = Field(default_factory=dict)
    """Which readings count: field -> the value that it must have, or one of several."""
    missing: Missing = Field(default_factory=list)
    """Numbers that mean "no range", as the messages hold them, before they are scaled."""


class NmeaTrajectory(_File):
    """A trajectory in an NMEA log."""

    format: Literal["nmea"]
    clock: Literal["gnss", "host"] = "gnss"
    """Which time counts: that of the sentence, or that of the stamp before it."""
    checksums: Literal["required", "optional"] = "required"
    """Whether sentences without a checksum are read."""
    stamps: StampOptions = StampOptions()


class RtklibTrajectory(_File):
    """A solution of RTKLIB."""

    format: Literal["rtklib"]
    clock: Literal["utc", "gps"] = "utc"
    """The clock of the ranges, into which times are brought."""


class KittiTrajectory(_File):
    """Poses of the KITTI odometry benchmark's form."""

    format: Literal["kitti"]
    times: str = Field(min_length=1)
    """File with the time of each pose, in seconds."""
    axes: Literal["camera", "east-north-up"] = "camera"
    """Of the positions: x right, y down, z ahead, or x east, y north, z up."""


PlainFormat = Literal["tum", "euroc", "gpx", "ubx"]


class PlainTrajectory(_File):
    """A trajectory in a format that leaves nothing to say."""

    format: PlainFormat


class GuessedTrajectory(_File):
    """A trajectory whose file tells its format."""

    format: None = None


class CsvTrajectory(_File):
    """A trajectory in a table."""

    format: Literal["csv"] = "csv"
    columns: TrajectoryColumns | None = None
    """Which column is what; ``None``: they bear GAIA's own names."""
    stamps: StampOptions = StampOptions()


class CsvRanges(_File, _OfOneTag):
    """Ranges in a table."""

    format: Literal["csv"] = "csv"
    columns: RangeColumns | None = None
    """Which column is what; ``None``: they bear GAIA's own names."""
    where: Where = Field(default_factory=dict)
    """Which rows count: column -> the value that it must have, or one of several."""
    missing: Missing = Field(default_factory=list)
    """Numbers that mean "no range", as the file holds them, before they are scaled."""
    stamps: StampOptions = StampOptions()


SerialFormat = Literal["dwm1001", "trek1000", "mauwb", "dwm3001"]


class SerialRanges(_File, _OfOneTag):
    """Ranges in a tag's serial log."""

    format: SerialFormat | None = None
    """Which device wrote it; ``None`` finds it by its lines."""
    where: Where = Field(default_factory=dict)
    """Which tag counts, where lines name the tag: ``{tag_id: 1}``."""
    missing: Missing = Field(default_factory=list)
    """Numbers that mean "no range", in the device's unit."""
    stamps: StampOptions = StampOptions()


class ConeRangesInput(_File):
    """Ranges between cones in a table."""

    format: Literal["csv"] = "csv"
    columns: ConeColumns | None = None
    """Which column is what; ``None``: they bear GAIA's own names."""
    stamps: StampOptions = StampOptions()


class FrameInput(Settings):
    """Where the local frame's origin lies on Earth."""

    lat_deg: float = Field(ge=-90, le=90)
    lon_deg: float = Field(ge=-180, le=180)
    alt_m: float = Field(default=0.0, ge=-1e5, le=1e5)


_TRAJECTORIES = {name: name for name in ("csv", "nmea", "ros", "rtklib", "kitti")}
_TRAJECTORIES |= dict.fromkeys(get_args(PlainFormat), "plain")


def _kind_of_trajectory(given: object) -> str | None:
    """Return which model describes a trajectory; columns are a table's."""
    form = _get(given, "format")
    if form is None:
        return _kind_without_format(given) or "guessed"
    return _TRAJECTORIES.get(form) if isinstance(form, str) else None


def _kind_without_format(given: object) -> str | None:
    """Return what a file is by keys that only one kind has, and by the ending of a ROS log."""
    name = _get(given, "file")
    ros_file = isinstance(name, str) and is_ros_file(Path(name))
    if ros_file or any(_get(given, key) is not None for key in ("topic", "fields", "frames")):
        return "ros"
    return "csv" if _get(given, "columns") is not None else None


def _get(given: object, key: str) -> object:
    return given.get(key) if isinstance(given, dict) else getattr(given, key, None)


TrajectoryInput = Annotated[
    Annotated[CsvTrajectory, Tag("csv")]
    | Annotated[NmeaTrajectory, Tag("nmea")]
    | Annotated[RosTrajectory, Tag("ros")]
    | Annotated[RtklibTrajectory, Tag("rtklib")]
    | Annotated[KittiTrajectory, Tag("kitti")]
    | Annotated[PlainTrajectory, Tag("plain")]
    | Annotated[GuessedTrajectory, Tag("guessed")],
    Discriminator(
        _kind_of_trajectory,
        custom_error_type="format",
        custom_error_message=f"format should be one of {', '.join(_TRAJECTORIES)}",
    ),
]


_RANGES = {"ros": "ros", "csv": "csv"} | dict.fromkeys(get_args(SerialFormat), "serial")


def _kind_of_ranges(given: object) -> str | None:
    """Return which model describes ranges; without a format, a serial log tells its own."""
    form = _get(given, "format")
    if form is None:
        name = _get(given, "file")
        is_table = isinstance(name, str) and name.endswith((".csv", ".parquet"))
        return _kind_without_format(given) or ("csv" if is_table else "serial")
    return _RANGES.get(form) if isinstance(form, str) else None


RangesInput = Annotated[
    Annotated[RosRanges, Tag("ros")]
    | Annotated[CsvRanges, Tag("csv")]
    | Annotated[SerialRanges, Tag("serial")],
    Discriminator(
        _kind_of_ranges,
        custom_error_type="format",
        custom_error_message=f"format should be one of {', '.join(_RANGES)}",
    ),
]


class InputDescription(Settings):
    """The content of ``gaia.yaml``."""

    name: str | None = Field(default=None, max_length=LONGEST_NAME)
    """Name of the scene; ``None`` uses the folder's name."""
    frame: FrameInput | None = None
    """Origin of the local frame; ``None`` uses the trajectory's first position on Earth."""
    trajectory: TrajectoryInput
    ranges: list[RangesInput] = Field(min_length=1, max_length=_MAX_RANGE_FILES)
    """One or more logs of the same drive, all by one clock."""
    anchors: str | None = None
    """Table of heights and surveyed positions, like GAIA's own ``anchors.csv``."""
    vehicle: str = Field(default="", max_length=LONGEST_NAME)
    """Name of the vehicle that drove."""
    lever_arm: LeverArm = LeverArm()
    """From the GNSS antenna to the tag's antenna."""
    tags: Tags = Field(default_factory=dict)
    """Tag's id -> from the GNSS antenna to that tag's antenna, where there are several tags."""
    cone_ranges: ConeRangesInput | None = None
    """Ranges between the cones."""

    @model_validator(mode="after")
    def _arms_once(self) -> InputDescription:
        if self.tags and self.lever_arm != LeverArm():
            raise ValueError("give lever_arm (of one tag) or tags (of several), not both")
        return self

    def names(self) -> list[str]:
        """Return the files and folders that are named, relative to the description's folder."""
        inputs = (self.trajectory, *self.ranges)
        folders = [given.msg_dir for given in inputs if isinstance(given, _Ros)]
        cones = None if self.cone_ranges is None else self.cone_ranges.file
        named = [given.file for given in inputs] + [self.anchors, cones, *folders]
        if isinstance(self.trajectory, KittiTrajectory):
            named.append(self.trajectory.times)
        return [name for name in named if name is not None]


def read_description(path: Path) -> InputDescription:
    """Read a description.

    Parameters
    ----------
    path
        The YAML file.

    Raises
    ------
    InputError
        If the file cannot be read.
    ConfigError
        If a key is unknown or missing, or a value is impossible: the message names the key.
    """
    check_file(path, MAX_BYTES)
    try:
        content = read_yaml(path)
        return InputDescription.model_validate(content)
    except ValidationError as error:
        raise ConfigError(f"{path}: {settings_problems(error)}") from error
    except (OSError, ValueError) as error:
        raise InputError(f"cannot be read: {error}", source=path) from error
