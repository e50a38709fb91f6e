"""What is compared, and with how much: methods, splits, seeds and sizes.

A table's rows are :data:`METHODS`. Another denoiser becomes a row everywhere by one line there;
while it does not exist it is passed over.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from gaia_uwb.config import (
    AlignmentConfig,
    CalibrationConfig,
    PipelineConfig,
    SidesConfig,
    SolverConfig,
)
from gaia_uwb.denoisers import DENOISERS
from gaia_uwb.evaluate import STRESSORS, Stressor
from gaia_uwb.learn import ABLATIONS, KINDS, Recipe, make_recipe
from gaia_uwb.models import GaiaArchitecture, WindowArchitecture
from gaia_uwb.scene import RangeLog, Scene, Trajectory

TEST_PRESET, TRAINING_PRESET, TEST_SEED = "stress-test", "stress", 0
"""The stress test, its seed, and what its models are trained on."""


@dataclass(frozen=True)
class Method:
    """A row of the tables.

    Parameters
    ----------
    name
        What the tables call it; also its denoiser, unless it is trained.
    network
        What is trained for the tables; ``None`` for a classical denoiser, and for one whose model
        comes with the package and is therefore the same in every split.
    packaged
        Whether its model comes with the package.
    """

    name: str
    network: WindowArchitecture | None = None
    packaged: bool = False

    @property
    def exists(self) -> bool:
        """Whether there is a denoiser for it."""
        return self.network is not None or self.name in DENOISERS


METHODS = (
    Method("raw"),
    Method("median"),
    Method("kalman"),
    Method("mlp", KINDS["mlp"]),
    Method("pose-kalman"),
    Method("pose-mlp", KINDS["pose-mlp"]),
    Method("gaia", KINDS["gaia"]),
    Method("gaia-set", packaged=True),
)
"""Rows of tables 1, 2 and 4, in their order."""

BASELINES = ("kalman", "mlp", "pose-kalman", "pose-mlp")
"""The paper's baselines; the margin of table 4 is relative to the best of them."""

REFERENCES = ("gaia", "gaia-set")
"""Methods that all others are subtracted from in tables of paired differences."""

CLASSICAL = ("raw", "median", "kalman", "pose-kalman")
"""Rows of the tables on what the alignment is worth."""


def existing_methods() -> tuple[Method, ...]:
    """Return the rows for which there is a denoiser.

    Examples
    --------
    >>> [method.name for method in existing_methods()][:4]
    ['raw', 'median', 'kalman', 'mlp']
    """
    return tuple(method for method in METHODS if method.exists)


def ablation_methods() -> tuple[Method, ...]:
    """Return the whole network and the paper's three ablations, the whole one last."""
    names = [*[name for name in ABLATIONS if name != "gaia"], "gaia"]
    return tuple(Method(name, ABLATIONS[name]) for name in names)


def paper_solver(config: PipelineConfig) -> PipelineConfig:
    """Return settings with the paper's solver: weighted least squares, each anchor by itself.

    Parameters
    ----------
    config
        All other settings.
    """
    return config.model_copy(
        update={"solver": SolverConfig(kind="wls"), "sides": SidesConfig(joint=False)}
    )


_PUBLISHED_ALIGNMENT = AlignmentConfig(clock_offset="off", gate=False, resample="nearest")
_NO_BIAS = CalibrationConfig(range_bias="off")


@dataclass(frozen=True)
class Variant:
    """A way to prepare and to locate, for the tables on what the alignment is worth."""

    title: str
    length: int | None
    config: PipelineConfig
    labels: bool = False


VARIANTS = (
    Variant("whole runs", None, PipelineConfig()),
    Variant("windows of 64 steps", 64, PipelineConfig()),
    Variant(
        "windows of 64 steps, range bias not removed",
        64,
        PipelineConfig(calibration=_NO_BIAS),
    ),
    Variant(
        "windows of 64 steps, each anchor's side decided separately",
        64,
        PipelineConfig(sides=SidesConfig(joint=False)),
    ),
    Variant(
        "windows of 64 steps, data as published: nearest sample, no clock offset, gate or bias",
        64,
        PipelineConfig(alignment=_PUBLISHED_ALIGNMENT, calibration=_NO_BIAS),
    ),
    Variant(
        "windows of 64 steps, data as published, wls with true NLOS labels, sides jointly",
        64,
        PipelineConfig(
            alignment=_PUBLISHED_ALIGNMENT, calibration=_NO_BIAS, solver=SolverConfig(kind="wls")
        ),
        labels=True,
    ),
)


