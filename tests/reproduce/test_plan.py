"""Plans shrink what they say they shrink, and rows without a denoiser are passed over."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from gaia_uwb.learn.recipes import ABLATIONS, KINDS
from gaia_uwb.reproduce import plan as plans
from gaia_uwb.reproduce.plan import (
    BASELINES,
    CLASSICAL,
    METHODS,
    QUICK,
    REFERENCES,
    Method,
    Plan,
    ablation_methods,
    existing_methods,
)
from surveyed import make_runs


def test_every_named_method_is_a_row() -> None:
    names = {method.name for method in METHODS}
    assert {*BASELINES, *CLASSICAL, *REFERENCES, *KINDS} <= names
    assert [method.name for method in ablation_methods()][-1] == "gaia"
    assert {method.name for method in ablation_methods()} == set(ABLATIONS)


def test_a_row_without_a_denoiser_is_passed_over(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(plans, "METHODS", (Method("raw"), Method("not-yet", packaged=True)))
    assert [method.name for method in existing_methods()] == ["raw"]


def test_the_full_plan_changes_no_recipe() -> None:
    full, quick = (p.recipe(KINDS["gaia"], 3, preparation="published") for p in (Plan(), QUICK))
    assert full.training.seed == 3
    assert full.training.epochs > quick.training.epochs == 1
    assert full.sets.preparation == quick.sets.preparation == "published"
    narrow = replace(QUICK, hidden=5).recipe(KINDS["gaia"], 0).network
    assert {narrow.base_hidden, narrow.gru_hidden, narrow.head_hidden} == {5}


def test_logs_are_cut_with_their_truth() -> None:
    runs = make_runs(("A/1",))
    short = replace(Plan(), run_s=10.0).shortened(runs)
    for before, after in zip(runs, short, strict=True):
        assert np.ptp(after.trajectory.t_s) <= 10.0
        assert 0 < len(after.ranges) < len(before.ranges)
        assert after.truth is not None
        assert after.truth.nlos is not None
        assert len(after.truth.nlos) == len(after.ranges)
    assert Plan().shortened(runs) == runs
