"""Start ONNX Runtime on a model's file."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

from gaia_uwb._shared import ConfigError

if TYPE_CHECKING:
    import onnxruntime


def start_session(content: bytes, source: str) -> onnxruntime.InferenceSession:
    """Return a session that runs a network on all processors that this process may use.

    Like other numerical libraries it uses no more than ``OMP_NUM_THREADS``, where that is set.

    Parameters
    ----------
    content
        An ONNX file's.
    source
        What to call it.

    Raises
    ------
    ConfigError
        If it is none, or cannot be run.
    """
    import onnxruntime

    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = _n_processors()
    options.log_severity_level = 3
    try:
        return onnxruntime.InferenceSession(content, options, providers=["CPUExecutionProvider"])
    except Exception as error:  # onnxruntime's own classes have no common base but this
        reason = " ".join(str(error).split())
        raise ConfigError(f"{source}: cannot run this model: {reason}") from error


def _n_processors() -> int:
    """Return how many processors this process may use, where the system says so."""
    there = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    allowed = os.environ.get("OMP_NUM_THREADS", "")
    if allowed.isdecimal() and int(allowed):
        return min(there or 1, int(allowed))
    return there or 1
