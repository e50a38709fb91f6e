"""Episodes come back as they were written, from files that pandas reads, too."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import polars as pl
import pytest

from alike import assert_same
from gaia_uwb._shared.errors import ConfigError, InputError, SourceError
from gaia_uwb._shared.files import visible
from gaia_uwb.episode import Episode
from gaia_uwb.logs import episodes as module
from gaia_uwb.logs.episodes import count_episodes, read_episodes, write_episodes
from gaia_uwb.simulate import PRESETS, simulate_episodes

EPISODES = tuple(
    replace(episode, frame=None) for episode in simulate_episodes(PRESETS["wild"], 7, seed=0)
)


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setattr(module, "_EPISODES_IN_A_PART", 3)
    assert list(write_episodes(EPISODES, tmp_path / "new" / "episodes")) == [3, 6, 7]
    return tmp_path / "new" / "episodes"


def test_episodes_come_back_in_order_and_equal(folder: Path) -> None:
    assert sorted(path.name for path in visible(folder)) == [
        f"episodes-{k:06d}.parquet" for k in range(3)
    ]
    for one, other in zip(EPISODES, read_episodes(folder), strict=True):
        assert_same(one, other)


def test_a_part_can_be_read_at_once_however_long_its_episodes_are(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    longest = max(episode.n_steps * episode.n_anchors for episode in EPISODES)
    monkeypatch.setattr(module, "MAX_ROWS", 2 * longest)
    assert list(write_episodes(EPISODES, tmp_path))[-1] == len(EPISODES)
    parts = [len(pl.read_parquet(path)) for path in visible(tmp_path)]
    assert len(parts) > 1
    assert max(parts) <= 2 * longest


def test_pandas_reads_the_folder(folder: Path) -> None:
    table = pd.read_parquet(folder)
    assert len(table) == sum(episode.n_steps * episode.n_anchors for episode in EPISODES)
    for episode in EPISODES:
        rows = table[table["episode"] == episode.name]
        grid = rows["range_m"].to_numpy().reshape(episode.n_steps, episode.n_anchors)
        np.testing.assert_array_equal(grid, episode.range_m)
        assert tuple(rows["anchor_id"][: episode.n_anchors]) == episode.anchor_ids


def test_a_folder_with_episodes_is_left_alone(folder: Path) -> None:
    with pytest.raises(SourceError, match="already"):
        next(write_episodes(EPISODES, folder))


def test_a_missing_part_is_noticed(folder: Path) -> None:
    assert count_episodes(folder) == 7
    (folder / "episodes-000001.parquet").unlink()
    with pytest.raises(SourceError, match=r"episodes-000001\.parquet is missing"):
        count_episodes(folder)


WRITE_HALF = """
import os, sys, time
from pathlib import Path
from gaia_uwb.logs.episodes import write_episodes
from gaia_uwb.simulate import PRESETS, simulate_episodes

def stand_still(number):
    if "episodes-" in os.readlink(f"/proc/self/fd/{number}"):
        print("half", flush=True)
        time.sleep(60)

os.fsync = stand_still
next(write_episodes(simulate_episodes(PRESETS["wild"], 2, seed=0), Path(sys.argv[1])))
"""


def test_the_next_run_removes_what_a_killed_one_left(tmp_path: Path) -> None:
    mine = [tmp_path / name for name in (".hidden", "episodes.parquet", "episodes-000000.partial")]
    for path in mine:
        path.touch()
    command = [sys.executable, "-c", WRITE_HALF, str(tmp_path)]
    with subprocess.Popen(command, stdout=subprocess.PIPE) as run:
        assert run.stdout is not None
        assert run.stdout.readline() == b"half\n"
        run.kill()
    assert len(list(tmp_path.iterdir())) == len(mine) + 2  # the record, and half a part
    assert list(write_episodes(EPISODES, tmp_path)) == [7]
    record, part = tmp_path / ".gaia-files", tmp_path / "episodes-000000.parquet"
    assert set(tmp_path.iterdir()) == {*mine, record, part}


def test_a_folder_without_episodes_is_a_source_error(tmp_path: Path) -> None:
    with pytest.raises(SourceError, match="contains no"):
        read_episodes(tmp_path)


def test_a_folder_that_cannot_be_written_is_a_config_error(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(ConfigError, match="cannot write to this folder"):
        next(write_episodes(EPISODES, tmp_path / "file"))


@pytest.mark.parametrize("lacking", ["heights", "truth", "outlier"])
def test_an_episode_that_lacks_something_is_an_input_error(lacking: str, tmp_path: Path) -> None:
    truth = EPISODES[0].truth
    assert truth is not None
    poor: dict[str, Episode] = {
        "heights": replace(EPISODES[0], tag_up_m=None),
        "truth": EPISODES[0].without_truth(),
        "outlier": replace(EPISODES[0], truth=replace(truth, outlier=None)),
    }
    with pytest.raises(InputError, match=EPISODES[0].name):
        next(write_episodes([poor[lacking]], tmp_path))


def test_bad_parts_are_input_errors(folder: Path) -> None:
    path = folder / "episodes-000000.parquet"
    table = pl.read_parquet(path)
    for bad, says in (
        (table.drop("nlos"), "column nlos"),
        (table.head(-1), "a row for each"),
        (table.with_columns(pl.col("anchor_id").reverse()), "a row for each"),
        (table.with_columns(pl.lit("x").alias("t_s")), "column t_s: expected a type that holds"),
        (table.with_columns(pl.lit([1.0]).alias("anchor_id")), "column anchor_id: expected a type"),
        (table.with_columns(pl.lit(None, pl.Float64).alias("true_range_m")), "got nothing"),
        (table.with_columns(pl.lit(1.0).alias("t_s")), "row 1, column t_s: .* increasing time"),
        (
            pl.concat([table, table.head(1)]),
            "column episode: expected the rows .* to follow one another",
        ),
    ):
        bad.write_parquet(path)
        with pytest.raises(InputError, match=says) as error:
            list(read_episodes(folder))
        assert path.name in str(error.value)
    path.write_bytes(b"PAR1 no")
    with pytest.raises(InputError, match="cannot be read"):
        list(read_episodes(folder))
