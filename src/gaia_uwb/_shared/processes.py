"""Processes that work for another one."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager


def end_with_parent() -> None:
    """Let this process end as soon as the one that started it does, even if that one is killed.

    A pool's processes would else wait for work for ever: each holds the other end of its own queue.
    """
    threading.Thread(target=_wait_for_parent, daemon=True).start()


@contextmanager
def without_interrupts() -> Iterator[None]:
    """Start processes in this block, and Ctrl-C is left to this one: it ends them.

    A terminal sends Ctrl-C to all processes, and each would tell of it. A signal that is blocked
    while a process is started stays blocked there; here it is only late.
    """
    blocked = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, blocked)


def _wait_for_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)
