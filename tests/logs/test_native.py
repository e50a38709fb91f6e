from __future__ import annotations

import dataclasses
import os
import re
from pathlib import Path
from typing import IO, Any, Literal

import numpy as np
import polars as pl
import pytest
from hypothesis import HealthCheck, given, settings, strategies as st

from gaia_uwb._shared.errors import ConfigError, GaiaError, InputError, SourceError
from gaia_uwb._shared.files import visible
from gaia_uwb.logs.native import is_native, read_native, write_native
from gaia_uwb.scene import ConeRanges, LocalFrame, RangeLog, Scene, Tag, Trajectory, Truth

# A folder per example is made inside one folder per test.
ONE_FOLDER = settings(
    max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)


def assert_equal(a: object, b: object) -> None:
    """Compare dataclasses with arrays, NaN equal to NaN, to the last bit."""
    assert type(a) is type(b)
    for field in dataclasses.fields(a):  # type: ignore[arg-type]
        x, y = getattr(a, field.name), getattr(b, field.name)
        if dataclasses.is_dataclass(x):
            assert_equal(x, y)
        elif isinstance(x, np.ndarray):
            assert isinstance(y, np.ndarray), field.name
            np.testing.assert_array_equal(x, y, err_msg=field.name)
        else:
            assert x == y, field.name


TEXTS = st.text(st.characters(exclude_categories=["Cs"]), max_size=8)
# Frozen data classes are built inside the tests: beartype draws random samples of what it checks,
# which hypothesis forbids inside a strategy.
RECIPES = st.fixed_dictionaries(
    {
        "seed": st.integers(0, 2**32 - 1),
        "name": TEXTS,
        "ids": st.lists(TEXTS.map(str.strip).filter(bool), min_size=1, max_size=4, unique=True),
        "range_m": st.lists(st.floats(1e-3, 500.0), min_size=1, max_size=12, unique=True),
        "start_s": st.sampled_from([0.0, -3.5, 1.7e9]),
        "frame": st.none()
        | st.tuples(st.floats(-90, 90), st.floats(-180, 180), st.floats(-1e5, 1e5)),
        "has": st.sets(
            st.sampled_from(
                [
                    "up",
                    "heights",
                    "rssi",
                    "rssi_fp",
                    "truth",
                    "nlos",
                    "ranges",
                    "clock",
                    "outlier",
                    "bias",
                    "attitude",
                    "azimuth",
                    "tag",
                    "tags",
                    "cones",
                ]
            )
        ),
    }
)


