import pytest

from gaia_uwb._shared.errors import ConfigError
from gaia_uwb.cli.options import Closure, Side, with_prior
from gaia_uwb.config import PipelineConfig, make_config


def said(**options):
    given = {"side": None, "closure": None, "spacing_m": None, "known_anchors": None} | options
    return with_prior(PipelineConfig(), **given).prior


def test_nothing_said_leaves_the_settings_as_they_are():
    settings = make_config({"prior": {"side": "left"}})
    assert with_prior(settings, None, None, None, None) is settings


def test_options_override_settings_one_by_one():
    settings = make_config({"denoiser": "raw", "prior": {"side": "left", "spacing_m": 8.0}})
    changed = with_prior(settings, Side.RIGHT, Closure.LANE_SHIFT, None, [])
    assert (changed.prior.side, changed.prior.closure) == ("right", "lane-shift")
    assert (changed.prior.spacing_m, changed.denoiser) == (8.0, "raw")


def test_surveyed_cones_in_metres_and_degrees():
    local, earth, odd = said(
        known_anchors=["a=1.5,-2", "b=@48.1,11.5,0.3", "x=y=0,0"]
    ).known_anchors
    assert (local.anchor_id, local.east_m, local.north_m) == ("a", 1.5, -2.0)
    assert (earth.lat_deg, earth.lon_deg, earth.sigma_m) == (48.1, 11.5, 0.3)
    assert odd.anchor_id == "x=y"


@pytest.mark.parametrize(
    "text", ["a", "a=1", "=1,2", "a=1,2,3,4", "a=east,north", "a=@91,0", "a=nan,0", "a=1,2,-1"]
)
def test_what_is_no_place_is_refused_in_one_line(text):
    with pytest.raises(ConfigError, match="known") as caught:
        said(known_anchors=[text])
    assert "\n" not in str(caught.value)
