"""Jobs wait for one another, the longest chain goes first, and a failure is not swallowed."""

from __future__ import annotations

import operator
import os
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from gaia_uwb._shared.errors import ConfigError
from gaia_uwb.reproduce.jobs import Job, run_jobs


def test_the_longest_chain_goes_first() -> None:
    jobs = [
        Job("short", pow, (2, 1), expected_s=5.0),
        Job("start", pow, (2, 2), expected_s=1.0),
        Job("end", pow, (2, 3), after=("start",), expected_s=10.0),
    ]
    assert list(run_jobs(jobs, 0)) == ["start", "end", "short"]


def test_a_job_that_is_not_there_is_not_waited_for() -> None:
    assert run_jobs([Job("a", pow, (2, 2), after=("done long ago",))], 0) == {"a": 4}


def test_whoever_watches_hears_how_much_is_left() -> None:
    said: list[str] = []
    run_jobs([Job(name, pow, (1, 1)) for name in "abc"], 0, said.append)
    assert [line.split(":")[0] for line in said] == ["1 of 3", "2 of 3", "3 of 3"]
    assert said[-1].endswith("about 0 s left")


def test_other_processes_have_one_thread_each() -> None:
    before = dict(os.environ)
    names = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS")
    found = run_jobs([Job(name, os.getenv, (name,)) for name in names], 2)
    assert found == dict.fromkeys(names, "1")
    assert dict(os.environ) == before


@pytest.mark.parametrize("workers", [0, 1])
def test_a_failure_is_raised(workers: int) -> None:
    with pytest.raises(ZeroDivisionError):
        run_jobs([Job("bad", operator.truediv, (1, 0))], workers)


def test_a_process_that_is_gone_is_told_in_one_line() -> None:
    with pytest.raises(ConfigError, match="bad: its process was killed from outside"):
        run_jobs([Job("bad", os._exit, (1,))], 1)


_KILLED = """
import os, sys, time
from pathlib import Path
from gaia_uwb.reproduce.jobs import Job, run_jobs

def sleep(note):
    Path(note).write_text(str(os.getpid()))
    time.sleep(600)

if __name__ == "__main__":
    run_jobs([Job("sleep", sleep, (sys.argv[1],))], 1)
"""


@pytest.mark.skipif(not Path("/proc/self").exists(), reason="left out: no /proc to look at")
def test_processes_end_with_a_parent_that_is_killed(tmp_path: Path) -> None:
    script, note = tmp_path / "killed.py", tmp_path / "pid"
    script.write_text(_KILLED)
    parent = subprocess.Popen([sys.executable, str(script), str(note)])
    _wait_for(note.exists)
    _wait_for(lambda: bool(note.read_text()))
    child = Path("/proc") / note.read_text()
    assert child.exists()
    parent.kill()
    parent.wait()
    _wait_for(lambda: not child.exists() or "State:\tZ" in (child / "status").read_text())


def _wait_for(condition: Callable[[], bool], limit_s: float = 120.0) -> None:
    end_s = time.monotonic() + limit_s
    while not condition():
        assert time.monotonic() < end_s, "it did not happen"
        time.sleep(0.2)
