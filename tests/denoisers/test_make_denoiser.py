from __future__ import annotations

import re
from collections.abc import Callable

import pytest
from pydantic import ValidationError

from drives import METHODS
from gaia_uwb._shared.errors import ConfigError
from gaia_uwb.denoisers.registry import DENOISERS, denoiser_class, make_denoiser


def test_every_name_gives_a_class_that_declares_options_and_abilities() -> None:
    assert set(METHODS) <= set(DENOISERS)
    for name in METHODS:
        kind = denoiser_class(name)
        assert kind.Options.model_config["extra"] == "forbid"
        assert isinstance(make_denoiser(name), kind)
        assert kind.uses_pose == (name == "pose-kalman")


def test_options_reach_the_denoiser_and_are_frozen() -> None:
    denoiser = make_denoiser("kalman", {"gate_sigma": 3})
    assert denoiser.options.gate_sigma == 3.0
    assert denoiser.options.smooth is True
    with pytest.raises(ValidationError, match="frozen"):
        denoiser.options.gate_sigma = 5.0


@pytest.mark.parametrize("call", [make_denoiser, denoiser_class])
def test_an_unknown_name_lists_those_that_exist(call: Callable[[str], object]) -> None:
    with pytest.raises(ConfigError, match="'karman'; available: raw, median, kalman, pose-kalman"):
        call("karman")


@pytest.mark.parametrize(
    ("name", "options", "problem"),
    [
        ("raw", {"window_steps": 3}, "window_steps: Extra inputs .* its options are none"),
        ("median", {"window_steps": 4}, "window_steps: .*odd number"),
        ("median", {"window_steps": 0}, "window_steps: .*greater than or equal to 1"),
        ("median", {"window": 5}, "window: .*its options are .*spike_threshold_m, window_steps"),
        ("kalman", {"gate_sigma": -1.0}, "gate_sigma: .*greater than 0"),
        ("kalman", {"gate_sigma": float("nan")}, "gate_sigma: .*"),
        ("kalman", {"smooth": "yes"}, "smooth: .*valid boolean"),
        ("kalman", {"max_coast_s": -0.1, "smooth": 1}, "max_coast_s: .*; smooth: "),
        ("pose-kalman", {"acceleration_density_m2ps3": 1.0}, "offset_acceleration_density_m2ps3"),
    ],
)
def test_a_wrong_option_is_named_in_one_line(
    name: str, options: dict[str, object], problem: str
) -> None:
    with pytest.raises(ConfigError) as caught:
        make_denoiser(name, options)
    assert re.match(f"denoiser '{name}': .*{problem}", str(caught.value))
    assert "\n" not in str(caught.value)
