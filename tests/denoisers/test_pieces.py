"""Pieces of long drives: they cover everything, and what comes of them is one result."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, strategies as st

from gaia_uwb.denoised import DenoisedRanges, ZonePosterior
from gaia_uwb.denoisers._pieces import Piece, pieces_of, put_together, sections
from gaia_uwb.episode import Episode
from gaia_uwb.models.description import ZONE_FARTHEST_M, ZONE_LONGEST_STEPS, ZONE_MOST_ANCHORS


def drive(step_m: np.ndarray, anchors_at: list[int], reach: int = 150) -> Episode:
    """Return a straight drive; each anchor is heard about the step where it is passed."""
    n_steps = len(step_m) + 1
    path = np.zeros((n_steps, 2))
    path[1:, 0] = np.cumsum(step_m)
    valid = np.abs(np.arange(n_steps)[:, None] - np.array(anchors_at)) <= reach
    places = path[np.minimum(anchors_at, n_steps - 1)] + [0.0, 5.0]
    range_m = np.linalg.norm(path[:, None] - places, axis=2)
    return Episode(
        name="long",
        anchor_ids=tuple(f"c{k}" for k in range(len(anchors_at))),
        t_s=0.1 * np.arange(n_steps),
        position_m=path,
        range_m=np.where(valid, range_m, np.nan),
        valid=valid,
    )


def answer(piece: Piece, episode: Episode, log_odds: float, own_left: float) -> DenoisedRanges:
    """Return what a network may say of a piece: ranges as they are, places named by columns."""
    part = piece.of(episode)
    n = part.n_anchors
    scene = 1.0 / (1.0 + np.exp(-log_odds))
    zone = ZonePosterior(
        place_m=np.broadcast_to(piece.heard[:, None, None].astype(float), (n, 2, 2)),
        covariance_m2=np.broadcast_to(np.eye(2), (n, 2, 2, 2)),
        scene_probability=np.array([scene, 1.0 - scene]),
        left_probability=np.stack([np.full(n, own_left), np.full(n, 1.0 - own_left)]),
        located=np.ones(n, dtype=bool),
    )
    sigma_m = np.where(part.valid, 0.1, np.nan)
    return DenoisedRanges(range_m=part.range_m, sigma_m=sigma_m, valid=part.valid, zone=zone)


@given(
    step_m=st.lists(st.sampled_from([0.0, 0.5, 3.0, 900.0]), min_size=3, max_size=40),
    repeat=st.integers(1, 300),
)
def test_sections_cover_all_steps_within_reach(step_m: list[float], repeat: int) -> None:
    episode = drive(np.repeat(step_m, repeat), [0])
    found = sections(episode)
    assert found[0].start == 0 and found[-1].stop == episode.n_steps
    for one, following in pairwise(found):
        assert one.start < following.start < one.stop < following.stop
    for part in found:
        length = part.stop - part.start
        assert 2 <= length <= ZONE_LONGEST_STEPS
        along_m = episode.position_m[part, 0]
        assert length == 2 or np.abs(along_m - along_m.mean()).max() <= ZONE_FARTHEST_M + 1e-6


def test_every_anchor_has_one_piece_with_most_of_its_ranges() -> None:
    episode = drive(np.full(6000, 1.0), [50, 900, 1000, 2700, 5990])
    pieces = pieces_of(episode)
    own = np.concatenate([piece.heard[piece.own] for piece in pieces])
    assert sorted(own.tolist()) == [0, 1, 2, 3, 4]
    for piece in pieces:
        for n in piece.heard[piece.own]:
            assert episode.valid[piece.steps, n].sum() == episode.valid[:, n].sum()


def test_too_many_anchors_in_one_section_are_split() -> None:
    episode = drive(np.full(300, 0.5), list(np.linspace(0, 300, 450).astype(int)))
    pieces = pieces_of(episode)
    assert max(len(piece.heard) for piece in pieces) <= ZONE_MOST_ANCHORS
    own = np.concatenate([piece.heard[piece.own] for piece in pieces])
    assert sorted(own.tolist()) == list(range(450))


def test_ranges_and_places_come_together_and_agreeing_sections_share_their_evidence() -> None:
    episode = drive(np.full(2000, 1.0), [100, 500, 900, 1300, 1900])
    pieces = pieces_of(episode)
    found = put_together(episode, pieces, [answer(p, episode, 1.0, 0.99) for p in pieces])
    np.testing.assert_allclose(found.range_m[episode.valid], episode.range_m[episode.valid])
    np.testing.assert_array_equal(np.isfinite(found.range_m), episode.valid)
    np.testing.assert_allclose(found.sigma_m[episode.valid], 0.1)
    assert found.zone is not None and found.zone.located.all()
    np.testing.assert_array_equal(found.zone.place_m[:, 0, 0], np.arange(5))
    one = 1.0 / (1.0 + np.exp(-1.0))
    assert one < found.zone.scene_probability[0] < 1.0 - 1e-4
    np.testing.assert_allclose(found.zone.left_probability[0], 0.99)


def test_sections_that_contradict_each_other_keep_their_own_sides() -> None:
    episode = drive(np.full(3000, 1.0), [100, 150, 2850, 2900])
    pieces = pieces_of(episode)
    answers = [answer(p, episode, 6.0 if p.steps.stop < 1500 else -6.0, 0.999) for p in pieces]
    zone = put_together(episode, pieces, answers).zone
    assert zone is not None
    left = zone.scene_probability @ zone.left_probability
    assert (left[:2] > 0.99).all() and (left[2:] < 0.01).all()


def test_sections_that_are_fairly_sure_of_opposite_sides_are_two_zones() -> None:
    episode = drive(np.full(3000, 1.0), [100, 400, 700, 1500, 2300, 2600, 2900])
    pieces = pieces_of(episode)
    answers = [answer(p, episode, 2.5 if p.steps.stop < 2400 else -2.5, 0.99) for p in pieces]
    zone = put_together(episode, pieces, answers).zone
    assert zone is not None
    left = zone.scene_probability @ zone.left_probability
    assert left[0] > 0.85 and left[-1] < 0.15


def test_where_the_vehicle_turns_back_left_and_right_change_places() -> None:
    out = np.stack([np.arange(1001.0), np.zeros(1001)], axis=1)
    path = np.concatenate([out, out[::-1] + np.array([0.0, 4.0])])
    places = np.array([[100.0 * k + 50.0, 9.0] for k in range(10)])  # left on the way out
    range_m = np.linalg.norm(path[:, None] - places, axis=2)
    episode = Episode(
        name="back",
        anchor_ids=tuple("abcdefghij"),
        t_s=0.1 * np.arange(len(path)),
        position_m=path,
        range_m=np.where(range_m < 150.0, range_m, np.nan),
        valid=range_m < 150.0,
    )
    pieces = pieces_of(episode)
    answers = []
    for piece in pieces:
        part = piece.of(episode)
        n, ahead = part.n_anchors, part.position_m[-1, 0] > part.position_m[0, 0]
        north_m = places[piece.heard]
        south_m = north_m * [1.0, -1.0]
        both_m = np.stack([north_m, south_m] if ahead else [south_m, north_m], axis=1)
        left = 0.97 if ahead else 0.03
        zone = ZonePosterior(
            place_m=both_m,
            covariance_m2=np.broadcast_to(np.eye(2), (n, 2, 2, 2)),
            scene_probability=np.array([left, 1.0 - left]),
            left_probability=np.stack([np.full(n, 0.98), np.full(n, 0.02)]),
            located=np.ones(n, dtype=bool),
        )
        sigma_m = np.where(part.valid, 0.1, np.nan)
        answers.append(DenoisedRanges(part.range_m, sigma_m, part.valid, zone))
    zone = put_together(episode, pieces, answers).zone
    assert zone is not None
    assert (zone.place_m[:, 0, 1] == 9.0).all()  # the first place is the same side of all
    left_probability = zone.scene_probability @ zone.left_probability
    assert (left_probability > 0.95).all()


def test_an_anchor_of_which_nothing_was_said_is_not_located() -> None:
    episode = drive(np.full(2000, 1.0), [100, 1900])
    pieces = pieces_of(episode)
    answers = [answer(p, episode, 0.0, 0.9) for p in pieces]
    silent = [replace(a, zone=None) if 1 in p.heard else a
              for p, a in zip(pieces, answers, strict=True)]  # fmt: skip
    zone = put_together(episode, pieces, silent).zone
    assert zone is not None
    assert zone.located.tolist() == [True, False]
    assert zone.scene_probability == pytest.approx([0.5, 0.5])
