"""Logs of several tags, with attitude, angles of arrival and ranges between cones."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from gaia_uwb._shared.errors import InputError
from gaia_uwb.config import Known
from gaia_uwb.logs.native import read_native
from gaia_uwb.logs.vehicle import Vehicle, VehicleTag
from gaia_uwb.scene import Tag, tag_scenes

DRIVE = "t_s,east_m,north_m,heading_deg,roll_deg,pitch_deg\n0,0,0,90,1,\n1,10,1,,1,2\n2,20,0,0,,\n"
RANGES = (
    "t_s,tag_id,anchor_id,range_m,azimuth_deg,azimuth_sigma_deg\n"
    "0,1,a,5,90,5\n0,2,a,6,,\n0.5,1,b,6.5,-45,\n1,2,a,7,270,2\n"
)
TAGS = "tags: {1: {forward_m: 2}, '2': {left_m: -0.5, own_clock: true}}\n"


def write(folder: Path, **files: str) -> Path:
    """Write a scene in GAIA's own format; the key's last _ stands for a dot."""
    folder.mkdir(parents=True, exist_ok=True)
    contents = {"trajectory_csv": DRIVE, "ranges_csv": RANGES, "scene_yaml": TAGS, **files}
    for name, content in contents.items():
        (folder / ".".join(name.rsplit("_", 1))).write_text(content, encoding="utf-8")
    return folder


def test_two_tags_with_attitude_and_angles(tmp_path: Path) -> None:
    scene = read_native(write(tmp_path))
    assert scene.notes == ()
    assert scene.tags == (Tag("1", forward_m=2.0), Tag("2", left_m=-0.5, own_clock=True))
    assert scene.ranges.tag.tolist() == [0, 1, 0, 1]
    np.testing.assert_allclose(scene.trajectory.heading_rad, [0, np.nan, np.pi / 2], atol=1e-12)
    np.testing.assert_allclose(np.degrees(scene.trajectory.roll_rad), [1, 1, np.nan])
    np.testing.assert_allclose(np.degrees(scene.trajectory.pitch_rad), [np.nan, 2, np.nan])
    np.testing.assert_allclose(np.degrees(scene.ranges.azimuth_rad), [90, np.nan, -45, -90])
    np.testing.assert_allclose(np.degrees(scene.ranges.azimuth_sigma_rad), [5, np.nan, np.nan, 2])
    first, second = tag_scenes(scene)
    np.testing.assert_allclose(first.trajectory.position_m[0], [2.0, 0.0])  # heads east
    np.testing.assert_allclose(second.trajectory.position_m[2], [20.5, 0.0], atol=1e-12)  # north
    assert second.ranges.range_m.tolist() == [6.0, 7.0]


@pytest.mark.parametrize("column", ["tag_id", "tagId", "tid", "initiator"])
@pytest.mark.parametrize("ids", ["1: {}, 2: {}", "'1': {}, '2': {}", "1.0: {}, 2.0: {}"])
def test_ids_are_compared_as_they_are_written(tmp_path: Path, column: str, ids: str) -> None:
    text = RANGES.replace("tag_id", column).replace(",2,", ",2.0,")
    scene = read_native(write(tmp_path, ranges_csv=text, scene_yaml=f"tags: {{{ids}}}"))
    assert [tag.tag_id for tag in scene.tags] == ["1", "2"]
    assert scene.ranges.tag.tolist() == [0, 1, 0, 1]


VAN = Vehicle(
    name="van 7",
    tags={
        "1": VehicleTag(forward_m=3.0, delay_m=Known(value=0.1, sigma=0.02)),
        "2": VehicleTag(left_m=1.0),
    },
)


def test_the_tags_of_a_vehicle_stand_in_for_those_that_a_log_does_not_give(tmp_path: Path) -> None:
    bare = read_native(write(tmp_path / "bare", scene_yaml=""), vehicle=VAN)
    assert bare.tags == (Tag("1", forward_m=3.0), Tag("2", left_m=1.0))
    assert bare.vehicle == "van 7"
    own = read_native(write(tmp_path / "own"), vehicle=VAN)
    assert own.tags == read_native(tmp_path / "own").tags
    one = write(
        tmp_path / "one", ranges_csv="t_s,anchor_id,range_m\n0,a,5\n", scene_yaml="tags: {3: {}}"
    )
    assert read_native(one, vehicle=VAN).tags == (Tag("3"),)


def test_a_tag_without_ranges_is_noted_and_left_out(tmp_path: Path) -> None:
    more = TAGS.replace("{1:", "{roof: {up_m: 1}, 1:")
    scene = read_native(write(tmp_path, scene_yaml=more))
    assert scene.notes == ("tags: no ranges of 'roof'",)
    assert [tag.tag_id for tag in scene.tags] == ["1", "2"]


def test_one_tag_needs_no_column(tmp_path: Path) -> None:
    text = "t_s,anchor_id,range_m\n0,a,5\n1,b,6\n"
    scene = read_native(write(tmp_path, ranges_csv=text, scene_yaml="tags: {t: {forward_m: 1}}"))
    assert scene.tags == (Tag("t", forward_m=1.0),)
    assert scene.ranges.tag is None


def test_who_drives_is_no_tag(tmp_path: Path) -> None:
    text = "t_s,vehicle,anchor_id,range_m\n0,truck 7,a,5\n1,truck 7,b,6\n"
    scene = read_native(write(tmp_path, ranges_csv=text, scene_yaml="tags: {t: {forward_m: 1}}"))
    assert scene.tags == (Tag("t", forward_m=1.0),)
    with pytest.raises(InputError, match="column tag: holds ranges of 'truck 7', which tags in"):
        read_native(write(tmp_path, ranges_csv=text.replace("vehicle", "tag")))


def test_where_takes_one_tag_with_its_lever_arm(tmp_path: Path) -> None:
    scene = read_native(write(tmp_path, scene_yaml=TAGS + "where: {tag_id: 2}\n"))
    assert scene.tags == (Tag("2", left_m=-0.5, own_clock=True),)
    assert scene.ranges.range_m.tolist() == [6.0, 7.0]


def test_of_several_columns_the_one_with_the_given_tags_counts(tmp_path: Path) -> None:
    text = "t_s,vehicle,tag,anchor_id,range_m\n0,9,1,a,5\n0,9,2,a,6\n"
    assert read_native(write(tmp_path, ranges_csv=text)).ranges.tag.tolist() == [0, 1]


def test_heights_of_tags_need_those_of_the_path(tmp_path: Path) -> None:
    scene = read_native(write(tmp_path, scene_yaml="tags: {1: {up_m: 2}, 2: {}}"))
    assert scene.notes == ("tags: up_m is ignored, as the trajectory has no heights",)


def test_repeats_are_those_of_one_tag_and_anchor(tmp_path: Path) -> None:
    scene = read_native(write(tmp_path, ranges_csv=RANGES + "1,2,a,7.1,,\n"))
    assert scene.notes == ("ranges.csv: skipped 1 row with the tag, anchor and time of another",)
    assert len(scene.ranges) == 4


def test_a_placeholder_is_found_among_the_readings_of_one_tag(tmp_path: Path) -> None:
    """Alternating with another tag's, each of the readings of 30 m would look like a jump."""
    k = np.arange(120)
    rows = "".join(f"{n / 10},{1 + n % 2},a,{30.0 if n % 2 else 5 + n / 100}\n" for n in k.tolist())
    scene = read_native(
        write(
            tmp_path,
            trajectory_csv="t_s,east_m,north_m\n0,0,0\n6,1,0\n12,2,0\n",
            ranges_csv="t_s,tag_id,anchor_id,range_m\n" + rows,
        )
    )
    assert scene.notes == ()
    assert len(scene.ranges) == 120


