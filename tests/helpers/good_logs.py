"""Small good logs of every kind that GAIA reads, one writer per reader."""

from __future__ import annotations

import shutil
import sqlite3
from collections.abc import Callable
from contextlib import closing
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import yaml
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import CompressionFormat, CompressionMode

from bags import FORMATS, START_S, Log, write_drive
from good_trajectories import TRAJECTORIES

LEC = "{t:.2f} DIST,2,AN0,022E,7.94,8.03,0.00,{a:.2f},AN1,0C1D,1.00,0.00,0.00,{b:.2f}\n"
LES = "{t:.2f} 022E[7.94,8.03,0.00]={a:.2f} 0C1D[1.00,0.00,0.00]={b:.2f} le_us=2576\n"


def gga(t: int) -> str:
    body = f"GNGGA,1200{t:02d}.00,3733.3{t:02d},N,12702.7,E,4,12,0.7,48.5,M,20.5,M,,"
    checksum = 0
    for character in body:
        checksum ^= ord(character)
    return f"${body}*{checksum:02X}\n"


def zda() -> str:
    return "$GPZDA,115959.00,03,03,2026,00,00*60\n"


def clock(t: int) -> str:
    return f"12:00:{t // 2:02d}.{t % 2 * 5}00"


def trek1000(t: int, a_cm: int, b_cm: int) -> str:
    ranges = f"{10 * a_cm:08x} {10 * b_cm:08x} 00000000 00000000"
    each = f"0f {ranges} {t:04x} {t:02x} 00a0642b a0:0"
    return "".join(f"Mar 03 {clock(t)} m{kind} {each}\n" for kind in "rc")


def mauwb(t: int, a_cm: int, b_cm: int) -> str:
    ranges = f"range:({a_cm},{b_cm},0,0),rssi:(-70.00,-80.50,0.00,0.00),ancid:(5,7,-1,-1)"
    return f"[2026-03-03 {clock(t)}] AT+RANGE=tid:1,mask:03,seq:{t},{ranges}\n"


def dwm3001(t: int, a_cm: int, b_cm: int) -> str:
    return (
        f"{clock(t)} -> SESSION_INFO_NTF: {{session_handle=1, sequence_number={t}, "
        f"block_index={t}, n_measurements=2\n"
        f' [mac_address=0x0001, status="SUCCESS", distance[cm]={a_cm}, RSSI[dBm]=-71.5];\n'
        f' [mac_address=0x0002, status="SUCCESS", distance[cm]={b_cm}]}}\n'
    )


DEVICES: dict[str, Callable[[int, int, int], str]] = {
    "trek1000": trek1000,
    "mauwb": mauwb,
    "dwm3001": dwm3001,
}
"""Device -> the lines of half a second, from its number and the ranges to two anchors in cm."""


def write_serial(folder: Path) -> Path:
    """Write DWM1001 logs of both kinds, an NMEA log and their description."""
    (folder / "drive.nmea").write_text("".join(map(gga, range(40))), encoding="utf-8")
    for name, line in (("lec.log", LEC), ("les.log", LES)):
        shift = 0.0 if name == "lec.log" else 0.25
        lines = "".join(line.format(t=43200 + t / 2 + shift, a=5 + t, b=9 + t) for t in range(80))
        (folder / name).write_text(lines, encoding="utf-8")
    description = {
        "trajectory": {"file": "drive.nmea", "format": "nmea"},
        "ranges": [{"file": f"{kind}.log", "format": "dwm1001"} for kind in ("lec", "les")],
    }
    (folder / "gaia.yaml").write_text(yaml.safe_dump(description), encoding="utf-8")
    return folder


