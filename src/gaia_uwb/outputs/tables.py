"""The two tables of a result: one row per anchor, and one per range."""

from __future__ import annotations

import io
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from gaia_uwb._shared import Array, Cell, Float64, csv_text
from gaia_uwb.denoised import DenoisedRanges
from gaia_uwb.episode import Episode
from gaia_uwb.estimate import AnchorFix
from gaia_uwb.outputs.geojson import lon_lat
from gaia_uwb.reconstruction import Reconstruction

if TYPE_CHECKING:
    import polars as pl


def other_place(anchor: AnchorFix) -> tuple[Float64[Array, "2"], Float64[Array, "2 2"]]:
    """Return the mirror position and its covariance; NaN where there is none."""
    if anchor.has_mirror:
        return anchor.mirror_position_m, anchor.mirror_covariance_m2
    return np.full(2, np.nan), np.full((2, 2), np.nan)


def cones_csv(reconstruction: Reconstruction) -> str:
    """Return one row per anchor as CSV: position, uncertainty, status.

    Parameters
    ----------
    reconstruction
        What to write.
    """
    anchors = reconstruction.anchors
    position_m = np.array([anchor.position_m for anchor in anchors])
    covariance_m2 = np.array([anchor.covariance_m2 for anchor in anchors])
    mirrors = [other_place(anchor) for anchor in anchors]
    mirror_m = np.array([place_m for place_m, _ in mirrors])
    mirror_m2 = np.array([covariance for _, covariance in mirrors])
    places = lon_lat(reconstruction.episode.frame, position_m).round(9)
    columns: dict[str, Sequence[Cell]] = {
        "anchor_id": [anchor.anchor_id for anchor in anchors],
        "status": [anchor.status.value for anchor in anchors],
        "east_m": position_m[:, 0].tolist(),
        "north_m": position_m[:, 1].tolist(),
        "lon": places[:, 0].tolist(),
        "lat": places[:, 1].tolist(),
        "covariance_ee_m2": covariance_m2[:, 0, 0].tolist(),
        "covariance_en_m2": covariance_m2[:, 0, 1].tolist(),
        "covariance_nn_m2": covariance_m2[:, 1, 1].tolist(),
        "mirror_probability": [float(anchor.mirror_probability) for anchor in anchors],
        "mirror_probability_by_ranges": [
            float(anchor.mirror_probability_by_ranges) for anchor in anchors
        ],
        "side_source": [anchor.side_source or "" for anchor in anchors],
        "side_is_open": [anchor.side_is_open for anchor in anchors],
        "mirror_east_m": mirror_m[:, 0].tolist(),
        "mirror_north_m": mirror_m[:, 1].tolist(),
        "mirror_covariance_ee_m2": mirror_m2[:, 0, 0].tolist(),
        "mirror_covariance_en_m2": mirror_m2[:, 0, 1].tolist(),
        "mirror_covariance_nn_m2": mirror_m2[:, 1, 1].tolist(),
        "n_ranges": [anchor.n_ranges for anchor in anchors],
        "range_bias_m": [float(anchor.range_bias_m) for anchor in anchors],
    }
    return csv_text(list(columns), zip(*columns.values(), strict=True))


def clean_ranges_parquet(reconstruction: Reconstruction) -> bytes:
    """Return one row per pass, step and anchor with a range as Parquet.

    Parameters
    ----------
    reconstruction
        What to write.
    """
    import polars as pl

    table = pl.concat([_ranges(*each) for each in reconstruction.passes])
    content = io.BytesIO()
    table.with_columns(pl.col(pl.Float64).fill_nan(None)).write_parquet(content)
    return content.getvalue()


def _ranges(episode: Episode, denoised: DenoisedRanges) -> pl.DataFrame:
    import polars as pl

    step, anchor = np.nonzero(episode.valid | denoised.valid)
    return pl.DataFrame(
        {
            "pass": pl.repeat(episode.name, len(step), eager=True),
            "t_s": episode.t_s[step],
            "anchor_id": pl.Series(episode.anchor_ids, dtype=pl.String).gather(anchor),
            "range_m": episode.range_m[step, anchor],
            "denoised_range_m": denoised.range_m[step, anchor],
            "sigma_m": denoised.sigma_m[step, anchor],
            "valid": denoised.valid[step, anchor],
        }
    )
