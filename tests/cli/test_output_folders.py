"""No command touches what it reads, a log, or a file that it did not write."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from gaia_uwb import models
from gaia_uwb.logs.native import write_native
from gaia_uwb.simulate import load

SHIPPED = Path(models.__file__).parent / "shipped"


def content_of(folder: Path) -> dict[str, bytes | None]:
    return {
        str(path.relative_to(folder)): path.read_bytes() if path.is_file() else None
        for path in sorted(folder.rglob("*"))
    }


@pytest.fixture
def logs(tmp_path: Path) -> Path:
    """Return a folder with two logs of the user's own, one in each format of tables."""
    folder = tmp_path / "logs"
    for name, kind in (("a", "csv"), ("b", "parquet")):
        write_native(load("lane-closure/1")[0], folder / name, kind)  # type: ignore[arg-type]
        (folder / name / ".gaia-files").unlink()
        (folder / name / "scene.yaml").unlink()  # so that the folder's name is the log's
    shutil.copytree(SHIPPED / "pose-mlp-stress", folder / "model")
    return folder


COMMANDS = {
    "reconstruct the log": ("reconstruct", "logs/a", "--out", "logs/a"),
    "reconstruct the Parquet log": ("reconstruct", "logs/b", "--out", "logs/b"),
    "reconstruct the folder": ("reconstruct", "logs", "--out", "logs"),
    "reconstruct one into another": ("reconstruct", "logs/a", "--out", "logs/b"),
    "fuse into one": ("reconstruct", "logs/a", "logs/b", "--out", "logs/a"),
    "each into itself": ("reconstruct", "logs/a", "logs/b", "--each-alone", "--out", "logs"),
    "fleet": ("fleet", "logs", "--out", "logs"),
    "fleet into a log": ("fleet", "logs", "--out", "logs/a"),
    "simulate": ("simulate", "--preset", "straight", "--out", "logs/a"),
    "simulate in CSV": ("simulate", "--preset", "straight", "--format", "csv", "--out", "logs/b"),
    "simulate lanes": ("simulate", "--preset", "straight", "--lanes", "0,3", "--out", "logs/a"),
    "simulate episodes": ("simulate", "--episodes", "2", "--as", "episodes", "--out", "logs/a"),
    "calibrate": ("simulate", "--calibrate-from", "logs/a", "--out", "logs/a"),
    "evaluate": ("evaluate", "logs/a", "--methods", "raw", "--out", "logs/a"),
    "into the model's folder": (
        *("reconstruct", "logs/a", "--denoiser", "pose-mlp:logs/model", "--out", "logs/model"),
    ),
    "evaluate the folder": ("evaluate", "logs", "--methods", "raw", "--out", "logs"),
}


@pytest.mark.parametrize("command", COMMANDS.values(), ids=COMMANDS.keys())
def test_a_log_is_as_before_whatever_the_command(run, logs: Path, command: tuple[str, ...]) -> None:  # type: ignore[no-untyped-def]
    before = content_of(logs)
    code, _, err = run(*(word.replace("logs", str(logs)) for word in command))
    assert code == 2
    assert err.count("\n") == 1
    assert "results need another folder" in err or "was not written by gaia" in err
    after = content_of(logs)
    assert {name: after.get(name) for name in before} == before
    assert set(after) - set(before) <= {".gaia-files", "a/.gaia-files", "b/.gaia-files"}


def test_a_result_of_ours_is_replaced_and_a_file_of_theirs_is_not(
    run,
    logs: Path,
    tmp_path: Path,  # type: ignore[no-untyped-def]
) -> None:
    out = tmp_path / "out"
    command = ("reconstruct", logs / "a", "--denoiser", "raw", "--out", out)
    assert run(*command)[0] in (0, 1)
    (out / "report.md").write_text("old", encoding="utf-8")
    (out / "plot.svg").write_text("theirs", encoding="utf-8")
    assert run(*command)[0] in (0, 1)
    assert (out / "report.md").read_text(encoding="utf-8") != "old"
    assert (out / "plot.svg").read_text(encoding="utf-8") == "theirs"
    code, _, err = run(*command, "--svg")
    assert code == 2
    assert "plot.svg: was not written by gaia" in err
    assert (out / "plot.svg").read_text(encoding="utf-8") == "theirs"


def test_a_name_that_is_taken_is_told_before_the_work(run, logs: Path, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    out = tmp_path / "out"
    out.mkdir()
    (out / "cones.csv").write_text("theirs", encoding="utf-8")
    code, told, err = run("reconstruct", logs / "a", "--out", out)
    assert (code, told) == (2, "")
    assert err.startswith(f"gaia: {out / 'cones.csv'}: was not written by gaia (see .gaia-files): ")
    assert err.count("\n") == 1
    assert content_of(out) == {"cones.csv": b"theirs"}


def test_a_simulation_replaces_itself_but_not_a_log_that_was_put_in_its_place(
    run,
    logs: Path,
    tmp_path: Path,  # type: ignore[no-untyped-def]
) -> None:
    command = ("simulate", "--preset", "straight", "--out", tmp_path / "sim")
    assert run(*command)[0] == 0
    assert run(*command, "--seed", "1")[0] == 0
    assert run(*command, "--format", "csv")[0] == 0
    shutil.rmtree(tmp_path / "sim")
    shutil.copytree(logs / "a", tmp_path / "sim")
    before = content_of(tmp_path / "sim")
    code, _, err = run(*command)
    assert code == 2
    assert "holds a log" in err
    assert content_of(tmp_path / "sim") == before


def test_a_page_is_replaced_only_where_this_command_wrote_it(run, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    page = tmp_path / "notes.md"
    page.write_bytes(b"Notes of many years, in Latin-1: Stra\xdfe.\n")
    command = ("reproduce", "page", "--out", tmp_path / "out", "--page")
    code, _, err = run(*command, page)
    assert code == 2
    assert "notes.md: was not written by gaia reproduce" in err
    assert page.read_bytes().startswith(b"Notes of many years")
    for _ in range(2):
        assert run(*command, tmp_path / "results.md")[0] == 0