def make_scene(recipe: dict[str, Any]) -> Scene:
    """Return any scene that is one drive: finite, in seconds and metres, with clocks that meet."""
    rng = np.random.default_rng(recipe["seed"])
    has, ids = recipe["has"], tuple(recipe["ids"])
    t_s = recipe["start_s"] + np.cumsum(rng.uniform(0.05, 2.0, rng.integers(2, 7)))
    n, n_anchors = len(recipe["range_m"]), len(ids)
    rssi_dbm = np.where(rng.random(n) < 0.3, np.nan, rng.uniform(-100, -60, n))
    truth = Truth(
        anchor_m=rng.normal(0, 30, (n_anchors, 2)),
        nlos=rng.random(n) < 0.5 if "nlos" in has else None,
        range_m=rng.uniform(0, 60, n) if "ranges" in has else None,
        clock_offset_s=float(rng.normal()) if "clock" in has else None,
        outlier=rng.random(n) < 0.1 if "outlier" in has else None,
        bias_m=rng.normal(0, 1, n) if "bias" in has else None,
    )
    two_tags = "tags" in has and n > 1
    tags = (Tag("front", 2.0, -0.5, 0.25 * ("up" in has)), Tag("1", own_clock=True))[: 1 + two_tags]
    cones = ConeRanges(
        anchor_a=np.zeros(2, np.int64),
        anchor_b=np.full(2, max(n_anchors - 1, 1)),
        range_m=rng.uniform(1, 50, 2),
        t_s=t_s[:2] if "clock" in has else None,
    )
    heights_m = np.where(rng.random(n_anchors) < 0.3, np.nan, rng.uniform(0, 3, n_anchors))
    return Scene(
        name=recipe["name"],
        trajectory=Trajectory(
            t_s=t_s,
            position_m=rng.normal(0, 50, (len(t_s), 2)),
            up_m=rng.normal(1, 0.1, len(t_s)) if "up" in has else None,
            heading_rad=angles(rng, len(t_s)) if "attitude" in has else None,
            roll_rad=angles(rng, len(t_s)) if "attitude" in has else None,
            pitch_rad=angles(rng, len(t_s)) if "attitude" in has else None,
        ),
        ranges=RangeLog(
            t_s=np.sort(np.append(rng.uniform(t_s[0] - 1, t_s[-1] + 1, n - 1), t_s[0])),
            anchor=rng.integers(0, n_anchors, n),
            range_m=np.array(recipe["range_m"]),
            rssi_dbm=rssi_dbm if "rssi" in has else None,
            rssi_fp_dbm=rssi_dbm - 2 if "rssi_fp" in has else None,
            tag=np.resize([0, 1], n) if two_tags else None,
            azimuth_rad=angles(rng, n) if "azimuth" in has else None,
            azimuth_sigma_rad=np.full(n, np.radians(5.0)) if "azimuth" in has else None,
        ),
        anchor_ids=ids,
        anchor_up_m=heights_m if "heights" in has else None,
        frame=recipe["frame"] and LocalFrame(*recipe["frame"]),
        truth=truth if "truth" in has else None,
        tags=tags if two_tags or "tag" in has else (),
        cone_ranges=cones if "cones" in has and n_anchors > 1 else None,
    )


def angles(rng: np.random.Generator, n: int) -> np.ndarray:
    """Return angles of degrees with four decimals, of which the first is known."""
    angle_deg = np.where(rng.random(n) < 0.3, np.nan, np.round(rng.uniform(-179.9, 180, n), 4))
    angle_deg[0] = 90.0
    return np.radians(angle_deg)


@pytest.mark.parametrize("file_format", ["csv", "parquet"])
@ONE_FOLDER
@given(recipe=RECIPES)
def test_gives_back_what_was_written(
    tmp_path: Path, file_format: Literal["csv", "parquet"], recipe: dict[str, Any]
) -> None:
    scene, folder = make_scene(recipe), tmp_path / "scene"
    write_native(scene, folder, file_format)
    assert_equal(read_native(folder), scene)
    assert [path.name for path in visible(tmp_path)] == ["scene"]


DRIVE = "t_s,east_m,north_m\n0,0,0\n1,10,1\n2,20,0\n"
RANGES = "t_s,anchor_id,range_m\n0,a,5\n0.5,b,6.5\n1,a,7\n"
GEO = "t_s,lat,lon\n0,48.1,11.5\n1,48.1001,11.5\n"


def make_folder(tmp_path: Path, **files: str) -> Path:
    """Write a small good scene with some files replaced; the key's last _ stands for a dot."""
    folder = tmp_path / "drive"
    folder.mkdir(parents=True)
    contents = {"trajectory_csv": DRIVE, "ranges_csv": RANGES, **files}
    for name, content in contents.items():
        (folder / ".".join(name.rsplit("_", 1))).write_text(content, encoding="utf-8")
    return folder


def test_reads_the_smallest_scene(tmp_path: Path) -> None:
    folder = make_folder(tmp_path)
    scene = read_native(folder)
    notes = scene.notes
    assert is_native(folder)
    assert (scene.name, scene.anchor_ids, notes) == ("drive", ("a", "b"), ())
    assert scene.frame is scene.truth is scene.anchor_up_m is scene.trajectory.up_m is None
    np.testing.assert_array_equal(scene.ranges.anchor, [0, 1, 0])
    np.testing.assert_array_equal(scene.trajectory.position_m, [[0, 0], [10, 1], [20, 0]])


