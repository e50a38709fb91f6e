"""The recorded data set has no road: four cones that somebody walked around."""

from __future__ import annotations

from pathlib import Path

import pytest

from gaia_uwb.api import load_scenes, reconstruct


@pytest.mark.real_data
def test_recorded_cones_are_an_area_and_the_path_is_outside(outdoor_dir: Path) -> None:
    for scene in load_scenes("outdoor-uwb", data_dir=outdoor_dir):
        result = reconstruct(scene)
        assert result.road_boundary is not None
        (zone,) = result.road_boundary.zones
        assert zone.form.value == "area", scene.name
        assert zone.drove_through is None
        assert zone.closed is not None
        assert 0.8 < zone.closed.region.area_m2 / result.boundary.area_m2 < 1.1
