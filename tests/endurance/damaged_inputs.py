"""Try thousands of damaged inputs: each is read or refused in one line, in bounded time and memory.

Usage: nice python tests/endurance/damaged_inputs.py [--n 10000] [--reader NAME ...]
       python tests/endurance/damaged_inputs.py --reader mcap --case 4711

The second form runs one case and shows its traceback.

Every case damages a fresh copy of a good input (``tests/helpers/damage.py``) and then does what
the command does that takes it (``tests/helpers/readers.py``: ``gaia data check`` for a log); every
twentieth that is still readable is also used (a log is reconstructed). A case counts as
bad where another exception than ours comes out, anything is printed on stderr (a warning, a
library's stack trace), the text is not one printable line, the process dies, or it takes more than
5 s of processor time or hangs. Memory is the peak of the whole process that read all of a reader's
cases. Needs the extras ros and feeds.

One process works at a time. After each reader its row is printed and written to
``tests/endurance/out/damaged_inputs.json``, where the rows of other readers stay as they are.
Resume after an interruption with ``--reader`` and the remaining names.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import select
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import traceback
import warnings
from importlib import import_module
from pathlib import Path
from typing import Any

LIMIT_S, LIMIT_GIB = 5.0, 1.0
STUCK_S = 10 * LIMIT_S
"""A worker that takes more processor time than this for one case is killed."""

SILENT_S = 3600.0
"""A worker that prints nothing for this long hangs; long, because the machine may be busy."""

USE_EVERY = 20
LONGEST_LINE = 2000
SEED = 20261122


class Cases:
    """The damaged inputs of one reader.

    Parameters
    ----------
    name
        One of ``readers.READERS``.
    folder
        For files; emptied again and again.
    """

    def __init__(self, name: str, folder: Path) -> None:
        readers = load_readers()
        self._reader = readers[name]
        self._damage = import_module("damage").damage_log
        self._key = list(readers).index(name)
        self._good, self._work = folder / "good", folder / "work"
        self._good.mkdir()
        self.good: Path = self._reader.write(self._good)
        self._place = self.good.relative_to(self._good)

    def make(self, case: int) -> Path:
        """Return one damaged input."""
        import numpy as np

        shutil.rmtree(self._work, ignore_errors=True)
        shutil.copytree(self._good, self._work)
        path: Path = self._work / self._place
        self._damage(path, np.random.default_rng([SEED, self._key, case]))
        return path

    def look(self, path: Path, case: int) -> tuple[str, str]:
        """Read an input as a user would; return whether it is ok, refused or bad, and the line."""
        from gaia_uwb._shared.errors import GaiaError

        try:
            for line in self._reader.read(path):
                if not line.isprintable() or len(line) > LONGEST_LINE:
                    return "bad", f"not one line ({len(line)} characters): {line!r}"[:300]
            if case % USE_EVERY == 0:
                self._reader.use(path)
        except GaiaError as error:
            line = str(error)
            if not line.isprintable() or len(line) > LONGEST_LINE:
                return "bad", f"not one line ({len(line)} characters): {line!r}"[:300]
            return "refused", line
        return "ok", ""


def load_readers() -> dict[str, Any]:
    """Return the readers, by name."""
    folder = str(Path(__file__).parents[1] / "helpers")
    if folder not in sys.path:
        sys.path.insert(0, folder)
    readers: dict[str, Any] = import_module("readers").READERS
    return readers


def work(reader: str, first: int, n: int) -> None:
    """Go through the cases of a reader and print a row on each."""
    # What a library prints on its own is a finding, so stderr goes where it can be looked at.
    out = os.dup(1)
    with tempfile.TemporaryFile() as stray, tempfile.TemporaryDirectory(dir=_memory()) as folder:
        cases = Cases(reader, Path(folder))
        cases.look(cases.good, 0)  # imports, and everything else that is done once
        os.dup2(stray.fileno(), 1)
        os.dup2(stray.fileno(), 2)
        warnings.simplefilter("always")
        _say(out, {"ready": True})
        for case in range(first, n):
            path = cases.make(case)
            _say(out, {"case": case})
            signal.setitimer(signal.ITIMER_PROF, STUCK_S)
            start = time.process_time()
            try:
                outcome, line = cases.look(path, case)
            except Exception:
                outcome, line = "bad", traceback.format_exc(limit=-3)
            seconds = time.process_time() - start
            if size := os.fstat(stray.fileno()).st_size:
                printed = os.pread(stray.fileno(), 2000, 0).decode("utf-8", "replace")
                outcome, line = "bad", f"printed {size} bytes: {printed}"
                os.ftruncate(stray.fileno(), 0)
                os.lseek(stray.fileno(), 0, os.SEEK_SET)
            peak_mib = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
            row = {"outcome": outcome, "s": seconds, "mib": peak_mib}
            _say(out, row | ({"line": line} if outcome == "bad" else {}))


def _say(out: int, row: dict[str, Any]) -> None:
    os.write(out, (json.dumps(row) + "\n").encode())


def _memory() -> str | None:
    """Return a folder in memory, where there is one: the disk is not what is tested."""
    return "/dev/shm" if os.access("/dev/shm", os.W_OK) else None


class Reader:
    """What came out for one reader; its worker is started again where it died or hung."""

    def __init__(self, name: str, n: int) -> None:
        self.name, self.n = name, n
        self.counts = {"ok": 0, "refused": 0, "bad": 0}
        self.worst_s = self.worst_mib = 0.0
        self.findings: list[dict[str, Any]] = []

    def run(self) -> None:
        """Go through all cases."""
        done = 0
        while done < self.n:
            command = [sys.executable, __file__, "--worker", self.name, "--first", str(done)]
            command += ["--n", str(self.n)]
            with subprocess.Popen(command, stdout=subprocess.PIPE) as process:
                done = self._listen(process, done)

    def _listen(self, process: subprocess.Popen[bytes], done: int) -> int:
        """Collect a worker's rows and return the next case to be done."""
        assert process.stdout is not None
        pipe, running = process.stdout, False
        while True:
            ready, _, _ = select.select([pipe], [], [], SILENT_S)
            line = pipe.readline() if ready else b""
            if not line:
                process.kill()
                if done < self.n:
                    if not running:
                        raise SystemExit(f"the worker of {self.name} did not start")
                    self._add(done, "bad", "hung" if not ready else f"died: {process.wait()}")
                return done + 1
            row = json.loads(line)
            running = "case" in row
            if "outcome" in row:
                late = row["s"] > LIMIT_S and row["outcome"] != "bad"
                self.worst_s = max(self.worst_s, row["s"])
                self.worst_mib = max(self.worst_mib, row["mib"])
                self._add(done, *(("bad", "late") if late else (row["outcome"], row.get("line"))))
                done += 1
                running = True

    def _add(self, case: int, outcome: str, line: str | None) -> None:
        self.counts[outcome] += 1
        if outcome == "bad":
            self.findings.append({"case": case, "line": line})

    def row(self) -> str:
        """Return the reader's row of the table."""
        within = self.counts["bad"] == 0 and self.worst_mib < 1024 * LIMIT_GIB
        return (
            f"{self.name:<22}{self.n:>7}{self.counts['ok']:>8}{self.counts['refused']:>9}"
            f"{self.counts['bad']:>6}{self.worst_s:>9.2f} s{self.worst_mib:>9.0f} MiB"
            f"  {'within' if within else 'OVER'}"
        )


