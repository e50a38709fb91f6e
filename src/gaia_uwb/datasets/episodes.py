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
            table.write_parquet(partial)
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

    numbers = [_columns(episode) for episode in batch]
    table: dict[str, Array | pl.Series] = {
        name: np.concatenate([one[name] for one in numbers]) for name in numbers[0]
    }
    # Names go by number, for text by the million is slow.
    rows = [episode.valid.size for episode in batch]
    number: dict[str, int] = {}
    for episode in batch:
        for anchor_id in episode.anchor_ids:
            number.setdefault(anchor_id, len(number))
    anchors = np.concatenate([
        np.tile([number[anchor_id] for anchor_id in episode.anchor_ids], episode.n_steps)
        for episode in batch
    ])  # fmt: skip
    names = pl.Series([episode.name for episode in batch])
    table["episode"] = names.gather(np.repeat(np.arange(len(batch)), rows))
    table["anchor_id"] = pl.Series(list(number)).gather(anchors)
    return {name: table[name] for name in _COLUMNS}


def _columns(episode: Episode) -> dict[str, Array]:
    """Return the numbers and flags of an episode's rows."""
    truth, tag_up_m, anchor_up_m = episode.truth, episode.tag_up_m, episode.anchor_up_m
    if tag_up_m is None or anchor_up_m is None:
        raise InputError("expected an episode with heights, got none", source=episode.name)
    if truth is None or truth.outlier is None or truth.bias_m is None:
        raise InputError("expected an episode with all of its truth", source=episode.name)
    t, n = episode.n_steps, episode.n_anchors
    return {
        "t_s": np.repeat(episode.t_s, n),
        "east_m": np.repeat(episode.position_m[:, 0], n),
        "north_m": np.repeat(episode.position_m[:, 1], n),
        "up_m": np.repeat(tag_up_m, n),
        "range_m": episode.range_m.ravel(),
        "true_range_m": truth.range_m.ravel(),
        "nlos": truth.nlos.ravel(),
        "outlier": truth.outlier.ravel(),
        "true_bias_m": truth.bias_m.ravel(),
        "anchor_east_m": np.tile(truth.anchor_m[:, 0], t),
        "anchor_north_m": np.tile(truth.anchor_m[:, 1], t),
        "anchor_up_m": np.tile(anchor_up_m, t),
    }


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