def test_ids_sort_as_people_sort_them(tmp_path: Path) -> None:
    rows = "".join(f"0,{name},5\n" for name in ("12", "cone-10", "3", "cone-9", "cone-09", "B"))
    scene = read_native(make_folder(tmp_path, ranges_csv="t_s,anchor_id,range_m\n" + rows))
    assert scene.anchor_ids == ("3", "12", "B", "cone-09", "cone-9", "cone-10")
    assert len(scene.ranges) == 6


def test_ranges_out_of_order_are_sorted_and_told(tmp_path: Path) -> None:
    ranges = "t_s,anchor_id,range_m,nlos,note\n1,b,7,1,x\n0,a,5,0,y\n"
    anchors = "anchor_id,east_m,north_m\na,1,2\nb,3,4\n"
    folder = make_folder(tmp_path, ranges_csv=ranges, anchors_csv=anchors)
    scene = read_native(folder)
    notes = scene.notes
    np.testing.assert_array_equal(scene.ranges.t_s, [0, 1])
    np.testing.assert_array_equal(scene.ranges.range_m, [5, 7])
    assert scene.truth is not None
    assert scene.truth.nlos is not None
    assert scene.truth.nlos.tolist() == [False, True]
    assert notes == (
        "ranges.csv: sorted by time, as 1 row came late",
        "ranges.csv: ignored columns: note",
    )


def test_rows_that_repeat_a_time_are_left_out_and_counted(tmp_path: Path) -> None:
    drive = "t_s,east_m,north_m\n2,20,0\n0,0,0\n1,10,1\n1,99,9\n"
    ranges = "t_s,anchor_id,range_m\n1,a,7\n1,b,8\n1,a,9\n0,a,5\n"
    scene = read_native(make_folder(tmp_path, trajectory_csv=drive, ranges_csv=ranges))
    notes = scene.notes
    np.testing.assert_array_equal(scene.trajectory.position_m, [[0, 0], [10, 1], [20, 0]])
    np.testing.assert_array_equal(scene.ranges.range_m, [5, 7, 8])
    assert notes == (
        "trajectory.csv: sorted by time, as 1 row came late",
        "trajectory.csv: skipped 1 row with the time of another",
        "ranges.csv: sorted by time, as 1 row came late",
        "ranges.csv: skipped 1 row with the anchor and time of another",
    )


def test_what_is_no_range_is_left_out_with_its_truth(tmp_path: Path) -> None:
    ranges = "t_s,anchor_id,range_m,nlos\n0,a,0,1\n0,b,5,0\n1,a,7,1\n1,b,-1,0\n"
    anchors = "anchor_id,east_m,north_m\na,1,2\nb,3,4\n"
    scene = read_native(make_folder(tmp_path, ranges_csv=ranges, anchors_csv=anchors))
    notes = scene.notes
    np.testing.assert_array_equal(scene.ranges.range_m, [5, 7])
    assert scene.truth is not None
    assert scene.truth.nlos is not None
    assert scene.truth.nlos.tolist() == [False, True]
    assert notes == ("ranges.csv: skipped 2 readings of 0 m or less, which mean no range",)


def test_anchors_table_gives_order_heights_and_survey(tmp_path: Path) -> None:
    anchors = "anchor_id,up_m,east_m,north_m\nspare,,1,2\nb,0.7,3,4\n"
    scene = read_native(make_folder(tmp_path, anchors_csv=anchors))
    notes = scene.notes
    assert scene.anchor_ids == ("spare", "b", "a")
    np.testing.assert_array_equal(scene.anchor_up_m, [np.nan, 0.7, np.nan])  # type: ignore[arg-type]
    assert scene.truth is None
    assert notes == (
        "anchors.csv: lacks a: heights unknown",
        "only 2 of 3 cones are surveyed: results cannot be scored",
    )


def test_truth_without_a_survey_is_told(tmp_path: Path) -> None:
    ranges = "t_s,anchor_id,range_m,true_range_m\n0,a,5,4.9\n"
    scene = read_native(make_folder(tmp_path, ranges_csv=ranges))
    notes = scene.notes
    assert scene.truth is None
    assert notes == ("ranges.csv: true_range_m ignored, as no cone is surveyed",)


