"""Named settings of simulated passes, and preset files.

Where a default imitates a measurement, it is the outdoor UWB data set's: polls at 10 Hz, a clock
0.2 s late, bursts that are nearly all negative, a received power that hardly falls with distance.

>>> from gaia_uwb.simulate import PRESETS
>>> print(", ".join(PRESETS))
lane-closure, straight, two-tags, angles, cone-ranges, parked, naive, calibrated, stress, wild
"""

from __future__ import annotations

from pathlib import Path
from types import MappingProxyType

from pydantic import ValidationError

from gaia_uwb._shared import ConfigError, read_yaml
from gaia_uwb.config import settings_problems
from gaia_uwb.scene import LocalFrame
from gaia_uwb.simulate.settings import (
    ClosureConfig,
    DriveConfig,
    PassConfig,
    RangingConfig,
    RoadConfig,
    TagConfig,
)

__all__ = [
    "DEFAULT_PRESET",
    "PLACE",
    "PRESETS",
    "ClosureConfig",
    "DriveConfig",
    "PassConfig",
    "RangingConfig",
    "RoadConfig",
    "find_preset",
    "load_preset",
]

PLACE = LocalFrame(lat_deg=42.0, lon_deg=-93.5, alt_m=270.0)
"""Origin of every simulated scene: invented, at round coordinates among the fields of Iowa."""

_PI = 3.14159


def load_preset(path: Path) -> PassConfig:
    """Read the settings of a pass from a YAML file; what it leaves out keeps its default.

    Parameters
    ----------
    path
        A file that mirrors :class:`PassConfig`, as ``gaia simulate`` writes beside its passes and
        the calibration from logs.

    Raises
    ------
    ConfigError
        If the file cannot be read, is not YAML, holds a key twice, an unknown key or an impossible
        value.
    """
    try:
        content = read_yaml(path)
        return PassConfig.model_validate({} if content is None else content)
    except ValidationError as error:
        raise ConfigError(f"{path}: {settings_problems(error)}") from error
    except ValueError as error:
        raise ConfigError(f"{path}: cannot read a preset: {error}") from error


def find_preset(name: str) -> PassConfig:
    """Return the preset of a name, or of a file that ends in ``.yaml``.

    Parameters
    ----------
    name
        One of :data:`PRESETS`, or one with ``-training`` or ``-test`` behind it for that part of
        its layouts; or a path.

    Raises
    ------
    ConfigError
        If there is no such preset, or the file is not one.

    Examples
    --------
    >>> find_preset("parked").drive.speed_mps
    0.0
    >>> find_preset("wild-test").split
    'test'
    """
    if name.endswith(".yaml"):
        return load_preset(Path(name))
    if name in PRESETS:
        return PRESETS[name]
    base, _, part = name.rpartition("-")
    if base in PRESETS and part in ("training", "test"):
        return PRESETS[base].model_copy(update={"split": part})
    raise ConfigError(f"unknown preset {name!r}; available: {', '.join(PRESETS)}")


DEFAULT_PRESET = "lane-closure"

_NAIVE = PassConfig(
    # Independent Gaussian errors, positive without line of sight, and outliers of one reading.
    ranging=RangingConfig(
        sigma_m=0.1,
        sigma_per_m=0.0,
        los_s=0.7,  # a new draw about every reading
        nlos_s=0.3,
        nlos_bias_correlation_s=0.01,
        nlos_bias_m=0.5,
        nlos_bias_sigma_m=0.3,
        burst_per_s=0.1,
        burst_lengths=(1.0,),
        burst_negative_share=0.5,
        outage_per_s=0.0,
        held_share=0.0,
        clock_offset_s=0.0,
    ),
)

