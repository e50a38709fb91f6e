"""Each pass has its own numbers of each kind, whoever draws before or beside it."""

from __future__ import annotations

import numpy as np
import pytest

from gaia_uwb._shared.errors import ConfigError
from gaia_uwb.simulate.streams import RowStreams, Source


def test_a_stream_is_philox_with_the_pass_as_key_and_the_kind_as_counter() -> None:
    key, counter = np.array([5, 7], dtype=np.uint64), np.array([0, 0, 0, 3], dtype=np.uint64)
    expected = np.random.Generator(np.random.Philox(key=key, counter=counter))
    rng = Source(5).stream(7)("polls")
    np.testing.assert_array_equal(rng.random(9), expected.random(9))
    np.testing.assert_array_equal(rng.standard_normal(9), expected.standard_normal(9))


def test_a_stream_starts_anew_whatever_was_drawn_before() -> None:
    source = Source(1)
    fresh = source.stream(4)("tails").standard_normal(5)
    source.stream(3)("tails").random(7)
    source.stream(4)("zone").integers(2, dtype=np.int32)  # leaves half a number in the generator
    np.testing.assert_array_equal(source.stream(4)("tails").standard_normal(5), fresh)
    source.stream(9)("tails").integers(2, dtype=np.int32)
    np.testing.assert_array_equal(source.stream(4)("tails").standard_normal(5), fresh)


def test_kinds_of_one_pass_may_be_drawn_in_turns() -> None:
    stream = Source(1).stream(0)
    zone, power = stream("zone"), stream("power")
    turns = [zone.random(), power.random(), zone.random(), power.random()]
    again = Source(1).stream(0)
    np.testing.assert_array_equal(turns[::2], again("zone").random(2))
    np.testing.assert_array_equal(turns[1::2], again("power").random(2))


@pytest.mark.parametrize(("seed", "episode"), [(-1, 0), (2**64, 0), (0, -1), (0, 2**64)])
def test_numbers_out_of_range_are_config_errors(seed: int, episode: int) -> None:
    with pytest.raises(ConfigError, match="below 2"):
        Source(seed).stream(episode)


def test_rows_are_those_of_each_pass() -> None:
    source, order = Source(2), np.array([[1.5], [1.5], [1.5], [3.0]])
    both = RowStreams([source.stream(0), source.stream(1)], [3, 1])
    for k, rows in ((0, slice(0, 3)), (1, slice(3, 4))):
        stream = source.stream(k)
        alone = RowStreams([stream], [rows.stop - rows.start])
        np.testing.assert_array_equal(
            both.uniform("polls", 2, 5)[rows], alone.uniform("polls", 2, 5)
        )
        np.testing.assert_array_equal(both.normal("power", 5)[rows], alone.normal("power", 5))
        common = both.common_normal("drift", 5)[rows]
        np.testing.assert_array_equal(common, [stream("drift").standard_normal(5)] * len(common))
        np.testing.assert_array_equal(
            both.gamma("tails", order, 5)[rows],
            stream("tails").standard_gamma(order[rows][0, 0], (len(common), 5)),
        )
