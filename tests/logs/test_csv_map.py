from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest
from pydantic import ValidationError

from gaia_uwb._shared.errors import InputError
from gaia_uwb.logs._stamps import StampOptions
from gaia_uwb.logs.csv_map import (
    Column,
    RangeColumns,
    TrajectoryColumns,
    read_ranges,
    read_trajectory,
)

STAMPS = StampOptions()


def write(folder: Path, text: str) -> Path:
    path = folder / "log.csv"
    path.write_text(text, encoding="utf-8")
    return path


def test_names_and_units(tmp_path: Path) -> None:
    path = write(tmp_path, "time_ms,x_cm,y_cm,note\n1000,100,200,a\n1500,300,400,b\n")
    columns = {
        "t_s": {"column": "time_ms", "scale": 0.001},
        "east_m": {"column": "x_cm", "scale": 0.01},
        "north_m": {"column": "y_cm", "scale": 0.01},
    }
    table, _ = read_trajectory(path, TrajectoryColumns.model_validate(columns), STAMPS)
    assert table["t_s"].tolist() == [1.0, 1.5]
    assert table["east_m"].tolist() == [1.0, 3.0]
    assert table["north_m"].tolist() == [2.0, 4.0]
    message = str(table.error("is odd", index=1, column="east_m"))
    assert message == f"{path}, row 3, column x_cm: is odd"


def test_iso_times(tmp_path: Path) -> None:
    columns = RangeColumns.model_validate(
        {"t_s": {"column": "when", "iso": True}, "anchor_id": "to", "range_m": "d"}
    )
    path = write(tmp_path, "when,to,d\n2026-01-01T00:00:00.5,7,1\n2026-01-01 00:00:01Z,8,2\n")
    table, _ = read_ranges(path, columns, STAMPS)
    assert table["t_s"].tolist() == [1767225600.5, 1767225601.0]
    assert table.labels["anchor_id"] == ("7", "8")
    path = write(tmp_path, "when,to,d\n2026-01-01T00:00:00.5,7,1\nyesterday,8,2\n")
    with pytest.raises(InputError, match=r"row 3, column when: expected an ISO date .*'yesterday'"):
        read_ranges(path, columns, STAMPS)


@pytest.mark.parametrize("suffix", [".csv", ".parquet"])
def test_a_column_per_anchor(tmp_path: Path, suffix: str) -> None:
    frame = pl.DataFrame({"t": [0.0, 1.0], "d1": [5.0, None], "d2": [6.0, 7.0], "d3": [None, None]})
    frame = frame.with_columns(pl.col("d3").cast(pl.Float64))
    path = tmp_path / f"wide{suffix}"
    (frame.write_csv if suffix == ".csv" else frame.write_parquet)(path)
    columns = RangeColumns.model_validate(
        {
            "t_s": "t",
            "anchors": {"cone-1": "d1", "cone-2": {"column": "d2", "scale": 2.0}, "c3": "d3"},
        }
    )
    table, _ = read_ranges(path, columns, STAMPS)
    ids = [table.labels["anchor_id"][k] for k in table["anchor_id"]]
    rows = sorted(zip(ids, table["t_s"].tolist(), table["range_m"].tolist(), strict=True))
    assert rows == [("cone-1", 0.0, 5.0), ("cone-2", 0.0, 12.0), ("cone-2", 1.0, 14.0)]


def test_wrong_cells_name_the_users_column(tmp_path: Path) -> None:
    columns = RangeColumns.model_validate({"t_s": "t", "anchor_id": "who", "range_m": "how far"})
    with pytest.raises(InputError, match=r"row 3, column how far: expected a number or nothing"):
        read_ranges(write(tmp_path, "t,who,how far\n0,a,1\n1,a,x\n"), columns, STAMPS)
    with pytest.raises(InputError, match="column who: missing; found 't', 'how far'"):
        read_ranges(write(tmp_path, "t,how far\n0,1\n"), columns, STAMPS)
    optional = columns.model_copy(update={"rssi_dbm": "p"})
    table, _ = read_ranges(write(tmp_path, "t,who,how far,p\n0,a,1,\n"), optional, STAMPS)
    assert np.isnan(table["rssi_dbm"]).all()


TIMES = [1767225600.0, 1767225600.25, 1767225661.0]  # 2026-01-01 00:00:00 and later