def write_device(folder: Path, name: str) -> Path:
    """Write a serial log of one device, an NMEA log and their description."""
    (folder / "drive.nmea").write_text(zda() + "".join(map(gga, range(40))), encoding="utf-8")
    lines = "".join(DEVICES[name](t, 500 + 100 * t, 900 + 100 * t) for t in range(80))
    (folder / "tag.log").write_text(lines, encoding="utf-8")
    description = {
        "trajectory": {"file": "drive.nmea", "format": "nmea"},
        "ranges": [{"file": "tag.log", "format": name}],
    }
    (folder / "gaia.yaml").write_text(yaml.safe_dump(description), encoding="utf-8")
    return folder


def write_tables(folder: Path, suffix: str = ".csv") -> Path:
    """Write mapped tables and their description."""
    t = np.arange(40.0)
    drive = pl.DataFrame({"t": t, "x": t * 3, "y": t * t / 9})
    n = np.arange(80)
    ranges = pl.DataFrame(
        {
            "t": n / 2,
            "id": [f"c{k % 3}" for k in n],
            "mm": 5000.0 + n,
            "p": np.where(n % 2 == 0, -80.0, np.nan),
        }
    )
    for name, table in (("drive", drive), ("uwb", ranges)):
        path = folder / (name + suffix)
        table.write_csv(path) if suffix == ".csv" else table.write_parquet(path)
    millimetres = {"column": "mm", "scale": 0.001}
    description = {
        "trajectory": {
            "file": f"drive{suffix}",
            "format": "csv",
            "columns": {"t_s": "t", "east_m": "x", "north_m": "y"},
        },
        "ranges": [
            {
                "file": f"uwb{suffix}",
                "format": "csv",
                "columns": {"t_s": "t", "anchor_id": "id", "range_m": millimetres, "rssi_dbm": "p"},
            }
        ],
        "lever_arm": {"forward_m": 1.0},
    }
    (folder / "gaia.yaml").write_text(yaml.safe_dump(description), encoding="utf-8")
    return folder


def write_own(folder: Path, suffix: str = ".csv") -> Path:
    """Write a log in GAIA's own format, with everything that it may hold."""
    t = np.arange(40.0)
    n = np.arange(90)
    tables = {
        "trajectory": {"t_s": t, "lat": 37 + t * 1e-5, "lon": 127 + t * t * 1e-7, "alt_m": t + 50},
        "ranges": {
            "t_s": n / 3 + n % 3 * 0.01,
            "anchor_id": [f"c{k % 3}" for k in n],
            "range_m": 12.0 + n % 7,
            "rssi_dbm": np.where(n % 2 == 0, -80.0, np.nan),
            "nlos": n % 2 == 0,
            "true_range_m": 12.0 + n % 7,
        },
        "anchors": {
            "anchor_id": ["c0", "c1", "c2"],
            "up_m": [0.5, 0.6, 0.7],
            "east_m": [1.0, 2.0, 3.0],
            "north_m": [4.0, 5.0, 7.0],
        },
    }  # fmt: skip
    for name, columns in tables.items():
        table = pl.DataFrame(columns, nan_to_null=True)
        path = folder / (name + suffix)
        table.write_csv(path) if suffix == ".csv" else table.write_parquet(path)
    scene = {
        "name": "pass",
        "frame": {"lat_deg": 37.0, "lon_deg": 127.0, "alt_m": 49.5},
        "clock_offset_s": 0.1,
    }
    (folder / "scene.yaml").write_text(yaml.safe_dump(scene), encoding="utf-8")
    return folder


