"""Made-up files in the form of the outdoor UWB data set's."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import polars as pl

from gaia_uwb.projection import to_geodetic
from gaia_uwb.scene import LocalFrame

START_NS = 1_730_017_526_625_169_679
SITE = LocalFrame(lat_deg=37.5552, lon_deg=127.0453, alt_m=49.0)
TURN_RAD = np.radians(19.5)
SURVEY = {"3": (2.58, -0.87, 1.97), "5": (-2.58, 0.87, 1.97), "9": (0, 0.5, 0.5), "12": (1, 0, 0.5)}

HEADER = (
    "timestamp,Transmission #,Reception #,maxNoise,Distance,Channel,FirstPathAmp1,FirstPathAmp2,"
    "FirstPathAmp3,Max Growth CIR,Rx Preamble Count,Standard Noise,RSSI(dBm),RSSI_fp(dBm),rtd_init,"
    "rtd_resp,resp_rx_ts,poll_tx_ts,resp_tx_ts,poll_rx_ts,anchor_id"
)
ROW = "1723714442.5,6,5,1236.0,10.04,5.0,14808,14198,9559,6759,230,48.0,-79.5,-81.0,1,2,3,4,5,6,12"
SUMMARY = "Distance Mean,10.07\nDistance Std,0.02\nRSSI(dBm) Mean,-79.5\nRSSI(dBm) Std,\n"


def rotated(position_m: np.ndarray, angle_rad: float) -> np.ndarray:
    cos, sin = np.cos(angle_rad), np.sin(angle_rad)
    return position_m @ np.array([[cos, sin], [-sin, cos]])


def write_run(data: Path, *, lever_arm_m: float = 0.185) -> np.ndarray:
    """Write a run in the data set's files; return the tag's path in east and north."""
    folder = data / "Dynamic_measurements" / "NLOS" / "Trajectory_B" / "Case_4"
    folder.mkdir(parents=True)
    stamp_ns = START_NS + np.arange(80) * 125_000_000
    angle_rad = np.linspace(0, 2 * np.pi, 80)
    path_m = np.column_stack([8 * np.cos(angle_rad), 5 * np.sin(angle_rad)])
    heading_rad = angle_rad + np.pi / 2
    ahead = np.column_stack([np.cos(heading_rad), np.sin(heading_rad)])
    antenna_m = rotated(path_m - lever_arm_m * ahead, -TURN_RAD)
    lat_deg, lon_deg, alt_m = to_geodetic(SITE, antenna_m, np.full(80, 1.0))
    pl.DataFrame(
        {
            "timestamp": [f"{float(stamp):.16e}" for stamp in stamp_ns],
            "x": path_m[:, 0],
            "y": path_m[:, 1],
            "z": np.zeros(80),
            "heading_degrees": np.degrees(heading_rad),
        }
    ).write_csv(folder / "trajectory.csv")
    pl.DataFrame(
        {
            "%time": stamp_ns,
            "field.header.stamp": stamp_ns,
            "field.latitude": lat_deg,
            "field.longitude": lon_deg,
            "field.altitude": alt_m,
        }
    ).write_csv(folder / "gnss.csv")
    for k, (anchor_id, (x, y, z)) in enumerate(SURVEY.items()):
        pl.DataFrame(
            {
                "%time": stamp_ns,
                "field.stamp": stamp_ns + 1_000_001 * k - 200_000_000,
                "field.id": int(anchor_id),
                "field.x": float(x),
                "field.y": float(y),
                "field.z": float(z),
                "field.distanceFromTag": 5.0 + np.arange(80),
                "field.rssi": [float("-inf")] + [-80.0] * 79,
                "field.rssi_fp": -82.0,
            }
        ).write_csv(folder / f"A{anchor_id}.csv")
    return rotated(path_m, -TURN_RAD)


def write_static(data: Path, place: str, *rows: str) -> None:
    """Write one of the files of an anchor and a tag that stood still."""
    path = data / "Static_measurements" / place
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("\n".join([HEADER, *rows, ""]))
