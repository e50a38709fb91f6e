"""Episodes by the million: one long table in parts, and one row per step and anchor.

A folder holds ``episodes-000000.parquet``, ``episodes-000001.parquet`` and so on. Each part is
complete in itself and is written whole or not at all, so that the memory needed does not grow with
their number, and an interruption loses no part that is there. The rows of an episode stand
together, step by step and in a step anchor by anchor:

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

import io
from collections.abc import Iterable, Iterator
from itertools import chain, pairwise
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from gaia_uwb._shared import Array, InputError, OutputFolder, SourceError
from gaia_uwb.episode import Episode, EpisodeTruth
from gaia_uwb.logs._cells import Kind
from gaia_uwb.logs._table import MAX_ROWS, Table, read_table

if TYPE_CHECKING:
    import polars as pl

_EPISODES_IN_A_PART = 1000
_COMPRESSION = 1  # of zstd's levels: half the time of the usual one for a tenth more space
_COLUMNS = {
    "episode": Kind.TEXT,
    "t_s": Kind.NUMBER,
    "east_m": Kind.NUMBER,
    "north_m": Kind.NUMBER,
    "up_m": Kind.NUMBER,
    "anchor_id": Kind.TEXT,
    "range_m": Kind.OPTIONAL,
    "true_range_m": Kind.NUMBER,
    "nlos": Kind.FLAG,
    "outlier": Kind.FLAG,
    "true_bias_m": Kind.NUMBER,
    "anchor_east_m": Kind.NUMBER,
    "anchor_north_m": Kind.NUMBER,
    "anchor_up_m": Kind.NUMBER,
}


def write_episodes(
    episodes: Iterable[Episode], folder: Path, *, append: bool = False
) -> Iterator[int]:
    """Write simulated episodes into a folder, part by part.

    Parameters
    ----------
    episodes
        Episodes with heights and the truth of everything, as the simulator makes them.
    folder
        Where; created if missing.
    append
        Write them after the parts that the folder has.

    Yields
    ------
    int
        After every part, how many of these episodes are written.

    Raises
    ------
    InputError
        If an episode lacks heights or part of its truth.
    SourceError
        If the folder has episodes already, and they are not appended.
    ConfigError
        If the folder cannot be written.
    """
    import polars as pl

    output = OutputFolder(folder)
    parts = _parts(folder)
    if parts and not append:
        raise SourceError(f"{folder}: already contains episodes")
    done = 0
    for part, batch in enumerate(_batches(episodes), start=len(parts)):
        table = pl.DataFrame(_table(batch), nan_to_null=True)
        content = io.BytesIO()
        table.write_parquet(content, compression_level=_COMPRESSION)
        output.write(_part_name(part), content.getvalue())
        done += len(batch)
        yield done


def count_episodes(folder: Path) -> int:
    """Return how many episodes a folder has; none if it is not there.

    Parameters
    ----------
    folder
        Where :func:`write_episodes` wrote, or will write.

    Raises
    ------
    InputError
        If a part cannot be read.
    SourceError
        If a part is missing among the others.
    """
    parts = _parts(folder)
    for k, part in enumerate(parts):
        if part.name != _part_name(k):
            raise SourceError(f"{folder}: {_part_name(k)} is missing")
    return sum(map(_count_in_part, parts))


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
        If the folder contains no episodes.
    InputError
        If a part cannot be read, lacks a column, or holds something that is not an episode.
    """
    parts = _parts(folder)
    if not parts:
        raise SourceError(f"{folder}: contains no episodes-*.parquet")
    return chain.from_iterable(map(_read_part, parts))


def _parts(folder: Path) -> list[Path]:
    return sorted(folder.glob("episodes-*.parquet"))


def _part_name(k: int) -> str:
    return f"episodes-{k:06d}.parquet"


def _batches(episodes: Iterable[Episode]) -> Iterator[list[Episode]]:
    """Yield the episodes of each part: so many that it can be read at once."""
    batch: list[Episode] = []
    n_rows = 0
    for episode in episodes:
        n_more = episode.n_steps * episode.n_anchors
        if batch and (len(batch) == _EPISODES_IN_A_PART or n_rows + n_more > MAX_ROWS):
            yield batch
            batch, n_rows = [], 0
        batch.append(episode)
        n_rows += n_more
    if batch:
        yield batch


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


def _count_in_part(path: Path) -> int:
    return len(read_table(path, {"episode": Kind.TEXT}).labels["episode"])


def _read_part(path: Path) -> Iterator[Episode]:
    table = read_table(path, _COLUMNS)
    starts = np.flatnonzero(np.diff(table["episode"], prepend=-1))
    if len(starts) > len(table.labels["episode"]):
        raise InputError(
            "expected the rows of each episode to follow one another", source=path, column="episode"
        )
    for start, stop in pairwise([*starts.tolist(), len(table)]):
        yield _to_episode(table, slice(start, stop))


def _to_episode(table: Table, rows: slice) -> Episode:
    """Return the episode that some rows of a table hold."""
    name = table.labels["episode"][table["episode"][rows.start]]
    ids = table["anchor_id"][rows]
    n = len(np.unique(ids))
    if len(ids) % n or (ids.reshape(-1, n) != ids[:n]).any():
        problem = f"{name!r}: expected a row for each of {n} anchors at every step, in order"
        raise table.error(problem, index=rows.start)

    def grid(column: str) -> Array:
        return table[column][rows].reshape(-1, n)

    range_m = grid("range_m")
    try:
        return Episode(
            name=name,
            anchor_ids=tuple(table.labels["anchor_id"][code] for code in ids[:n]),
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
    except InputError as error:
        problem = f"{name!r}: {error.problem}"
        raise table.error(problem, index=rows.start, column=error.column) from error
