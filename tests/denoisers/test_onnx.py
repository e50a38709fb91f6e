from __future__ import annotations

import os

import pytest

from gaia_uwb._shared.errors import ConfigError
from gaia_uwb.denoisers._onnx import start_session
from gaia_uwb.models.checkpoint import ONNX, find_model


@pytest.mark.parametrize(
    ("allowed", "threads"), [(None, 3), ("1", 1), ("2", 2), ("9", 3), ("0", 3), ("two", 3)]
)
def test_it_takes_the_processors_it_may_use_and_no_more(
    monkeypatch: pytest.MonkeyPatch, allowed: str | None, threads: int
) -> None:
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: {0, 1, 2}, raising=False)
    if allowed is None:
        monkeypatch.delenv("OMP_NUM_THREADS", raising=False)
    else:
        monkeypatch.setenv("OMP_NUM_THREADS", allowed)
    content = (find_model("gaia-set", "mixed") / ONNX).read_bytes()
    session = start_session(content, "model.onnx")
    assert session.get_session_options().intra_op_num_threads == threads


def test_its_threads_sleep_while_there_is_no_work() -> None:
    content = (find_model("gaia-set", "mixed") / ONNX).read_bytes()
    options = start_session(content, "model.onnx").get_session_options()
    assert options.get_session_config_entry("session.intra_op.allow_spinning") == "0"


def test_what_is_no_network_is_refused_in_one_line() -> None:
    with pytest.raises(ConfigError, match=r"^here/model\.onnx: cannot run this model: .+$"):
        start_session(b"no network", "here/model.onnx")