def test_latitude_and_longitude(tmp_path: Path) -> None:
    """One arc second of latitude is 30.9 m; heights are relative to the first sample."""
    drive = "t_s,lat,lon,alt_m\n0,48.1,11.5,500\n1,48.10027777777778,11.5,503\n"
    anchors = "anchor_id,lat,lon,alt_m\na,48.1,11.5001,501.5\nb,48.1,11.5002,\n"
    folder = make_folder(tmp_path, trajectory_csv=drive, anchors_csv=anchors)
    scene = read_native(folder)
    assert scene.frame == LocalFrame(48.1, 11.5, 500.0)
    np.testing.assert_allclose(scene.trajectory.position_m, [[0, 0], [0, 30.89]], atol=0.01)
    np.testing.assert_allclose(scene.trajectory.up_m, [0, 3], atol=1e-3)  # type: ignore[arg-type]
    np.testing.assert_allclose(scene.anchor_up_m, [1.5, np.nan], atol=1e-4)  # type: ignore[arg-type]
    assert scene.truth is not None
    np.testing.assert_allclose(scene.truth.anchor_m, [[7.45, 0], [14.89, 0]], atol=0.01)


def test_a_frame_moves_the_origin(tmp_path: Path) -> None:
    folder = make_folder(
        tmp_path,
        trajectory_csv=GEO,
        scene_yaml="name: A9 km 512\nframe: {lat_deg: 48.1001, lon_deg: 11.5, alt_m: 20}\n",
    )
    scene = read_native(folder)
    assert scene.name == "A9 km 512"
    assert scene.frame == LocalFrame(48.1001, 11.5, 20.0)
    assert scene.trajectory.up_m is None
    np.testing.assert_allclose(scene.trajectory.position_m, [[0, -11.12], [0, 0]], atol=0.01)


