"""The comparison with general solvers: its solvers, its counts, and that it goes on."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

import _drives
import _peers
import peers
from _drives import Case, in_drive, shuffled
from _peers import Gtsam, Place, Readings, Result, SciPy, each_alone, results_of
from gaia_uwb.scene import Scene
from peers import Cones, fused_row, interval_95
from roads import Radios, road_drives

NO_OFFSET = Radios(noise_m=0.03, bias_m=0.0, delay_m=0.0, offset_s=0.0, trucks_per_s=0.0)


def place(
    off_m: tuple[float, float],
    *,
    sigma_m: float = 0.1,
    mirror_m: tuple[float, float] = (np.nan, np.nan),
    mirror_probability: float = np.nan,
    status: str = "ok",
    true_m: tuple[float, float] = (0.0, 0.0),
) -> Place:
    return Place.of(
        "cone",
        np.array(true_m),
        np.add(true_m, off_m),
        sigma_m**2 * np.eye(2),
        np.array(mirror_m),
        mirror_probability=mirror_probability,
        status=status,
    )


@pytest.mark.parametrize("make_solver", [SciPy, Gtsam])
def test_a_general_solver_finds_a_cone_and_states_the_covariance_of_white_noise(
    make_solver: type[SciPy | Gtsam],
) -> None:
    if make_solver is Gtsam:
        pytest.importorskip("gtsam")
    solver = make_solver()
    (scene,) = road_drives("u-turn", 1, radios=NO_OFFSET)
    assert scene.truth is not None
    for anchor_id, true_m in zip(scene.anchor_ids[:3], scene.truth.anchor_m, strict=False):
        readings = Readings.of([scene], anchor_id)
        minima = [solver.fit(readings, start_m) for start_m in readings.starts_m()]
        position_m = min(minima, key=lambda minimum: minimum[0])[1]
        assert np.hypot(*(position_m - true_m)) < 0.05
        apart_m = true_m - readings.tag_m
        slant_m = np.hypot(np.hypot(*apart_m.T), readings.height_gap_m)
        jacobian = apart_m / slant_m[:, None]
        variance_m2 = np.var(readings.range_m - slant_m)
        white_m2 = variance_m2 * np.linalg.inv(jacobian.T @ jacobian)
        ratio = np.linalg.eigvals(
            solver.covariance_m2(readings, position_m) @ np.linalg.inv(white_m2)
        )
        np.testing.assert_allclose(ratio, 1.0, atol=0.15)


def test_each_anchor_is_located_alone_and_keeps_its_other_minimum() -> None:
    (scene,) = road_drives("single", 2, radios=NO_OFFSET)
    places, status = each_alone(SciPy())([scene])
    assert status == ""  # no verdict on the log
    assert [each.anchor_id for each in places] == list(scene.anchor_ids)
    for each in places:
        off_m = [
            np.hypot(*np.subtract(found_m, each.true_m))
            for found_m in (each.position_m, each.mirror_position_m)
        ]
        assert min(off_m) < 0.5 < max(off_m)  # one of the two is on the other side of the road


def test_gtsam_and_scipy_find_the_same_minimum() -> None:
    pytest.importorskip("gtsam")
    (scene,) = road_drives("single", 2)
    for anchor_id in scene.anchor_ids[:3]:
        readings = Readings.of([scene], anchor_id)
        for start_m in readings.starts_m()[::4]:
            one, other = (solver.fit(readings, start_m)[1] for solver in (SciPy(), Gtsam()))
            np.testing.assert_allclose(one, other, atol=0.03)


def test_all_passes_count_with_their_own_poses() -> None:
    passes = road_drives("opposite directions", 0, radios=NO_OFFSET)
    readings = Readings.of(passes, "c07")
    alone = [Readings.of([scene], "c07") for scene in passes]
    assert len(readings.range_m) == sum(len(each.range_m) for each in alone)
    assert passes[0].truth is not None
    apart_m = np.hypot(*(readings.tag_m - passes[0].truth.anchor_m[7]).T)
    error_m = readings.range_m - np.hypot(apart_m, readings.height_gap_m)
    assert np.abs(error_m).max() < 6 * NO_OFFSET.noise_m


@pytest.mark.parametrize("block_s", [None, 8.0])
def test_shuffling_moves_every_error_and_loses_none(block_s: float | None) -> None:
    (scene,) = road_drives("u-turn", 0)
    assert scene.truth is not None
    assert scene.truth.range_m is not None
    moved = shuffled(scene, block_s)
    before_m, after_m = (s.ranges.range_m - scene.truth.range_m for s in (scene, moved))
    followed, stayed = 0, 0
    for anchor in range(scene.n_anchors):
        rows = np.flatnonzero((scene.ranges.anchor == anchor) & in_drive(scene))
        order, shuffled_order = np.argsort(before_m[rows]), np.argsort(after_m[rows])
        # The offset is found on a grid of 0.01 s, in which the vehicle moves 0.2 m.
        np.testing.assert_allclose(before_m[rows][order], after_m[rows][shuffled_order], atol=0.2)
        new_place = np.empty(len(rows), np.int64)
        new_place[shuffled_order] = order
        followed += int((np.diff(new_place) == 1).sum())
        stayed += int((new_place == np.arange(len(rows))).sum())
    assert stayed / len(scene.ranges) < 0.5
    share = followed / len(scene.ranges)  # of errors that still follow the one before them
    assert share > 0.5 if block_s else share < 0.1
    assert moved.truth is not None
    assert moved.truth.range_m is None  # no longer true of the moved readings


def test_cones_are_counted_once_and_for_what_they_are() -> None:
    result = Result(
        "run",
        (
            place((0.1, 0.0)),  # one standard deviation
            place((0.3, 0.0), mirror_m=(5.0, 0.0), mirror_probability=0.04),  # three
            place((4.0, 0.0), mirror_m=(0.0, 0.0), mirror_probability=0.01),  # forty: wrong side
            place((9.0, 0.0), mirror_m=(0.0, 0.0), mirror_probability=0.4, status="ambiguous"),
            place((np.nan, np.nan), status="too-few-ranges"),
        ),
        "unreliable",
        1.0,
    )
    cells = dict(zip(peers.COLUMNS, peers.summary([result], None), strict=True))
    assert (cells["cones"], cells["located"], cells["called ok"]) == ("5", "4", "3")
    assert cells["90 % ellipse"].startswith("33.3 % of 3 ")
    assert cells["beyond 99.9 %"] == "1"
    assert cells["logs ok"] == "0 of 1"
    assert cells["RMSE (m)"] == f"{np.sqrt((0.01 + 0.09 + 16 + 81) / 4):.3g}"
    assert cells["wrong sides (expected)"] == "1 (0.1)"
    assert Cones.of(result).sides() == (1, pytest.approx(0.05))
    silent = Result("run", result.places[:1], "", 1.0)
    assert "0 (none stated)" in peers.summary([silent], None)


def test_alignment_takes_the_frame_out_of_the_coverage() -> None:
    corners_m = [(0.0, 0.0), (30.0, 0.0), (30.0, 4.0), (0.0, 4.0)]
    angle_rad = np.radians(1.0)
    turn = np.array([[0.0, -angle_rad], [angle_rad, 0.0]])
    places = tuple(
        place(tuple(turn @ corner_m + [0.5, -0.5]), true_m=corner_m) for corner_m in corners_m
    )
    cones = Cones.of(Result("run", places, "ok", 1.0))
    assert (cones.chi_square() > peers.CHI_SQUARE_99_9).all()
    assert (cones.chi_square_aligned() < 0.1).all()
    two = Cones.of(Result("run", places[:2], "ok", 1.0))
    assert not len(two.chi_square_aligned())  # two cones nearly always align


def test_the_interval_is_the_wider_of_wilson_and_bootstrap() -> None:
    low, high = interval_95([np.ones(4, np.bool_)] * 8)
    assert low == pytest.approx(32 / (32 + 1.96**2))  # Wilson's, all inside
    assert high == 1.0
    runs = [np.full(40, k < 4) for k in range(8)]  # a run is all inside or all outside
    low, high = interval_95(runs)
    assert low < 0.2
    assert high > 0.8


def test_a_ratio_is_a_geometric_mean_over_runs() -> None:
    two, half, one = (Cones.of(Result("run", (place((e, 0.0)),), "", 1.0)) for e in (2.0, 0.5, 1.0))
    assert peers.ratio([two, half], [one, one]) == pytest.approx(1.0)
    assert peers.ratio([two, two], [one, half]) == pytest.approx(np.sqrt(2.0 * 4.0))


def test_a_fused_result_is_worse_only_beyond_what_it_states() -> None:
    def pair(fused_m: float) -> tuple[Result, list[Result]]:
        errors_m = {"pair-0": fused_m, "pair-0-0": 0.1, "pair-0-1": 1.0}
        fused, *alone = (Result(k, (place((e, 0.0)),), "", 1.0) for k, e in errors_m.items())
        return fused, alone

    for fused_m, worse in ((0.3, "0"), (0.4, "1")):  # 0.1 m, and 0.215 m is its 90 % radius
        fused, alone = pair(fused_m)
        assert fused_row([fused], alone)[-1] == worse


def test_an_interrupted_run_goes_on_and_a_changed_method_begins_anew(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (scene,) = road_drives("single", 0)
    cases = [Case(name, (scene,)) for name in "abc"]
    calls: list[int] = []

    def locate(passes: Sequence[Scene]) -> tuple[list[Place], str]:
        calls.append(len(passes))
        if len(calls) == 3:
            raise KeyboardInterrupt
        return [place((0.1, 0.0))], "ok"

    monkeypatch.setattr(_peers, "made_by", lambda method: method)
    with pytest.raises(KeyboardInterrupt):
        results_of("data", cases, "ours", locate, tmp_path)
    results = results_of("data", cases, "ours", locate, tmp_path)
    assert [result.name for result in results] == ["a", "b", "c"]
    assert len(calls) == 4
    assert results_of("data", cases, "ours", locate, tmp_path) == results_of(
        "data", cases, "ours", locate, tmp_path
    )
    assert len(calls) == 4
    monkeypatch.setattr(_peers, "made_by", lambda method: method + " changed")
    results_of("data", cases, "ours", locate, tmp_path)
    assert len(calls) == 7


def test_data_that_are_not_here_are_left_out_with_a_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit):
        peers.main(["--data", "lias", "outdoor-uwb", "--data-dir", str(tmp_path)])
    assert capsys.readouterr().err.count("left out: there is no") == 2
    assert list(_drives.data_sets(["lias", "roads"], 1, tmp_path)) == [
        *(f"road, {kind}" for kind in _drives.ROAD_KINDS),
        *(f"road, {kind}, each pass" for kind in _drives.PAIRS),
    ]


@pytest.mark.slow
def test_the_page_is_written_from_road_drives(tmp_path: Path) -> None:
    table = tmp_path / "page.md"
    options = ["--data", "roads", "--methods", "ours", "scipy", "--n", "1"]
    peers.main([*options, "--out", str(tmp_path), "--table", str(table)])
    page = table.read_text(encoding="utf-8")
    for kind in _drives.ROAD_KINDS:
        assert f"\n## road, {kind}, n = 1\n" in page
    assert page.count("\n| ours | ") == page.count("\n| SciPy | ") == 4
    assert page.count("each pass") == 0
    assert "\n| road, two lanes | ours | 1 | " in page
