"""Writes the same drive as a ROS 1 bag, as MCAP and as SQLite, with rosbags' own writers."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin, Writer as Writer2
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

FORMATS = ("bag", "mcap", "folder-mcap", "folder-sqlite3")
VENDOR = "acme_uwb/msg/Range"
FLAT = "std_msgs/Header header\nstring anchor_id\nfloat32 range\nfloat32 rssi\n"
START_S = 1_700_000_000
RECORDED_LATER_NS = 250_000_000


def store(ros1: bool, definitions: dict[str, str], release: Stores = Stores.ROS2_HUMBLE) -> Any:
    """Return the types of a format with a vendor's among them."""
    types = get_typestore(Stores.ROS1_NOETIC if ros1 else release)
    for name, text in definitions.items():
        types.register(get_types_from_msg(text, name))
    return types


class Log:
    """One log that is being written.

    Parameters
    ----------
    folder
        Where.
    kind
        One of FORMATS.
    definitions
        Type -> text of its ``.msg`` file.
    packed
        How to compress, for rosbags' writer.
    release
        Release of ROS 2 whose types are used.
    """

    def __init__(
        self,
        folder: Path,
        kind: str,
        definitions: dict[str, str] | None = None,
        packed: tuple[Any, ...] = (),
        release: Stores = Stores.ROS2_HUMBLE,
    ) -> None:
        self.ros1 = kind == "bag"
        self.types = store(self.ros1, definitions or {VENDOR: FLAT}, release)
        folder.mkdir(parents=True, exist_ok=True)
        self.path = folder / ("log.bag" if self.ros1 else "log")
        self._kind = kind
        self._connections: dict[str, Any] = {}
        if self.ros1:
            self.writer: Any = Writer1(self.path)
        else:
            plugin = StoragePlugin.SQLITE3 if kind.endswith("sqlite3") else StoragePlugin.MCAP
            self.writer = Writer2(self.path, version=9, storage_plugin=plugin)
        if packed:
            self.writer.set_compression(*packed)
        self.writer.open()

    def stamp(self, t_s: float) -> Any:
        whole = int(t_s)
        time = self.types.types["builtin_interfaces/msg/Time"]
        return time(sec=whole, nanosec=round((t_s - whole) * 1e9))

    def header(self, t_s: float, frame_id: str = "map") -> Any:
        extra = {"seq": 0} if self.ros1 else {}
        header = self.types.types["std_msgs/msg/Header"]
        return header(stamp=self.stamp(t_s), frame_id=frame_id, **extra)

    def add(self, topic: str, msgtype: str, t_s: float, **fields: Any) -> None:
        """Write a message; without a ``header`` among the fields the type has none."""
        connection = self._connections.get(topic)
        if connection is None:
            connection = self.writer.add_connection(topic, msgtype, typestore=self.types)
            self._connections[topic] = connection
        message = self.types.types[msgtype](**fields)
        pack = self.types.serialize_ros1 if self.ros1 else self.types.serialize_cdr
        time_ns = round(t_s * 1000) * 1_000_000 + RECORDED_LATER_NS
        self.writer.write(connection, time_ns, pack(message, msgtype))

    def fix(self, topic: str, t_s: float, lat: float, lon: float, alt: float = 50.0) -> None:
        status = self.types.types["sensor_msgs/msg/NavSatStatus"](status=0, service=1)
        self.add(
            topic,
            "sensor_msgs/msg/NavSatFix",
            t_s,
            header=self.header(t_s, "gnss"),
            status=status,
            latitude=lat,
            longitude=lon,
            altitude=alt,
            position_covariance=np.zeros(9),
            position_covariance_type=0,
        )

    def point(self, topic: str, t_s: float, x: float, y: float, z: float = 1.5) -> None:
        point = self.types.types["geometry_msgs/msg/Point"](x=x, y=y, z=z)
        msgtype = "geometry_msgs/msg/PointStamped"
        self.add(topic, msgtype, t_s, header=self.header(t_s), point=point)

    def close(self) -> Path:
        """Return the log's path."""
        self.writer.close()
        return next(self.path.glob("*.mcap")) if self._kind == "mcap" else self.path


def write_drive(folder: Path, kind: str, packed: tuple[Any, ...] = ()) -> Path:
    """Write a drive of 20 s along a bend past 3 anchors, each ranged at 2 Hz."""
    log = Log(folder, kind, packed=packed)
    for k in range(200):
        t_s = START_S + k / 10
        log.fix("/fix", t_s, 37.0 + k * 1e-5, 127.0 + (k / 100) ** 2 * 1e-5)
        if k % 5 == 0:
            for n, anchor_id in enumerate(("A1", "A2", "A10")):
                fields = {"header": log.header(t_s), "anchor_id": anchor_id}
                log.add("/uwb", VENDOR, t_s, **fields, range=20.0 + n + k / 100, rssi=-80.0 - n)
    return log.close()
