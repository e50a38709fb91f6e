"""``gaia-set``: the network for work zones that it has never seen, run by ONNX Runtime.

Besides ranges, it returns the places and sides of all anchors. It processes a drive as a whole,
from the first range to the last. A drive that is longer than ``ZONE_LONGEST_STEPS``, reaches
farther than ``ZONE_FARTHEST_M`` from the middle of the path, or has more than
``ZONE_MOST_ANCHORS`` anchors, goes through it in pieces (``_pieces.py``).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import ClassVar

import numpy as np
from pydantic import Field

from gaia_uwb._shared import Array, Float64
from gaia_uwb.denoised import DenoisedRanges, ZonePosterior
from gaia_uwb.denoisers._base import Denoiser, Options
from gaia_uwb.denoisers._onnx import TrainedOptions, find_trained, start_network
from gaia_uwb.denoisers._pieces import pieces_of, put_together
from gaia_uwb.episode import Episode
from gaia_uwb.models import (
    ZONE_FARTHEST_M,
    ZONE_LONGEST_STEPS,
    ZONE_MOST_ANCHORS,
    PathFrame,
    ZoneInputs,
    ZoneModel,
    make_zone_inputs,
    zone_readings,
)

_SHORT = 512  # steps of what is taken as it is, not from the first range to the last
_READINGS = 1 << 17  # (episodes x anchors x steps) that the network takes at a time
_PAIRS = 1 << 16  # (episodes x anchors x anchors) that it takes at a time
_LEAST_STEPS = 3  # fewer have no path
_LEAST_RANGES = 4  # an anchor with fewer cannot be located, and keeps its measured ranges


class ZoneOptions(TrainedOptions):
    """Options of ``gaia-set``."""

    model: str = Field(default="mixed", min_length=1)
    """Like that of the other networks; the package comes with ``mixed``."""


class ZoneNetwork(Denoiser):
    """The trained network.

    Parameters
    ----------
    options
        Which model.

    Raises
    ------
    ConfigError
        If the model is missing, corrupt or of another kind.
    """

    Options: ClassVar[type[Options]] = ZoneOptions
    uses_pose: ClassVar[bool] = True
    locates: ClassVar[bool] = True
    options: TrainedOptions

    def __init__(self, options: TrainedOptions) -> None:
        super().__init__(options)
        folder, self.description = find_trained("gaia-set", options.model, ZoneModel)
        sizes = dict.fromkeys(ZoneInputs._fields)
        self._network = start_network(folder, self.description, sizes)

    def __call__(self, episodes: Sequence[Episode]) -> list[DenoisedRanges]:
        """Denoise and locate; see the base class. ``zone`` holds the places."""
        found: dict[int, DenoisedRanges] = {}
        groups: dict[tuple[int, int], list[int]] = {}
        for k, episode in enumerate(episodes):
            heard = _heard(episode)
            if heard.stop - heard.start < _LEAST_STEPS:
                found[k] = _as_measured(episode)
            elif _too_much(cut := episode.window(heard.start, heard.stop)):
                found[k] = self._in_pieces(episode, heard)
            elif cut.n_steps < episode.n_steps:
                found[k] = _padded(self([cut])[0], heard, episode)
            else:
                groups.setdefault((episode.n_steps, episode.n_anchors), []).append(k)
        for (n_steps, n_anchors), members in groups.items():
            size = max(1, min(_READINGS // (n_steps * n_anchors), _PAIRS // n_anchors**2))
            for start in range(0, len(members), size):
                part = members[start : start + size]
                found.update(zip(part, self._run([episodes[k] for k in part]), strict=True))
        return [found[k] for k in range(len(episodes))]

    def _run(self, episodes: Sequence[Episode]) -> list[DenoisedRanges]:
        """Denoise episodes of one number of steps and of anchors."""
        inputs, frame = make_zone_inputs(zone_readings(episodes))
        feed = dict(zip(ZoneInputs._fields, inputs, strict=True))
        output = self._network.run(feed, _shapes(episodes))
        zones = self._zones(episodes, output, frame)
        results = []
        for b, (episode, zone) in enumerate(zip(episodes, zones, strict=True)):
            unsolved = np.count_nonzero(episode.valid, axis=0) < _LEAST_RANGES
            range_m = np.maximum(output["denoised_range"][b].T, 0.0)
            range_m = np.where(unsolved, episode.range_m, range_m)
            sigma_m = np.where(
                unsolved, 1.0, np.exp(np.clip(output["log_sigma"][b].T, -20.0, 20.0))
            )
            results.append(
                DenoisedRanges(
                    range_m=np.where(episode.valid, range_m, np.nan),
                    sigma_m=np.where(episode.valid, sigma_m, np.nan),
                    valid=episode.valid,
                    zone=zone,
                )
            )
        return results

    def _zones(
        self, episodes: Sequence[Episode], output: dict[str, Array], frame: PathFrame
    ) -> list[ZonePosterior]:
        """Bring places and probabilities into the local frame."""
        place = output["place"]
        n_episodes, n_anchors = place.shape[:2]
        flat = (n_episodes, 2 * n_anchors, 2)
        place_m = frame.leave(place.reshape(flat)).reshape(place.shape)
        scale = self.description.variance_scale(episodes[0].n_steps)
        covariance_m2 = scale * _inverse(output["information"])
        turned_m2 = frame.turn_covariance(covariance_m2.reshape(*flat, 2))
        scene, own = _probability(output["scene_logit"]), _probability(output["side_logit"])
        return [
            ZonePosterior(
                place_m=place_m[b],
                covariance_m2=turned_m2[b].reshape(n_anchors, 2, 2, 2),
                scene_probability=np.array([scene[b], 1.0 - scene[b]]),
                left_probability=np.stack([own[b, :, 0], 1.0 - own[b, :, 1]]),
                located=np.asarray(episode.valid.any(axis=0)),
            )
            for b, episode in enumerate(episodes)
        ]

    def _in_pieces(self, episode: Episode, heard: slice) -> DenoisedRanges:
        """Denoise and locate piece by piece, one after another: memory for one."""
        pieces = [
            piece.later(heard.start) for piece in pieces_of(episode.window(heard.start, heard.stop))
        ]
        found = [self([piece.of(episode)])[0] for piece in pieces]
        return put_together(episode, pieces, found)


def _shapes(episodes: Sequence[Episode]) -> dict[str, tuple[int, ...]]:
    """Return the shapes of the outputs that are used."""
    b, n, t = len(episodes), episodes[0].n_anchors, episodes[0].n_steps
    return {
        "denoised_range": (b, n, t),
        "log_sigma": (b, n, t),
        "place": (b, n, 2, 2),
        "information": (b, n, 2, 3),
        "scene_logit": (b,),
        "side_logit": (b, n, 2),
    }


def _too_much(episode: Episode) -> bool:
    """Tell whether an episode is too large to be processed as a whole."""
    if episode.n_steps > ZONE_LONGEST_STEPS or episode.n_anchors > ZONE_MOST_ANCHORS:
        return True
    nearest = np.where(episode.valid, episode.range_m, np.inf).argmin(axis=0)
    passed_m = episode.position_m[nearest[episode.valid.any(axis=0)]]
    off_m = passed_m - episode.position_m.mean(axis=0)
    return bool((np.hypot(off_m[:, 0], off_m[:, 1]) > ZONE_FARTHEST_M).any())


def _heard(episode: Episode) -> slice:
    """Return the steps from the first range to the last, of long episodes; else all steps."""
    if episode.n_steps <= _SHORT:
        return slice(0, episode.n_steps)
    steps = np.flatnonzero(episode.valid.any(axis=1))
    return slice(int(steps[0]), int(steps[-1]) + 1) if len(steps) else slice(0, 0)


def _padded(part: DenoisedRanges, heard: slice, episode: Episode) -> DenoisedRanges:
    """Return what was made of the steps between the first and the last range, for all steps."""
    range_m, sigma_m = np.full((2, *episode.valid.shape), np.nan)
    range_m[heard], sigma_m[heard] = part.range_m, part.sigma_m
    return replace(part, range_m=range_m, sigma_m=sigma_m, valid=episode.valid)


def _as_measured(episode: Episode) -> DenoisedRanges:
    """Return the ranges as measured, for an episode without a real path."""
    sigma_m = np.where(episode.valid, 1.0, np.nan)
    return DenoisedRanges(range_m=episode.range_m, sigma_m=sigma_m, valid=episode.valid)


def _inverse(information: Float64[Array, "*shape 3"]) -> Float64[Array, "*shape 2 2"]:
    """Return the covariances of information matrices (along along, along left, left left)."""
    aa, al, ll = np.moveaxis(information, -1, 0)
    determinant = np.maximum(aa * ll - al * al, 1e-12)
    rows = [np.stack([ll, -al], axis=-1), np.stack([-al, aa], axis=-1)]
    return np.asarray(np.stack(rows, axis=-2) / determinant[..., None, None])


def _probability(logit: Float64[Array, "*shape"]) -> Float64[Array, "*shape"]:
    return np.asarray(1.0 / (1.0 + np.exp(-np.clip(logit, -50.0, 50.0))))