@pytest.mark.parametrize(
    ("files", "message"),
    [
        ({"trajectory_csv": ""}, "trajectory.csv: is empty"),
        ({"trajectory_csv": "t_s,x\n0,1\n"}, "expected the columns east_m,north_m or lat,lon, got"),
        ({"trajectory_csv": "t_s,east_m,north\n0,1,2\n"}, "column north_m: missing; found"),
        ({"trajectory_csv": "t_s,east_m,north_m,lat,lon\n0,1,2,3,4\n"}, "keep one pair"),
        ({"trajectory_csv": "t_s,east_m,north_m\n0,1,2\n"}, "expected at least 2 samples, got 1"),
        (
            {"trajectory_csv": "t_s,east_m,north_m\n0,1,2\n125,2,2\n250,3,2\n"},
            "column t_s: expected seconds, got a step of 125: is it in milliseconds?",
        ),
        (
            {"trajectory_csv": "t_s,east_m,north_m\n1730017526478717088,1,2\n"},
            "row 2, column t_s: expected seconds, got 1.73002e+18, which looks like nanoseconds",
        ),
        ({"ranges_csv": RANGES + "1.7e12,a,3\n"}, "row 5, column t_s: expected seconds, got 1.7e"),
        ({"ranges_csv": RANGES.replace("6.5", "x")}, "ranges.csv, row 3, column range_m: expec"),
        (
            {
                "trajectory_csv": "t_s,east_m,north_m\n0,0,0\n1,3000,0\n",
                "ranges_csv": "t_s,anchor_id,range_m\n0,a,5012\n1,a,6042\n",
            },
            "a median of 5527 on a path 3000 m wide: this looks like millimetres",
        ),
        (
            {"ranges_csv": "t_s,anchor_id,range_m\n0,a,5012\n1,a,6042\n"},
            "column range_m: expected metres, got a median of 5527 on a path 20 m wide: this",
        ),
        (
            {"ranges_csv": "t_s,anchor_id,range_m\n3600,a,5\n3601,a,6\n"},
            "the times do not overlap: the ranges span 3600.000 to 3601.000 s, the trajectory 0.0",
        ),
        ({"anchors_csv": "anchor_id\na\nb\na\n"}, "row 4, column anchor_id: 'a' appears twice"),
        ({"anchors_csv": "anchor_id,lat,lon\na,1,2\n"}, "add frame to scene.yaml"),
        ({"anchors_csv": "anchor_id,lat\na,1\n"}, "column lon: missing"),
        (
            {
                "trajectory_csv": GEO,
                "anchors_csv": "anchor_id,up_m,lat,lon,alt_m\na,1,48.1,11.5,2\n",
            },
            "anchors.csv: has both up_m and alt_m: keep one",
        ),
        (
            {"trajectory_csv": "t_s,lat,lon\n0,11.5,48.1\n1,111.5,48.1\n"},
            "row 3, column lat: expected a number between -90 and 90, got 111.5; are lat",
        ),
        ({"trajectory_csv": "t_s,lat,lon\n0,1,2\n1,1,181\n"}, "row 3, column lon: expected a num"),
        (
            {"trajectory_csv": "t_s,lat,lon,alt_m\n0,1,2,3\n1,1,2,3e6\n"},
            "row 3, column alt_m: expected a number between -100000 and 100000, got 3e+06",
        ),
        (
            {"trajectory_csv": "t_s,lat,lon\n0,48.1,11.5\n1,0,10\n"},
            "row 3, column lat: expected a position near the origin at lat 48.1, lon 11.5, got one",
        ),
        ({"scene_yaml": "frame: [1"}, "scene.yaml: cannot be read: line 2: did not find"),
        ({"scene_yaml": "name: 3"}, "scene.yaml: name: input should be a valid string, got 3"),
        (
            {"scene_yaml": "name: x\nname: y"},
            "cannot be read: line 2: duplicate key 'name'",
        ),
        ({"scene_yaml": "name: " + "x" * 401}, "scene.yaml: name: string should have at most 400"),
        ({"scene_yaml": "nam: x"}, "scene.yaml: nam: unknown key"),
        ({"scene_yaml": "- 1"}, "scene.yaml: top level: input should be"),
        ({"scene_yaml": "frame: {lat_deg: 91, lon_deg: 0}"}, "scene.yaml: frame.lat_deg: input"),
        ({"scene_yaml": "a: 2020-13-45"}, "line 1: 2020-13-45: month must be in 1..12"),
        ({"scene_yaml": "#" * (2**20 + 1)}, "scene.yaml: cannot be read: larger than 262,144"),
        ({"trajectory_parquet": ""}, "has both trajectory.csv and trajectory.parquet: keep one"),
    ],
)
def test_names_what_is_wrong_and_where(tmp_path: Path, files: dict[str, str], message: str) -> None:
    with pytest.raises(InputError) as caught:
        read_native(make_folder(tmp_path, **files))
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


def test_missing_tables_and_folders(tmp_path: Path) -> None:
    with pytest.raises(SourceError, match="no such folder"):
        read_native(tmp_path / "none")
    with pytest.raises(InputError, match=r"has no trajectory\.csv or trajectory\.parquet"):
        read_native(tmp_path)
    (tmp_path / "trajectory.csv").write_text(DRIVE)
    with pytest.raises(InputError, match=r"has no ranges\.csv or ranges\.parquet"):
        read_native(tmp_path)


def test_writing_replaces_a_scene_and_keeps_other_files(tmp_path: Path) -> None:
    scene = read_native(make_folder(tmp_path))
    folder = tmp_path / "ours"
    write_native(scene, folder, "csv")
    (folder / "notes.txt").write_text("mine", encoding="utf-8")
    write_native(scene, folder, "parquet")
    assert_equal(read_native(folder), scene)
    names = ["anchors.parquet", "notes.txt", "ranges.parquet", "scene.yaml", "trajectory.parquet"]
    assert sorted(path.name for path in visible(folder)) == names


