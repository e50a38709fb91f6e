"""Run the command ``gaia`` in this process, and say what its processor time went to.

    python benchmarks/speed/_parts.py FILE ARGUMENT...

A part's time is its own: what a step imports, or has another part do, counts there. Functions are
replaced from outside, where they are looked up, so nothing of this is in the package.
"""

from __future__ import annotations

import builtins
import importlib
import json
import sys
import time
from collections import defaultdict
from collections.abc import Callable
from contextlib import suppress
from functools import wraps
from pathlib import Path
from typing import Any

IMPORTS, REST = "interpreter and imports", "command line and the rest"
# Where each function is looked up: module, name.
PARTS = {
    "reading": ["api load_readable"],
    "alignment": ["pipeline align", "pipeline calibrate", "pipeline log_problems"],
    "locating": ["pipeline find_places", "pipeline fuse"],
    "network session": ["pipeline make_denoiser", "denoisers make_denoiser"],
    "network inference": ["pipeline _denoise"],
    "deciding, and regions": [
        "pipeline _decide",
        "pipeline decide_sides",
        "pipeline make_boundary",
        "reconstruction sample_scenes",
        "reconstruction boundary_uncertainty",
    ],
    "drawing plot.png": ["outputs.report plot_reconstruction", "outputs.report figure_png"],
    "map.html": ["outputs.report map_page"],
    "other files": ["outputs write_all"],
}


class Clock:
    """Processor time by part; the innermost part runs."""

    def __init__(self) -> None:
        self.spent_s = defaultdict(float, {IMPORTS: time.process_time()})
        self._running = [REST]
        self._since_s = time.process_time()

    def switch(self) -> None:
        """Book the time since the last switch."""
        now_s = time.process_time()
        self.spent_s[self._running[-1]] += now_s - self._since_s
        self._since_s = now_s

    def timed(self, part: str, function: Callable[..., Any]) -> Callable[..., Any]:
        """Return a function whose time is booked to a part."""

        @wraps(function)
        def run(*args: Any, **kwargs: Any) -> Any:
            self.switch()
            self._running.append(part)
            try:
                return function(*args, **kwargs)
            finally:
                self.switch()
                self._running.pop()

        return run

    def watch_imports(self) -> None:
        """Book the imports of modules that are not loaded yet."""
        plain, timed = builtins.__import__, self.timed(IMPORTS, builtins.__import__)

        @wraps(plain)
        def load(name: str, *args: Any, **kwargs: Any) -> Any:
            relative = bool(args[3:] and args[3]) or bool(kwargs.get("level"))
            known = name in sys.modules and not relative
            return (plain if known else timed)(name, *args, **kwargs)

        builtins.__import__ = load
        importlib.import_module = self.timed(IMPORTS, importlib.import_module)


def main() -> None:
    """Run the command and write the parts as JSON."""
    clock = Clock()
    clock.watch_imports()
    run = importlib.import_module("gaia_uwb.cli").main
    for part, places in PARTS.items():
        for place in places:
            module, _, name = place.partition(" ")
            found = importlib.import_module(f"gaia_uwb.{module}")
            setattr(found, name, clock.timed(part, getattr(found, name)))
    out, *sys.argv[1:] = sys.argv[1:]
    with suppress(SystemExit):
        run()
    clock.switch()
    Path(out).write_text(json.dumps(clock.spent_s), encoding="utf-8")


if __name__ == "__main__":
    main()