@dataclass(frozen=True)
class Plan:
    """How much of everything; the defaults are the full size.

    Parameters
    ----------
    quick
        Whether it is a quick run, whose numbers mean nothing.
    n_test
        Episodes of the stress test; the paper has 216.
    stress_seeds, outdoor_seeds
        Of the models of each learned method on the stress test, and in every fold of the outdoor
        data.
    splits, preparations, lengths
        Of table 1; ``None`` is a whole run.
    stressors
        Of table 4.
    n_replays, n_passes, n_resamples
        Of table 5: repeats of each drive, passes along the lane closure, bootstrap draws.
    epochs, n_training, n_validation, training_stride, hidden
        Instead of the recipes' own, if given.
    run_s, n_layouts
        Use only the first so many seconds of each outdoor run, and in table 1 only the runs past
        the first so many layouts.
    """

    quick: bool = False
    n_test: int = 216
    stress_seeds: tuple[int, ...] = (0, 1, 2)
    outdoor_seeds: tuple[int, ...] = (0,)
    splits: tuple[str, ...] = ("window", "run", "layout", "sim")
    preparations: tuple[str, ...] = ("published", "aligned")
    lengths: tuple[int | None, ...] = (64, 256, None)
    stressors: tuple[Stressor, ...] = STRESSORS
    n_replays: int = 3
    n_passes: int = 20
    n_resamples: int = 200
    epochs: int | None = None
    n_training: int | None = None
    n_validation: int | None = None
    training_stride: int | None = None
    hidden: int | None = None
    run_s: float | None = None
    n_layouts: int | None = None

    def recipe(
        self, network: WindowArchitecture, seed: int, *, preparation: str | None = None
    ) -> Recipe:
        """Return how a network is trained.

        Parameters
        ----------
        network
            Kind, sizes and variants.
        seed
            Of the training.
        preparation
            Of the outdoor data; ``None`` for the stress test's simulation.
        """
        recipe = make_recipe(network, simulated=preparation is None).with_seed(seed)
        sets = {
            "preparation": preparation,
            "n_training": self.n_training,
            "n_validation": self.n_validation,
            "training_stride": self.training_stride,
        }
        return recipe.model_copy(
            update={
                "network": _narrowed(recipe.network, self.hidden),
                "training": recipe.training.model_copy(update=_given({"epochs": self.epochs})),
                "sets": recipe.sets.model_copy(update=_given(sets)),
            }
        )

    def shortened(self, scenes: Sequence[Scene]) -> list[Scene]:
        """Return logs as long as this plan uses them.

        Parameters
        ----------
        scenes
            Whole logs.
        """
        if self.run_s is None:
            return list(scenes)
        return [_first_seconds(scene, self.run_s) for scene in scenes]

    def describe(self) -> dict[str, object]:
        """Return what depends on the plan, for results and checksums."""
        content = {name: value for name, value in vars(self).items() if name != "stressors"}
        content["stressors"] = [[s.name, list(s.settings)] for s in self.stressors]
        return content


def _mild_and_worst(stressor: Stressor) -> Stressor:
    return replace(stressor, settings=(stressor.settings[0], stressor.settings[-1]))


QUICK = Plan(
    quick=True,
    n_test=8,
    stress_seeds=(0,),
    stressors=tuple(map(_mild_and_worst, STRESSORS)),
    n_replays=1,
    n_passes=2,
    n_resamples=20,
    epochs=1,
    n_training=64,
    n_validation=16,
    training_stride=64,
    run_s=75.0,
    n_layouts=2,
)
"""The same code on little data."""


def _given(values: Mapping[str, object]) -> dict[str, object]:
    return {name: value for name, value in values.items() if value is not None}


def _narrowed(network: WindowArchitecture, hidden: int | None) -> WindowArchitecture:
    if hidden is None:
        return network
    if isinstance(network, GaiaArchitecture):
        widths = ("base_hidden", "gru_hidden", "layout_hidden", "head_hidden")
        return network.model_copy(update=dict.fromkeys(widths, hidden))
    return network.model_copy(update={"hidden": hidden})


def _first_seconds(scene: Scene, duration_s: float) -> Scene:
    """Return the beginning of a log."""
    path, log, truth = scene.trajectory, scene.ranges, scene.truth
    end_s = path.t_s[0] + duration_s
    steps, rows = path.t_s <= end_s, log.t_s <= end_s

    def cut(values: np.ndarray | None, chosen: np.ndarray) -> np.ndarray | None:
        return None if values is None else values[chosen]

    return replace(
        scene,
        trajectory=Trajectory(path.t_s[steps], path.position_m[steps], cut(path.up_m, steps)),
        ranges=RangeLog(
            log.t_s[rows],
            log.anchor[rows],
            log.range_m[rows],
            cut(log.rssi_dbm, rows),
            cut(log.rssi_fp_dbm, rows),
        ),
        truth=None
        if truth is None
        else replace(
            truth,
            nlos=cut(truth.nlos, rows),
            range_m=cut(truth.range_m, rows),
            outlier=cut(truth.outlier, rows),
            bias_m=cut(truth.bias_m, rows),
        ),
    )
