"""The static half of the outdoor UWB data set: one anchor and one tag that stood still.

Both stood for some 12 seconds at each of 13 anchor heights and 30 distances (29 without line of
sight), 767 files with the receiver's diagnostics. A few files are empty or nearly so: the radio
did not reach that far. All end with a summary, and some have a garbled row.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from gaia_uwb._shared import Array, Float64, InputError
from gaia_uwb.logs._table import read_errors
from gaia_uwb.logs.outdoor_uwb import TAG_HEIGHT_M

_COLUMNS = {
    "timestamp": "t_s",
    "Distance": "range_m",
    "RSSI(dBm)": "rssi_dbm",
    "RSSI_fp(dBm)": "rssi_fp_dbm",
    "maxNoise": "max_noise",
    "Standard Noise": "standard_noise",
    "FirstPathAmp1": "first_path_amplitude_1",
    "FirstPathAmp2": "first_path_amplitude_2",
    "FirstPathAmp3": "first_path_amplitude_3",
    "Max Growth CIR": "max_growth_cir",
    "Rx Preamble Count": "preamble_count",
    "rtd_init": "round_trip_initiator_ticks",
    "rtd_resp": "round_trip_responder_ticks",
    "poll_tx_ts": "poll_sent_ticks",
    "poll_rx_ts": "poll_received_ticks",
    "resp_tx_ts": "response_sent_ticks",
    "resp_rx_ts": "response_received_ticks",
}
_SUMMARY = r"^(Distance|RSSI\(dBm\)|RSSI_fp\(dBm\)) (Mean|Std)$"


@dataclass(frozen=True)
class StaticFile:
    """What one anchor measured to one tag that stood still.

    Parameters
    ----------
    path
        The file.
    nlos
        Whether something stood between them.
    anchor_up_m
        Height of the anchor above the ground; the tag's is :data:`TAG_HEIGHT_M`.
    distance_m
        Horizontal distance between them.
    readings
        Name -> (R,) values, NaN where the file has none: ``t_s`` (since 1970), ``range_m``,
        ``rssi_dbm``, ``rssi_fp_dbm`` and the receiver's diagnostics in its own units. R may be 0.
    n_damaged
        Number of rows with a cell that is not a number; without a time or a range they are skipped.
    """

    path: Path
    nlos: bool
    anchor_up_m: float
    distance_m: float
    readings: Mapping[str, Float64[Array, "R"]]
    n_damaged: int

    def __len__(self) -> int:
        return len(self.readings["range_m"])

    @property
    def true_range_m(self) -> float:
        """True slant range, in metres."""
        return float(np.hypot(self.distance_m, self.anchor_up_m - TAG_HEIGHT_M))


def load_static(folder: Path) -> list[StaticFile]:
    """Read the static files with their diagnostics; some have no readings.

    Parameters
    ----------
    folder
        The data set's folder (the one that holds ``Static_measurements``).

    Returns
    -------
    list of StaticFile
        Line of sight first, then by height and distance.

    Raises
    ------
    InputError
        If there is none, or a file lacks a column.
    """
    paths = list((folder / "Static_measurements").glob("*LOS/height_*cm/[!.]*m.csv"))
    if not paths:
        raise InputError("has no Static_measurements", source=folder)
    files = [_load_static_file(path) for path in paths]
    return sorted(files, key=lambda f: (f.nlos, f.anchor_up_m, f.distance_m))


def _load_static_file(path: Path) -> StaticFile:
    """Read one static file, which ends with a summary; a few have garbled rows."""
    import polars as pl

    place = re.search(r"(N?)LOS/height_([0-9.]+)cm/([0-9.]+)m\.csv$", path.as_posix())
    if place is None:
        raise InputError("expected a name like LOS/height_50.0cm/2m.csv", source=path)
    with read_errors(path):
        frame = pl.read_csv(path, infer_schema=False, truncate_ragged_lines=True)
        texts = frame.select(list(_COLUMNS))
    blank = pl.all_horizontal(pl.all().fill_null("").str.strip_chars() == "")
    texts = texts.filter(~blank & ~pl.first().str.contains(_SUMMARY))
    numbers = texts.cast(pl.Float64, strict=False).rename(_COLUMNS)
    damaged = numbers.select(pl.any_horizontal(pl.all().is_null()).sum()).item()
    numbers = numbers.filter(pl.col("t_s").is_finite() & pl.col("range_m").is_finite())
    return StaticFile(
        path=path,
        nlos=place[1] == "N",
        anchor_up_m=float(place[2]) / 100,
        distance_m=float(place[3]),
        readings={name: _finite_or_nan(numbers[name].to_numpy()) for name in numbers.columns},
        n_damaged=int(damaged),
    )


def _finite_or_nan(values: Float64[Array, "R"]) -> Float64[Array, "R"]:
    return np.where(np.isfinite(values), values, np.nan)
