"""From episodes to the normalised, padded tensors of a network, and back.

Here numbers change their type: episodes are float64 in metres, the paper's networks take float32 in
units of :class:`gaia_uwb.models.Normalisation`.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from gaia_uwb._shared import Array, Float32, Float64, InputError
from gaia_uwb.episode import Episode
from gaia_uwb.models.domain import Normalisation


class WindowInputs(NamedTuple):
    """Inputs of a network: B episodes of T steps, N channels for anchors; lengths are scaled."""

    position: Float32[Array, "B T 2"]
    """Where the tag's antenna is, from the normalisation's origin."""
    distance: Float32[Array, "B T N"]
    """Measured ranges, 0 where there is none."""
    mask: Float32[Array, "B T N"]
    """1 where there is a range, else 0; always 0 in channels without an anchor."""
    height_gap: Float32[Array, "B T N"]
    """Tag's height minus the anchor's; 0 where unknown."""


class WindowTargets(NamedTuple):
    """The targets that a network is trained towards, in metres."""

    range_m: Float32[Array, "B T N"]
    """True slant ranges; 0 in channels without an anchor."""
    nlos: Float32[Array, "B T N"]
    """1 where there was no line of sight."""
    anchor: Float32[Array, "B N 2"]
    """True places of the anchors, scaled like positions."""


def make_window_inputs(
    episodes: Sequence[Episode], n_anchors: int, normalisation: Normalisation
) -> WindowInputs:
    """Lay episodes of equally many steps out for a network.

    Parameters
    ----------
    episodes
        At least one.
    n_anchors
        Channels N of the network; an episode may have fewer anchors.
    normalisation
        Of the network.

    Raises
    ------
    InputError
        If an episode has more anchors than the network has channels.
    """
    shape = (len(episodes), episodes[0].n_steps, n_anchors)
    position = np.empty((*shape[:2], 2), dtype=np.float32)
    distance, mask, height_gap = (np.zeros(shape, dtype=np.float32) for _ in range(3))
    origin_m = _origin_m(normalisation)
    for b, episode in enumerate(episodes):
        n = _channels(episode, n_anchors)
        position[b] = (episode.position_m - origin_m) / normalisation.scale_m
        range_m = np.where(episode.valid, episode.range_m, 0.0)
        distance[b, :, :n] = range_m / normalisation.scale_m
        mask[b, :, :n] = episode.valid
        height_gap[b, :, :n] = episode.height_gap_m() / normalisation.scale_m
    return WindowInputs(position, distance, mask, height_gap)


def window_targets(
    episodes: Sequence[Episode], n_anchors: int, normalisation: Normalisation
) -> WindowTargets:
    """Lay the truth of episodes of equally many steps out for training.

    Parameters
    ----------
    episodes, n_anchors, normalisation
        Like :func:`make_window_inputs`; every episode has its truth.

    Raises
    ------
    InputError
        If an episode has no truth, or more anchors than there are channels.
    """
    shape = (len(episodes), episodes[0].n_steps, n_anchors)
    range_m, nlos = (np.zeros(shape, dtype=np.float32) for _ in range(2))
    anchor = np.zeros((shape[0], n_anchors, 2), dtype=np.float32)
    origin_m = _origin_m(normalisation)
    for b, episode in enumerate(episodes):
        n, truth = _channels(episode, n_anchors), episode.truth
        if truth is None:
            raise InputError("expected true ranges to train on, got none", source=episode.name)
        range_m[b, :, :n] = truth.range_m
        nlos[b, :, :n] = truth.nlos
        anchor[b, :n] = (truth.anchor_m - origin_m) / normalisation.scale_m
    return WindowTargets(range_m, nlos, anchor)


def window_starts(n_steps: int, length: int) -> list[int]:
    """Return where windows start that cover all steps evenly, overlapping by half or more.

    Parameters
    ----------
    n_steps
        Steps of the series, at least 1.
    length
        Steps of a window; a shorter series is one window.

    Examples
    --------
    >>> window_starts(150, 64)
    [0, 29, 57, 86]
    """
    if n_steps <= length:
        return [0]
    last, stride = n_steps - length, max(1, length // 2)
    n_gaps = -(-last // stride)
    return [round(k * last / n_gaps) for k in range(n_gaps + 1)]


def blend(
    windows: Float64[Array, "W L N"], starts: Sequence[int], n_steps: int
) -> Float64[Array, "T N"]:
    """Blend overlapping windows into one series, each fading in and out.

    Parameters
    ----------
    windows
        Values of windows of equal length L.
    starts
        Where each starts, as returned by :func:`window_starts`.
    n_steps
        Steps T of the series.

    Examples
    --------
    >>> starts = window_starts(5, 4)
    >>> blend(np.array([[[0.0]] * 4, [[1.0]] * 4]), starts, 5).round(2).ravel().tolist()
    [0.0, 0.33, 0.5, 0.67, 1.0]
    """
    length = windows.shape[1]
    fade = np.minimum(np.arange(1, length + 1), np.arange(length, 0, -1))[:, None].astype(float)
    total = np.zeros((n_steps, windows.shape[2]))
    weight = np.zeros((n_steps, 1))
    for values, start in zip(windows, starts, strict=True):
        total[start : start + length] += fade * values
        weight[start : start + length] += fade
    return np.asarray(total / weight)


def _origin_m(normalisation: Normalisation) -> Float64[Array, "2"]:
    return np.array([normalisation.origin_east_m, normalisation.origin_north_m])


def _channels(episode: Episode, n_anchors: int) -> int:
    """Return how many anchors an episode has, if the model has a channel for each."""
    if episode.n_anchors > n_anchors:
        raise InputError(
            f"the model has channels for {n_anchors} cones, this log has {episode.n_anchors}",
            source=episode.name,
        )
    return episode.n_anchors
