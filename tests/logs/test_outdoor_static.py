from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from gaia_uwb._shared.errors import InputError
from gaia_uwb.logs.outdoor_static import load_static
from outdoor_files import ROW, SUMMARY, write_static


def test_reads_readings_and_counts_garbled_rows(tmp_path: Path) -> None:
    garbled = ROW.replace("-79.5", "t: 3")
    write_static(
        tmp_path,
        "LOS/height_162.5cm/10m.csv",
        ROW,
        garbled,
        ROW.replace("-79.5", "-inf"),
        ROW.replace("10.04", "1 0"),
        "," * 20,
        "\0" * 30,
        SUMMARY,
    )
    (file,) = load_static(tmp_path)
    assert (file.nlos, file.anchor_up_m, file.distance_m, len(file)) == (False, 1.625, 10.0, 3)
    assert file.true_range_m == pytest.approx(np.hypot(10.0, 0.625))
    np.testing.assert_array_equal(file.readings["range_m"], [10.04] * 3)
    np.testing.assert_array_equal(file.readings["rssi_dbm"], [-79.5, np.nan, np.nan])
    np.testing.assert_array_equal(file.readings["first_path_amplitude_3"], [9559] * 3)
    assert file.n_damaged == 3


def test_a_file_that_is_being_fetched_is_none_yet(tmp_path: Path) -> None:
    write_static(tmp_path, "LOS/height_50.0cm/6m.csv", ROW)
    write_static(tmp_path, "LOS/height_50.0cm/.gaia-0-1-2-3-7m.csv")
    assert [file.distance_m for file in load_static(tmp_path)] == [6.0]


def test_files_without_readings_are_no_error(tmp_path: Path) -> None:
    write_static(tmp_path, "NLOS/height_50.0cm/60m.csv")
    write_static(tmp_path, "NLOS/height_50.0cm/6m.csv", ROW)
    write_static(tmp_path, "LOS/height_200.0cm/60m.csv", "," * 20)
    files = load_static(tmp_path)
    places = [(file.nlos, file.distance_m, len(file), file.n_damaged) for file in files]
    assert places == [(False, 60.0, 0, 0), (True, 6.0, 1, 0), (True, 60.0, 0, 0)]


def test_names_what_is_wrong(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="has no Static_measurements"):
        load_static(tmp_path)
    write_static(tmp_path, "LOS/height_xcm/6m.csv", ROW)
    with pytest.raises(InputError, match=r"6m\.csv: expected a name like LOS/height_50\.0cm/2m"):
        load_static(tmp_path)
    (tmp_path / "Static_measurements/LOS/height_xcm").rename(
        tmp_path / "Static_measurements/LOS/height_50.0cm"
    )
    for content in ("", "timestamp,Distance\n1,2\n"):
        (tmp_path / "Static_measurements/LOS/height_50.0cm/6m.csv").write_text(content)
        with pytest.raises(InputError, match=r"6m\.csv: cannot be read: "):
            load_static(tmp_path)


@pytest.mark.real_data
def test_all_real_files(outdoor_dir: Path) -> None:
    files = load_static(outdoor_dir / "outdoor-uwb")
    assert len(files) == 13 * 30 + 13 * 29
    assert sum(len(file) == 0 for file in files) == 15
    assert sum(map(len, files)) == 67_105
    bias_m = [
        float(np.median(file.readings["range_m"])) - file.true_range_m
        for file in files
        if len(file) and not file.nlos
    ]
    assert np.mean(bias_m) == pytest.approx(0.213, abs=0.001)