_STRESS = PassConfig(
    # Six seconds of a pass on a road that starts out east and bends to the right: where a vehicle
    # is tells where the anchors are. A member of this family is like any other.
    road=RoadConfig(direction_rad=0.0, speed_limit_mph=55),
    drive=DriveConfig(duration_s=6.4, rate_hz=10.0, position_sigma_m=0.02),
    ranging=RangingConfig(
        max_range_m=2000.0,
        dropout_share=0.0,
        outage_per_s=0.0,
        held_share=0.0,
        sigma_m=0.5,
        los_s=0.8,
        nlos_s=2.9,
        nlos_bias_m=2.0,
        nlos_bias_sigma_m=1.5,
        burst_per_s=0.2,
        clock_offset_s=0.0,
    ),
    vary={
        "road.curvature_per_m": [-0.003, -0.001],
        "closure.n_anchors": [8, 12],
        "closure.buffer_m": [30.0, 60.0],
        "closure.work_m": [60.0, 120.0],
        "drive.ahead_m": [-40.0, 40.0],
        "drive.speed_mps": [8.0, 15.0],
    },
)

_WILD = PassConfig(
    closure=ClosureConfig(),
    drive=DriveConfig(duration_s=6.4, rate_hz=10.0),
    ranging=RangingConfig(clock_offset_s=0.0, max_range_m=300.0),
    vary={
        "road.closed_lane": ["right", "left"],
        "road.direction_rad": [-_PI, _PI],
        "road.curvature_per_m": [-0.003, 0.003],
        "road.s_curve": [False, True],
        "road.inflection_m": [0.0, 150.0],
        "road.speed_limit_mph": [20, 25, 30, 35, 40, 45, 55, 65],
        "closure.kind": [
            "lane-closure",
            "shoulder-closure",
            "lane-shift",
            "median-crossover",
            "mobile-operation",
        ],
        "closure.both_sides": [False, True],
        "closure.n_anchors": [4, 12],
        "closure.buffer_m": [10.0, 100.0],
        "closure.work_m": [20.0, 150.0],
        "closure.antenna_up_m": [0.4, 1.5],
        "closure.n_trucks": [0, 3],
        "closure.n_crew": [0, 6],
        "drive.ahead_m": [-80.0, 80.0],
        "drive.speed_mps": [2.0, 25.0],
        "drive.lane_change": [False, True],
        "drive.sway_m": [0.0, 0.2],
        "ranging.bias_m": [-0.2, 0.2],
        "ranging.bias_per_decade_m": [-0.1, 0.3],
        "ranging.sigma_m": [0.02, 0.2],
        "ranging.own_drift_sigma_m": [0.0, 0.1],
        "ranging.los_s": [1.0, 20.0],
        "ranging.nlos_s": [0.3, 10.0],
        "ranging.nlos_bias_m": [0.05, 2.0],
        "ranging.nlos_bias_sigma_m": [0.05, 1.0],
        "ranging.burst_per_s": [0.0, 0.3],
        "ranging.burst_negative_share": [0.0, 1.0],
        "ranging.dropout_share": [0.0, 0.3],
    },
)

_STRAIGHT = PassConfig(
    # On a path this straight, the mirror position of every cone fits as well as its true one.
    road=RoadConfig(curvature_per_m=0.0),
    drive=DriveConfig(lane_change=False, sway_m=0.03),
)
_TWO_TAGS = _STRAIGHT.drive.model_copy(
    update={"tags": (TagConfig(left_m=0.8), TagConfig(left_m=-0.8))}
)

PRESETS = MappingProxyType(
    {
        DEFAULT_PRESET: PassConfig(),
        "straight": _STRAIGHT,
        "two-tags": _STRAIGHT.model_copy(update={"drive": _TWO_TAGS}),
        "angles": _STRAIGHT.model_copy(update={"ranging": RangingConfig(azimuth_sigma_deg=10.0)}),
        "cone-ranges": _STRAIGHT.model_copy(update={"ranging": RangingConfig(cone_neighbours=3)}),
        "parked": PassConfig(drive=DriveConfig(speed_mps=0.0, lane_change=False)),
        "naive": _NAIVE,
        "calibrated": load_preset(Path(__file__).with_name("calibrated.yaml")),
        "stress": _STRESS,
        "wild": _WILD,
    }
)
"""Named settings: ``sim:NAME`` on the command line."""
