"""A scene as the files of GAIA's own format hold it."""

from __future__ import annotations

import io
from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

import numpy as np

from gaia_uwb._shared import Array
from gaia_uwb.scene import Scene, Tag


def table_bytes(columns: Mapping[str, Any], file_format: str) -> bytes:
    """Return a table as a file's content: what writes it to the disk then fails as files do."""
    import polars as pl

    frame, content = pl.DataFrame(columns, nan_to_null=True), io.BytesIO()
    if file_format == "csv":
        frame.write_csv(content)
    else:
        frame.write_parquet(content)
    return content.getvalue()


def scene_tables(scene: Scene) -> dict[str, dict[str, Any]]:
    """Return the tables of a scene: name -> column -> values, without columns that it lacks."""
    import polars as pl

    drive, ranges, truth, cones = scene.trajectory, scene.ranges, scene.truth, scene.cone_ranges
    ids = pl.Series(scene.anchor_ids)
    tags = pl.Series([tag.tag_id for tag in scene.tags])
    tables: dict[str, dict[str, Any]] = {
        "trajectory": {
            "t_s": drive.t_s,
            "east_m": drive.position_m[:, 0],
            "north_m": drive.position_m[:, 1],
            "up_m": drive.up_m,
            "heading_deg": _degrees(drive.heading_rad, compass=True),
            "roll_deg": _degrees(drive.roll_rad),
            "pitch_deg": _degrees(drive.pitch_rad),
        },
        "ranges": {
            "t_s": ranges.t_s,
            "tag_id": None if ranges.tag is None else tags.gather(ranges.tag),
            "anchor_id": ids.gather(ranges.anchor),
            "range_m": ranges.range_m,
            "rssi_dbm": ranges.rssi_dbm,
            "rssi_fp_dbm": ranges.rssi_fp_dbm,
            "azimuth_deg": _degrees(ranges.azimuth_rad),
            "azimuth_sigma_deg": _degrees(ranges.azimuth_sigma_rad),
            "true_range_m": None if truth is None else truth.range_m,
            "nlos": None if truth is None else truth.nlos,
            "outlier": None if truth is None else truth.outlier,
            "true_bias_m": None if truth is None else truth.bias_m,
        },
        "anchors": {
            "anchor_id": scene.anchor_ids,
            "up_m": scene.anchor_up_m,
            "east_m": None if truth is None else truth.anchor_m[:, 0],
            "north_m": None if truth is None else truth.anchor_m[:, 1],
        },
    }
    if cones is not None:
        tables["cone_ranges"] = {
            "anchor_a": ids.gather(cones.anchor_a),
            "anchor_b": ids.gather(cones.anchor_b),
            "range_m": cones.range_m,
            "t_s": cones.t_s,
        }
    return {
        table: {name: values for name, values in columns.items() if values is not None}
        for table, columns in tables.items()
    }


def _degrees(angle_rad: Array | None, *, compass: bool = False) -> Array | None:
    """Return angles as the tables hold them, without what the last bits add."""
    if angle_rad is None:
        return None
    angle_deg = np.degrees(angle_rad)
    return np.round((90.0 - angle_deg) % 360.0 if compass else angle_deg, 10)


def scene_yaml(scene: Scene) -> str:
    import yaml

    content: dict[str, Any] = {"name": scene.name}
    if scene.frame is not None:
        content["frame"] = asdict(scene.frame)
    if scene.truth is not None and scene.truth.clock_offset_s is not None:
        content["clock_offset_s"] = scene.truth.clock_offset_s
    if scene.vehicle:
        content["vehicle"] = scene.vehicle
    if scene.tags:
        content["tags"] = {tag.tag_id: _tag_place(tag) for tag in scene.tags}
    return yaml.safe_dump(content, sort_keys=False)


def _tag_place(tag: Tag) -> dict[str, Any]:
    """Return where a tag is, as the scene's file holds it."""
    place: dict[str, Any] = {
        "forward_m": tag.forward_m,
        "left_m": tag.left_m,
        "up_m": tag.up_m,
    }
    return {**place, "own_clock": True} if tag.own_clock else place