def test_an_interruption_leaves_no_half_of_a_scene(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    scene = read_native(make_folder(tmp_path))
    write_native(scene, tmp_path / "old")

    def interrupt(frame: pl.DataFrame, file: IO[bytes]) -> None:
        file.write(b"t_s,east_m")
        raise KeyboardInterrupt

    monkeypatch.setattr(pl.DataFrame, "write_csv", interrupt)
    for folder in (tmp_path / "new", tmp_path / "old"):
        with pytest.raises(KeyboardInterrupt):
            write_native(scene, folder)
    assert not list(visible(tmp_path / "new"))
    assert_equal(read_native(tmp_path / "old"), scene)


def test_writing_where_it_cannot_be(tmp_path: Path) -> None:
    scene = read_native(make_folder(tmp_path))
    with pytest.raises(ConfigError, match="cannot write to this folder: File exists"):
        write_native(scene, tmp_path / "drive" / "ranges.csv")


@settings(ONE_FOLDER, max_examples=60)
@given(data=st.data())
def test_whatever_the_bytes_only_our_errors_come(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], data: st.DataObject
) -> None:
    """Random bytes, and good files with a few bytes replaced, removed or put in."""
    contents = {
        "trajectory.csv": DRIVE.encode(),
        "ranges.csv": RANGES.encode(),
        "anchors.csv": b"anchor_id,up_m,east_m,north_m\na,1,2,3\nb,,4,5\n",
        "scene.yaml": b"name: x\nframe: {lat_deg: 1, lon_deg: 2}\nclock_offset_s: 0.1\n",
    }
    name = data.draw(st.sampled_from(sorted(contents)))
    content = contents[name]
    junk = st.binary(max_size=6) | st.sampled_from([b'"', b",", b"\n", b"\r", b"\0", b"9e99", b"-"])
    if data.draw(st.booleans()):
        content = data.draw(st.binary(max_size=40))
    else:
        for _ in range(data.draw(st.integers(1, 4))):
            start = data.draw(st.integers(0, len(content)))
            stop = start + data.draw(st.integers(0, 3))
            content = content[:start] + data.draw(junk) + content[stop:]
    for other, good in contents.items():
        (tmp_path / other).write_bytes(content if other == name else good)
    try:
        scene = read_native(tmp_path)
    except GaiaError as error:
        assert "\n" not in str(error)
    else:
        assert len(scene.ranges) > 0
    assert capfd.readouterr().err == ""  # polars' panics are caught, but show there


def test_a_pipe_or_a_broken_link_is_told_at_once(tmp_path: Path) -> None:
    (tmp_path / "trajectory.csv").write_text("t_s,east_m,north_m\n0,1,2\n1,9,2\n", encoding="utf-8")
    (tmp_path / "ranges.csv").write_text(RANGES, encoding="utf-8")
    (tmp_path / "anchors.csv").symlink_to(tmp_path / "no-such-file")
    with pytest.raises(InputError, match=r"anchors\.csv: is not a regular file"):
        read_native(tmp_path)
    (tmp_path / "anchors.csv").unlink()
    (tmp_path / "ranges.csv").unlink()
    os.mkfifo(tmp_path / "ranges.csv")
    with pytest.raises(InputError, match=r"ranges\.csv: is not a regular file"):
        read_native(tmp_path)
    os.mkfifo(tmp_path / "scene.yaml")
    with pytest.raises(InputError, match=r"scene\.yaml: cannot be read: .*not a regular file"):
        read_native(tmp_path)


def test_empty_cells_are_no_ranges(tmp_path: Path) -> None:
    rows = ["0,a,5", "0.2,b,", "0.4,a,NaN", "0.6,b,6.5", "0.8,a,-1", "1,b,65.535"]
    text = "t_s,anchor_id,range_m\n" + "\n".join(rows) + "\n"
    folder = make_folder(tmp_path, ranges_csv=text, scene_yaml="missing: [-1, 65.535]")
    scene = read_native(folder)
    notes = scene.notes
    assert scene.ranges.range_m.tolist() == [5.0, 6.5]
    assert "ranges.csv: skipped 4 cells without a range (empty, or -1, 65.535)" in notes
    empty = "t_s,anchor_id,range_m\n0,a,\n1,a,\n"
    with pytest.raises(InputError, match=r"ranges\.csv, column range_m: contains no ranges"):
        read_native(make_folder(tmp_path / "none", ranges_csv=empty))


