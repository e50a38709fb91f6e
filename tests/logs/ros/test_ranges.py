from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bags import FORMATS, START_S, VENDOR, Log
from gaia_uwb._shared.errors import InputError
from gaia_uwb.logs.bags.fields import FieldMap
from gaia_uwb.logs.ros import RosLog

Fill = Callable[[Log, int], dict[str, Any]]
"""From a log and the number of a message to its fields."""

BOTH_ENDS = "std_msgs/Header header\nuint8 from_id\nuint8 to_id\nfloat32 range\n"
NODES = "std_msgs/Header header\nuint8 role\nuint8 id\nNode[] nodes\n"
NODE = "uint8 role\nuint8 id\nfloat32 dis\nfloat32 fp_rssi\nfloat32 rx_rssi\n"
TAG_FRAME = "uint8 role\nuint8 id\nuint32 local_time\nfloat32[8] dis_arr\n"


def write(
    folder: Path, text: str, fill: Fill, *, n: int = 24, kind: str = "mcap", **types: str
) -> Path:
    """Write a log with n messages of a vendor's type."""
    name = types.pop("name", VENDOR)
    log = Log(folder, kind, {**types, name: text})
    for k in range(n):
        log.point("/pose", START_S + k, float(k), 0.0)
        log.add("/uwb", name, START_S + k, **fill(log, k))
    return log.close()