def test_unknown_angles_are_no_angles(tmp_path: Path) -> None:
    text = RANGES.replace(",90,5", ",,").replace("-45", "").replace("270,2", ",2")
    drive = "t_s,east_m,north_m,heading_deg\n0,0,0,\n1,10,1,\n2,20,0,nan\n"
    scene = read_native(write(tmp_path, ranges_csv=text, trajectory_csv=drive))
    assert scene.trajectory.heading_rad is None
    assert scene.ranges.azimuth_rad is scene.ranges.azimuth_sigma_rad is None


@pytest.mark.parametrize(
    ("heading_deg", "step_m", "off"),
    [(90, 2, None), (110, 2, None), (0, 2, "90"), (-90, 2, "180"), (0, 0, None)],
)
def test_a_heading_far_off_the_direction_of_travel_is_noted(
    tmp_path: Path, heading_deg: int, step_m: int, off: str | None
) -> None:
    rows = "".join(f"{k / 4},{step_m * k},0,{heading_deg}\n" for k in range(12))
    drive = "t_s,east_m,north_m,heading_deg\n" + rows
    scene = read_native(write(tmp_path, trajectory_csv=drive))
    note = (
        f"the heading is {off}° off the direction of travel (median): is it where the vehicle's "
        "front points?"
    )
    assert scene.notes == ((note,) if off else ())


def test_ranges_between_cones(tmp_path: Path) -> None:
    text = "anchor_a,anchor_b,range_m\na,b,6\nb,c,\nc,a,0\n c ,b,6.5\n"
    scene = read_native(write(tmp_path, cone_ranges_csv=text))
    assert scene.anchor_ids == ("a", "b", "c")
    assert scene.cone_ranges.anchor_a.tolist() == [0, 2]
    assert scene.cone_ranges.anchor_b.tolist() == [1, 1]
    assert scene.cone_ranges.range_m.tolist() == [6.0, 6.5]
    assert scene.cone_ranges.t_s is None
    assert scene.notes == (
        "cone_ranges.csv: skipped 2 rows without a range (empty, or 0 m and less)",
    )
    timed = "anchor_a,anchor_b,range_m,t_s\na,b,6,0.5\nb,a,6.1,0.7\n"
    scene = read_native(write(tmp_path, cone_ranges_csv=timed))
    assert scene.cone_ranges.t_s.tolist() == [0.5, 0.7]