def test_two_tags_in_one_table_are_refused_until_one_is_chosen(tmp_path: Path) -> None:
    text = "t_s,tag_id,anchor_id,range_m\n0,T1,a,5\n0.1,T2,a,9\n1,T1,a,6\n1.1,T2,a,8\n"
    folder = make_folder(tmp_path, ranges_csv=text)
    with pytest.raises(InputError, match="column tag_id: holds ranges of 2 tags") as caught:
        read_native(folder)
    (way_out,) = re.findall("(where: {.*}) in scene.yaml", str(caught.value))
    (folder / "scene.yaml").write_text(way_out, encoding="utf-8")
    scene = read_native(folder)
    notes = scene.notes
    assert scene.ranges.range_m.tolist() == [5.0, 6.0]
    assert "ranges.csv: 2 of 4 rows are those that where wants" in notes
    one = make_folder(tmp_path / "one", ranges_csv=text.replace("T2", "T1"))
    assert len(read_native(one).ranges.t_s) == 4


@pytest.mark.parametrize("tags", [("00:11:22", "no"), ("010", "10"), ("on", "off"), ("it's", "a")])
def test_the_way_out_can_be_copied(tmp_path: Path, tags: tuple[str, str]) -> None:
    rows = "".join(f"{k / 10},{tag},a,{k + 5}\n" for k, tag in enumerate(tags * 2))
    folder = make_folder(tmp_path, ranges_csv="t_s,tag,anchor_id,range_m\n" + rows)
    with pytest.raises(InputError) as caught:
        read_native(folder)
    (way_out,) = re.findall("(where: {.*}) in scene.yaml", str(caught.value))
    (folder / "scene.yaml").write_text(way_out, encoding="utf-8")
    assert len(read_native(folder).ranges.t_s) == 2


@pytest.mark.parametrize(
    ("rows", "words"),
    [
        ("0,0,0\n1,0.0,0\n2,48.1,11.5\n3,48.1001,11.5\n", "2 rows at latitude 0, longitude 0"),
        ("1,,\n2,48.1,11.5\n3,48.1001,11.5\n", "1 row without a place"),
    ],
)
def test_rows_without_a_fix_are_named_and_left_out(tmp_path: Path, rows: str, words: str) -> None:
    ranges = "t_s,anchor_id,range_m\n2.5,a,5\n"
    folder = make_folder(tmp_path, trajectory_csv="t_s,lat,lon\n" + rows, ranges_csv=ranges)
    scene = read_native(folder)
    notes = scene.notes
    assert scene.trajectory.t_s.tolist() == [2, 3]
    assert scene.frame == LocalFrame(48.1, 11.5, 0.0)
    assert any(words in note and "the first is row 2" in note for note in notes)


def test_a_drive_that_goes_through_zero_zero_stays_whole(tmp_path: Path) -> None:
    rows = "t_s,lat,lon\n0,0,0\n1,0.0001,0\n2,0.0002,0\n"
    ranges = "t_s,anchor_id,range_m\n1,a,5\n"
    folder = make_folder(tmp_path, trajectory_csv=rows, ranges_csv=ranges)
    assert len(read_native(folder).trajectory.t_s) == 3


def test_a_place_without_a_height_among_heights_is_refused(tmp_path: Path) -> None:
    rows = "t_s,lat,lon,alt_m\n0,48,11,5\n1,48,11,\n"
    with pytest.raises(InputError, match="row 3, column alt_m: expected a finite number, got noth"):
        read_native(make_folder(tmp_path, trajectory_csv=rows))


