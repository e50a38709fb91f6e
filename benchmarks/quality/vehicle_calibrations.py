"""Are calibrated vehicles what they are said to be? Their numbers beside their 90 % intervals.

Each vehicle has two tags, and a clock offset, a range bias, delays and patterns of its own, which
stay as they are. It drives past two zones, turns and comes back, and stops and goes. In each drive
it points beside its course by another angle (2 degrees), as the program assumes. The drives are
made by code other than the simulator's.

    python benchmarks/quality/vehicle_calibrations.py --n 100

A lever arm is where the antenna seems to be, by its ranges: a pattern that looks like a shift is
part of it.
"""

from __future__ import annotations

import argparse
from collections import defaultdict
from dataclasses import dataclass

import numpy as np

from _tally import table
from gaia_uwb._shared import SIGMAS_90, Array, Float64
from gaia_uwb.logs import Vehicle, VehicleTag
from gaia_uwb.scene import RangeLog, Scene, Tag, Trajectory, antenna_path
from gaia_uwb.vehicle_calibration import Calibration, calibrate_vehicle, tag_of_value

N_DRIVES = 2
LEVERS_M = ((1.2, 0.8), (1.2, -0.8))
TAPE_M, PATTERN_M, DELAY_M, NOISE_M, CONE_DELAY_M = 0.02, 0.03, 0.05, 0.06, 0.03
HEADING_RAD = np.radians(2.0)
N_CONES, HALF_M, RADIUS_M, REACH_M = 10, 80.0, 6.0, 75.0
SLOWEST_MPS, FASTEST_MPS = 1.0, 12.0
POSES_PER_S, READ_EACH_S = 20, 0.2
TAG_UP_M, CONE_UP_M = 1.9, 0.8


@dataclass(frozen=True)
class TrueVehicle:
    """What is true of a vehicle.

    Parameters
    ----------
    stated
        Where a tape measure puts its antennas.
    levers_m : (K, 2)
        Where they are, forward and left.
    delays_m : (K,)
        Of its tags, with the mean 0.
    patterns_m : (K, 4)
        Cosines and sines of two harmonics of each tag's pattern.
    offset_s, bias_m
        Its clock offset and range bias.
    """

    stated: Vehicle
    levers_m: Float64[Array, "K 2"]
    delays_m: Float64[Array, "K"]
    patterns_m: Float64[Array, "K 4"]
    offset_s: float
    bias_m: float

    @classmethod
    def draw(cls, rng: np.random.Generator) -> TrueVehicle:
        """Draw one."""
        stated_m = np.array(LEVERS_M) + rng.normal(0.0, 0.3, (len(LEVERS_M), 2))
        delays_m = rng.normal(0.0, DELAY_M, len(LEVERS_M))
        tags = {
            str(k): VehicleTag(forward_m=round(ahead, 2), left_m=round(left, 2))
            for k, (ahead, left) in enumerate(stated_m.tolist())
        }
        return cls(
            stated=Vehicle(name="van", tags=tags),
            levers_m=stated_m.round(2) + rng.normal(0.0, TAPE_M, stated_m.shape),
            delays_m=delays_m - delays_m.mean(),
            patterns_m=rng.normal(0.0, PATTERN_M, (len(LEVERS_M), 4)),
            offset_s=rng.normal(0.0, 0.2),
            bias_m=rng.normal(0.1, 0.1),
        )

    def truth(self) -> dict[str, float]:
        """Return the true numbers by the names that a calibration has for them."""
        seems_m = self.levers_m - self.patterns_m[:, :2]  # a cone that seems nearer, ahead
        values = {"clock_offset_s": self.offset_s, "range_bias_m": self.bias_m}
        for k, (ahead_m, left_m) in enumerate(seems_m.tolist()):
            values[f"tags.{k}.forward_m"], values[f"tags.{k}.left_m"] = ahead_m, left_m
            values[f"tags.{k}.delay_m"] = float(self.delays_m[k])
        return values

    def drive(self, seed: int, *, levers_known: bool) -> Scene:
        """Return a drive past cones, out and back, that stops and goes."""
        rng = np.random.default_rng([20261204, seed])
        path, cones_m = _path(rng), _cones(rng)
        delays_m = rng.normal(0.0, CONE_DELAY_M, len(cones_m))
        turned_rad = rng.normal(0.0, HEADING_RAD)
        parts = []
        for k, lever in enumerate(self.levers_m):
            ahead_m, left_m = _turned(lever, turned_rad)
            antenna = antenna_path(path, ahead_m, left_m, 0.0)
            lever_m = antenna.lever_m
            assert lever_m is not None
            heading_rad = np.arctan2(*lever_m.T[::-1]) - np.arctan2(*lever[::-1])
            for n, cone_m in enumerate(cones_m):
                t_s = np.arange(rng.uniform(0.0, READ_EACH_S), path.t_s[-1], READ_EACH_S)
                off_m = cone_m - _at(path.t_s, antenna.position_m, t_s)
                true_m = np.hypot(np.hypot(*off_m.T), TAG_UP_M - CONE_UP_M)
                bearing = np.arctan2(*off_m.T[::-1])
                bearing -= np.interp(t_s, path.t_s, np.unwrap(heading_rad))
                waves = [np.cos(bearing), np.sin(bearing), np.cos(2 * bearing), np.sin(2 * bearing)]
                range_m = true_m + self.bias_m + self.delays_m[k] + delays_m[n]
                range_m += self.patterns_m[k] @ waves + rng.normal(0.0, NOISE_M, len(t_s))
                heard = rng.random(len(t_s)) < 0.95 - 0.6 * (true_m / REACH_M) ** 3
                own = np.full((2, int(heard.sum())), [[n], [k]])
                parts.append((t_s[heard], range_m[heard], *own))
        t_s, range_m, anchor, tag = (np.concatenate(part) for part in zip(*parts, strict=True))
        order = np.argsort(t_s, kind="stable")
        anchor, tag = (each[order].astype(np.int64) for each in (anchor, tag))
        stated = [
            Tag(tag_id, tag.forward_m, tag.left_m) if levers_known else Tag(tag_id)
            for tag_id, tag in self.stated.tags.items()
        ]
        return Scene(
            name=f"drive-{seed}",
            trajectory=path,
            ranges=RangeLog(t_s[order] + self.offset_s, anchor, range_m[order], tag=tag),
            anchor_ids=tuple(f"cone-{n}" for n in range(len(cones_m))),
            anchor_up_m=np.full(len(cones_m), CONE_UP_M),
            tags=tuple(stated),
        )


