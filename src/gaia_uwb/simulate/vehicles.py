"""The vehicle that drives past: its clock, and its tags with their antennas, delays and angles.

What a log states of it is not quite true: antennas are up to centimetres from where the lever arms
say, and the front points beside the course. A vehicle with a name is the same in all passes of a
seed; one without is that of its pass.
"""

from __future__ import annotations

import zlib
from dataclasses import dataclass

import numpy as np

from gaia_uwb._shared import Array, Float64
from gaia_uwb.simulate.rows import PassRows, SectionRows
from gaia_uwb.simulate.streams import RowStreams, Source, Stream
from gaia_uwb.simulate.trajectories import Drive


@dataclass(frozen=True)
class MountedTag:
    """A tag as it is on its vehicle.

    Parameters
    ----------
    forward_m, left_m, up_m
        Where its antenna truly is from the reference point, in the vehicle's frame.
    turned_rad
        Angle from the course to the vehicle's front.
    delay_m
        What all of its ranges are too long by.
    pattern_m : (4,)
        What they depend on the bearing by: cosine and sine of the bearing and of its double.
    azimuth_bias_rad
        What all of its angles are off by.
    """

    forward_m: float
    left_m: float
    up_m: float
    turned_rad: float
    delay_m: float
    pattern_m: Float64[Array, "4"]
    azimuth_bias_rad: float

    def antenna_m(
        self, drive: Drive, t_s: Float64[Array, "*shape"]
    ) -> tuple[Float64[Array, "*shape 2"], Float64[Array, "*shape"]]:
        """Return east and north of the antenna, and the heading of the vehicle.

        Parameters
        ----------
        drive
            Of the reference point.
        t_s
            Time of the trajectory's clock, in seconds.
        """
        heading_rad = drive.course_rad(t_s) + self.turned_rad
        cosine, sine = np.cos(heading_rad), np.sin(heading_rad)
        east_m = self.forward_m * cosine - self.left_m * sine
        north_m = self.forward_m * sine + self.left_m * cosine
        return drive.position_m(t_s) + np.stack([east_m, north_m], axis=-1), heading_rad

    def bias_m(self, bearing_rad: Float64[Array, "*shape"]) -> Float64[Array, "*shape"]:
        """Return what ranges to cones at these bearings from the front are too long by."""
        waves = [wave(turn * bearing_rad) for turn in (1, 2) for wave in (np.cos, np.sin)]
        return np.asarray(self.delay_m + np.tensordot(self.pattern_m, np.stack(waves), axes=1))

    def azimuth_rad(
        self, bearing_rad: Float64[Array, "N P"], ranging: SectionRows, stream: Stream
    ) -> Float64[Array, "N P"]:
        """Return the angles of arrival that the tag reports, between -pi and pi.

        Parameters
        ----------
        bearing_rad : (N, P)
            True bearings of the anchors from the vehicle's front at their polls.
        ranging
            Settings of the pass.
        stream
            Source of randomness of the tag.
        """
        n, p = bearing_rad.shape
        streams = RowStreams([stream], [n])
        noise_rad = np.radians(ranging.azimuth_sigma_deg) * streams.normal("azimuth", p)
        wild, anywhere = np.moveaxis(streams.uniform("wild-azimuth", 2, p), 1, 0)
        azimuth_rad = np.where(
            wild < ranging.azimuth_wild_share,
            2 * np.pi * anywhere,
            bearing_rad + self.azimuth_bias_rad + noise_rad,
        )
        return np.asarray((azimuth_rad + np.pi) % (2 * np.pi) - np.pi)


@dataclass(frozen=True)
class Vehicle:
    """What is true of a vehicle.

    Parameters
    ----------
    clock_offset_s, bias_m
        Its radios' clock offset, and their range bias at 10 m.
    tags
        In the order of the settings' tags; one at the reference point, if there are none.
    """

    clock_offset_s: float
    bias_m: float
    tags: tuple[MountedTag, ...]

    def ranging(self, settings: SectionRows) -> SectionRows:
        """Return the settings of the ranging as they are for this vehicle."""
        own = {"clock_offset_s": self.clock_offset_s, "bias_m": self.bias_m}
        return SectionRows(**vars(settings) | own)


def draw_vehicle(config: PassRows, source: Source, episode: int, name: str) -> Vehicle:
    """Draw the vehicle of one pass.

    Parameters
    ----------
    config
        Settings of the pass.
    source
        Random numbers of the batch.
    episode
        Number of the pass.
    name
        Of the vehicle; empty for one that drives this pass alone, with the clock offset and the
        range bias that the settings give.
    """
    drive, ranging = config.drive, config.ranging
    rng = source.stream(zlib.crc32(name.encode()) if name else episode)("vehicle")
    clock, bias, turned = rng.standard_normal(3)
    tags = []
    for tag in drive.tags:
        draw = rng.standard_normal(8)  # one more tag leaves those before it as they are
        aside_m = drive.lever_sigma_m * draw[:2]
        tags.append(
            MountedTag(
                forward_m=tag.forward_m + float(aside_m[0]),
                left_m=tag.left_m + float(aside_m[1]),
                up_m=tag.up_m,
                turned_rad=float(np.radians(drive.crab_sigma_deg) * turned),
                delay_m=float(ranging.tag_delay_sigma_m * draw[2]),
                pattern_m=ranging.tag_pattern_sigma_m * draw[3:7],
                azimuth_bias_rad=float(np.radians(ranging.azimuth_bias_sigma_deg) * draw[7]),
            )
        )
    spread_s, spread_m = ranging.vehicle_clock_sigma_s, ranging.vehicle_bias_sigma_m
    return Vehicle(
        clock_offset_s=ranging.clock_offset_s + (round(float(spread_s * clock), 6) if name else 0),
        bias_m=ranging.bias_m + (float(spread_m * bias) if name else 0.0),
        tags=tuple(tags) or (_only_tag(ranging, float(rng.standard_normal())),),
    )


def _only_tag(ranging: SectionRows, draw: float) -> MountedTag:
    """Return a tag whose path is the recorded one."""
    bias_rad = float(np.radians(ranging.azimuth_bias_sigma_deg) * draw)
    return MountedTag(0.0, 0.0, 0.0, 0.0, 0.0, np.zeros(4), bias_rad)
