"""The check judges each run by fits that did not see it, and the same way as the real one."""

from __future__ import annotations

from dataclasses import astuple, replace
from pathlib import Path

import numpy as np
import pytest

from gaia_uwb._shared.errors import InputError
from gaia_uwb.api import load_scenes
from gaia_uwb.simulate.reality import check as simulator_check
from gaia_uwb.simulate.reality.check import (
    PAPER_ROWS,
    SIGHTS,
    VIEWS,
    SimulatorCheck,
    Split,
    case_of,
    check_simulator,
)
from gaia_uwb.simulate.reality.fit import fit_ranging
from gaia_uwb.simulate.reality.real_errors import range_errors
from gaia_uwb.simulate.reality.replay import replay
from gaia_uwb.simulate.reality.statistics import ErrorSummary, summarise
from surveyed import CASES, make_runs


@pytest.fixture(scope="module")
def check() -> SimulatorCheck:
    return check_simulator(make_runs(), n_resamples=20, n_replays=1, n_passes=2)


def test_every_choice_of_two_cases_is_checked_on_the_others(check: SimulatorCheck) -> None:
    assert len(check.splits) == 6 * len(VIEWS)
    for split in check.splits:
        assert sorted(split.fitted + split.held_out) == sorted(CASES)
    held = check.corrected_runs["calibrated"]
    # Each run is held out in 3 of the 6 choices, and has 3 anchors.
    assert {name: len(tracks) for name, tracks in held.items()} == dict.fromkeys(held, 9)
    assert set(held) == set(check.corrected_runs["real"])


def test_no_fit_sees_the_runs_it_is_judged_on(monkeypatch: pytest.MonkeyPatch) -> None:
    seen: list[set[str]] = []
    fit, again = simulator_check.fit_ranging, simulator_check.replay

    def fit_and_note(scenes):  # type: ignore[no-untyped-def]
        seen.append({case_of(scene) for scene in scenes})
        return fit(scenes).model_copy(update={"bias_m": float(len(seen))})

    def replay_and_compare(scene, settings, seed):  # type: ignore[no-untyped-def]
        if settings.bias_m >= 1.0:  # of a fit, not naive
            assert case_of(scene) not in seen[int(settings.bias_m) - 1]
        return again(scene, settings, seed)

    monkeypatch.setattr(simulator_check, "fit_ranging", fit_and_note)
    monkeypatch.setattr(simulator_check, "replay", replay_and_compare)
    check_simulator(make_runs(), n_resamples=2, n_replays=1, n_passes=1)
    assert len(seen) == 7  # six choices, and all runs for the preset
    assert seen[-1] == set(CASES)


def test_rows_cover_views_sights_and_methods(check: SimulatorCheck) -> None:
    keys = {(row.view.name, row.sight, row.method) for row in check.rows}
    for view in VIEWS:
        for sight in SIGHTS:
            assert {(view.name, sight, method) for method in PAPER_ROWS} <= keys
    rows = {(row.view.name, row.sight, row.method): row for row in check.rows}
    real = rows["corrected", "all", "real"]
    assert real.n == rows["corrected", "LOS", "real"].n + rows["corrected", "NLOS", "real"].n
    assert real.wasserstein_m == 0.0
    assert ("paper", "all", "naive, lane closure") not in keys


def test_calibrated_is_nearer_than_naive(check: SimulatorCheck) -> None:
    rows = {row.method: row for row in check.rows if row.view == VIEWS[0] and row.sight == "all"}
    assert rows["calibrated"].wasserstein_m < 0.3 * rows["naive"].wasserstein_m
    assert check.fitted.bias_m == pytest.approx(0.1, abs=0.06)


def test_gap_ratios_compare_with_the_papers_own_gap() -> None:
    real, calibrated = PAPER_ROWS["real"], PAPER_ROWS["calibrated"]
    as_paper = Split(("a",), ("b",), VIEWS[0], real, calibrated)
    assert list(as_paper.gap_ratios().values()) == pytest.approx([1.0] * 6)
    half = ErrorSummary(*np.mean([astuple(real), astuple(calibrated)], axis=0).tolist())
    ratios = replace(as_paper, calibrated=half).gap_ratios()
    assert list(ratios.values()) == pytest.approx([0.5] * 6)


def test_four_cases_are_needed() -> None:
    with pytest.raises(InputError, match="at least 4 cases"):
        check_simulator(make_runs(CASES[:3]))


def test_a_survey_is_needed() -> None:
    with pytest.raises(InputError, match="expected surveyed anchors"):
        check_simulator([run.without_truth() for run in make_runs()])


@pytest.mark.real_data
def test_unseen_real_runs_are_met_better_than_in_the_paper(outdoor_dir: Path) -> None:
    scenes = load_scenes("outdoor-uwb", data_dir=outdoor_dir)
    fitted = ("A/2", "B/3")
    model = fit_ranging([scene for scene in scenes if case_of(scene) in fitted])
    held = [scene for scene in scenes if case_of(scene) not in fitted]
    view = VIEWS[0]

    def summary(runs):  # type: ignore[no-untyped-def]
        tracks = [t.error_m for run in runs for t in range_errors(run, view.definition)]
        return summarise(tracks, outlier_m=view.outlier_m)

    real, simulated = summary(held), summary([replay(run, model, 0) for run in held])
    ratios = Split(fitted, ("A/1", "B/4"), view, real, simulated).gap_ratios()
    assert max(ratios.values()) < 0.7
