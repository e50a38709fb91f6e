"""Long work says how far it is: every minute, whether or not a step ends, and only then."""

from __future__ import annotations

import sys
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from gaia_uwb.cli import terminal
from gaia_uwb.cli.terminal import Progress


class Clock:
    """Tells the time that a test wants."""

    def __init__(self) -> None:
        self.now_s = 1000.0

    def __call__(self) -> float:
        return self.now_s


@pytest.fixture
def clock() -> Clock:
    return Clock()


def said(capsys: pytest.CaptureFixture[str]) -> list[str]:
    return capsys.readouterr().err.splitlines()


def test_a_line_comes_every_minute_even_within_a_step(
    clock: Clock, capsys: pytest.CaptureFixture[str]
) -> None:
    progress = Progress(clock)
    lines = []
    for _ in progress.track(range(3), "train gaia\x1b"):
        for _ in range(5):
            clock.now_s += 30.0
            progress.tell_if_due()
            lines.append(said(capsys))
    assert lines[:5] == [
        [],
        [r"train gaia\x1b: 0 of 3, 1 min so far"],
        [],
        [r"train gaia\x1b: 0 of 3, 2 min so far"],
        [],
    ]
    assert lines[5] == [r"train gaia\x1b: 1 of 3, 3 min so far"]


def test_work_of_unknown_length_and_work_without_steps(
    clock: Clock, capsys: pytest.CaptureFixture[str]
) -> None:
    progress = Progress(clock)
    clock.now_s += 61.0
    progress.tell_if_due()
    progress.update("table1")
    clock.now_s += 59.0
    progress.tell_if_due()
    clock.now_s += 1.0
    progress.tell_if_due()
    assert said(capsys) == ["working: 1 min so far", "table1: 2 min so far"]


def test_lines_come_by_themselves_and_end_with_the_work(
    clock: Clock, monkeypatch: pytest.MonkeyPatch
) -> None:
    told = threading.Event()
    monkeypatch.setattr(terminal, "_LOOK_EVERY_S", 0.001)
    monkeypatch.setattr(Progress, "tell_if_due", lambda self: told.set())
    with Progress(clock):
        assert told.wait(60.0)
    assert not [t for t in threading.enumerate() if "_tell_every_minute" in t.name]


def test_a_terminal_gets_a_bar(clock: Clock, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True, raising=False)
    with Progress(clock) as progress:
        assert progress.on_terminal
        assert list(progress.track("ab", "letters")) == ["a", "b"]
        clock.now_s += 100.0


LONG: dict[str, tuple[str, ...]] = {
    "reconstruct": ("reconstruct", "sim", "--denoiser", "raw", "--out", "out"),
    "simulate": ("simulate", "--out", "out", "--episodes", "2"),
    "evaluate": ("evaluate", "sim", "--methods", "raw", "--out", "out"),
    "data check": ("data", "check", "log"),
}


@pytest.mark.parametrize("name", LONG)
def test_long_commands_say_how_far_they_are(
    run: Callable[..., tuple[int, str, str]],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    name: str,
) -> None:
    """Every note of progress is told here, as if a minute had passed."""
    from gaia_uwb.logs import write_native
    from gaia_uwb.simulate import PRESETS, simulate_pass

    monkeypatch.chdir(tmp_path)
    write_native(simulate_pass(PRESETS["straight"], seed=0), tmp_path / "log")
    update = Progress.update

    def update_and_tell(self: Progress, *arguments: Any) -> None:
        update(self, *arguments)
        self._told_s -= terminal.EVERY_S
        self.tell_if_due()

    monkeypatch.setattr(Progress, "update", update_and_tell)
    code, _, err = run(*LONG[name])
    assert code in (0, 1)
    assert " of " in err and "min so far" in err


def test_quick_work_says_nothing(run: Callable[..., tuple[int, str, str]], tmp_path: Path) -> None:
    code, _, err = run("simulate", "--out", tmp_path / "out", "--episodes", "3")
    assert (code, err) == (0, "")
