from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, strategies as st
from pyproj import Geod, Transformer

from gaia_uwb.projection import to_geodetic, to_local
from gaia_uwb.scene import LocalFrame

FRAMES = st.builds(
    LocalFrame,
    lat_deg=st.floats(-85, 85),
    lon_deg=st.floats(-179.9, 179.9),
    alt_m=st.floats(-100, 4000),
)
SITE = LocalFrame(lat_deg=37.555, lon_deg=127.045, alt_m=50.0)


def test_the_origin_is_zero() -> None:
    position_m, up_m = to_local(SITE, np.array([37.555]), np.array([127.045]), np.array([50.0]))
    np.testing.assert_allclose(position_m, 0.0, atol=1e-8)
    np.testing.assert_allclose(up_m, 0.0, atol=1e-8)


@given(FRAMES, st.integers(0, 2**32 - 1))
def test_the_way_back_is_exact_within_10_km(frame: LocalFrame, seed: int) -> None:
    rng = np.random.default_rng(seed)
    position_m = rng.uniform(-1e4, 1e4, (50, 2))
    up_m = rng.uniform(-200.0, 200.0, 50)
    back_m, back_up_m = to_local(frame, *to_geodetic(frame, position_m, up_m))
    assert np.abs(back_m - position_m).max() < 1e-6
    assert np.abs(back_up_m - up_m).max() < 1e-6


@given(FRAMES, st.integers(0, 2**32 - 1))
def test_the_way_back_without_heights_is_exact_too(frame: LocalFrame, seed: int) -> None:
    position_m = np.random.default_rng(seed).uniform(-7e3, 7e3, (50, 2))
    lat_deg, lon_deg, alt_m = to_geodetic(frame, position_m)
    assert np.abs(alt_m - frame.alt_m).max() < 1e-3
    assert np.abs(to_local(frame, lat_deg, lon_deg)[0] - position_m).max() < 1e-6


def test_the_way_back_without_heights_stays_exact_far_away() -> None:
    """At 100 km the Earth has fallen away from the plane by 784 m, which is known to the mm."""
    angle_rad = np.linspace(0.0, 2.0 * np.pi, 12)
    position_m = 1e5 * np.stack([np.cos(angle_rad), np.sin(angle_rad)], axis=1)
    lat_deg, lon_deg, alt_m = to_geodetic(SITE, position_m)
    assert np.abs(alt_m - SITE.alt_m).max() < 1e-3
    back_m, up_m = to_local(SITE, lat_deg, lon_deg)
    assert np.abs(back_m - position_m).max() < 1e-3
    assert up_m == pytest.approx(-(1e5**2) / (2 * 6.37e6), rel=0.01)


@pytest.mark.parametrize("azimuth_deg", [0.0, 37.0, 90.0, 200.0, 355.0])
def test_agrees_with_the_geodesic(azimuth_deg: float) -> None:
    """On the ellipsoid, 100 m along a geodesic are 100 m in the plane, in its direction."""
    frame = LocalFrame(lat_deg=SITE.lat_deg, lon_deg=SITE.lon_deg)
    start = frame.lon_deg, frame.lat_deg
    lon_deg, lat_deg, _ = Geod(ellps="WGS84").fwd(*start, azimuth_deg, 100.0)
    position_m, up_m = to_local(frame, np.array([lat_deg]), np.array([lon_deg]))
    azimuth_rad = np.radians(azimuth_deg)
    expected_m = 100.0 * np.array([[np.sin(azimuth_rad), np.cos(azimuth_rad)]])
    np.testing.assert_allclose(position_m, expected_m, atol=1e-4)
    np.testing.assert_allclose(up_m, -(100.0**2) / (2 * 6.37e6), atol=1e-5)


def test_keeps_distances_of_space() -> None:
    """The frame is a rigid motion of the Earth-centred frame: no scale, no shear."""
    rng = np.random.default_rng(0)
    lat_deg = SITE.lat_deg + rng.uniform(-0.05, 0.05, 20)
    lon_deg = SITE.lon_deg + rng.uniform(-0.05, 0.05, 20)
    alt_m = rng.uniform(0.0, 300.0, 20)
    position_m, up_m = to_local(SITE, lat_deg, lon_deg, alt_m)
    local_m = np.column_stack([position_m, up_m])
    earth_m = np.stack(
        Transformer.from_crs(4979, 4978, always_xy=True).transform(lon_deg, lat_deg, alt_m), axis=1
    )
    np.testing.assert_allclose(
        np.linalg.norm(local_m - local_m[0], axis=1),
        np.linalg.norm(earth_m - earth_m[0], axis=1),
        atol=1e-6,
    )
