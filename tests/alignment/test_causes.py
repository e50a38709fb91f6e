"""The usual mistakes are named where undoing them makes the ranges fit."""

from dataclasses import replace

import numpy as np
import pytest

from gaia_uwb.alignment.causes import biased_anchors, drifting_clock, likely_cause
from gaia_uwb.estimate import ReasonKind
from gaia_uwb.projection import to_geodetic, to_local
from gaia_uwb.scene import LocalFrame, RangeLog, Scene, Trajectory

T_S = np.arange(0.0, 60.0, 0.2)
PATH_M = np.column_stack([2.0 * T_S + 5.0 * np.sin(0.3 * T_S), 5.0 * np.sin(0.2 * T_S)])
PLACES_M = np.array([[20.0, 12.0], [50.0, 14.0], [80.0, -12.0], [110.0, 13.0]])


def make_scene(*, late_s: float = 0.0, scale: float = 1.0, longer_m: float = 0.0) -> Scene:
    """Return a drive past four anchors; their clock is late, and their ranges are wrong."""
    rng = np.random.default_rng(6)
    far_m = np.sqrt(((PATH_M[:, None] - PLACES_M) ** 2).sum(axis=2))
    far_m = scale * (far_m + 0.04 * rng.standard_normal(far_m.shape)) + longer_m
    step, anchor = np.nonzero(np.ones_like(far_m, dtype=bool))
    log = RangeLog(T_S[step] + late_s, anchor, far_m[step, anchor])
    return Scene("drive", Trajectory(T_S, PATH_M), log, ("a", "b", "c", "d"))


def cause(scene: Scene) -> str:
    found = likely_cause(scene)
    if found is None:
        return ""
    assert found.kind is ReasonKind.MISFIT
    return found.text.split(" if ")[-1]


def test_a_log_that_fits_needs_no_cause() -> None:
    assert cause(make_scene()) == ""


@pytest.mark.parametrize(
    ("scale", "unit"), [(100.0, "centimetres"), (10.0, "decimetres"), (1 / 0.3048, "feet")]
)
def test_another_unit(scale: float, unit: str) -> None:
    assert cause(make_scene(scale=scale)).startswith(f"they were {unit}: then scale: ")


@pytest.mark.parametrize("longer_m", [154.0, 12.5])
def test_an_antenna_delay_of_all_radios(longer_m: float) -> None:
    said = cause(make_scene(longer_m=longer_m))
    assert said.endswith("shorter: is the radios' antenna delay set?")
    assert float(said.split()[2]) == pytest.approx(longer_m, abs=0.5)


def test_leap_seconds_between_the_clocks() -> None:
    said = cause(make_scene(late_s=18.0))
    assert said == (
        "the radio's clock were 18.0 s ahead of the trajectory's, as GPS time and UTC are "
        "(18 leap seconds)"
    )
    assert cause(make_scene(late_s=-9.3)).startswith("the radio's clock were 9.3 s behind the tr")


@pytest.mark.parametrize("whose", ["radio", "trajectory"])
def test_a_clock_that_was_set_forward(whose: str) -> None:
    scene = make_scene()
    if whose == "radio":
        stepped_s = scene.ranges.t_s + 6.0 * (scene.ranges.t_s > 25.0)
        scene = replace(scene, ranges=replace(scene.ranges, t_s=stepped_s))
    else:
        stepped = replace(scene.trajectory, t_s=T_S + 6.0 * (T_S > 25.0))
        scene = replace(scene, trajectory=stepped)
    said = cause(scene)
    assert said.startswith(f"the {whose}'s clock had not been set forward by ")
    assert float(said.split("by ")[1].split()[0]) == pytest.approx(6.0, abs=0.2)
    assert said.endswith(", 31.2 s after its start")