def test_heights_above_the_ellipsoid_everywhere(tmp_path: Path) -> None:
    folder = make_folder(
        tmp_path,
        trajectory_csv="t_s,east_m,north_m,alt_m\n0,0,0,521.5\n2,10,0,522\n",
        ranges_csv="t_s,anchor_id,range_m\n1,a,5\n1,b,6\n",
        anchors_csv="anchor_id,alt_m\na,520.25\nb,\n",
        scene_yaml="frame: {lat_deg: 48.0, lon_deg: 11.0, alt_m: 520.0}",
    )
    scene = read_native(folder)
    assert scene.trajectory.up_m is not None
    assert scene.trajectory.up_m.tolist() == [1.5, 2.0]
    np.testing.assert_array_equal(scene.anchor_up_m, [0.25, np.nan])
    wrong = (folder / "anchors.csv").write_text("anchor_id,alt_m\na,5e5\n", encoding="utf-8")
    assert wrong
    with pytest.raises(InputError, match="row 2, column alt_m: expected metres between"):
        read_native(folder)


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16"])
@pytest.mark.parametrize("separator", [";", "\t"])
def test_tables_of_a_spreadsheet_in_europe(tmp_path: Path, separator: str, encoding: str) -> None:
    folder = make_folder(tmp_path)
    tables = {
        "trajectory": "t_s;east_m;north_m\r\n0,0;0,0;0,5\r\n1,5;10,25;0,5\r\n",
        "ranges": "t_s;anchor_id;range_m\r\n0,5;a,1;5,25\r\n1,0;b;\r\n",
    }
    for name, text in tables.items():
        path = folder / f"{name}.csv"
        path.write_bytes(text.replace(";", separator).encode(encoding))
    scene = read_native(folder)
    notes = scene.notes
    assert scene.trajectory.position_m.tolist() == [[0, 0.5], [10.25, 0.5]]
    assert (scene.anchor_ids, scene.ranges.range_m.tolist()) == (("a,1", "b"), [5.25])
    assert sum("between the columns and decimal commas" in note for note in notes) == 2


def test_a_counter_is_not_taken_for_the_anchors_id(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("gaia_uwb.logs._logs.MAX_ANCHORS", 3)
    (tmp_path / "trajectory.csv").write_text("t_s,east_m,north_m\n0,1,2\n1,9,2\n", encoding="utf-8")
    rows = "".join(f"0.5,{k},4\n" for k in range(4))
    (tmp_path / "ranges.csv").write_text(f"t_s,anchor_id,range_m\n{rows}", encoding="utf-8")
    told = r"ranges\.csv, column anchor_id: 4 different anchors, but at most 3 are read"
    with pytest.raises(InputError, match=told):
        read_native(tmp_path)
    (tmp_path / "ranges.csv").write_text("t_s,anchor_id,range_m\n0.5,1,4\n", encoding="utf-8")
    (tmp_path / "anchors.csv").write_text("anchor_id\n1\n2\n3\n4\n", encoding="utf-8")
    with pytest.raises(InputError, match=r"anchors\.csv, column anchor_id: 4 different anchors"):
        read_native(tmp_path)


@pytest.mark.parametrize(
    ("name", "drive", "ranges"),
    [
        ("t_s", "2026/03/03 09:00:00", "2026-03-03T10:00:00.5+01:00"),
        ("date,time", "2026-03-03,09:00:00", "03.03.2026,09:00:00.5"),
    ],
)
def test_times_may_be_dates(tmp_path: Path, name: str, drive: str, ranges: str) -> None:
    folder = make_folder(
        tmp_path,
        trajectory_csv=f"{name},lat,lon\n{drive},48,11\n{drive[:-1]}1,48,11.0001\n",
        ranges_csv=f"{name},anchor_id,range_m\n{ranges},a,5\n",
    )
    scene = read_native(folder)
    notes = scene.notes
    assert scene.trajectory.t_s.tolist() == [1772528400, 1772528401]
    assert scene.ranges.t_s.tolist() == [1772528400.5]
    assert "ranges.csv: dates and times without a zone are taken as UTC" in notes
    (folder / "ranges.csv").write_text(f"{name},anchor_id,range_m\n{ranges},a,5\n{drive[1:]},a,5\n")
    with pytest.raises(InputError, match=r"row 3, column .*: expected an ISO date and time"):
        read_native(folder)