@pytest.mark.parametrize(
    ("cells", "stamps"),
    [
        ("2026/01/01,0:00:00 2026/01/01,0:00:00.250 2026/01/01,0:01:01", {}),
        (
            "2026-01-01,00:00:00Z 2026-01-01,00:00:00.25Z 2026-01-01,00:01:01Z",
            {"utc_offset_h": 2.0},
        ),
        ("2026-01-01,01:00:00 2026-01-01,01:00:00.25 2026-01-01,01:01:01", {"utc_offset_h": 1.0}),
        ("01.01.2026,00:00:00 01.01.2026,00:00:00.25 01.01.2026,00:01:01", {}),
        (
            "1/1/2026,12:00:00_AM 1/1/2026,12:00:00.25_AM 1/1/2026,12:01:01_AM",
            {"date_order": "mdy"},
        ),
        ("20260101,000000 20260101,000000.250 20260101,000101", {}),
    ],
)
def test_date_and_time_in_two_columns(tmp_path: Path, cells: str, stamps: dict[str, Any]) -> None:
    rows = [f"{row.replace('_', ' ')},1,2\n" for row in cells.split()]
    t_s = {"columns": ["day", "clock"], "iso": True}
    columns = {"t_s": t_s, "east_m": "x", "north_m": "y"}
    table, _ = read_trajectory(
        write(tmp_path, "day,clock,x,y\n" + "".join(rows)),
        TrajectoryColumns.model_validate(columns),
        StampOptions.model_validate(stamps),
    )
    assert table["t_s"].tolist() == TIMES


@pytest.mark.parametrize(
    ("time", "order", "second"),
    [
        ("2026/03/04 09:00:00,5", None, 1772614800.5),
        ("2026-03-04T09:00:00.5+01:00", None, 1772611200.5),
        ("04.03.2026 09:00", None, 1772614800.0),
        ("03/04/2026 9:00:00 am", "mdy", 1772614800.0),
        ("03/04/2026 12:30:00 PM", "mdy", 1772627400.0),
        ("2026/03/04 04:00:00-05:00", None, 1772614800.0),
        ("04/03/2026 09:00:00 UTC", "dmy", 1772614800.0),
    ],
)
def test_forms_of_dates(tmp_path: Path, time: str, order: Any, second: float) -> None:
    columns = RangeColumns.model_validate(
        {"t_s": {"column": "when", "iso": True}, "anchor_id": "to", "range_m": "d"}
    )
    path = write(tmp_path, f"when;to;d\n{time};7;1\n")
    assert read_ranges(path, columns, StampOptions(date_order=order))[0]["t_s"].tolist() == [second]


@pytest.mark.parametrize("time", ["03/04/2026 09:00:00", "13/04/2026 09:00:00"])
def test_day_or_month_first_is_asked(tmp_path: Path, time: str) -> None:
    columns = RangeColumns.model_validate(
        {"t_s": {"column": "when", "iso": True}, "anchor_id": "to", "range_m": "d"}
    )
    path = write(tmp_path, f"when,to,d\n{time},7,1\n")
    with pytest.raises(InputError, match=r"day or month first\? Add stamps: {date_order: dmy}"):
        read_ranges(path, columns, STAMPS)
    if time.startswith("13"):
        with pytest.raises(InputError, match="expected an ISO date and time, got '13/04/2026"):
            read_ranges(path, columns, StampOptions(date_order="mdy"))


@pytest.mark.parametrize(
    "height",
    [{"up_m": {"column": "z", "scale": -0.01}}, {"down_m": {"column": "z", "scale": 0.01}}],
)
def test_heights_that_count_down(tmp_path: Path, height: dict[str, Any]) -> None:
    path = write(tmp_path, "t,x,y,z\n0,1,2,-150\n1,2,3,50\n")
    columns = {"t_s": "t", "east_m": "y", "north_m": "x", **height}
    table, _ = read_trajectory(path, TrajectoryColumns.model_validate(columns), STAMPS)
    assert table["up_m"].tolist() == [1.5, -0.5]
    assert "column z" in str(table.error("is odd", column="up_m"))


