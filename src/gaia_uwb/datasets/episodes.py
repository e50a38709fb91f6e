"""Episodes by the million: one long table in parts, and one row per step and anchor.

A folder holds ``episodes-000000.parquet``, ``episodes-000001.parquet`` and so on. Each part is
complete in itself and is written in one go, so that the memory needed does not grow with their
number, and an interruption loses no part that is there. The rows of an episode stand together, step
by step and in a step anchor by anchor:

==============================  ====================================================================
``episode``                     name of the episode
``t_s``                         time of the step
``east_m, north_m, up_m``       recorded place of the tag's antenna
``anchor_id``                   name of the anchor
``range_m``                     measured range; null where there is none
``true_range_m, nlos``          truth of the range
``outlier, true_bias_m``        truth of its error
``anchor_east_m, .._north_m``   true place of the anchor
``anchor_up_m``                 its height
==============================  ====================================================================

``pandas.read_parquet(folder)`` gives all of it in one frame, ``groupby("episode")`` the episodes.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from itertools import chain, islice
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from gaia_uwb._typing import Array
from gaia_uwb.episode import Episode, EpisodeTruth
from gaia_uwb.errors import InputError, SourceError

if TYPE_CHECKING:
    import polars as pl

_EPISODES_IN_A_PART = 1000
_COMPRESSION = 1  # of zstd's levels: half the time of the usual one for a tenth more space
_COLUMNS = (
    "episode", "t_s", "east_m", "north_m", "up_m", "anchor_id",
    "range_m", "true_range_m", "nlos", "outlier", "true_bias_m",
    "anchor_east_m", "anchor_north_m", "anchor_up_m",
)  # fmt: skip
_FLAGS = ("nlos", "outlier")
_NUMBERS = tuple(name for name in _COLUMNS if name not in ("episode", "anchor_id", *_FLAGS))


def write_episodes(episodes: Iterable[Episode], folder: Path) -> Iterator[int]:
    """Write simulated episodes into a folder, part by part.

    Parameters
    ----------
    episodes
        Episodes with heights and the truth of everything, as the simulator makes them.
    folder
        Where; made if needed.

    Yields
    ------
    int
        After every part, how many episodes are written.

    Raises
    ------
    InputError
        If an episode lacks heights or part of its truth.
    SourceError
        If the folder has episodes already, or cannot be written.
    """
    import polars as pl

    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise SourceError(f"{folder}: cannot be written: {error.strerror or error}") from error
    if _parts(folder):
        raise SourceError(f"{folder}: there are episodes already")
    source, done, part = iter(episodes), 0, 0
    while batch := list(islice(source, _EPISODES_IN_A_PART)):
        table = pl.DataFrame(_table(batch), nan_to_null=True)
        path = folder / f"episodes-{part:06d}.parquet"
        partial = path.with_suffix(".partial")
        try:
            table.write_parquet(partial, compression_level=_COMPRESSION)
            partial.rename(path)
        except OSError as error:
            partial.unlink(missing_ok=True)
            raise SourceError(f"{path}: cannot be written: {error.strerror or error}") from error
        done, part = done + len(batch), part + 1
        yield done


def read_episodes(folder: Path) -> Iterator[Episode]:
    """Read the episodes of a folder one after another, holding one part in memory.

    Parameters
    ----------
    folder
        Where :func:`write_episodes` wrote them.

    Yields
    ------
    Episode
        Equal to the one that was written, but without a place on Earth.

    Raises
    ------
    SourceError
        If the folder holds no episodes.
    InputError
        If a part cannot be read, or lacks a column.
    """
    parts = _parts(folder)
    if not parts:
        raise SourceError(f"{folder}: holds no episodes-*.parquet")
    return chain.from_iterable(map(_read_part, parts))


def _parts(folder: Path) -> list[Path]:
    return sorted(folder.glob("episodes-*.parquet"))


def _table(batch: list[Episode]) -> dict[str, Array | pl.Series]:
    """Return the columns of some episodes' rows."""
    import polars as pl

    truths, heights = zip(*map(_truth_and_heights, batch), strict=True)
    steps, anchors = ([getattr(one, name) for one in batch] for name in ("n_steps", "n_anchors"))
    # The row of an episode, step and anchor: which of all steps, and which of all anchors it has.
    in_step = np.repeat(anchors, steps)
    step = np.repeat(np.arange(len(in_step)), in_step)
    before = np.repeat(np.cumsum(anchors) - anchors, steps) - (np.cumsum(in_step) - in_step)
    anchor = np.arange(len(step)) + before[step]
    place_m = np.concatenate([one.position_m for one in batch])[step]
    anchor_m = np.concatenate([truth.anchor_m for truth in truths])[anchor]
    # Names go by number, for text by the million is slow.
    names = pl.Series([one.name for one in batch])
    anchor_names = pl.Series([name for one in batch for name in one.anchor_ids])
    return {
        "episode": names.gather(np.repeat(np.arange(len(batch)), np.multiply(steps, anchors))),
        "t_s": np.concatenate([one.t_s for one in batch])[step],
        "east_m": place_m[:, 0],
        "north_m": place_m[:, 1],
        "up_m": np.concatenate([tag_up_m for tag_up_m, _ in heights])[step],
        "anchor_id": anchor_names.gather(anchor),
        "range_m": _end_to_end(one.range_m for one in batch),
        "true_range_m": _end_to_end(truth.range_m for truth in truths),
        "nlos": _end_to_end(truth.nlos for truth in truths),
        "outlier": _end_to_end(truth.outlier for truth in truths),
        "true_bias_m": _end_to_end(truth.bias_m for truth in truths),
        "anchor_east_m": anchor_m[:, 0],
        "anchor_north_m": anchor_m[:, 1],
        "anchor_up_m": np.concatenate([anchor_up_m for _, anchor_up_m in heights])[anchor],
    }


