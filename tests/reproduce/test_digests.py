"""Code counts by what it does, data by every number."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from gaia_uwb.episode import ClockOffset, DriveErrors, ErrorSizes, RangeReadings
from gaia_uwb.reproduce import digests
from gaia_uwb.reproduce.digests import code_digest, episodes_digest
from gaia_uwb.scene import Trajectory
from tiny_models import make_run


def write_package(folder: Path, inner: str, outer: str = "") -> None:
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "inner.py").write_text(inner)
    (folder / "outer.py").write_text(f"from gaia_uwb.inner import f\n{outer}")


@pytest.fixture
def digest(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(digests, "_PACKAGE", tmp_path)

    def of(inner: str, outer: str = "", **options: tuple[str, ...]) -> str:
        write_package(tmp_path, inner, outer)
        code_digest.cache_clear()
        found = code_digest("outer", **options)
        code_digest.cache_clear()
        return found

    return of


def test_comments_and_docstrings_do_not_count(digest) -> None:
    plain = digest("def f():\n    return 1\n")
    assert digest('def f():\n    """Say it."""\n    return 1  # one\n') == plain
    assert digest("def f():\n    return 2\n") != plain


def test_imported_code_counts_unless_it_is_left_out(digest) -> None:
    one, two = (digest(f"def f():\n    return {n}\n") for n in (1, 2))
    assert one != two
    one, two = (digest(f"def f():\n    return {n}\n", without=("inner",)) for n in (1, 2))
    assert one == two
    assert digest("", "x = 1\n", without=("inner",)) != digest("", "x = 2\n", without=("inner",))


def test_lazy_imports_are_followed() -> None:
    # The pipeline's solver is C, which only an import inside multilateration leads to.
    assert code_digest("locate") != code_digest("locate", without=("solver._solver",))


def test_a_name_that_a_face_hands_out_leads_to_its_file_only(digest, tmp_path: Path) -> None:
    room = tmp_path / "room"
    room.mkdir()
    (room / "__init__.py").write_text("import lazy_loader\n")
    (room / "__init__.pyi").write_text("from .one import f as f\nfrom .two import g as g\n")

    def of(one: int, two: int) -> str:
        (room / "one.py").write_text(f"def f():\n    return {one}\n")
        (room / "two.py").write_text(f"def g():\n    return {two}\n")
        return digest("", "from gaia_uwb.room import f\n")

    assert of(1, 1) == of(1, 2)
    assert of(1, 1) != of(2, 1)


def test_the_place_of_a_file_does_not_count(digest, tmp_path: Path) -> None:
    before = digest("def f():\n    return 1\n")
    (tmp_path / "moved.py").write_text((tmp_path / "inner.py").read_text())
    (tmp_path / "user.py").write_text("from gaia_uwb.moved import f\n")
    assert code_digest("user") == before


def test_a_module_that_is_not_there_is_an_error() -> None:
    with pytest.raises(ValueError, match=r"unknown module no\.such"):
        code_digest("pipeline", without=("no.such",))


def test_every_number_of_an_episode_counts() -> None:
    run = make_run(0)
    moved = replace(run, position_m=run.position_m + 1e-9)
    blind = run.without_truth()
    assert len({episodes_digest([run]), episodes_digest([moved]), episodes_digest([blind])}) == 3
    assert episodes_digest([run]) == episodes_digest([make_run(0)])


def test_what_a_run_says_of_its_errors_and_the_readings_own_times_count() -> None:
    sizes = ErrorSizes(0.1, 0.2, 0.05, np.full(3, 0.02), 0.03, 0.02)
    errors = DriveErrors(np.zeros(8), np.eye(8), sizes)
    path = Trajectory(np.arange(2.0), np.zeros((2, 2)))
    own = RangeReadings(np.ones(1), np.zeros(1, dtype=int), np.ones(1), trajectory=path)
    run = replace(
        make_run(0), run_errors=errors, own_times=own, clock=ClockOffset(0.1, 0.01, True, "")
    )
    others = [
        replace(run, run_errors=replace(errors, sizes=replace(sizes, delay_m=0.04))),
        replace(run, run_errors=replace(errors, sizes=replace(sizes, field_m=np.full(3, 0.03)))),
        replace(run, run_errors=replace(errors, mean=np.full(8, 1e-3))),
        replace(run, own_times=replace(own, t_s=np.full(1, 1.5))),
        replace(run, own_times=replace(own, trajectory=replace(path, position_m=np.ones((2, 2))))),
        replace(run, clock=ClockOffset(0.1, 0.02, True, "")),
    ]
    assert len({episodes_digest([each]) for each in (run, *others)}) == 7
