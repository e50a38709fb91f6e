"""What a method makes of episodes, kept in files, apart from all scores.

A file holds the denoised ranges and the located anchors of one method on one set of episodes, and a
checksum of what they depend on: every number of the episodes, the model, the settings, and the code
from the ranges to the anchors. With another checksum they are computed again. Scores are always
formed from what the file holds, so that a second call gives the same digits.
"""

from __future__ import annotations

import io
import json
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np

from gaia_uwb._shared import Array, Bool, OutputFolder
from gaia_uwb.config import PipelineConfig
from gaia_uwb.denoised import DenoisedRanges
from gaia_uwb.denoisers import Denoiser, denoiser_identity, make_denoiser
from gaia_uwb.episode import Episode
from gaia_uwb.estimate import AnchorFix, AnchorStatus
from gaia_uwb.pipeline import reconstruct_episodes
from gaia_uwb.reproduce.digests import code_digest, digest_of, episodes_digest

_CODE = (
    "pipeline",
    "locate.zone_places",
    "locate.paper_solver",
    "zone.network_prior",
    "zone.network_sides",
    "zone.sides",
    "denoisers",
    "reproduce.predictions",
)
_NOT_FOLLOWED = (
    "_shared.files",
    "learn.window_sets",
    "reproduce.digests",
    "simulate",
    "config",
)
_STATUSES = tuple(AnchorStatus)


@dataclass(frozen=True)
class Stretch:
    """Steps of an episode that one denoiser takes by themselves.

    Parameters
    ----------
    denoiser
        Its name, such as ``kalman`` or ``gaia:FOLDER``.
    start, stop
        The steps that it sees.
    used_from
        From here on its ranges count.
    """

    denoiser: str
    start: int
    stop: int
    used_from: int


Pieces = Sequence[Sequence[Stretch]]
"""For each episode, pieces that cover it."""


@dataclass(frozen=True)
class Solver:
    """How anchors are located.

    Parameters
    ----------
    config
        All of them but ``denoiser`` are used.
    labels
        Whether ``wls`` gets the true NLOS labels, as in the paper.
    """

    config: PipelineConfig
    labels: bool


@dataclass(frozen=True)
class Predictions:
    """Ranges and anchors of every episode.

    Parameters
    ----------
    denoised
        By episode.
    anchors
        By the solver's name and by episode.
    seconds
        How long it took.
    key
        The checksum.
    """

    denoised: tuple[DenoisedRanges, ...]
    anchors: Mapping[str, tuple[tuple[AnchorFix, ...], ...]]
    seconds: float
    key: str


def whole(denoiser: str, episodes: Sequence[Episode]) -> Pieces:
    """Let one denoiser take every episode as a whole.

    Parameters
    ----------
    denoiser
        Its name.
    episodes
        Any.
    """
    return [[Stretch(denoiser, 0, episode.n_steps, 0)] for episode in episodes]


def cached_predictions(
    folder: OutputFolder,
    name: str,
    episodes: Sequence[Episode],
    pieces: Pieces,
    solvers: Mapping[str, Solver],
) -> Predictions:
    """Return predictions from their file, or compute and keep them.

    Parameters
    ----------
    folder
        Where files are kept.
    name
        Of the file, without its ending.
    episodes
        Their truth is used for nothing but the labels of a solver that gets them.
    pieces
        Who denoises what.
    solvers
        By name.
    """
    key = _key(episodes, pieces, solvers)
    path = folder.path / f"{name}.npz"
    if (found := _read(path, key, episodes)) is not None:
        return found
    start = time.perf_counter()
    denoised, anchors = _reconstruct(episodes, pieces, solvers)
    content = _pack(denoised, anchors, key, time.perf_counter() - start)
    folder.write(path.name, content)
    read = _read(path, key, episodes)
    if read is None:
        raise RuntimeError(f"{path}: cannot read what was just written")
    return read


