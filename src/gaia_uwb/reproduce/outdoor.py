"""Table 1: all methods on the outdoor data set, and what each part of the alignment is worth.

A learned method's models are trained once for each fold, on windows of 64 steps, and applied to all
lengths; no model is scored on ranges that it has seen:

``window``  a fifth of the windows is held out, the same layouts in training and test. A longer
            episode is denoised window by window, each by the model that has not seen it.
``run``     one run is held out.
``layout``  all runs past one layout are held out.
``sim``     trained on the simulator's stress preset only. Its coordinates mean nothing here, and
            what a network knows of layouts does not either.

A window of 64 or 256 steps is denoised and located from its own ranges alone; the clock's offset
and the range bias were found from its whole run, without truth.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

from gaia_uwb.config import PipelineConfig
from gaia_uwb.episode import Episode
from gaia_uwb.evaluate import make_test
from gaia_uwb.learn import held_out, n_folds, preparation_config
from gaia_uwb.reproduce.plan import (
    CLASSICAL,
    TRAINING_PRESET,
    VARIANTS,
    Method,
    existing_methods,
    paper_solver,
)
from gaia_uwb.reproduce.predictions import Pieces, Solver, Stretch, held_out_pieces, whole
from gaia_uwb.reproduce.scores import NO_SPLIT, Row, Table, score_row
from gaia_uwb.reproduce.trainings import Data, Training, outdoor_training
from gaia_uwb.reproduce.workshop import OUTDOOR, Workshop

SIM = "sim"
WINDOW_STEPS = 64
SOLVERS = {
    "wls": "wls, each anchor by itself, with the true NLOS labels",
    "robust": "robust, sides jointly, without labels",
}
"""Solvers of table 1, in words."""


@dataclass(frozen=True)
class _Cut:
    """Episodes of one length, and where each lies in the runs."""

    episodes: tuple[Episode, ...]
    places: tuple[tuple[int, int], ...]
    groups: tuple[str, ...]
    empty: int


@dataclass(frozen=True)
class _Source:
    """Who denoises which runs: one row of the tables with one of its models."""

    label: str
    denoisers: tuple[tuple[str, ...], ...]
    """For each run, one for all of it, or one for each of its windows."""


def outdoor_trainings(workshop: Workshop) -> list[Training]:
    """Return all trainings of table 1: every fold of every split, for every preparation.

    Parameters
    ----------
    workshop
        What all parts need.
    """
    plan = workshop.plan
    found: list[Training] = []
    for preparation in plan.preparations:
        for split in plan.splits:
            if split != SIM:
                for fold in range(n_folds(split, workshop.runs(preparation))):
                    own = _fold_trainings(workshop, preparation, f"{split}/{fold}")
                    found += [training for trainings in own.values() for training in trainings]
    if SIM in plan.splits:
        own = workshop.stress_trainings(existing_methods())
        found += [training for trainings in own.values() for training in trainings]
    return found


def _fold_trainings(workshop: Workshop, preparation: str, split: str) -> dict[str, list[Training]]:
    plan, data = workshop.plan, Data(OUTDOOR, split, workshop.runs(preparation))
    return {
        method.name: [
            outdoor_training(
                workshop.models.path,
                method.name,
                plan.recipe(method.network, seed, preparation=preparation),
                data,
                workshop.version,
            )
            for seed in plan.outdoor_seeds
        ]
        for method in existing_methods()
        if method.network is not None
    }


def outdoor_tables(workshop: Workshop) -> dict[str, Table]:
    """Score all methods on the outdoor data in every split, preparation and length.

    Parameters
    ----------
    workshop
        What all parts need.

    Returns
    -------
    dict
        Tables by ``PREPARATION/LENGTH/SOLVER``; each has a row per method and split.
    """
    plan = workshop.plan
    workshop.train(outdoor_trainings(workshop))
    tables: dict[str, Table] = {}
    for preparation in plan.preparations:
        runs = workshop.runs(preparation)
        prepared = preparation_config(preparation)
        solvers = {
            "wls": Solver(paper_solver(prepared), labels=True),
            "robust": Solver(prepared, labels=False),
        }
        for length in plan.lengths:
            cut = _cut(runs, length)
            if not cut.episodes:
                continue
            rows: dict[str, list[Row]] = {name: [] for name in solvers}
            for method, split, sources in _sources(workshop, preparation):
                where = f"outdoor/{preparation}-{length or 'whole'}"
                workshop.watch(f"{where}: {method.name} {split}")
                pieces = [_pieces(cut, source) for source in sources]
                found = [
                    workshop.predict(where, source.label, cut.episodes, own, solvers)
                    for source, own in zip(sources, pieces, strict=True)
                ]
                for name, own_rows in rows.items():
                    row = score_row(method.name, split, found, cut.episodes, name)
                    own_rows.append(replace(row, pieces=pieces[0]))
            for name, own in rows.items():
                protocol = _protocol(workshop, preparation, length, name, cut)
                key = f"{preparation}/{length or 'whole'}/{name}"
                tables[key] = Table(protocol, cut.episodes, cut.groups, name, tuple(own))
    return tables


def _cut(runs: Sequence[Episode], length: int | None) -> _Cut:
    """Cut runs into episodes one after another; those without a range say nothing."""
    found, places, empty = [], [], 0
    for k, run in enumerate(runs):
        starts = [0] if length is None else range(0, run.n_steps - length + 1, length)
        for start in starts:
            episode = run if length is None else run.window(start, start + length)
            if episode.valid.any():
                found.append(episode)
                places.append((k, start))
            else:
                empty += 1
    return _Cut(tuple(found), tuple(places), tuple(runs[k].name for k, _ in places), empty)


def _sources(workshop: Workshop, preparation: str) -> Iterator[tuple[Method, str, list[_Source]]]:
    """Yield every row of the tables with who denoises what, one source for each seed."""
    plan, runs = workshop.plan, workshop.runs(preparation)
    for method in existing_methods():
        if method.network is None:
            split = SIM if method.packaged else NO_SPLIT
            yield method, split, [_Source(method.name, _everywhere(method.name, runs))]
            continue
        for split in plan.splits:
            if split == SIM:
                trainings = workshop.stress_trainings([method])[method.name]
                yield (
                    method,
                    split,
                    [
                        _Source(f"{method.name}-{SIM}-{k}", _everywhere(t.denoiser, runs))
                        for k, t in enumerate(trainings)
                    ],
                )
            else:
                yield method, split, _fold_sources(workshop, preparation, split, method)


def _everywhere(name: str, runs: Sequence[Episode]) -> tuple[tuple[str, ...], ...]:
    return tuple((name,) for _ in runs)


def _fold_sources(
    workshop: Workshop, preparation: str, split: str, method: Method
) -> list[_Source]:
    """Let every run, or every window of a run, be denoised by the model of its fold."""
    runs = workshop.runs(preparation)
    sources = []
    for k in range(len(workshop.plan.outdoor_seeds)):
        names: list[list[str]] = [[""] * max(1, run.n_steps // WINDOW_STEPS) for run in runs]
        for fold in range(n_folds(split, runs)):
            own = _fold_trainings(workshop, preparation, f"{split}/{fold}")[method.name][k].denoiser
            for run, start in held_out(runs, f"{split}/{fold}", WINDOW_STEPS):
                names[run][start // WINDOW_STEPS] = own
        # A window without a range is in no fold, and there is nothing in it to be denoised.
        filled = tuple(
            tuple(name or next(filter(None, of_run)) for name in of_run) for of_run in names
        )
        if split != "window":
            filled = tuple(of_run[:1] for of_run in filled)
        sources.append(_Source(f"{method.name}-{split}-{k}", filled))
    return sources


def _pieces(cut: _Cut, source: _Source) -> Pieces:
    return [
        [Stretch(names[0], 0, episode.n_steps, 0)]
        if len(names) == 1
        else held_out_pieces(episode, names, start, WINDOW_STEPS)
        for episode, (run, start) in zip(cut.episodes, cut.places, strict=True)
        for names in [source.denoisers[run]]
    ]


def _protocol(
    workshop: Workshop, preparation: str, length: int | None, solver: str, cut: _Cut
) -> dict[str, Any]:
    plan = workshop.plan
    return {
        "data": OUTDOOR,
        "preparation": preparation,
        "length": length or "whole",
        "solver": SOLVERS[solver],
        "training_seeds": list(plan.outdoor_seeds),
        "sim_trained_on": f"sim:{TRAINING_PRESET}",
        "sim_training_seeds": list(plan.stress_seeds),
        "windows_without_ranges": cut.empty,
    }


def alignment_tables(workshop: Workshop) -> dict[str, Table]:
    """Score the methods without training with parts of the alignment switched off.

    Parameters
    ----------
    workshop
        What all parts need.

    Returns
    -------
    dict
        Tables by the variant's title.
    """
    tables = {}
    for k, variant in enumerate(VARIANTS):
        workshop.watch(f"alignment: {variant.title}")
        test = make_test(workshop.scenes, variant.length, variant.config)
        solver = Solver(variant.config, variant.labels)
        rows = []
        for name in CLASSICAL:
            found = workshop.predict(
                f"alignment/{k}", name, test.episodes, whole(name, test.episodes), {"own": solver}
            )
            rows.append(score_row(name, NO_SPLIT, [found], test.episodes, "own"))
        protocol = {
            "data": OUTDOOR,
            "length": variant.length or "whole",
            "solver": variant.config.solver.kind,
            "true_nlos_labels": variant.labels,
            "settings": _changed(variant.config),
            "windows_without_ranges": test.windows_without_ranges,
        }
        tables[variant.title] = Table(protocol, test.episodes, test.groups, "own", tuple(rows))
    return tables


def _changed(config: PipelineConfig) -> dict[str, Any]:
    """Return the settings that are not the defaults, as a settings file would hold them."""
    default = PipelineConfig().model_dump(mode="json")
    changed: dict[str, Any] = {}
    for section, values in config.model_dump(mode="json").items():
        if isinstance(values, dict):
            own = {k: v for k, v in values.items() if default[section][k] != v}
            if own:
                changed[section] = own
    return changed
