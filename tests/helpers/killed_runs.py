"""Kill a command or a training in the middle of its work, and look at what it leaves."""

from __future__ import annotations

import multiprocessing
import os
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from multiprocessing.connection import Connection
from pathlib import Path

import numpy as np


def gaia(arguments: Sequence[object], stderr: int = subprocess.DEVNULL) -> subprocess.Popen[bytes]:
    """Start the command line, and keep what it says on stderr if that is a pipe."""
    command = [sys.executable, "-m", "gaia_uwb", *map(str, arguments)]
    return subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=stderr)


def files_of(folder: Path) -> dict[str, bytes]:
    """Return what lies under final names."""
    found = {str(path.relative_to(folder)): path for path in folder.rglob("*") if path.is_file()}
    return {name: path.read_bytes() for name, path in found.items() if not is_hidden(name)}


def hidden_in(folder: Path) -> list[str]:
    """Return what lies there under hidden names, but for the record of what is ours."""
    paths = (path for path in folder.rglob("*") if path.name != ".gaia-files")
    names = [str(path.relative_to(folder)) for path in paths]
    return sorted(filter(is_hidden, names))


def is_hidden(name: str) -> bool:
    return any(part.startswith(".") for part in Path(name).parts)


def kill_training(train: Callable[..., object], after: int) -> None:
    """Train in another process and kill that in the middle of an epoch or portion.

    Parameters
    ----------
    train
        Trains and takes ``progress``; the other process gets it pickled.
    after
        How many epochs or portions are whole by then.

    Raises
    ------
    EOFError
        If the training ended before.
    """
    import torch

    context = multiprocessing.get_context("spawn")
    there, tell = context.Pipe(duplex=False)
    arguments = (train, after, tell, torch.get_num_threads())
    process = context.Process(target=_train_and_wait, args=arguments)
    process.start()
    tell.close()  # the other process has its own end; the pipe breaks if that process ends
    try:
        there.recv()
    finally:
        process.kill()
        process.join()
        there.close()
    assert process.exitcode == -signal.SIGKILL


def _train_and_wait(
    train: Callable[..., object], after: int, tell: Connection, n_threads: int
) -> None:
    """Train up to the first step after so many whole epochs, tell so, and go no further."""
    import torch
    from torch.optim.optimizer import register_optimizer_step_post_hook

    torch.set_num_threads(n_threads)
    begun = 0

    def counted(rounds: Iterable[int], *_: object) -> Iterator[int]:
        nonlocal begun
        for one in rounds:
            begun += 1
            yield one

    def stop_midway(*_: object) -> None:
        if begun > after:
            tell.send("midway")
            threading.Event().wait()

    register_optimizer_step_post_hook(stop_midway)
    train(progress=counted)


class KilledRuns:
    """One command over the results of an earlier one, killed again and again.

    Parameters
    ----------
    arguments_for
        From an output folder to the command's arguments.
    old
        A folder with what an earlier run wrote.
    folder
        For outputs.
    """

    def __init__(
        self, arguments_for: Callable[[Path], list[object]], old: Path, folder: Path
    ) -> None:
        self._arguments_for = arguments_for
        self._old, self._out = old, folder / "out"
        whole = folder / "whole"
        start = time.perf_counter()
        self.check_a_whole_run(whole)
        self.whole_s = time.perf_counter() - start
        self.old, self.new = files_of(old), files_of(whole)
        assert self.old.keys() <= self.new.keys()
        assert self.old != self.new
        self.n_done = self.n_before_writing = self.n_litter = 0

    def check_a_whole_run(self, out: Path) -> None:
        """Run the command to its end."""
        assert gaia(self._arguments_for(out)).wait() in (0, 1)

    def kill_once(self, rng: np.random.Generator) -> None:
        """Kill a run at a random moment of its whole time, or of its writing; check what is left.

        Raises
        ------
        AssertionError
            If there is a file that is neither the old one nor the new one, byte for byte.
        """
        shutil.rmtree(self._out, ignore_errors=True)
        shutil.copytree(self._old, self._out)
        process = gaia(self._arguments_for(self._out))
        if rng.random() < 0.3:
            time.sleep(rng.uniform(0, self.whole_s))
        else:
            self._wait_for_writing(process, rng)
        process.send_signal(signal.SIGKILL)
        self.n_done += process.wait() != -signal.SIGKILL
        self.n_litter += bool(hidden_in(self._out))
        left = files_of(self._out)
        self.n_before_writing += left == self.old
        for name, content in left.items():
            assert content in (self.old.get(name), self.new[name]), name
        # Where there is a last file, all belong to one run.
        if "report.json" in left:
            assert left in (self.old, self.new)

    def _wait_for_writing(self, process: subprocess.Popen[bytes], rng: np.random.Generator) -> None:
        """Wait until a random number of files is new, and a moment longer."""
        before, wanted = self._files(), int(rng.integers(1, len(self.new)))
        while process.poll() is None and len(self._files() ^ before) < wanted:
            time.sleep(1e-4)
        time.sleep(rng.uniform(0, 0.003))

    def _files(self) -> set[tuple[str, int, int]]:
        """Return place, number and time of each file: a number is used again once it is free."""
        found = set()
        for folder, _, names in os.walk(self._out):
            for name in names:
                with suppress(FileNotFoundError):  # one with a temporary name is gone again
                    about = os.lstat(Path(folder) / name)
                    found.add((str(Path(folder) / name), about.st_ino, about.st_mtime_ns))
        return found

    def check_the_next_run(self) -> None:
        """Run once more over what a killed run left: all is new, and nothing else is there."""
        self.check_a_whole_run(self._out)
        assert files_of(self._out) == self.new
        assert hidden_in(self._out) == []