def _truth_and_heights(episode: Episode) -> tuple[EpisodeTruth, tuple[Array, Array]]:
    """Return the truth of an episode, and the heights of its tag and anchors."""
    truth, tag_up_m, anchor_up_m = episode.truth, episode.tag_up_m, episode.anchor_up_m
    if tag_up_m is None or anchor_up_m is None:
        raise InputError("expected an episode with heights, got none", source=episode.name)
    if truth is None or truth.outlier is None or truth.bias_m is None:
        raise InputError("expected an episode with all of its truth", source=episode.name)
    return truth, (tag_up_m, anchor_up_m)


def _end_to_end(grids: Iterable[Array]) -> Array:
    """Return grids of steps and anchors as one column."""
    return np.concatenate([grid.ravel() for grid in grids])


def _read_part(path: Path) -> Iterator[Episode]:
    import polars as pl

    try:
        table = pl.read_parquet(path)
        missing = [name for name in _COLUMNS if name not in table.columns]
        if missing:
            raise InputError("expected this column, got none", source=path, column=missing[0])
        table = table.with_columns(
            pl.col(_NUMBERS).cast(pl.Float64), pl.col(_FLAGS).cast(pl.Boolean)
        )
    except (OSError, pl.exceptions.PolarsError) as error:
        reason = " ".join(str(error).split())[:200]
        raise InputError(f"cannot be read: {reason}", source=path) from error
    for rows in table.partition_by("episode", maintain_order=True):
        try:
            yield _to_episode(rows)
        except InputError as error:
            raise InputError(str(error), source=path) from error


def _to_episode(rows: pl.DataFrame) -> Episode:
    name = str(rows["episode"][0])
    ids = rows["anchor_id"]
    n = ids.n_unique()
    anchor_ids = tuple(ids[:n])
    if len(rows) % n or ids.to_list() != list(anchor_ids) * (len(rows) // n):
        raise InputError(f"{name}: expected a row for each of {n} anchors at every step, in order")

    def grid(column: str) -> Array:
        values: Array = rows[column].to_numpy().reshape(-1, n)
        return values

    range_m = rows["range_m"].fill_null(np.nan).to_numpy().reshape(-1, n)
    return Episode(
        name=name,
        anchor_ids=anchor_ids,
        t_s=grid("t_s")[:, 0],
        position_m=np.column_stack([grid("east_m")[:, 0], grid("north_m")[:, 0]]),
        range_m=range_m,
        valid=np.isfinite(range_m),
        tag_up_m=grid("up_m")[:, 0],
        anchor_up_m=grid("anchor_up_m")[0],
        truth=EpisodeTruth(
            anchor_m=np.column_stack([grid("anchor_east_m")[0], grid("anchor_north_m")[0]]),
            range_m=grid("true_range_m"),
            nlos=grid("nlos"),
            outlier=grid("outlier"),
            bias_m=grid("true_bias_m"),
        ),
    )