@pytest.mark.parametrize(
    ("files", "message"),
    [
        (
            {"scene_yaml": ""},
            "ranges.csv, column tag_id: holds ranges of 2 tags ('1', '2'): say where each is on "
            "the vehicle, tags: {1: {forward_m: ..., left_m: ...}, ...} in scene.yaml or in a "
            "vehicle's file (--vehicle), or take one by where: {tag_id: 1} in scene.yaml",
        ),
        (
            {"scene_yaml": "tags: {1: {}, 3: {}}"},
            "ranges.csv, column tag_id: holds ranges of '2', which tags in scene.yaml (or in the "
            "vehicle's file) lacks: add "
            "2: {forward_m: ..., left_m: ...} there, or leave it out by where in scene.yaml",
        ),
        (
            {"ranges_csv": "t_s,anchor_id,range_m\n0,a,5\n"},
            "ranges.csv, column tag_id: names no tag, but scene.yaml gives 2 tags: add a column "
            "tag_id",
        ),
        (
            {"ranges_csv": RANGES + "1.5,,a,6,,\n"},
            "ranges.csv, row 6, column tag_id: expected the tag that took the range, got nothing",
        ),
        (
            {"scene_yaml": "tags: {1: {}, '1': {}}"},
            "scene.yaml: tags: tag 1 appears twice, got {1: {}, '1': {}}",
        ),
        (
            {"scene_yaml": "tags: {no: {}}"},
            "scene.yaml: tags: a tag's id must be a number or text (in quotes), got {False: {}}",
        ),
        (
            {"scene_yaml": "tags: {1: {forward_m: 51}}"},
            "scene.yaml: tags.1.forward_m: input should be less than or equal to 50, got 51",
        ),
        (
            {"scene_yaml": "tags: {1: {ahead_m: 1}}"},
            "scene.yaml: tags.1.ahead_m: unknown key",
        ),
        (
            {"trajectory_csv": DRIVE.replace("90,1,", "361,1,")},
            "trajectory.csv, row 2, column heading_deg: expected degrees between -360 and 360, got "
            "361",
        ),
        (
            {"ranges_csv": RANGES.replace("-45", "-400")},
            "ranges.csv, row 4, column azimuth_deg: expected degrees between -360 and 360, got "
            "-400",
        ),
        (
            {"ranges_csv": RANGES.replace("90,5", "90,0")},
            "ranges.csv, row 2, column azimuth_sigma_deg: expected a number above 0, got 0",
        ),
        (
            {"ranges_csv": RANGES.replace("azimuth_deg", "angle")},
            "ranges.csv, column azimuth_sigma_deg: needs azimuth_deg beside it",
        ),
        (
            {"cone_ranges_csv": "anchor_a,anchor_b,range_m\na,b,6\nb,b,1\n"},
            "cone_ranges.csv, row 3, column anchor_b: expected another cone than anchor_a, got 'b' "
            "twice",
        ),
        (
            {"cone_ranges_csv": "anchor_a,anchor_b,range_m\na,b,\n"},
            "cone_ranges.csv, column range_m: contains no ranges",
        ),
        (
            {"cone_ranges_csv": "anchor_a,anchor_b,range_m\na,b,6000\n"},
            "cone_ranges.csv, column range_m: expected metres, got a median of 6000: this looks "
            "like millimetres or centimetres",
        ),
        (
            {"cone_ranges_csv": "anchor_a,range_m\na,6\n"},
            "cone_ranges.csv, column anchor_b: missing; found 'anchor_a', 'range_m'",
        ),
    ],
)
def test_refusals(tmp_path: Path, files: dict[str, str], message: str) -> None:
    folder = write(tmp_path / "log", **files)
    with pytest.raises(InputError) as caught:
        read_native(folder)
    assert str(caught.value).removeprefix(f"{folder}/") == message


@pytest.mark.parametrize("ids", [("T1", "T2"), ("010", "x"), ("no", "off"), ("it's", "0")])
def test_the_way_out_can_be_copied(tmp_path: Path, ids: tuple[str, str]) -> None:
    text = RANGES.replace(",1,", f",{ids[0]},").replace(",2,", f",{ids[1]},")
    with pytest.raises(InputError) as caught:
        read_native(write(tmp_path, ranges_csv=text, scene_yaml=""))
    arms = str(caught.value).partition("vehicle, ")[2].partition(" in scene.yaml")[0]
    arms = arms.replace("forward_m: ..., left_m: ...", "")
    other = sorted(ids)[1]
    arms = arms.replace("...", f"'{other.replace(chr(39), chr(39) * 2)}': {{}}")
    scene = read_native(write(tmp_path, ranges_csv=text, scene_yaml=arms))
    assert [tag.tag_id for tag in scene.tags] == sorted(ids)
