"""Everything that a reconstruction writes.

========================  ==========================================================================
file                      what it contains
========================  ==========================================================================
``cones.csv``             one row per anchor: position, uncertainty, status
``clean-ranges.parquet``  one row per pass, step and anchor with a range: before and after denoising
``boundary.geojson``      edges, areas, cones and ellipses for a GIS (``geojson.py``)
``boundary.gpkg``         the same as layers of a GeoPackage; only on request
``boundary.kml``          the same for a globe; only on request and with a geographic reference
``plot.png``              the site from above and the ranges over time (``picture.py``)
``plot.svg``              the same to scale and to edit; only on request
``map.html``              an interactive map that needs no network (``interactive_map.py``)
``report.md``             the result in plain words: confidence, limitations (``plain_words.py``)
``config.yaml``           every setting, read back by ``gaia reconstruct --config``
``report.json``           the result for programs; written last, so if it is new, all files are
========================  ==========================================================================

No input has one of these names, and everything is made before any file is written. In
``clean-ranges.parquet``, ``range_m`` is the measured range on the trajectory's timeline, less the
radios' common bias (``range_calibration`` in the report), and ``denoised_range_m`` with ``sigma_m``
is what the denoiser made of it. A value that is not usable is null; ``valid`` says whether the
denoised one is usable.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from importlib.metadata import version
from pathlib import Path

import numpy as np

from gaia_uwb._shared import figure_png, figure_svg
from gaia_uwb.config import dump_config
from gaia_uwb.episode import Episode, RangeCalibration, ReadingCounts
from gaia_uwb.estimate import AnchorFix, Reason
from gaia_uwb.evaluate import Improvement, Metric, improvements
from gaia_uwb.logs import results_folder
from gaia_uwb.outputs.geojson import Json, boundary_geojson, lon_lat
from gaia_uwb.outputs.geopackage import geopackage
from gaia_uwb.outputs.interactive_map import map_page
from gaia_uwb.outputs.kml import kml
from gaia_uwb.outputs.picture import plot_reconstruction
from gaia_uwb.outputs.plain_words import people_report
from gaia_uwb.outputs.road_report import road_report
from gaia_uwb.outputs.tables import clean_ranges_parquet, cones_csv, other_place
from gaia_uwb.reconstruction import Reconstruction
from gaia_uwb.zone import BoundaryUncertainty

SCHEMA = 2
REPORT = "report.json"

RESULT_FILES = (
    "cones.csv",
    "clean-ranges.parquet",
    "boundary.geojson",
    "plot.png",
    "map.html",
    "config.yaml",
    "report.md",
    REPORT,
)
"""What every reconstruction writes."""

UNCERTAINTY_NOTE = (
    "covariance_m2 is the covariance of (east, north) of an anchor in the trajectory's own frame, "
    "given that the side of the path is right (see mirror_probability). An error in that frame "
    "(GNSS datum, base station, heading of a local frame) shifts and rotates all anchors together "
    "and is not included: in the public outdoor UWB data set the frames of trajectory and survey "
    "differ by 0.2 to 1.0 degrees and up to 0.2 m. It does not affect the shape or area of the "
    "boundary."
)


def make_report(
    reconstruction: Reconstruction,
    metrics: Mapping[str, Metric] | None = None,
    proposed: Sequence[Improvement] = (),
) -> Json:
    """Return the content of ``report.json``.

    Parameters
    ----------
    reconstruction
        What to report.
    metrics
        Scores against a known truth, by name.
    proposed
        What could be done would give, from :func:`gaia_uwb.evaluate.improvements`.

    Returns
    -------
    dict
        Strict JSON values only: what is unknown is None, never NaN. ``clock_offset_s`` is the shift
        applied to the ranges, ``clock_offset`` says how it was found. Both, like
        ``range_calibration``, belong to a pass, and are None at the top level where several passes
        were fused. ``boundary`` is the paper's, ``road_boundary`` what a driver sees
        (``road_report.py``). Lengths are in metres.
    """
    episode, boundary = reconstruction.episode, reconstruction.boundary
    alone = None if reconstruction.more_passes else episode
    return {
        "schema": SCHEMA,
        "version": version("gaia-uwb"),
        "scene": reconstruction.name,
        "status": reconstruction.status.value,
        "reasons": [_reason(reason) for reason in reconstruction.reasons],
        "notes": list(reconstruction.notes),
        "stated": list(reconstruction.stated),
        **_errors(alone),
        "passes": [
            {
                "name": e.name,
                "n_ranges": int(e.n_readings.sum()),
                "readings": _readings(e.all_readings),
                **_errors(e),
            }
            for e, _ in reconstruction.passes
        ],
        "anchors": _anchors(reconstruction),
        "boundary": {
            "status": boundary.status.value,
            "area_m2": boundary.area_m2,
            "hull_m": boundary.hull_m.tolist(),
            "outline_ids": [episode.anchor_ids[index] for index in boundary.outline_index],
            "side_unknown_ids": [
                anchor.anchor_id
                for anchor in reconstruction.anchors
                if anchor.side_is_open
            ],
            "uncertainty": _uncertainty(reconstruction.boundary_uncertainty),
        },
        "improvements": [
            {**asdict(each), "radius_90_m": _finite(each.radius_90_m)} for each in proposed
        ],
        "road_boundary": road_report(reconstruction.road_boundary),
        "frame": None if episode.frame is None else asdict(episode.frame),
        "uncertainty_note": UNCERTAINTY_NOTE,
        "config": reconstruction.config.model_dump(mode="json"),
        "metrics": None if metrics is None else {
            name: {"value": metric.value, "unit": metric.unit, "n": metric.n}
            for name, metric in metrics.items()
        },
    }  # fmt: skip


def write_all(
    reconstruction: Reconstruction,
    folder: str | Path,
    metrics: Mapping[str, Metric] | None = None,
    *,
    svg: bool = False,
    gis: bool = False,
) -> list[Path]:
    """Write all result files (see the module's table) and return their paths.

    Parameters
    ----------
    reconstruction
        What to write.
    folder
        Created if missing. Files of an earlier run are replaced one by one, each as a whole, and
        nobody else's are. The old ``report.json`` is removed first and the new one written last, so
        that where there is a report, all files belong to it.
    metrics
        Scores against a known truth, by name.
    svg
        Also write ``plot.svg``, which takes as long as ``plot.png``.
    gis
        Also write ``boundary.gpkg`` and, with a geographic reference, ``boundary.kml``.

    Raises
    ------
    ConfigError
        If the folder holds a log, a file in it has the name of a result and was not written by
        gaia, or something cannot be written.
    """
    output = results_folder(Path(folder))
    proposed = improvements(reconstruction)
    report = make_report(reconstruction, metrics, proposed)
    page = map_page(reconstruction, boundary_geojson(reconstruction, local=True), report)
    figure = plot_reconstruction(reconstruction)
    plots = {"plot.png": figure_png(figure)}
    if svg:
        plots["plot.svg"] = figure_svg(figure).encode()
    collection = boundary_geojson(reconstruction)
    optional = {"boundary.gpkg": geopackage(collection)} if gis else {}
    if gis and reconstruction.episode.frame is not None:
        optional["boundary.kml"] = kml(collection).encode()
    files: dict[str, str | bytes] = {
        "cones.csv": cones_csv(reconstruction),
        "clean-ranges.parquet": clean_ranges_parquet(reconstruction),
        "boundary.geojson": json.dumps(collection, ensure_ascii=False, allow_nan=False),
        **optional,
        **plots,
        "map.html": page,
        "config.yaml": f"# gaia-uwb {report['version']}\n{dump_config(reconstruction.config)}",
        "report.md": people_report(reconstruction, proposed),
        REPORT: json.dumps(report, indent=1, ensure_ascii=False, allow_nan=False) + "\n",
    }
    output.claim(files)
    with output.alone():
        for name in (REPORT, "plot.svg", "boundary.gpkg", "boundary.kml"):
            output.remove(name)  # of an earlier run, which may have been asked for more
        return [output.write(name, content) for name, content in files.items()]


def _reason(reason: Reason) -> Json:
    return {
        "kind": reason.kind.value,
        "text": reason.text,
        "cones": list(reason.cones),
        "passes": list(reason.passes),
        "statements": list(reason.statements),
        "numbers": dict(reason.numbers),
    }


def _uncertainty(found: BoundaryUncertainty | None) -> Json | None:
    """Return the regions that hold with a probability, and the probability on a grid."""
    if found is None:
        return None
    regions: Json = {
        name: {
            "area_m2": region.area_m2,
            "polygons_m": [[ring.round(4).tolist() for ring in rings] for rings in region.polygons],
        }
        for name, region in (("inner", found.inner), ("outer", found.outer))
    }
    grid = {
        "origin_m": found.map.origin_m.tolist(),
        "cell_m": found.map.cell_m,
        "probability": found.map.probability.round(3).tolist(),
    }
    return {"probability": found.probability, **regions, "map": grid}


def _errors(episode: Episode | None) -> Json:
    """Return what was found of a pass's clock and radios."""
    clock = None if episode is None else episode.clock
    return {
        "clock_offset_s": None if clock is None else clock.applied_s,
        "clock_offset": None if clock is None else asdict(clock),
        "range_calibration": None if episode is None else _calibration(episode.calibration),
    }


def _calibration(calibration: RangeCalibration | None) -> Json | None:
    if calibration is None:
        return None
    bias_at_10_m, bias_per_decade = calibration.bias.tolist()
    return {
        "bias_at_10_m_m": bias_at_10_m,
        "bias_per_decade_m": bias_per_decade,
        "sigma_m": calibration.sigma_m,
        "correlation_steps": calibration.correlation,
    }


def _anchors(reconstruction: Reconstruction) -> list[Json]:
    position_m = np.array([anchor.position_m for anchor in reconstruction.anchors])
    readings = reconstruction.readings
    places = lon_lat(reconstruction.episode.frame, position_m).round(9)
    return [
        _anchor(anchor, float(lon), float(lat), readings.get(anchor.anchor_id))
        for anchor, (lon, lat) in zip(reconstruction.anchors, places, strict=True)
    ]


def _anchor(anchor: AnchorFix, lon: float, lat: float, readings: ReadingCounts | None) -> Json:
    covariance_m2, (mirror_m, mirror_m2) = anchor.covariance_m2, other_place(anchor)
    return {
        "id": anchor.anchor_id,
        "east_m": _finite(anchor.position_m[0]),
        "north_m": _finite(anchor.position_m[1]),
        "lon": _finite(lon),
        "lat": _finite(lat),
        "covariance_m2": covariance_m2.tolist() if np.isfinite(covariance_m2).all() else None,
        "mirror_probability": anchor.mirror_probability,
        "mirror_probability_by_ranges": _finite(anchor.mirror_probability_by_ranges),
        "side_source": None if anchor.side_source is None else anchor.side_source.value,
        "side_is_open": anchor.side_is_open,
        "mirror_east_m": _finite(mirror_m[0]),
        "mirror_north_m": _finite(mirror_m[1]),
        "mirror_covariance_m2": mirror_m2.tolist() if np.isfinite(mirror_m2).all() else None,
        "status": anchor.status.value,
        "n_ranges": anchor.n_ranges,
        "readings": _readings(readings),
        "range_bias_m": _finite(anchor.range_bias_m),
    }


def _readings(counts: ReadingCounts | None) -> Json | None:
    """Return what became of readings; ``in_log`` is the sum of the others."""
    names = ("in_log", "kept", "spikes", "in_gaps", "outside")
    return None if counts is None else {name: getattr(counts, name) for name in names}


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
