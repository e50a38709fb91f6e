"""Small good trajectories of every format: the same drive, 40 s at 1 Hz, written by us."""

from __future__ import annotations

import math
import struct
from collections.abc import Callable, Iterator
from pathlib import Path

import yaml

N = 40
START_S = 1_772_528_400.0
"""3 March 2026, 9:00 UTC."""
GPS_WEEK, GPS_AHEAD_S = 2408, 18.0
ORIGIN_DEG = (48.137, 11.575, 520.0)
METRE_DEG = (8.993e-6, 1.3473e-5)


def drive() -> Iterator[tuple[float, float, float, float]]:
    """Yield seconds from the start, east, north and up in metres: a road that bends."""
    for k in range(N):
        yield float(k), 2.7 * k, 8 * math.sin(k / 9), 1.5 + 0.01 * k


def on_earth() -> Iterator[tuple[float, float, float, float]]:
    """Yield seconds from the start, latitude, longitude and height of the drive."""
    lat, lon, alt_m = ORIGIN_DEG
    for t, east, north, up in drive():
        yield t, lat + north * METRE_DEG[0], lon + east * METRE_DEG[1], alt_m + up


def tum() -> str:
    rows = [f"{START_S + t:.3f} {x:.3f} {y:.3f} {z:.3f} 0 0 0 1\n" for t, x, y, z in drive()]
    return "# a drive\n# timestamp tx ty tz qx qy qz qw\n" + "".join(rows)


def euroc() -> str:
    names = [f"p_RS_R_{axis} [m]" for axis in "xyz"] + [f"q_RS_{axis} []" for axis in "wxyz"]
    rows = [
        f"{int(START_S + t) * 10**9},{x:.6f},{y:.6f},{z:.6f},1,0,0,0\n" for t, x, y, z in drive()
    ]
    return f"#timestamp [ns],{','.join(names)}\n" + "".join(rows)


def kitti() -> str:
    """Return poses: x right is east, y down, z ahead is north."""
    rows = [f"1 0 0 {x:.6e} 0 1 0 {-z:.6e} 0 0 1 {y:.6e}\n" for _, x, y, z in drive()]
    return "".join(rows)


def kitti_times() -> str:
    return "".join(f"{START_S + t:.12e}\n" for t, *_ in drive())


def rtklib() -> str:
    head = (
        "% program   : RTKPOST ver.2.4.3\n% obs start : 2026/03/03 09:00:18.0 GPST\n"
        "% (lat/lon/height=WGS84/ellipsoidal,Q=1:fix,2:float,3:sbas,4:dgps,5:single,6:ppp)\n"
        "%  GPST               latitude(deg) longitude(deg)  height(m)   Q  ns   sdn(m)   age(s)\n"
    )
    rows = [
        f"{gps_clock(t)}   {lat:.9f}  {lon:.9f}  {alt:9.4f}   {1 if t % 7 else 2}  12  0.01 0.0\n"
        for t, lat, lon, alt in on_earth()
    ]
    return head + "".join(rows)


def gps_clock(t: float, day: str = "2026/03/03") -> str:
    """Return date and GPS time of a time after the start."""
    minutes, seconds = divmod(t + GPS_AHEAD_S, 60)
    return f"{day} 09:{int(minutes):02d}:{seconds:06.3f}"


def gpx() -> str:
    points = [
        f'<trkpt lat="{lat:.9f}" lon="{lon:.9f}"><ele>{alt:.2f}</ele>'
        f"<time>2026-03-03T09:00:{int(t):02d}.00Z</time></trkpt>\n"
        for t, lat, lon, alt in on_earth()
    ]
    middle = "</trkseg><trkseg>\n".join(["".join(points[:20]), "".join(points[20:])])
    return (
        '<?xml version="1.0" encoding="UTF-8"?>\n'
        '<gpx version="1.1" creator="us" xmlns="http://www.topografix.com/GPX/1/1">\n'
        f"<trk><name>drive</name><trkseg>\n{middle}</trkseg></trk></gpx>\n"
    )


def ubx_frame(kind: int, payload: bytes) -> bytes:
    """Return a UBX-NAV message with its checksum."""
    body = struct.pack("<BBH", 1, kind, len(payload)) + payload
    a = b = 0
    for byte in body:
        a = a + byte & 255
        b = b + a & 255
    return b"\xb5\x62" + body + bytes([a, b])


def nav_pvt(
    t: float,
    lat: float,
    lon: float,
    alt: float,
    *,
    carrier: int = 2,
    kind: int = 3,
    valid: int = 7,
    flags: int = 3,
) -> bytes:
    """Return a NAV-PVT message of a time after the start."""
    nano = round(t % 1 * 1e9)
    itow = round((START_S + GPS_AHEAD_S - 315_964_800 + t) % 604_800 * 1000)
    head = struct.pack(
        "<IHBBBBBBIi", itow, 2026, 3, 3, 9, int(t) // 60, int(t) % 60, valid, 20, nano
    )
    place = struct.pack(
        "<BBBBiiii",
        *(kind, flags | carrier << 6, 0, 12, round(lon * 1e7), round(lat * 1e7)),
        *(round(alt * 1000), round(alt * 1000) - 47_000),
    )
    return ubx_frame(7, (head + place).ljust(92, b"\0"))


def ubx() -> bytes:
    """Return UBX with other UBX and NMEA between, as receivers send it."""
    other = ubx_frame(0x35, bytes(20)) + b"$GNTXT,01,01,02,u-blox*00\r\n"
    return b"".join(nav_pvt(*each) + other for each in on_earth())


def _writer(name: str, content: Callable[[], str | bytes], **more: str) -> Callable[[Path], Path]:
    def write(folder: Path) -> Path:
        """Write a trajectory, ranges on its clock and their description."""
        data = content()
        (folder / name).write_bytes(data if isinstance(data, bytes) else data.encode())
        if "times" in more:
            (folder / more["times"]).write_text(kitti_times(), encoding="utf-8")
        rows = [f"{START_S + t / 2:.2f},c{t % 3},{9 + t % 5}\n" for t in range(2 * N - 2)]
        (folder / "uwb.csv").write_text("t,id,r\n" + "".join(rows), encoding="utf-8")
        columns = {"t_s": "t", "anchor_id": "id", "range_m": "r"}
        description = {
            "trajectory": {"file": name, **more},
            "ranges": [{"file": "uwb.csv", "format": "csv", "columns": columns}],
        }
        (folder / "gaia.yaml").write_text(yaml.safe_dump(description), encoding="utf-8")
        return folder

    return write


TRAJECTORIES: dict[str, Callable[[Path], Path]] = {
    "tum": _writer("traj.txt", tum, format="tum"),
    "euroc": _writer("data.csv", euroc, format="euroc"),
    "kitti": _writer("poses.txt", kitti, format="kitti", times="times.txt"),
    "rtklib": _writer("drive.pos", rtklib, format="rtklib"),
    "gpx": _writer("drive.gpx", gpx, format="gpx"),
    "ubx": _writer("drive.ubx", ubx, format="ubx"),
    "guessed": _writer("drive.log", gpx),
}
"""Format -> function that writes a good log into a folder and returns what names it as a source."""
