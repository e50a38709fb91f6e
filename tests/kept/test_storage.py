"""Data as bytes and back: the same data, the same bytes, and nothing that runs."""

from __future__ import annotations

import io
import pickle
from dataclasses import replace
from decimal import Decimal

import numpy as np
import pytest

from gaia_uwb import InputError
from gaia_uwb.estimate import Reason, ReasonKind
from gaia_uwb.kept.storage import FORMAT, from_bytes, to_bytes
from gaia_uwb.pipeline import prepare
from gaia_uwb.simulate import PRESETS, simulate_pass


def test_an_episode_comes_back_equal_and_with_the_same_bytes():
    episode = prepare(simulate_pass(PRESETS["lane-closure"], seed=1).without_truth())
    episode = replace(episode, problems=(Reason(ReasonKind.CLOCK, "unknown", numbers={"s": 0.1}),))
    data = to_bytes([episode])
    (found,) = from_bytes(data)
    assert to_bytes([found]) == data
    assert found.problems == episode.problems
    assert found.readings == episode.readings
    np.testing.assert_array_equal(found.own_times.t_s, episode.own_times.t_s)
    np.testing.assert_array_equal(found.range_m, episode.range_m)


@pytest.mark.parametrize(
    "data",
    [b"", b"PK\x03\x04", pickle.dumps({"drives": []}), to_bytes({"a": 1})[:-30]],
    ids=["nothing", "a zip's head", "a pickle", "cut short"],
)
def test_what_is_not_ours_is_an_error(data):
    with pytest.raises(InputError, match="cannot be read"):
        from_bytes(data, "zone.npz")


def test_arrays_of_objects_are_not_read():
    file = io.BytesIO()
    np.savez(file, content=np.array([{"format": FORMAT}], dtype=object))
    with pytest.raises(InputError, match="cannot be read"):
        from_bytes(file.getvalue())


def test_another_format_is_told(monkeypatch):
    monkeypatch.setattr("gaia_uwb.kept.storage.FORMAT", FORMAT + 1)
    data = to_bytes({"a": 1})
    monkeypatch.undo()
    with pytest.raises(InputError, match=f"has format {FORMAT + 1}"):
        from_bytes(data)


def test_a_class_that_is_not_listed_is_neither_written_nor_read():
    with pytest.raises(TypeError, match="cannot be kept: Decimal"):
        to_bytes({"a": Decimal(1)})
    data = to_bytes({"a": 1}).replace(b'"mapping"', b'"classes"')
    with pytest.raises(InputError):
        from_bytes(data)
