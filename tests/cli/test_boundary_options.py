"""What the command line says about the boundary that a driver sees."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from gaia_uwb._shared import ConfigError, InputError
from gaia_uwb.cli.boundary_options import Form, read_line, with_boundary
from gaia_uwb.config import BoundaryConfig, PipelineConfig
from gaia_uwb.roadside import ZoneForm

LINE = {"type": "LineString", "coordinates": [[11.5, 48.1, 3.0], [11.6, 48.2, 3.0]]}
FEATURE = {"type": "Feature", "properties": {}, "geometry": LINE}
COLLECTION = {"type": "FeatureCollection", "features": [FEATURE]}


def said(settings: PipelineConfig = PipelineConfig(), **options: object) -> BoundaryConfig:
    names = ("form", "closed_width_m", "closed_lanes", "lane_width_m", "road_edge")
    given = [options.get(name) for name in names]
    return with_boundary(settings, *given).boundary  # type: ignore[arg-type]


def test_every_form_can_be_stated() -> None:
    assert [form.value for form in Form] == [form.value for form in ZoneForm]
    for form in Form:
        assert said(form=form).form == form.value


def test_nothing_said_changes_nothing() -> None:
    settings = PipelineConfig(boundary=BoundaryConfig(closed_lanes=2, form="area"))
    assert with_boundary(settings, None, None, None, None, None) is settings


def test_an_option_takes_the_place_of_another_width_in_the_settings() -> None:
    settings = PipelineConfig(boundary=BoundaryConfig(closed_lanes=2, lane_width_m=3.0))
    found = said(settings, closed_width_m=4.5)
    assert found == BoundaryConfig(closed_width_m=4.5, lane_width_m=3.0)
    assert said(settings, lane_width_m=3.5).closed_lanes == 2


@pytest.mark.parametrize("content", [LINE, FEATURE, COLLECTION])
def test_a_road_edge_is_read_from_geojson(content: object, tmp_path: Path) -> None:
    path = tmp_path / "edge.geojson"
    path.write_text(json.dumps(content), encoding="utf-8")
    assert said(road_edge=path).road_edge == ((11.5, 48.1), (11.6, 48.2))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("{", "is not GeoJSON"),
        ("[]", "expected GeoJSON with one LineString, got none"),
        (json.dumps({"type": "Point", "coordinates": [1, 2]}), "got none"),
        (json.dumps({**COLLECTION, "features": [FEATURE, FEATURE]}), "got 2"),
        (json.dumps({**COLLECTION, "features": 3}), "got none"),
        (json.dumps({**COLLECTION, "features": [None]}), "got none"),
        (json.dumps({**FEATURE, "geometry": None}), "got none"),
    ],
)
def test_what_is_no_line_is_refused(text: str, message: str, tmp_path: Path) -> None:
    path = tmp_path / "edge.geojson"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=message):
        read_line(path)
    with pytest.raises(InputError, match="No such file"):
        read_line(tmp_path / "none.geojson")


@pytest.mark.parametrize(
    ("points", "message"),
    [
        ([[11.5, 48.1]], "at least two points"),
        ([[11.5, 48.1], [11.5, 48.1]], "at least two points that differ"),
        ([[11.5, 98.1], [11.5, 48.1]], "expected longitude, latitude, got 11.5, 98.1"),
        ([[11.5], [11.5, 48.1]], "road_edge"),
        ([5, 6], "road_edge"),
        ([["a", "b"], [1, 2]], "road_edge"),
    ],
)
def test_a_line_that_is_none_on_the_earth_is_refused(
    points: list[object], message: str, tmp_path: Path
) -> None:
    path = tmp_path / "edge.geojson"
    path.write_text(json.dumps({**LINE, "coordinates": points}), encoding="utf-8")
    with pytest.raises(ConfigError, match=message):
        said(road_edge=path)


def test_two_widths_are_too_many() -> None:
    with pytest.raises(ConfigError, match="expected one of --closed-width"):
        said(closed_width_m=3.0, closed_lanes=1)


def test_the_command_takes_them(run, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    options = ("--form", "one-row", "--closed-lanes", "2", "--lane-width", "3.2")
    run("reconstruct", "sim:straight", "--denoiser", "raw", *options, "--out", tmp_path)
    written = (tmp_path / "config.yaml").read_text(encoding="utf-8")
    assert "form: one-row" in written
    assert "closed_lanes: 2" in written
    assert "lane_width_m: 3.2" in written
