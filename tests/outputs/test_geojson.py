"""The GeoJSON is what RFC 7946 asks for, and says what the reconstruction says."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest
from hypothesis import given, strategies as st
from shapely.geometry import LinearRing, shape

from factories import NOWHERE, SITE, SQUARE_M, make_fix, make_reconstruction, make_unlocated
from gaia_uwb.estimate import AnchorStatus
from gaia_uwb.outputs.geojson import LOCAL, WGS84, boundary_geojson, confidence_ellipse, lon_lat
from gaia_uwb.projection import to_local
from gaia_uwb.reconstruction import Reconstruction
from gaia_uwb.zone.uncertainty import BoundaryUncertainty, ProbabilityMap, Region


def read_back(reconstruction: Reconstruction, *, local: bool = False) -> Any:
    """Return the collection as a strict reader of the file sees it."""
    collection = boundary_geojson(reconstruction, local=local)
    return json.loads(json.dumps(collection, allow_nan=False))


def by_role(collection: Any, role: str) -> list[Any]:
    return [f for f in collection["features"] if f["properties"]["role"] == role]


def one(collection: Any, role: str) -> Any:
    (feature,) = by_role(collection, role)
    return feature


def rings(collection: Any) -> list[Any]:
    polygons = [f for f in collection["features"] if f["geometry"]["type"] == "Polygon"]
    assert all(len(polygon["geometry"]["coordinates"]) == 1 for polygon in polygons)
    return [polygon["geometry"]["coordinates"][0] for polygon in polygons]


def test_roles_in_drawing_order_and_valid_geometries() -> None:
    collection = read_back(make_reconstruction())
    assert collection["type"] == "FeatureCollection"
    roles = [feature["properties"]["role"] for feature in collection["features"]]
    assert roles == ["path", "hull", "outline", *["ellipse"] * 4, *["cone"] * 4]
    assert all(shape(feature["geometry"]).is_valid for feature in collection["features"])
    assert all(feature["type"] == "Feature" for feature in collection["features"])


@pytest.mark.parametrize("reverse", [False, True])
def test_rings_are_closed_and_counter_clockwise(reverse: bool) -> None:
    found = rings(read_back(make_reconstruction(SQUARE_M[::-1] if reverse else SQUARE_M)))
    assert len(found) == 6
    for ring in found:
        assert ring[0] == ring[-1]
        assert LinearRing(ring).is_ccw


def test_coordinates_are_longitude_latitude_good_to_a_millimetre() -> None:
    cones = by_role(read_back(make_reconstruction()), "cone")
    lon_deg, lat_deg = np.array([cone["geometry"]["coordinates"] for cone in cones]).T
    assert (lon_deg[1] - SITE.lon_deg) > 0 and abs(lon_deg[0] - SITE.lon_deg) < 1e-9
    position_m, _ = to_local(SITE, lat_deg, lon_deg)
    assert np.abs(position_m - SQUARE_M).max() < 1e-3


def test_says_which_coordinates_it_holds() -> None:
    placed, unplaced = make_reconstruction(), make_reconstruction(frame=None)
    assert read_back(placed)["gaia"] == {
        "coordinates": WGS84, "scene": "a drive", "status": "ok",
    }  # fmt: skip
    for collection in (read_back(unplaced), read_back(placed, local=True)):
        assert collection["gaia"]["coordinates"] == LOCAL
        cones = by_role(collection, "cone")
        assert [cone["geometry"]["coordinates"] for cone in cones] == SQUARE_M.tolist()


def test_cone_carries_its_uncertainty() -> None:
    covariance_m2 = np.array([[0.04, 0.0], [0.0, 0.01]])
    fix = make_fix("A", SQUARE_M[0], covariance_m2=covariance_m2)
    collection = read_back(make_reconstruction(changed={0: fix}))
    cone = by_role(collection, "cone")[0]["properties"]
    ellipse = confidence_ellipse(covariance_m2)
    assert ellipse is not None
    assert cone == {
        "role": "cone", "id": "A", "status": "ok", "n_ranges": 180, "mirror_probability": 0.002,
        "mirror_probability_by_ranges": 0.3, "side_source": "layout",
        "sigma_east_m": 0.2, "sigma_north_m": 0.1, "ellipse_probability": 0.9,
        "ellipse_semi_major_m": ellipse.semi_major_m, "ellipse_semi_minor_m": ellipse.semi_minor_m,
        "ellipse_azimuth_deg": 90.0,
    }  # fmt: skip
    drawn = by_role(collection, "ellipse")[0]["properties"]
    assert drawn == {**cone, "role": "ellipse"}


def test_mirror_places_only_of_ambiguous_cones() -> None:
    fix = make_fix("A", SQUARE_M[0], status=AnchorStatus.AMBIGUOUS, mirror_probability=0.4)
    collection = read_back(make_reconstruction(changed={0: fix}), local=True)
    mirror = one(collection, "mirror")
    assert mirror["properties"] == {"role": "mirror", "id": "A", "mirror_probability": 0.4}
    assert mirror["geometry"]["coordinates"] == fix.mirror_position_m.tolist()


def with_regions(*polygons: tuple[np.ndarray, ...]) -> Reconstruction:
    """Return a result whose inner region is empty and whose outer one has these polygons."""
    result = make_reconstruction()
    nothing = ProbabilityMap(np.zeros(2), 1.0, np.zeros((1, 1)))
    # What the property would keep when first asked for.
    vars(result)["boundary_uncertainty"] = BoundaryUncertainty(
        Region((), 0.0), Region(polygons, 50.0), 0.9, nothing
    )
    return result


def test_outer_region_in_one_piece_is_a_polygon_and_in_two_a_multipolygon() -> None:
    hole_m = SQUARE_M[::-1] * 0.1 + 1.0
    for pieces, kind in (
        ([(SQUARE_M, hole_m)], "Polygon"),
        ([(SQUARE_M, hole_m), (SQUARE_M + np.array([0.0, -20.0]),)], "MultiPolygon"),
    ):
        outer = one(read_back(with_regions(*pieces), local=True), "hull-outer")
        assert outer["geometry"]["type"] == kind
        assert outer["properties"] == {"role": "hull-outer", "probability": 0.9, "area_m2": 50.0}
        geometry = shape(outer["geometry"])
        assert geometry.is_valid
        assert geometry.area == pytest.approx(len(pieces) * 12.0 - 0.12)
        first, hole = getattr(geometry, "geoms", [geometry])[0].exterior, hole_m
        assert first.is_ccw and not LinearRing(hole).is_ccw


def test_an_empty_region_is_left_out() -> None:
    assert by_role(read_back(with_regions()), "hull-inner") == []
    assert by_role(read_back(with_regions()), "hull-outer") == []


def test_both_ellipses_of_an_ambiguous_cone() -> None:
    fix = make_fix("A", SQUARE_M[0], status=AnchorStatus.AMBIGUOUS, mirror_probability=0.4,
                   mirror_covariance_m2=np.diag([0.01, 0.25]))  # fmt: skip
    found = by_role(read_back(make_reconstruction(changed={0: fix}), local=True), "ellipse")
    mirrored = [each for each in found if each["properties"].get("mirror")]
    assert len(found) == 5
    (around,) = mirrored
    assert around["properties"]["sigma_north_m"] == 0.5
    centre_m = np.array(around["geometry"]["coordinates"][0][:-1]).mean(axis=0)
    assert centre_m == pytest.approx(fix.mirror_position_m, abs=1e-3)


def test_unlocated_cones_are_left_out() -> None:
    changed = {0: make_unlocated("A")}
    collection = read_back(make_reconstruction(changed=changed))
    assert [cone["properties"]["id"] for cone in by_role(collection, "cone")] == [
        "cone-1", "cone-2", "cone-3",
    ]  # fmt: skip
    assert one(collection, "outline")["properties"]["anchor_ids"] == ["cone-1", "cone-2", "cone-3"]
    assert len(by_role(collection, "ellipse")) == 3


def test_no_hull_without_an_area() -> None:
    changed = {k: make_unlocated(f"cone-{k}") for k in (0, 1)}
    collection = read_back(make_reconstruction(changed=changed))
    assert by_role(collection, "hull") == by_role(collection, "outline") == []
    assert len(by_role(collection, "cone")) == 2


def test_unknown_covariance_becomes_null_without_an_ellipse() -> None:
    fix = make_fix("A", SQUARE_M[0], covariance_m2=np.full((2, 2), np.nan))
    collection = read_back(make_reconstruction(changed={0: fix}))
    cone = by_role(collection, "cone")[0]["properties"]
    assert cone["sigma_east_m"] is None
    assert cone["ellipse_semi_major_m"] is None
    assert len(by_role(collection, "ellipse")) == 3


def test_path_is_thinned_but_keeps_its_ends_and_shape() -> None:
    reconstruction = make_reconstruction(n_steps=20_000)
    coordinates = one(read_back(reconstruction, local=True), "path")["geometry"]["coordinates"]
    assert 900 < len(coordinates) <= 1002
    path_m = reconstruction.episode.position_m
    assert coordinates[0] == path_m[0].tolist()
    assert coordinates[-1] == path_m[-1].tolist()
    assert np.diff(np.array(coordinates)[:, 0]).max() < 0.1


def test_parked_vehicle_still_gives_a_line() -> None:
    reconstruction = make_reconstruction()
    object.__setattr__(reconstruction.episode, "position_m", np.zeros((200, 2)))
    coordinates = one(read_back(reconstruction, local=True), "path")["geometry"]["coordinates"]
    assert coordinates == [[0.0, 0.0], [0.0, 0.0]]


@pytest.mark.parametrize("azimuth_deg", [0.0, 30.0, 90.0, 135.0])
def test_ellipse_axes_and_azimuth(azimuth_deg: float) -> None:
    azimuth = np.radians(azimuth_deg)
    major = np.array([np.sin(azimuth), np.cos(azimuth)])
    minor = np.array([-major[1], major[0]])
    covariance_m2 = 0.3**2 * np.outer(major, major) + 0.1**2 * np.outer(minor, minor)
    ellipse = confidence_ellipse(covariance_m2)
    assert ellipse is not None
    factor = np.sqrt(2.0 * np.log(10.0))
    assert ellipse.semi_major_m == pytest.approx(0.3 * factor)
    assert ellipse.semi_minor_m == pytest.approx(0.1 * factor)
    assert np.sin(np.radians(ellipse.azimuth_deg) - azimuth) == pytest.approx(0.0, abs=1e-9)
    outline_m = ellipse.outline_m(np.array([5.0, -2.0])) - [5.0, -2.0]
    mahalanobis2 = np.einsum("ki,ij,kj->k", outline_m, np.linalg.inv(covariance_m2), outline_m)
    assert mahalanobis2 == pytest.approx(np.full(len(outline_m), factor**2))
    assert LinearRing(outline_m).is_ccw


@given(st.floats(0.05, 0.99), st.integers(0, 2**31))
def test_ellipse_covers_with_its_probability(probability: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(2, 2)) + 0.1 * np.eye(2)
    ellipse = confidence_ellipse(root @ root.T, probability)
    assert ellipse is not None
    azimuth = np.radians(ellipse.azimuth_deg)
    drawn = rng.normal(size=(4000, 2)) @ root.T
    along = drawn @ [np.sin(azimuth), np.cos(azimuth)]
    across = drawn @ [-np.cos(azimuth), np.sin(azimuth)]
    inside = (along / ellipse.semi_major_m) ** 2 + (across / ellipse.semi_minor_m) ** 2 <= 1.0
    assert inside.mean() == pytest.approx(probability, abs=0.04)


@pytest.mark.parametrize("variance_m2", [np.nan, np.inf, 1e12])
def test_no_ellipse_where_nothing_is_known(variance_m2: float) -> None:
    assert confidence_ellipse(np.diag([0.01, variance_m2])) is None


def test_ellipse_of_a_singular_covariance_is_a_line() -> None:
    ellipse = confidence_ellipse(np.array([[1.0, 1.0], [1.0, 1.0]]))
    assert ellipse is not None
    assert ellipse.semi_minor_m == pytest.approx(0.0, abs=1e-6)
    assert ellipse.azimuth_deg == pytest.approx(45.0)


def test_lon_lat_of_unknown_places_is_nan() -> None:
    places = np.array([[0.0, 0.0], NOWHERE])
    assert np.isnan(lon_lat(None, places)).all()
    degrees = lon_lat(SITE, places)
    assert degrees[0] == pytest.approx([SITE.lon_deg, SITE.lat_deg])
    assert np.isnan(degrees[1]).all()