def held_out_pieces(
    episode: Episode, denoisers: Sequence[str], first_step: int, length: int
) -> list[Stretch]:
    """Let each window of a long episode be denoised by the model that has not seen it.

    Parameters
    ----------
    episode
        Part of a run.
    denoisers
        Of the run's windows, one after another.
    first_step
        Where the episode starts in its run, a multiple of ``length``.
    length
        Steps of a window. What is left at the end of a run belongs to the last window's model,
        which has seen no window that reaches into it.
    """
    pieces = []
    starts = range(0, episode.n_steps - length + 1, length)
    for start in starts:
        name = denoisers[(first_step + start) // length]
        pieces.append(Stretch(name, start, start + length, start))
    rest = len(starts) * length
    if rest < episode.n_steps:
        start = max(0, episode.n_steps - length)
        last = denoisers[min((first_step + rest) // length, len(denoisers) - 1)]
        pieces.append(Stretch(last, start, episode.n_steps, rest))
    return pieces


def _window(episode: Episode, piece: Stretch) -> Episode:
    if (piece.start, piece.stop) == (0, episode.n_steps):
        return episode
    return episode.window(piece.start, piece.stop)


_Anchors = dict[str, list[tuple[AnchorFix, ...]]]


class _InPieces(Denoiser):
    """Lets every piece of an episode be denoised by a denoiser of its own.

    Parameters
    ----------
    pieces
        For each episode, pieces whose used steps cover it.
    """

    def __init__(self, pieces: Pieces) -> None:
        super().__init__(None)
        self._pieces = pieces

    def __call__(self, episodes: Sequence[Episode]) -> list[DenoisedRanges]:
        shapes = [episode.range_m.shape for episode in episodes]
        arrays = [
            (np.full(shape, np.nan), np.full(shape, np.nan), np.zeros(shape, dtype=np.bool_))
            for shape in shapes
        ]
        every = [(k, piece) for k, own in enumerate(self._pieces) for piece in own]
        for name in dict.fromkeys(piece.denoiser for _, piece in every):
            chosen = [(k, piece) for k, piece in every if piece.denoiser == name]
            windows = [_window(episodes[k], piece) for k, piece in chosen]
            for (k, piece), found in zip(chosen, make_denoiser(name)(windows), strict=True):
                used = slice(piece.used_from, piece.stop)
                own = slice(piece.used_from - piece.start, None)
                for target, values in zip(
                    arrays[k], (found.range_m, found.sigma_m, found.valid), strict=True
                ):
                    target[used] = values[own]
        return [DenoisedRanges(*own) for own in arrays]


def _reconstruct(
    episodes: Sequence[Episode], pieces: Pieces, solvers: Mapping[str, Solver]
) -> tuple[list[DenoisedRanges], _Anchors]:
    """Denoise, and locate as the pipeline does; together what one denoiser takes as a whole."""
    denoised: dict[int, DenoisedRanges] = {}
    anchors: dict[tuple[str, int], tuple[AnchorFix, ...]] = {}
    groups: dict[str, list[int]] = {}
    for k, own in enumerate(pieces):
        groups.setdefault(own[0].denoiser if len(own) == 1 else "", []).append(k)
    for name, members in groups.items():
        chosen = [episodes[k] for k in members]
        denoiser = make_denoiser(name) if name else _InPieces([pieces[k] for k in members])
        for solver_name, solver in solvers.items():
            results = reconstruct_episodes(
                chosen, solver.config, denoiser=denoiser, true_nlos=_labels(chosen, solver)
            )
            for k, result in zip(members, results, strict=True):
                denoised[k], anchors[solver_name, k] = result.denoised, result.anchors
    order = range(len(episodes))
    by_solver = {name: [anchors[name, k] for k in order] for name in solvers}
    return [denoised[k] for k in order], by_solver


def _labels(episodes: Sequence[Episode], solver: Solver) -> list[Bool[Array, "_ _"]] | None:
    if not solver.labels:
        return None
    return [episode.truth.nlos for episode in episodes if episode.truth is not None]


def _key(episodes: Sequence[Episode], pieces: Pieces, solvers: Mapping[str, Solver]) -> str:
    models = {p.denoiser: denoiser_identity(p.denoiser) for own in pieces for p in own}
    return digest_of(
        {
            "episodes": episodes_digest(episodes),
            "pieces": [
                [(models[p.denoiser], p.start, p.stop, p.used_from) for p in own] for own in pieces
            ],
            "solvers": {name: [s.config.model_dump(), s.labels] for name, s in solvers.items()},
            "code": code_digest(*_CODE, without=_NOT_FOLLOWED),
        }
    )


def _pack(
    denoised: Sequence[DenoisedRanges],
    anchors: Mapping[str, Sequence[Sequence[AnchorFix]]],
    key: str,
    seconds: float,
) -> bytes:
    arrays: dict[str, Any] = {
        "note": np.array(json.dumps({"key": key, "seconds": seconds, "solvers": list(anchors)})),
        "valid": np.packbits(np.concatenate([d.valid.ravel() for d in denoised])),
        "range_m": np.concatenate([d.range_m[d.valid] for d in denoised]).astype(np.float32),
        "sigma_m": np.concatenate([d.sigma_m[d.valid] for d in denoised]).astype(np.float32),
    }
    for name, by_episode in anchors.items():
        fixes = [fix for own in by_episode for fix in own]
        arrays[f"{name}.places"] = np.array(
            [
                (
                    *fix.position_m, *fix.mirror_position_m, *fix.covariance_m2.ravel(),
                    fix.mirror_probability, _STATUSES.index(fix.status), fix.n_ranges,
                    fix.range_bias_m, *fix.mirror_covariance_m2.ravel(),
                )
                for fix in fixes
            ]
        )  # fmt: skip
    buffer = io.BytesIO()
    np.savez_compressed(buffer, **arrays)
    return buffer.getvalue()


def _read(path: Path, key: str, episodes: Sequence[Episode]) -> Predictions | None:
    """Return what a file holds, or nothing if it is not there, damaged, or of something else."""
    try:
        with np.load(io.BytesIO(path.read_bytes()), allow_pickle=False) as content:
            arrays = dict(content)
        note = json.loads(str(arrays["note"]))
        if note["key"] != key:
            return None
        denoised = _unpack_ranges(arrays, episodes)
        anchors = {
            name: _unpack_anchors(arrays[f"{name}.places"], episodes) for name in note["solvers"]
        }
    except (OSError, ValueError, KeyError, BadZipFile, EOFError):
        return None
    return Predictions(denoised, anchors, note["seconds"], key)


def _unpack_ranges(
    arrays: Mapping[str, Any], episodes: Sequence[Episode]
) -> tuple[DenoisedRanges, ...]:
    bits = np.unpackbits(arrays["valid"]).astype(np.bool_)
    found, bit, row = [], 0, 0
    for episode in episodes:
        size = episode.range_m.size
        valid = bits[bit : bit + size].reshape(episode.range_m.shape)
        count = int(valid.sum())
        range_m, sigma_m = (np.full(valid.shape, np.nan) for _ in range(2))
        range_m[valid] = arrays["range_m"][row : row + count]
        sigma_m[valid] = arrays["sigma_m"][row : row + count]
        found.append(DenoisedRanges(range_m, sigma_m, valid))
        bit, row = bit + size, row + count
    return tuple(found)


def _unpack_anchors(places: Any, episodes: Sequence[Episode]) -> tuple[tuple[AnchorFix, ...], ...]:
    rows = iter(np.asarray(places, dtype=np.float64))
    return tuple(
        tuple(_fix(anchor_id, next(rows)) for anchor_id in episode.anchor_ids)
        for episode in episodes
    )


def _fix(anchor_id: str, row: Any) -> AnchorFix:
    return AnchorFix(
        anchor_id=anchor_id,
        position_m=row[0:2],
        mirror_position_m=row[2:4],
        covariance_m2=row[4:8].reshape(2, 2),
        mirror_probability=float(row[8]),
        status=_STATUSES[int(row[9])],
        n_ranges=int(row[10]),
        range_bias_m=float(row[11]),
        mirror_covariance_m2=row[12:16].reshape(2, 2),
    )
