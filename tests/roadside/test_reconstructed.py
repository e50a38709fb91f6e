"""The road boundary of whole reconstructions."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from factories import make_reconstruction
from gaia_uwb.api import load_scenes, reconstruct
from gaia_uwb.estimate import AnchorStatus
from gaia_uwb.reconstruction import Reconstruction
from road_forms import road_form


@pytest.fixture(scope="module")
def bend() -> Reconstruction:
    """A row of cones on the left of a bend, passed in two directions."""
    return reconstruct(list(road_form(1010).drives))


def test_a_row_is_found_and_everything_is_on_its_side(bend: Reconstruction) -> None:
    assert bend.road_boundary is not None
    assert bend.road_boundary is bend.road_boundary, "it is computed once"
    (zone,) = bend.road_boundary.zones
    assert (zone.form.value, zone.edges[0].side.value) == ("one-row", "left")
    assert len(zone.cones) == len(bend.anchors)
    assert [path.along for path in bend.road_boundary.paths] == [1, -1]


@pytest.mark.parametrize("status", [AnchorStatus.DOES_NOT_FIT, AnchorStatus.MOVED])
def test_cones_that_are_nothing_to_go_by_shape_no_edge(
    bend: Reconstruction, status: AnchorStatus
) -> None:
    ids = [anchor.anchor_id for anchor in bend.anchors]
    doubtful = [
        replace(anchor, status=status if k in (3, 4) else anchor.status)
        for k, anchor in enumerate(bend.anchors)
    ]
    found = replace(bend, anchors=tuple(doubtful)).road_boundary
    assert found is not None
    assert set(found.unlocated) == {ids[3], ids[4]}
    assert not {ids[3], ids[4]} & set(found.zones[0].cones)
    all_doubtful = tuple(replace(anchor, status=status) for anchor in bend.anchors)
    found = replace(bend, anchors=all_doubtful).road_boundary
    assert found is not None
    assert found.unlocated == (), "there is nothing better"


def test_without_possible_places_there_is_none() -> None:
    assert make_reconstruction().road_boundary is None


@pytest.mark.real_data
def test_recorded_cones_are_an_area_and_the_path_is_outside(outdoor_dir: Path) -> None:
    """Somebody walked around four cones: there is no road."""
    for scene in load_scenes("outdoor-uwb", data_dir=outdoor_dir):
        result = reconstruct(scene)
        assert result.road_boundary is not None
        (zone,) = result.road_boundary.zones
        assert zone.form.value == "area", scene.name
        assert zone.drove_through is None
        assert zone.closed is not None
        assert 0.8 < zone.closed.region.area_m2 / result.boundary.area_m2 < 1.1