def test_a_clock_that_was_set_back_while_nothing_was_recorded() -> None:
    scene = make_scene()
    log = scene.ranges
    heard = (log.t_s < 20.0) | (log.t_s > 28.0)
    t_s = np.where(log.t_s > 28.0, log.t_s - 5.0, log.t_s)[heard]
    kept = RangeLog(t_s, log.anchor[heard], log.range_m[heard])
    said = cause(replace(scene, ranges=kept))
    assert said.startswith("the radio's clock had not been set back by ")
    assert float(said.split("by ")[1].split()[0]) == pytest.approx(5.0, abs=0.2)


def test_a_gap_alone_is_no_step() -> None:
    scene = make_scene()
    log = scene.ranges
    heard = (log.t_s < 20.0) | (log.t_s > 28.0)
    kept = RangeLog(log.t_s[heard], log.anchor[heard], log.range_m[heard])
    assert cause(replace(scene, ranges=kept)) == ""


def test_latitude_and_longitude_in_each_others_place() -> None:
    scene = make_scene()
    frame = LocalFrame(47.0, 11.0)
    lat_deg, lon_deg, _ = to_geodetic(frame, PATH_M)
    swapped = LocalFrame(lon_deg[0], lat_deg[0])
    position_m, _ = to_local(swapped, lon_deg, lat_deg, np.zeros(len(T_S)))
    wrong = replace(scene, trajectory=Trajectory(T_S, position_m), frame=swapped)
    assert cause(wrong) == "latitude and longitude stand in each other's place"


def test_heights_that_do_not_belong_together() -> None:
    scene = make_scene()
    up_m = 40.0 * np.sin(0.1 * T_S)
    wrong = replace(scene, trajectory=replace(scene.trajectory, up_m=up_m), anchor_up_m=np.zeros(4))
    assert cause(wrong) == "the heights were left out: then check them"


def test_ranges_without_sense_have_no_cause() -> None:
    scene = make_scene()
    range_m = np.random.default_rng(0).uniform(5.0, 80.0, len(scene.ranges))
    assert cause(replace(scene, ranges=replace(scene.ranges, range_m=range_m))) == ""


@pytest.mark.parametrize("more_m", [0.8, -0.6])
def test_one_radio_with_a_bias_of_its_own_is_named(more_m: float) -> None:
    scene = make_scene(longer_m=0.2)
    assert not list(biased_anchors(scene))
    range_m = scene.ranges.range_m + more_m * (scene.ranges.anchor == 2)
    (reason,) = biased_anchors(replace(scene, ranges=replace(scene.ranges, range_m=range_m)))
    assert (reason.kind, reason.cones) == (ReasonKind.RANGE_BIAS, ("c",))
    assert reason.numbers["bias_m"] == pytest.approx(more_m, abs=0.2)


@pytest.mark.parametrize(("rate", "said"), [(0.01, "1.0 % fast"), (-0.02, "2.0 % slow")])
def test_a_clock_that_is_fast_or_slow_is_named(rate: float, said: str) -> None:
    scene = make_scene()
    assert not list(drifting_clock(scene))
    t_s = 30.0 + (scene.ranges.t_s - 30.0) * (1.0 + rate)
    (reason,) = drifting_clock(replace(scene, ranges=replace(scene.ranges, t_s=t_s)))
    assert reason.kind is ReasonKind.CLOCK
    assert f"the radio's clock runs about {said}" in reason.text
    assert reason.numbers["drift"] == pytest.approx(rate, rel=0.15)


def test_noise_alone_is_no_drift() -> None:
    scene = make_scene()
    noise_m = np.random.default_rng(2).normal(0.0, 0.4, len(scene.ranges))
    range_m = scene.ranges.range_m + noise_m
    assert not list(drifting_clock(replace(scene, ranges=replace(scene.ranges, range_m=range_m))))


def test_an_anchor_with_much_noise_is_not_called_biased() -> None:
    scene = make_scene()
    noise_m = np.random.default_rng(1).normal(0.0, 0.5, len(scene.ranges))
    range_m = scene.ranges.range_m + np.where(scene.ranges.anchor == 1, noise_m, 0.0)
    assert not list(biased_anchors(replace(scene, ranges=replace(scene.ranges, range_m=range_m))))
