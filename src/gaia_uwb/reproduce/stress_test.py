"""Table 2 and the ablations: methods on the stress test, past layouts that no model has seen."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from gaia_uwb.learn import KINDS
from gaia_uwb.reproduce.plan import TEST_PRESET, TEST_SEED, TRAINING_PRESET, Method
from gaia_uwb.reproduce.predictions import whole
from gaia_uwb.reproduce.scores import NO_SPLIT, Table, score_row
from gaia_uwb.reproduce.workshop import STRESS_SOLVERS, Workshop


def stress_table(workshop: Workshop, methods: Sequence[Method]) -> Table:
    """Score methods on the stress test; trains what is missing.

    Parameters
    ----------
    workshop
        What all parts need.
    methods
        Rows of the table.
    """
    denoisers = stress_denoisers(workshop, methods)
    episodes = workshop.stress_test
    rows = []
    for method, names in denoisers.items():
        workshop.watch(f"stress test: {method}")
        found = [
            workshop.predict(
                "stress", f"{method}-{k}", episodes, whole(name, episodes), STRESS_SOLVERS
            )
            for k, name in enumerate(names)
        ]
        rows.append(score_row(method, NO_SPLIT, found, episodes, "wls"))
    groups = tuple(episode.name for episode in episodes)
    return Table(stress_protocol(workshop), episodes, groups, "wls", tuple(rows))


def stress_denoisers(workshop: Workshop, methods: Sequence[Method]) -> dict[str, list[str]]:
    """Return each method's denoisers, one for each of its models; trains what is missing.

    Parameters
    ----------
    workshop
        What all parts need.
    methods
        In their order.
    """
    trainings = workshop.stress_trainings(methods)
    workshop.train([training for own in trainings.values() for training in own])
    return {
        method.name: [t.denoiser for t in trainings.get(method.name, [])] or [method.name]
        for method in methods
    }


def stress_protocol(workshop: Workshop) -> dict[str, Any]:
    """Return what is done to every method of the stress test, for the reader.

    Parameters
    ----------
    workshop
        Gives the plan.
    """
    plan = workshop.plan
    sets = plan.recipe(KINDS["gaia"], 0).sets
    return {
        "data": f"sim:{TEST_PRESET}/{TEST_SEED}/{plan.n_test}",
        "split": "layouts of training and test are disjoint",
        "length": 64,
        "solver": "wls, each anchor by itself, with the true NLOS labels",
        "training_seeds": list(plan.stress_seeds),
        "trained_on": f"sim:{TRAINING_PRESET}, {sets.n_training} episodes",
    }
