from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest
from pydantic import ValidationError

from gaia_uwb._shared.errors import InputError
from gaia_uwb.logs._stamps import StampOptions
from gaia_uwb.logs.csv_map import RangeColumns, TrajectoryColumns, read_ranges, read_trajectory

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
    table = read_trajectory(path, TrajectoryColumns.model_validate(columns), STAMPS)
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
    table = read_ranges(path, columns, STAMPS)
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
    table = read_ranges(path, columns, STAMPS)
    ids = [table.labels["anchor_id"][k] for k in table["anchor_id"]]
    rows = sorted(zip(ids, table["t_s"].tolist(), table["range_m"].tolist(), strict=True))
    assert rows == [("cone-1", 0.0, 5.0), ("cone-2", 0.0, 12.0), ("cone-2", 1.0, 14.0)]


def test_wrong_cells_name_the_users_column(tmp_path: Path) -> None:
    columns = RangeColumns.model_validate({"t_s": "t", "anchor_id": "who", "range_m": "how far"})
    with pytest.raises(InputError, match=r"row 3, column how far: expected a finite number"):
        read_ranges(write(tmp_path, "t,who,how far\n0,a,1\n1,a,x\n"), columns, STAMPS)
    with pytest.raises(InputError, match="column who: missing; found 't', 'how far'"):
        read_ranges(write(tmp_path, "t,how far\n0,1\n"), columns, STAMPS)
    optional = columns.model_copy(update={"rssi_dbm": "p"})
    table = read_ranges(write(tmp_path, "t,who,how far,p\n0,a,1,\n"), optional, STAMPS)
    assert np.isnan(table["rssi_dbm"]).all()


@pytest.mark.parametrize(
    ("model", "content", "message"),
    [
        (TrajectoryColumns, {"lat": "a"}, "give either lat and lon"),
        (TrajectoryColumns, {"lat": "a", "lon": "b", "up_m": "c"}, "give either lat and lon"),
        (TrajectoryColumns, {"lat": "a", "lon": "b", "est_m": "c"}, "Extra inputs"),
        (RangeColumns, {"range_m": "a"}, "give anchor_id and range_m, or anchors"),
        (RangeColumns, {"anchors": {"a": "b"}, "range_m": "a"}, "not both"),
        (RangeColumns, {"anchors": {}}, "at least one"),
    ],
)
def test_maps_that_cannot_be(model: Any, content: dict[str, Any], message: str) -> None:
    with pytest.raises(ValidationError, match=message):
        model.model_validate(content)