def test_only_the_rows_of_one_tag(tmp_path: Path) -> None:
    path = write(tmp_path, "t,tagId,to,d\n0,1,a,5\n0.1,2,a,9\n1,1,a,6\n1.1,2,a,8\n")
    columns = RangeColumns.model_validate({"t_s": "t", "anchor_id": "to", "range_m": "d"})
    with pytest.raises(
        InputError, match=r"column tagId: holds ranges of 2 tags \('1', '2'\)"
    ) as caught:
        read_ranges(path, columns, STAMPS)
    assert "or take one by where: {tagId: 1} in this file's entry in gaia.yaml" in str(caught.value)
    for value in (2, "2", 2.0, [2]):
        table, notes = read_ranges(path, columns, STAMPS, where={"tagId": value})
        assert table["range_m"].tolist() == [9.0, 8.0]
        assert notes == ["log.csv: 2 of 4 rows are those that where wants"]
    with pytest.raises(InputError, match="no row has what where wants; there are: '1', '2'"):
        read_ranges(path, columns, STAMPS, where={"tagId": 3})
    with pytest.raises(InputError, match="column tag: missing"):
        read_ranges(path, columns, STAMPS, where={"tag": 3})
    assert str(caught.value).endswith("(or is this the anchor's id?)")  # there is one anchor only
    # where the tag is the id that is asked for, nothing is to be chosen
    own = columns.model_copy(update={"anchor_id": "tagId"})
    assert len(read_ranges(path, own, STAMPS)[0]) == 4


@pytest.mark.parametrize("suffix", [".csv", ".parquet"])
def test_numbers_that_mean_no_range(tmp_path: Path, suffix: str) -> None:
    frame = pl.DataFrame({"t": [0, 1, 2, 3], "to": [1, 2, 1, 2], "mm": [65535, 2000, None, -1]})
    path = tmp_path / f"log{suffix}"
    (frame.write_csv if suffix == ".csv" else frame.write_parquet)(path)
    scaled = {"column": "mm", "scale": 0.001}
    columns = RangeColumns.model_validate({"t_s": "t", "anchor_id": "to", "range_m": scaled})
    table, notes = read_ranges(path, columns, STAMPS, missing=[65535, -1])
    assert (table["t_s"].tolist(), table["range_m"].tolist()) == ([1.0], [2.0])
    assert notes == [f"log{suffix}: skipped 3 cells without a range (empty, or 65535, -1)"]
    with pytest.raises(InputError, match="column mm: contains no ranges"):
        read_ranges(path, columns, STAMPS, missing=[65535, -1, 2000])
    wide = RangeColumns.model_validate({"t_s": "t", "anchors": {"a": scaled}})
    table, notes = read_ranges(path, wide, STAMPS, missing=[65535, -1])
    assert (table["t_s"].tolist(), table["range_m"].tolist(), len(notes)) == ([1.0], [2.0], 1)


@pytest.mark.parametrize(
    ("model", "content", "message"),
    [
        (TrajectoryColumns, {"lat": "a"}, "give either lat and lon"),
        (TrajectoryColumns, {"lat": "a", "lon": "b", "up_m": "c"}, "give either lat and lon"),
        (TrajectoryColumns, {"lat": "a", "lon": "b", "est_m": "c"}, "Extra inputs"),
        (RangeColumns, {"range_m": "a"}, "give anchor_id and range_m, or anchors"),
        (RangeColumns, {"anchors": {"a": "b"}, "range_m": "a"}, "not both"),
        (RangeColumns, {"anchors": {}}, "at least one"),
        (TrajectoryColumns, {"lat": "a", "lon": {"column": "b", "scale": -1.0}}, "heights, roll"),
        (TrajectoryColumns, {"lat": "a", "lon": {"column": "b", "iso": True}}, "for t_s only"),
        (TrajectoryColumns, {"east_m": "a", "north_m": "b", "up_m": "c", "down_m": "c"}, "or down"),
        (Column, {}, "give column, or columns"),
        (Column, {"column": "a", "columns": ["b", "c"], "iso": True}, "give column, or columns"),
        (Column, {"columns": ["b", "c"]}, "add iso: true"),
        (Column, {"column": "a", "scale": 0.0}, "a scale of 0"),
    ],
)
def test_maps_that_cannot_be(model: Any, content: dict[str, Any], message: str) -> None:
    with pytest.raises(ValidationError, match=message):
        model.model_validate(content)
