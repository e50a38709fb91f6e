"""How much memory a piece of a test takes at its peak, whatever ran before it in the process."""

from __future__ import annotations

import resource
from collections.abc import Callable
from pathlib import Path


def start_measuring() -> Callable[[], int]:
    """Return a function that tells by how many bytes the process has grown at most since now."""
    try:
        Path("/proc/self/clear_refs").write_text("5", encoding="ascii")  # forget the earlier peak
    except OSError:  # not Linux: then only growth beyond the earlier peak shows
        before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        return lambda: 1024 * (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before)
    now = _status_bytes("VmRSS")
    return lambda: _status_bytes("VmHWM") - now


def _status_bytes(name: str) -> int:
    lines = Path("/proc/self/status").read_text(encoding="ascii").splitlines()
    return next(1024 * int(line.split()[1]) for line in lines if line.startswith(f"{name}:"))