def write_tags(folder: Path, suffix: str = ".csv") -> Path:
    """Write a log of two tags in GAIA's own format, with attitude, angles and ranges of cones."""
    t, n = np.arange(40.0), np.arange(160)
    some = np.where(t % 5 == 0, np.nan, 1.0)
    tables = {
        "trajectory": {
            "t_s": t,
            "east_m": t * 3,
            "north_m": t * t / 40,
            "up_m": np.ones(40),
            "heading_deg": (85 - t) * some,
            "roll_deg": some,
            "pitch_deg": -some,
        },
        "ranges": {
            "t_s": n / 4,
            "tag_id": np.where(n % 2 == 0, "1", "2"),
            "anchor_id": [f"c{k // 2 % 3}" for k in n],
            "range_m": 12.0 + n % 7,
            "azimuth_deg": np.where(n % 3 == 0, np.nan, n - 80.0),
            "azimuth_sigma_deg": np.full(160, 5.0),
        },
        "cone_ranges": {
            "anchor_a": ["c0", "c1"],
            "anchor_b": ["c1", "c2"],
            "range_m": [6.1, 5.9],
            "t_s": [1.0, 2.0],
        },
    }
    for name, columns in tables.items():
        table = pl.DataFrame(columns, nan_to_null=True)
        path = folder / (name + suffix)
        table.write_csv(path) if suffix == ".csv" else table.write_parquet(path)
    scene = {"tags": {1: {"forward_m": 1.0}, "2": {"left_m": 0.5, "own_clock": True}}}
    (folder / "scene.yaml").write_text(yaml.safe_dump(scene), encoding="utf-8")
    return folder


def write_described_tags(folder: Path) -> Path:
    """Write mapped tables of two tags, and their description."""
    write_tags(folder)
    (folder / "scene.yaml").unlink()
    for name in ("trajectory", "ranges"):
        (folder / f"{name}.csv").rename(folder / f"my-{name}.csv")
    place = {"t_s": "t_s", "east_m": "east_m", "north_m": "north_m"}
    reading = {"t_s": "t_s", "anchor_id": "anchor_id", "range_m": "range_m", "tag_id": "tag_id"}
    azimuth = {"column": "azimuth_deg", "scale": 0.5, "clockwise": True}
    description = {
        "trajectory": {
            "file": "my-trajectory.csv",
            "columns": {**place, "heading_deg": "roll_deg"},
        },
        "ranges": [{"file": "my-ranges.csv", "columns": {**reading, "azimuth_deg": azimuth}}],
        "tags": {1: {"forward_m": 1.0}, 2: {"left_m": 0.5}},
        "cone_ranges": {"file": "cone_ranges.csv"},
    }
    (folder / "gaia.yaml").write_text(yaml.safe_dump(description), encoding="utf-8")
    return folder


def write_described_bag(folder: Path) -> Path:
    """Write a ROS 2 log and a description that says where its messages keep what."""
    log = write_drive(folder, "mcap")
    log.rename(folder / "log.mcap")
    log.parent.joinpath("metadata.yaml").unlink()
    log.parent.rmdir()
    place = {"file": "log.mcap", "format": "ros"}
    fields = {"anchor": "anchor_id", "range": "range", "rssi": "rssi", "stamp": "header.stamp"}
    description = {
        "name": "pass",
        "frame": {"lat_deg": 37.0, "lon_deg": 127.0},
        "trajectory": {**place, "topic": "/fix", "clock": "header"},
        "ranges": [{**place, "topic": "/uwb", "clock": "header", "fields": fields}],
        "lever_arm": {"forward_m": 1.0, "left_m": 0.2},
    }
    (folder / "gaia.yaml").write_text(yaml.safe_dump(description), encoding="utf-8")
    return folder


VENDORS = {
    "both-ends": (
        "acme/msg/Range",
        "std_msgs/Header header\nuint8 src\nuint8 dst\nfloat32 range\n",
    ),
    "places": ("nlink/msg/Frame", "uint8 id\nfloat32[8] dis_arr\n"),
    "roles": ("nlink/msg/LinktrackNodeframe2", "uint8 id\nNode[] nodes\n"),
    "old-range": ("sensor_msgs/msg/Range", ""),
}
"""Way to say which anchor a range is of -> a message's type and definition."""


