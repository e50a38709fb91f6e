"""The map shows angles of arrival and ranges between cones beside the ranges to the vehicle."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from browser import Browser
from gaia_uwb import PipelineConfig, reconstruct
from gaia_uwb.outputs.map_evidence import map_evidence
from gaia_uwb.reconstruction import Reconstruction
from map_looks import PHONE, picture, show, texts, write_page
from road_tags import road_drive_with_tags

ACROSS = [(0.0, 0.8), (0.0, -0.8)]


@pytest.fixture(scope="module")
def result() -> Reconstruction:
    scene = road_drive_with_tags(0, ACROSS, angle_sigma_deg=3.0, cone_to_cone=True)
    return reconstruct(scene, PipelineConfig(denoiser="raw"))


def test_directions_point_at_the_cones_and_every_pair_counts_once(result: Reconstruction) -> None:
    passes = [episode for episode, _ in result.passes]
    every = 3
    found = map_evidence(passes, every)
    scene = road_drive_with_tags(0, ACROSS, angle_sigma_deg=3.0, cone_to_cone=True)
    assert scene.cone_ranges is not None
    assert sum(count for *_, count in found["ties"]) == len(scene.cone_ranges)  # type: ignore[attr-defined,misc]
    path_m = np.concatenate([episode.position_m for episode in passes])[::every]
    off_deg = []
    for fix, pairs in zip(result.anchors, found["bearings"], strict=True):  # type: ignore[call-overload]
        for step, degrees in pairs:
            east_m, north_m = fix.position_m - path_m[step]
            off = degrees - np.degrees(np.arctan2(north_m, east_m))
            off_deg.append((off + 180.0) % 360.0 - 180.0)
    assert len(off_deg) > 1000
    assert abs(np.median(off_deg)) < 6.0  # the tags' angles have a bias
    assert np.median(np.abs(off_deg - np.median(off_deg))) < 6.0


def test_without_such_evidence_there_is_nothing(result: Reconstruction) -> None:
    plain = [
        replace(
            episode,
            cone_ranges=None,
            own_times=None
            if episode.own_times is None
            else replace(episode.own_times, azimuth_rad=None, azimuth_sigma_rad=None),
        )
        for episode, _ in result.passes
    ]
    assert map_evidence(plain, 1) == {"ties": [], "bearings": [[]] * len(result.anchors)}


def test_the_map_draws_and_tells_them(
    chromium: Browser, result: Reconstruction, tmp_path: Path
) -> None:
    page = write_page(result, tmp_path / "map.html")
    show(chromium, page)
    assert "range between two cones" in texts(chromium, "#legend div")
    n_ties = len(map_evidence([result.episode], 1)["ties"])  # type: ignore[arg-type]
    assert len(chromium.evaluate("[...document.querySelectorAll('.tie')].map(() => 1)")) == (
        n_ties + 1  # one is in the legend
    )
    chromium.evaluate("select(order[3])")
    chromium.evaluate("showMoment(Math.round(steps / 5))")
    chromium.evaluate("draw()")
    details = " ".join(texts(chromium, "#details"))
    assert "ranges to other cones" in details
    assert "directions of arrival" in details
    assert chromium.evaluate("document.querySelectorAll('#map .bearing').length > 0")
    picture(chromium, "evidence")
    show(chromium, page, PHONE)
    picture(chromium, "evidence-phone")