def _turned(lever_m: Float64[Array, "2"], by_rad: float) -> tuple[float, float]:
    cosine, sine = np.cos(by_rad), np.sin(by_rad)
    ahead_m, left_m = lever_m @ np.array([[cosine, sine], [-sine, cosine]])
    return float(ahead_m), float(left_m)


def _at(
    t_s: Float64[Array, "T"], position_m: Float64[Array, "T 2"], when_s: Float64[Array, "R"]
) -> Float64[Array, "R 2"]:
    return np.stack([np.interp(when_s, t_s, axis) for axis in position_m.T], axis=1)


def _cones(rng: np.random.Generator) -> Float64[Array, "N 2"]:
    """Return a taper on the outer side of one of the lanes."""
    along_m = np.linspace(-60.0, 60.0, N_CONES) + rng.normal(0.0, 0.4, N_CONES)
    off_m = np.linspace(5.0, 2.2, N_CONES) + rng.normal(0.0, 0.1, N_CONES)
    beside_m = -off_m if rng.random() < 0.5 else 2 * RADIUS_M + off_m
    return np.stack([along_m, beside_m], axis=1)


def _path(rng: np.random.Generator) -> Trajectory:
    """Return a drive east, through a half circle, and back, at changing speed."""
    east_m = np.arange(-HALF_M, HALF_M, 0.05)
    weave_m = 0.3 * np.sin(east_m / rng.uniform(6.0, 15.0) + rng.uniform(0.0, 2 * np.pi))
    weave_m *= np.clip((HALF_M - np.abs(east_m)) / 20.0, 0.0, 1.0)
    angle = np.arange(0.0, np.pi, 0.05 / RADIUS_M)
    turn = np.stack([HALF_M + RADIUS_M * np.sin(angle), RADIUS_M * (1 - np.cos(angle))], axis=1)
    out = np.stack([east_m, weave_m], axis=1)
    back = np.stack([east_m[::-1], 2 * RADIUS_M + weave_m[::-1]], axis=1)
    place_m = np.concatenate([out, turn, back])
    step_m = np.hypot(*np.diff(place_m, axis=0).T)
    wave = 0.5 + 0.5 * np.sin(np.cumsum(step_m) / 8.0 + rng.uniform(0.0, 2 * np.pi))
    then_s = np.cumsum(step_m / (SLOWEST_MPS + (FASTEST_MPS - SLOWEST_MPS) * wave))
    t_s = np.arange(then_s[0], then_s[-1], 1 / POSES_PER_S)
    place_m = _at(then_s, place_m[1:], t_s)
    return Trajectory(t_s - t_s[0], place_m, np.full(len(t_s), TAG_UP_M))


def calibrated(vehicle: TrueVehicle, number: int, *, levers_known: bool) -> Calibration:
    """Calibrate a vehicle from its drives."""
    seeds = range(N_DRIVES * number, N_DRIVES * (number + 1))
    drives = [vehicle.drive(seed, levers_known=levers_known) for seed in seeds]
    known = vehicle.stated if levers_known else None
    return calibrate_vehicle(drives, known, name="van", levers_unknown=not levers_known)


def main() -> None:
    """Calibrate vehicles and print how often the truth is within the intervals."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--n", type=int, default=100, help="Number of vehicles.")
    parser.add_argument("--first", type=int, default=0, help="Number of the first vehicle.")
    options = parser.parse_args()
    for levers_known in (True, False):
        off: dict[str, list[tuple[float, float, bool]]] = defaultdict(list)
        for number in range(options.first, options.first + options.n):
            vehicle = TrueVehicle.draw(np.random.default_rng([20261205, number]))
            result = calibrated(vehicle, number, levers_known=levers_known)
            for name, true in vehicle.truth().items():
                found = result.found[name]
                told = name not in result.unknown
                off[tag_of_value(name)[1]].append((found.value - true, found.sigma, told))
        print(f"Lever arms {'measured with a tape' if levers_known else 'unknown'}\n")
        print(
            table(
                ("number", "determined", "median error", "within 90 %"),
                map(_row, *zip(*off.items(), strict=True)),
            )
        )


def _row(name: str, off: list[tuple[float, float, bool]]) -> tuple[str, ...]:
    error, sigma, told = (np.array(column) for column in zip(*off, strict=True))
    within = float((np.abs(error) <= SIGMAS_90 * sigma).mean())
    return name, f"{told.mean():.0%}", f"{np.median(np.abs(error)):.4f}", f"{within:.0%}"


if __name__ == "__main__":
    main()