def write_vendor(folder: Path, way: str, kind: str = "mcap") -> Path:
    """Write a ROS log with poses in /tf only and ranges in a vendor's own type."""
    msgtype, text = VENDORS[way]
    types = {msgtype: text} if text else {}
    types |= {"nlink/msg/Node": "uint8 role\nuint8 id\nfloat32 dis\n"}
    log = Log(folder, kind, types)
    made = log.types.types
    for k in range(60):
        t_s = START_S + k / 4
        header = log.header(t_s, f"cone-{k % 3}")
        turn = made["geometry_msgs/msg/Quaternion"](x=0.0, y=0.0, z=0.0, w=1.0)
        shift = made["geometry_msgs/msg/Vector3"](x=2.0 * k, y=k * k / 90, z=1.0)
        moved = made["geometry_msgs/msg/Transform"](translation=shift, rotation=turn)
        one = made["geometry_msgs/msg/TransformStamped"](
            header=log.header(t_s), child_frame_id="base_link", transform=moved
        )
        log.add("/tf", "tf2_msgs/msg/TFMessage", t_s, transforms=[one])
        range_m, places = 9.0 + k / 10, np.zeros(8, np.float32)
        places[:3] = range_m
        nodes = [made["nlink/msg/Node"](role=1 + n // 3, id=n % 3, dis=range_m) for n in range(4)]
        limits = {"radiation_type": 0, "field_of_view": 0.1, "min_range": 0.0, "max_range": 99.0}
        fields: dict[str, dict[str, Any]] = {
            "both-ends": {"header": header, "src": k % 3, "dst": 9, "range": range_m},
            "places": {"id": 4, "dis_arr": places},
            "roles": {"id": 4, "nodes": nodes},
            "old-range": {"header": header, **limits, "range": range_m},
        }
        log.add("/uwb", msgtype, t_s, **fields[way])
    return log.close()


def write_killed(folder: Path) -> Path:
    """Write a database as a killed recorder of Humble leaves it: without types, with a WAL."""
    whole = write_vendor(folder / "whole", "old-range", "folder-sqlite3")
    path = next(whole.glob("*.db3")).rename(folder / "live.db3")
    shutil.rmtree(folder / "whole")
    with closing(sqlite3.connect(path)) as database:
        database.execute("DELETE FROM message_definitions")
        database.commit()
        database.execute("PRAGMA journal_mode=WAL")
        database.execute("UPDATE messages SET timestamp = timestamp + 1")
        database.commit()
        for name in ("live.db3", "live.db3-wal"):
            shutil.copy(folder / name, folder / name.replace("live", "drive"))
    path.unlink()
    return folder / "drive.db3"


def _ros(kind: str, packed: tuple[Any, ...] = ()) -> Callable[[Path], Path]:
    return lambda folder: write_drive(folder, kind, packed)


_CHUNKS, _MESSAGES = (
    (mode, CompressionFormat.ZSTD) for mode in (CompressionMode.STORAGE, CompressionMode.MESSAGE)
)

LOGS: dict[str, Callable[[Path], Path]] = {
    **{kind: _ros(kind) for kind in FORMATS},
    "bag-bz2": _ros("bag", (Writer1.CompressionFormat.BZ2,)),
    "bag-lz4": _ros("bag", (Writer1.CompressionFormat.LZ4,)),
    "mcap-zstd": _ros("mcap", _CHUNKS),
    "folder-mcap-zstd": _ros("folder-mcap", _MESSAGES),
    "folder-sqlite3-zstd": _ros("folder-sqlite3", _MESSAGES),
    "serial": write_serial,
    **{f"serial-{name}": partial(write_device, name=name) for name in DEVICES},
    "tables": write_tables,
    "tables-parquet": lambda folder: write_tables(folder, ".parquet"),
    "own": write_own,
    "own-parquet": lambda folder: write_own(folder, ".parquet"),
    "tags": write_tags,
    "tags-parquet": lambda folder: write_tags(folder, ".parquet"),
    "tags-described": write_described_tags,
    "ros-described": write_described_bag,
    **TRAJECTORIES,
    **{f"ros-{way}": partial(write_vendor, way=way) for way in VENDORS if way != "old-range"},
    "ros-killed": write_killed,
}
"""Kind -> function that writes a good log into a folder and returns what names it as a source."""
