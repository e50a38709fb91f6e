from __future__ import annotations

from itertools import product

import pytest

from gaia_uwb.logs.bags.ends import EndsError, check_one_tag, choose_anchor, choose_tag


def seen(*columns: list[str], n: int = 20) -> dict[tuple[str, ...], int]:
    """Return readings in which every value of one field meets every value of the others."""
    return dict.fromkeys(product(*columns), n)


ANCHORS, TAG, TAGS = ["0", "1", "2"], ["10"], ["10", "11"]


@pytest.mark.parametrize("names", [("from_id", "to_id"), ("id", "dest_id"), ("initiator", "peer")])
@pytest.mark.parametrize("turned", [False, True])
def test_the_end_that_varies_is_the_anchor(names: tuple[str, str], turned: bool) -> None:
    columns = (TAG, ANCHORS) if turned else (ANCHORS, TAG)
    assert choose_anchor(names, seen(*columns)) == names[turned]


@pytest.mark.parametrize("columns", [(ANCHORS, TAGS), (["4"], TAG)])
def test_ends_that_both_vary_or_both_do_not_are_asked_for(columns: tuple[list[str], ...]) -> None:
    with pytest.raises(EndsError, match=r"from_id is '.*; to_id is '10'.*: set fields: \{anchor"):
        choose_anchor(("from_id", "to_id"), seen(*columns))


def test_every_second_tag_with_anchors_of_its_own_does_not_look_like_an_anchor() -> None:
    pairs = dict.fromkeys([("0", "10"), ("1", "10"), ("2", "11"), ("3", "11")], 20)
    with pytest.raises(EndsError, match="from_id is '0', '1', '2', '3'; to_id is '10', '11'"):
        choose_anchor(("from_id", "to_id"), pairs)


@pytest.mark.parametrize("tags", [TAG, TAGS])
def test_a_name_that_says_anchor_is_the_anchor(tags: list[str]) -> None:
    assert choose_anchor(("anchorId", "tag_id"), seen(ANCHORS, tags)) == "anchorId"
    assert choose_anchor(("anchorId", "id"), seen(["7"], TAG)) == "anchorId"


def test_two_names_of_one_radio_are_alike() -> None:
    pairs = {("1", "0a"): 9, ("2", "0b"): 9}
    assert choose_anchor(("node_id", "mac"), pairs) == "node_id"
    check_one_tag("node_id", ["mac"], pairs)


def test_a_counter_is_no_end() -> None:
    counted = {(str(k % 3), str(k)): 1 for k in range(60)}
    assert choose_anchor(("id", "node"), {key[::-1]: n for key, n in counted.items()}) == "node"
    check_one_tag("node", ["id"], counted)


def test_one_anchor_alone_is_read() -> None:
    assert choose_anchor(("id",), seen(["3"])) == "id"
    assert choose_anchor(("id", "tag_id"), seen(["3"], TAG)) == "id"
    with pytest.raises(EndsError, match="id is '3'; tag_id is '10', '11'"):
        choose_anchor(("id", "tag_id"), seen(["3"], TAGS))


@pytest.mark.parametrize("name", ["to_id", ".id", "role"])
def test_another_end_with_several_values_is_several_tags(name: str) -> None:
    check_one_tag("from_id", [name], seen(ANCHORS, TAG))
    with pytest.raises(EndsError, match=rf"{name} has several values \('10', '11'\), as of "):
        check_one_tag("from_id", [name], seen(ANCHORS, TAGS))


def test_roles_are_told_apart_even_if_every_id_has_one() -> None:
    pairs = {("1", "1"): 9, ("2", "2"): 30}
    with pytest.raises(EndsError, match=r"as of anchors and tags: choose one, where: \{role: 2\}"):
        check_one_tag("id", ["role"], pairs)


@pytest.mark.parametrize(
    ("names", "columns", "tag"),
    [
        (("from_id", "to_id"), (ANCHORS, TAGS), "to_id"),
        (("mac", "tag_id"), (TAGS, TAG), "tag_id"),  # by its name, though the other has more
        (("from_id", "to_id"), (TAG, TAGS), "to_id"),  # the one that varies
        (("anchor_id", "to_id"), (TAGS, ANCHORS), None),
        (("role", "to_id"), (TAGS, ANCHORS), None),
        (("count", ".id"), (TAGS, TAGS), ".id"),
        (("id", "tag_ids"), (ANCHORS, ["9"]), "tag_ids"),  # so that the one unknown is named
    ],
)
def test_the_tag_is_a_field_whose_values_are_tags(
    names: tuple[str, ...], columns: tuple[list[str], ...], tag: str | None
) -> None:
    assert choose_tag(names, seen(*columns), set(TAGS).__contains__) == tag
