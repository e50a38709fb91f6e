"""``mlp``, ``pose-mlp`` and ``gaia``: trained networks, run by ONNX Runtime.

A run is cut into windows as long as those that the network was trained on, each overlapping the
next by half; their outputs fade into one another, so that a run of any length comes out whole. A
window that the network corrects beyond what is plausible gets a running median instead, which knows
no layout.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar

import numpy as np

from gaia_uwb._shared import Array, Float64
from gaia_uwb.denoised import DenoisedRanges
from gaia_uwb.denoisers._base import Denoiser, Options
from gaia_uwb.denoisers._onnx import TrainedOptions, find_trained, start_network
from gaia_uwb.denoisers.median import Median, MedianOptions
from gaia_uwb.episode import Episode
from gaia_uwb.estimate import Reason, ReasonKind
from gaia_uwb.models import (
    WindowInputs,
    WindowModel,
    blend,
    largest_median_correction_m,
    make_window_inputs,
    window_starts,
)

_CHUNK = 256  # windows that the network takes at a time: this bounds the memory


class WindowNetwork(Denoiser):
    """A trained network; its subclasses name the kinds.

    Parameters
    ----------
    options
        Which model.

    Raises
    ------
    ConfigError
        If the model is missing, corrupt or of another kind.

    Examples
    --------
    >>> from gaia_uwb.denoisers import make_denoiser
    >>> make_denoiser("gaia:stress").description.n_anchors
    12
    """

    Options: ClassVar[type[Options]] = TrainedOptions
    kind: ClassVar[str]
    options: TrainedOptions

    def __init__(self, options: TrainedOptions) -> None:
        super().__init__(options)
        folder, self.description = find_trained(self.kind, options.model, WindowModel)
        n = self.description.n_anchors
        sizes = dict(zip(WindowInputs._fields, (2, n, n, n), strict=True))
        self._network = start_network(folder, self.description, sizes)

    def __call__(self, episodes: Sequence[Episode]) -> list[DenoisedRanges]:
        """Denoise episodes; see the base class.

        Raises
        ------
        InputError
            If an episode has more anchors than the network has channels.
        """
        length = self.description.window_steps
        pieces = [
            (index, start)
            for index, episode in enumerate(episodes)
            for start in window_starts(episode.n_steps, length)
        ]
        found: list[list[Float64[Array, "L N"]]] = [[] for _ in episodes]
        for size in sorted({min(length, episode.n_steps) for episode in episodes}):
            same = [p for p in pieces if min(length, episodes[p[0]].n_steps) == size]
            for first in range(0, len(same), _CHUNK):
                chunk = same[first : first + _CHUNK]
                windows = [episodes[i].window(start, start + size) for i, start in chunk]
                for (index, _), values in zip(chunk, self._run(windows), strict=True):
                    found[index].append(values)
        return [
            self._whole(episode, np.stack(windows))
            for episode, windows in zip(episodes, found, strict=True)
        ]

    def notes(self, episode: Episode) -> tuple[Reason, ...]:
        """Return where an episode lies outside the model's training data.

        Parameters
        ----------
        episode
            Any.
        """
        name = f"{self.kind}:{self.options.model}"
        return tuple(
            Reason(
                ReasonKind.OUTSIDE_TRAINING,
                f"{name} is not reliable here: {reason}; use another denoiser",
            )
            for reason in self.description.domain.strange(episode)
        )

    def _run(self, windows: Sequence[Episode]) -> Float64[Array, "B L N"]:
        """Return the network's ranges in metres; those of mistaken windows come from a median."""
        description = self.description
        features = make_window_inputs(windows, description.n_anchors, description.normalisation)
        inputs: dict[str, Any] = dict(zip(WindowInputs._fields, features, strict=True))
        shape = (len(windows), windows[0].n_steps, description.n_anchors)
        output = self._network.run(inputs, {"predicted_distance": shape})
        range_m = output["predicted_distance"] * description.normalisation.scale_m
        mistaken = [
            k
            for k, window in enumerate(windows)
            if self._mistaken(window, range_m[k, :, : window.n_anchors])
        ]
        plain = Median(MedianOptions())([windows[k] for k in mistaken])
        for k, ranges in zip(mistaken, plain, strict=True):
            own_m = range_m[k, :, : windows[k].n_anchors]
            own_m[windows[k].valid] = windows[k].range_m[windows[k].valid]
            own_m[ranges.valid] = ranges.range_m[ranges.valid]
        return range_m

    def _mistaken(self, window: Episode, range_m: Float64[Array, "L N"]) -> bool:
        """Whether the network took a window for one of another layout."""
        limit_m = self.description.plausible_correction_m
        if limit_m is None:
            return False
        return largest_median_correction_m(range_m - window.range_m, window.valid) > limit_m

    def _whole(self, episode: Episode, windows: Float64[Array, "W L N"]) -> DenoisedRanges:
        """Blend an episode's windows into one series."""
        starts = window_starts(episode.n_steps, self.description.window_steps)
        range_m = blend(windows, starts, episode.n_steps)[:, : episode.n_anchors]
        sigma_m = np.full(episode.range_m.shape, self.description.sigma_m)
        return DenoisedRanges(
            range_m=np.where(episode.valid, range_m, np.nan),
            sigma_m=np.where(episode.valid, sigma_m, np.nan),
            valid=episode.valid,
        )


class WindowMlp(WindowNetwork):
    """The paper's MLP: a perceptron on the ranges of a step."""

    kind: ClassVar[str] = "mlp"


class WindowPoseMlp(WindowNetwork):
    """The paper's PoseMLP: a perceptron on the ranges and the position of a step."""

    kind: ClassVar[str] = "pose-mlp"
    uses_pose: ClassVar[bool] = True


class WindowGaia(WindowNetwork):
    """The paper's GAIA: temporal refinement, a layout, and ranges that agree with it."""

    kind: ClassVar[str] = "gaia"
    uses_pose: ClassVar[bool] = True