def both_ends(anchor: str, tag: str, n_tags: int = 1) -> Fill:
    def fill(log: Log, k: int) -> dict[str, Any]:
        ends = {anchor: k % 3, tag: 10 + k // 3 % n_tags}
        return {"header": log.header(START_S + k), **ends, "range": 5.0 + k}

    return fill


def ids(table: Any) -> list[str]:
    return [table.labels["anchor_id"][k] for k in table["anchor_id"]]


@pytest.mark.parametrize("kind", FORMATS)
@pytest.mark.parametrize(("anchor", "tag"), [("from_id", "to_id"), ("to_id", "from_id")])
def test_the_end_that_varies_is_the_anchor(
    tmp_path: Path, kind: str, anchor: str, tag: str
) -> None:
    log = RosLog(write(tmp_path, BOTH_ENDS, both_ends(anchor, tag), kind=kind))
    assert ids(log.ranges())[:4] == ["0", "1", "2", "0"]
    assert log.notes == [f"ranges: /uwb: anchor: {anchor}, range: range, {tag} is always 10"]


def test_of_two_tags_one_is_taken(tmp_path: Path) -> None:
    path = write(tmp_path, BOTH_ENDS, both_ends("from_id", "to_id", 2))
    with pytest.raises(InputError, match=r"from_id is '0', '1', '2'; to_id is '10', '11': set"):
        RosLog(path).ranges()
    fields = FieldMap(anchor="from_id", range="range")
    with pytest.raises(InputError, match=r"to_id has several values \('10', '11'\).* where: \{to"):
        RosLog(path).ranges(fields=fields)
    for fields_or_not in (fields, None):
        log = RosLog(path)
        table = log.ranges(fields=fields_or_not, where={"to_id": 11})
        assert table["range_m"].tolist()[:4] == [8, 9, 10, 14]
        assert log.notes[1] == "/uwb: skipped 12 readings other than of to_id 11"
    assert len(RosLog(path).ranges(fields=fields, where={"to_id": [10, "11"]})) == 24
    with pytest.raises(InputError, match="no ranges: where leaves out all 24 readings"):
        RosLog(path).ranges(fields=fields, where={"to_id": 12})
    with pytest.raises(InputError, match="no field 'tag'; available: header, from_id"):
        RosLog(path).ranges(fields=fields, where={"tag": 12})


def test_a_second_tag_that_comes_late_is_found(tmp_path: Path) -> None:
    def fill(log: Log, k: int) -> dict[str, Any]:
        ends = {"anchor_id": k % 2, "tag_id": 1 + (k > 29_900)}
        return {**ends, "range": 5.0}

    path = write(tmp_path, "uint8 anchor_id\nuint8 tag_id\nfloat32 range\n", fill, n=30_000)
    with pytest.raises(InputError, match=r"tag_id has several values \('1', '2'\)"):
        RosLog(path).ranges()


def nodes(log: Log, k: int) -> dict[str, Any]:
    node = log.types.types["acme_uwb/msg/Node"]
    radios = ((1, 3), (1, 4), (2, 3))  # (role, id): another tag has an anchor's id
    each = [
        node(role=role, id=n, dis=10.0 * role + n + k, fp_rssi=-90.0, rx_rssi=-80.0)
        for role, n in radios
    ]
    return {"header": log.header(START_S + k), "role": 2, "id": 1 + k % 2, "nodes": each}


def test_roles_are_chosen_by_the_element_and_tags_by_the_message(tmp_path: Path) -> None:
    path = write(tmp_path, NODES, nodes, **{"acme_uwb/msg/Node": NODE})
    with pytest.raises(InputError, match=r"role has several values \('1', '2'\), as of anchors"):
        RosLog(path).ranges(where={".id": 1})
    with pytest.raises(InputError, match=r"\.id has several values.* where: \{\.id: 1\}"):
        RosLog(path).ranges(where={"role": 1})
    log = RosLog(path)
    table = log.ranges(where={"role": 1, ".id": 2})
    assert ids(table)[:4] == ["3", "4", "3", "4"]
    assert table["range_m"].tolist()[:4] == [14, 15, 16, 17]
    assert log.notes[0] == "ranges: /uwb: anchor: nodes.id, range: nodes.dis"
    assert log.notes[1] == "/uwb: skipped 48 readings other than of role 1, .id 2"


def test_entries_that_fill_an_array_are_no_other_role(tmp_path: Path) -> None:
    def fill(log: Log, k: int) -> dict[str, Any]:
        node = log.types.types["acme_uwb/msg/Node"]
        power = {"fp_rssi": -90.0, "rx_rssi": -80.0}
        each = [node(role=1, id=3, dis=9.0 + k, **power), node(role=0, id=0, dis=0.0, **power)]
        return {"header": log.header(START_S + k), "role": 2, "id": 1, "nodes": each}

    path = write(tmp_path, NODES, fill, **{"acme_uwb/msg/Node": NODE})
    log = RosLog(path)
    assert set(ids(log.ranges(missing=[0.0]))) == {"3"}
    with pytest.raises(InputError, match="no ranges: where leaves out all 48 readings"):
        RosLog(path).ranges(where={"dis": 0.25})


def test_of_a_linktracks_nodes_the_anchors_are_taken(tmp_path: Path) -> None:
    name = "nlink_parser/msg/LinktrackNodeframe2"
    text = NODES.replace("Node[]", "acme_uwb/Node[]")
    types = {"acme_uwb/msg/Node": NODE}
    log = RosLog(write(tmp_path, text, nodes, name=name, **types))
    table = log.ranges(where={".id": 1})
    assert set(ids(table)) == {"3", "4"}
    assert len(table) == 24
    assert log.notes[1] == "/uwb: skipped 48 readings other than of .id 1, role 1"


def tag_frame(log: Log, k: int) -> dict[str, Any]:
    heard = np.zeros(8, np.float32)
    heard[[0, 5]] = 12.5, 30.0 + k
    return {"role": 2, "id": 4, "local_time": 100 * k, "dis_arr": heard}


def test_an_array_whose_place_is_the_id(tmp_path: Path) -> None:
    path = write(tmp_path, TAG_FRAME, tag_frame)
    log = RosLog(path)
    table = log.ranges()
    assert ids(table)[:4] == ["0", "5", "0", "5"]
    assert table["range_m"].tolist()[:4] == [12.5, 30, 12.5, 31]
    assert log.notes[0].startswith("ranges: /uwb: anchor: (index), range: dis_arr, id is always 4")
    assert "/uwb: skipped 144 readings of 0, which stand for no range" in log.notes
    fields = FieldMap(anchor="(index)", range="dis_arr", scale=0.1)
    assert RosLog(path).ranges(fields=fields, missing=[0.0, 12.5])["range_m"][0] == 3.0


def test_arrays_of_several_tags_in_one_message(tmp_path: Path) -> None:
    def fill(log: Log, k: int) -> dict[str, Any]:
        tag = log.types.types["acme_uwb/msg/Tag"]
        places = np.zeros(4, np.float32)
        places[2] = 7.0 + k
        return {"nodes": [tag(id=n, dis_arr=places + 100 * n) for n in (0, 3)]}

    types = {"acme_uwb/msg/Tag": "uint8 id\nfloat32[4] dis_arr\n"}
    path = write(tmp_path, "Tag[] nodes\n", fill, **types)
    with pytest.raises(InputError, match=r"id has several values \('0', '3'\)"):
        RosLog(path).ranges()
    table = RosLog(path).ranges(where={"id": 0})
    assert table["range_m"].tolist()[:2] == [7, 8]
    assert set(ids(table)) == {"2"}


def test_topics_of_one_type_may_be_one_per_anchor(tmp_path: Path) -> None:
    log = Log(tmp_path, "mcap", {VENDOR: "uint8 id\nfloat32 range\n"})
    for k in range(3):
        for name in ("/cone1", "/cone2"):
            log.add(name, VENDOR, START_S + k, id=7, range=5.0)
    path = log.close()
    with pytest.raises(
        InputError, match=r"2 topics could .* each is one anchor's, fields: \{anchor:"
    ):
        RosLog(path).ranges()
    fields = FieldMap(anchor="(topic)", range="range")
    assert RosLog(path).ranges(fields=fields).labels["anchor_id"] == ("/cone1", "/cone2")


def test_other_arrays_are_read_by_their_place_if_told(tmp_path: Path) -> None:
    text = TAG_FRAME.replace("dis_arr", "distances")

    def fill(log: Log, k: int) -> dict[str, Any]:
        fields = tag_frame(log, k)
        fields["distances"] = fields.pop("dis_arr")
        return fields

    path = write(tmp_path, text, fill)
    with pytest.raises(InputError, match=r"set fields: \{anchor: \(index\), range: distances\}"):
        RosLog(path).ranges()
    with pytest.raises(InputError, match=r"id is not an array .* set anchor: \(index\)"):
        RosLog(path).ranges(fields=FieldMap(anchor="id", range="distances"), topic="/uwb")
    assert len(RosLog(path).ranges(fields=FieldMap(anchor="(index)", range="distances"))) == 48
    with pytest.raises(InputError, match=r"anchor: \(index\) needs a range that is an array"):
        RosLog(path).ranges("/uwb", fields=FieldMap(anchor="(index)", range="local_time"))


def test_numbers_that_are_missing_are_left_out_before_they_are_scaled(tmp_path: Path) -> None:
    def fill(log: Log, k: int) -> dict[str, Any]:
        return {"anchorId": k % 2, "rangeMm": 65535 if k % 4 == 0 else 1000 + k}

    log = RosLog(write(tmp_path, "uint8 anchorId\nuint16 rangeMm\n", fill))
    table = log.ranges(missing=[0.0, 65535.0])
    assert table["range_m"].tolist()[:3] == pytest.approx([1.001, 1.002, 1.003])
    assert log.notes[:1] == ["ranges: /uwb: anchor: anchorId, range: rangeMm x 0.001"]
    assert "/uwb: skipped 6 readings of 0, 65535, which stand for no range" in log.notes


@pytest.mark.parametrize(
    ("field", "metres"),
    [("float32 distanceInMm", 1.5), ("uint16 dist_cm", 15.0), ("float64 range_meters", 1500.0)],
)
def test_a_name_that_ends_in_the_unit_is_scaled(tmp_path: Path, field: str, metres: float) -> None:
    name = field.split()[1]

    def fill(log: Log, k: int) -> dict[str, Any]:
        return {"anchor": f"A{k % 2}", name: 1500}

    table = RosLog(write(tmp_path, f"string anchor\n{field}\n", fill)).ranges()
    assert table["range_m"][0] == pytest.approx(metres)


def test_whole_numbers_without_a_unit_are_not_guessed(tmp_path: Path) -> None:
    def fill(log: Log, k: int) -> dict[str, Any]:
        return {"anchorId": k % 2, "range": 1000 + k}

    path = write(tmp_path, "uint8 anchorId\nint32 range\n", fill)
    fields = r"set fields: \{anchor: anchorId, range: range, scale: 0.001\}"
    for topic in (None, "/uwb"):
        with pytest.raises(
            InputError, match=f"range is a whole number of unknown unit; .*{fields}"
        ):
            RosLog(path).ranges(topic)
    told = FieldMap(anchor="anchorId", range="range", scale=0.001)
    assert RosLog(path).ranges(fields=told)["range_m"][0] == 1.0


def test_parallel_arrays_of_both_ends(tmp_path: Path) -> None:
    text = "string[] from_ids\nstring[] to_ids\nfloat32[] ranges\n"

    def fill(log: Log, k: int) -> dict[str, Any]:
        ranges = np.array([3.0, 4.0], np.float32)
        return {"from_ids": ["t1", "t1"], "to_ids": ["a", "b"], "ranges": ranges}

    log = RosLog(write(tmp_path, text, fill))
    assert ids(log.ranges()) == ["a", "b"] * 24
    assert log.notes[0].endswith("anchor: to_ids, range: ranges, from_ids is always t1")