def main() -> None:
    """Run the readers one after the other and print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("--n", type=int, default=10_000)
    parser.add_argument("--reader", nargs="*", default=[])
    parser.add_argument("--case", type=int)
    parser.add_argument("--worker", help=argparse.SUPPRESS)
    parser.add_argument("--first", type=int, default=0, help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.worker is not None:
        work(given.worker, given.first, given.n)
        return
    if given.case is not None:
        with tempfile.TemporaryDirectory() as folder:
            cases = Cases(given.reader[0], Path(folder))
            print(*cases.look(cases.make(given.case), given.case))
        return
    out = Path(__file__).parent / "out" / "damaged_inputs.json"
    out.parent.mkdir(exist_ok=True)
    results = json.loads(out.read_text(encoding="utf-8")) if out.exists() else {}
    print(
        f"{'reader':<22}{'cases':>7}{'read':>8}{'refused':>9}{'bad':>6}{'slowest':>11}{'memory':>13}"
    )
    for name in given.reader or load_readers():
        reader = Reader(name, given.n)
        reader.run()
        print(reader.row(), flush=True)
        results[name] = vars(reader)
        out.write_text(json.dumps(results, indent=1) + "\n", encoding="utf-8")
        for finding in reader.findings[:5]:
            print(f"    case {finding['case']}: {finding['line']}")


if __name__ == "__main__":
    main()
