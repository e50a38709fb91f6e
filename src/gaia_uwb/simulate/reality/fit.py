"""Fit the simulator's ranging errors to surveyed logs, so that its passes err as real ones do.

Every setting is read off the errors by its own moment, in the order of the model in
``simulate/settings.py``: bursts first (``spikes.py`` finds them), then the bias, then what is left:
what it shares between anchors is drift of all, what outlives a moment is drift of each anchor's
own, the rest is noise. Nothing is tuned, and logs of the simulator give its settings back.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from textwrap import indent
from typing import Any

import numpy as np

from gaia_uwb._shared import Array, Bool, Float64, InputError, Int64
from gaia_uwb.alignment import gate_spikes
from gaia_uwb.config import dump_config
from gaia_uwb.episode import bias_basis
from gaia_uwb.scene import Scene
from gaia_uwb.simulate.reality.real_errors import ErrorDefinition, clock_offset_s, range_errors
from gaia_uwb.simulate.settings import RangingConfig

_LEAST_BURST_M = 0.5  # smaller spikes are told from the noise by chance
_LONGEST_BURST = 10  # readings; what lasts longer is no burst
_OUTAGE_POLLS = 3  # so many polls lost in a row are an outage, fewer are lost each on its own
_CYCLE_S = 10.0  # of lost and regained sight, where no label ever changes within a run
_MOST_AVERAGED = 20
_CORRELATION_S = np.geomspace(0.5, 120.0, 60)  # candidates of a drift's correlation time
_LONGEST_LAG_S = 40.0


def fit_ranging(scenes: Sequence[Scene]) -> RangingConfig:
    """Fit the simulator's ranging errors to logs.

    Parameters
    ----------
    scenes
        Surveyed logs, with and without line of sight where the difference is to be told. Readings
        without a label count as having it.

    Returns
    -------
    RangingConfig
        The settings; those that no log tells of keep their default.

    Raises
    ------
    InputError
        If a scene has no surveyed anchors, or there are too few readings on known poses.

    Examples
    --------
    >>> from gaia_uwb.simulate import PRESETS, simulate_pass
    >>> fit_ranging([simulate_pass(PRESETS["lane-closure"], seed=0)]).clock_offset_s
    0.2
    """
    tracks = [track for scene in scenes for track in _tracks(scene)]
    if sum(len(track.t_s) for track in tracks) < 100:
        raise InputError("expected at least 100 ranges with a known true distance for the fit")
    found = _polling(tracks) | _bursts(tracks) | _sight(tracks) | _power(scenes)
    found |= _errors(tracks, 1.0 / found["rate_hz"])
    offset_s = float(np.median([clock_offset_s(scene) for scene in scenes]))
    return RangingConfig(**found, clock_offset_s=round(offset_s, 4))


def preset_text(fitted: RangingConfig, scenes: Sequence[Scene], version: str) -> str:
    """Return a fitted error model as a preset file; all but the ranging keeps its default.

    Parameters
    ----------
    fitted
        What :func:`fit_ranging` returned.
    scenes
        What the errors were fitted to.
    version
        Of the package.
    """
    lines = [
        f"# Ranging errors fitted by gaia {version} to these {len(scenes)} logs, all of them:",
        *(f"#   {' '.join(scene.name.split())}" for scene in scenes),
        "ranging:",
        indent(dump_config(fitted), "  "),
    ]
    return "\n".join(lines)


@dataclass(frozen=True)
class _Track:
    """One anchor's errors in one run; ``burst_m`` is a burst's offset, 0 outside bursts."""

    run: str
    t_s: Float64[Array, "R"]
    error_m: Float64[Array, "R"]
    true_m: Float64[Array, "R"]
    range_m: Float64[Array, "R"]
    nlos: Bool[Array, "R"]
    burst_m: Float64[Array, "R"]


def _tracks(scene: Scene) -> list[_Track]:
    """Return a scene's corrected errors, with the bursts marked."""
    tracks = []
    for track in range_errors(scene, ErrorDefinition.CORRECTED):
        known = np.isfinite(track.error_m)
        if known.sum() < 2:
            continue
        t_s, error_m, reading = track.t_s[known], track.error_m[known], track.reading[known]
        labels = None if scene.truth is None else scene.truth.nlos
        tracks.append(
            _Track(
                run=scene.name,
                t_s=t_s,
                error_m=error_m,
                true_m=track.true_m[known],
                range_m=scene.ranges.range_m[reading],
                nlos=np.zeros(len(t_s), dtype=np.bool_) if labels is None else labels[reading],
                burst_m=_burst_offsets(t_s, error_m),
            )
        )
    return tracks


def _burst_offsets(t_s: Float64[Array, "R"], error_m: Float64[Array, "R"]) -> Float64[Array, "R"]:
    """Return the offset of the burst that each reading is part of, 0 where it is part of none."""
    keep = gate_spikes(t_s, error_m)
    above_m = error_m - np.interp(t_s, t_s[keep], error_m[keep])
    offset_m = np.zeros(len(t_s))
    for start, stop in _stretches(~keep):
        size_m = float(np.median(above_m[start:stop]))
        if abs(size_m) >= _LEAST_BURST_M and stop - start <= _LONGEST_BURST:
            offset_m[start:stop] = size_m
    return offset_m


def _stretches(on: Bool[Array, "R"]) -> Int64[Array, "K 2"]:
    """Return start and stop of every stretch of True."""
    edge = np.diff(np.concatenate([[False], on, [False]]).astype(np.int64))
    return np.stack([np.flatnonzero(edge > 0), np.flatnonzero(edge < 0)], axis=1)


def _polling(tracks: Sequence[_Track]) -> dict[str, Any]:
    """Fit how often anchors are polled, and which polls give nothing new."""
    between_s = np.concatenate([np.diff(track.t_s) for track in tracks])
    poll_s = float(np.median(between_s))
    lost = np.maximum(np.round(between_s / poll_s) - 1, 0)
    alone, outage = lost[lost < _OUTAGE_POLLS], lost[lost >= _OUTAGE_POLLS]
    polls = len(between_s) + alone.sum()
    held = np.concatenate([np.diff(track.range_m) == 0.0 for track in tracks])
    found = {
        "rate_hz": _rounded(1.0 / poll_s),
        "max_range_m": float(np.ceil(max(track.true_m.max() for track in tracks))),
        "dropout_share": _rounded(alone.sum() / polls),
        "outage_per_s": _rounded(len(outage) / (polls * poll_s)),
        "held_share": _rounded(held.mean()),
    }
    return found | ({"outage_s": _rounded(outage.mean() * poll_s)} if len(outage) else {})


def _bursts(tracks: Sequence[_Track]) -> dict[str, Any]:
    """Fit how often bursts come, how long they are, and how large."""
    offsets, lengths = [], []
    for track in tracks:
        for start, stop in _stretches(track.burst_m != 0.0):
            offsets.append(float(track.burst_m[start]))
            lengths.append(stop - start)
    if not offsets:
        return {"burst_per_s": 0.0}
    size_m = np.abs(offsets)
    seconds = sum(len(track.t_s) * float(np.median(np.diff(track.t_s))) for track in tracks)
    shares = np.round(np.bincount(lengths)[1:] / len(lengths), 4)
    shares[np.argmax(shares)] += 1.0 - shares.sum()  # what rounding left over
    return {
        "burst_per_s": _rounded(len(offsets) / seconds),
        "burst_lengths": tuple(np.round(shares, 4).tolist()),
        "burst_negative_share": _rounded((np.array(offsets) < 0).mean()),
        "burst_median_m": _rounded(float(np.median(size_m))),
        "burst_log_sigma": _rounded(float(np.log(size_m).std())),
        "burst_max_m": float(np.ceil(size_m.max())),
    }


def _sight(tracks: Sequence[_Track]) -> dict[str, Any]:
    """Fit how long line of sight lasts and is lost; where labels never change, only the shares."""
    share = float(np.concatenate([track.nlos for track in tracks]).mean())
    if share == 0.0:
        return {"los_s": None}
    changes = sum(int(np.diff(track.nlos).sum()) for track in tracks)
    seconds = sum(float(np.ptp(track.t_s)) for track in tracks)
    cycle_s = 2.0 * seconds / changes if changes else _CYCLE_S
    return {
        "los_s": _rounded(max(cycle_s * (1.0 - share), 1e-3)),
        "nlos_s": _rounded(max(cycle_s * share, 1e-3)),
    }


def _power(scenes: Sequence[Scene]) -> dict[str, Any]:
    """Fit the received power where the logs hold it; nothing of the first path without labels."""
    decade, power, gap, blocked = [], [], [], []
    for scene in scenes:
        log = scene.ranges
        if log.rssi_dbm is None or log.rssi_fp_dbm is None:
            continue
        for track in range_errors(scene, ErrorDefinition.CORRECTED):
            rssi_dbm, first_dbm = log.rssi_dbm[track.reading], log.rssi_fp_dbm[track.reading]
            ok = np.isfinite(rssi_dbm) & np.isfinite(first_dbm) & np.isfinite(track.true_m)
            labels = None if scene.truth is None else scene.truth.nlos
            nlos = np.zeros(len(ok), np.bool_) if labels is None else labels[track.reading]
            decade.append(np.log10(np.maximum(track.true_m[ok], 1.0)))
            power.append(rssi_dbm[ok])
            gap.append((rssi_dbm - first_dbm)[ok])
            blocked.append(nlos[ok])
    if not decade or not sum(map(len, decade)):
        return {}
    x, y = np.concatenate(decade), np.concatenate(power)
    design = np.stack([np.ones_like(x), -x], axis=1)
    (at_1m_dbm, per_decade_db), *_ = np.linalg.lstsq(design, y)
    loss_db, nlos = np.concatenate(gap), np.concatenate(blocked)
    found = {
        "rssi_at_1m_dbm": _rounded(at_1m_dbm),
        "rssi_per_decade_db": _rounded(max(float(per_decade_db), 0.0)),
        "rssi_sigma_db": _rounded((y - design @ (at_1m_dbm, per_decade_db)).std()),
    }
    if nlos.any() and not nlos.all():
        more_db = float(loss_db[nlos].mean() - loss_db[~nlos].mean())
        found["nlos_first_path_loss_db"] = _rounded(max(more_db, 0.0))
    return found


def _errors(tracks: Sequence[_Track], poll_s: float) -> dict[str, Any]:
    """Fit bias, drift and noise to the readings outside bursts."""
    kept = [track.burst_m == 0.0 for track in tracks]
    basis = np.concatenate([bias_basis(t.true_m)[k] for t, k in zip(tracks, kept, strict=True)])
    y = np.concatenate([t.error_m[k] for t, k in zip(tracks, kept, strict=True)])
    nlos = np.concatenate([t.nlos[k] for t, k in zip(tracks, kept, strict=True)]).astype(float)
    bias_m, slope_m, excess_m = (
        float(v) for v in np.linalg.lstsq(np.column_stack([basis, nlos]), y)[0]
    )
    left = []
    for track, keep in zip(tracks, kept, strict=True):
        expected_m = bias_basis(track.true_m) @ (bias_m, slope_m) + excess_m * track.nlos
        left.append(np.where(keep, track.error_m - expected_m, np.nan))
    found = {"bias_m": _rounded(bias_m), "bias_per_decade_m": _rounded(slope_m)}
    more_m2 = 0.0
    if excess_m > 0 and not nlos.all():
        all_left = np.concatenate([v[k] for v, k in zip(left, kept, strict=True)])
        more_m2 = float(all_left[nlos > 0].var() - all_left[nlos == 0].var())
        # What exceeds the excess itself tells of drifts that differ from run to run, not of it.
        more_m2 = min(max(more_m2, 0.0), excess_m**2)
    found |= _drift_and_noise(tracks, left, poll_s, of_nlos_m2=float(nlos.mean()) * more_m2)
    if nlos.any():
        found |= {
            "nlos_bias_m": _rounded(max(excess_m, 0.0)),
            "nlos_bias_sigma_m": _rounded(np.sqrt(more_m2)),
            "nlos_bias_correlation_s": found["own_drift_correlation_s"],
        }
    return found


def _drift_and_noise(
    tracks: Sequence[_Track],
    left: Sequence[Float64[Array, "_"]],
    poll_s: float,
    *,
    of_nlos_m2: float,
) -> dict[str, Any]:
    """Split what is left of the errors into drift of all anchors, of each one, and noise.

    The excess without line of sight varies like the anchors' own drift; its share is taken out.
    """
    lags = _lags(poll_s)
    own_m2, shared_m2 = _covariances(tracks, left, lags, poll_s)
    drift_m2, drift_s = _fit_exponential(shared_m2, lags * poll_s)
    own_drift_m2, own_drift_s, noise_m2, averaged = _fit_with_noise(
        own_m2 - shared_m2, lags, poll_s
    )
    sigma_m, per_m = _noise_over_distance(tracks, left, noise_m2)
    return {
        "drift_sigma_m": _rounded(np.sqrt(drift_m2)),
        "drift_correlation_s": _rounded(drift_s),
        "own_drift_sigma_m": _rounded(np.sqrt(max(own_drift_m2 - of_nlos_m2, 0.0))),
        "own_drift_correlation_s": _rounded(own_drift_s),
        "sigma_m": _rounded(sigma_m),
        "sigma_per_m": _rounded(per_m),
        "averaged": averaged,
    }


def _covariances(
    tracks: Sequence[_Track],
    left: Sequence[Float64[Array, "_"]],
    lags: Int64[Array, "L"],
    poll_s: float,
) -> tuple[Float64[Array, "L"], Float64[Array, "L"]]:
    """Return covariances of an anchor with itself and with another one, by lag."""
    runs: dict[str, list[int]] = {}
    for k, track in enumerate(tracks):
        runs.setdefault(track.run, []).append(k)
    grids = [
        _on_grid([tracks[k] for k in of], [left[k] for k in of], poll_s) for of in runs.values()
    ]
    sums = np.zeros((4, len(lags)))  # of own products, their count, others' products, their count
    for grid in grids:
        value, there = np.nan_to_num(grid), np.isfinite(grid).astype(float)
        for row, lag in enumerate(lags):
            if lag >= grid.shape[1]:
                continue
            early, late = slice(0, grid.shape[1] - lag), slice(lag, None)
            for first, of in ((0, value), (1, there)):
                product = of[:, early] @ of[:, late].T
                own = np.trace(product)
                sums[first, row] += own
                sums[first + 2, row] += product.sum() - own
    own_m2, shared_m2 = (sums[i] / np.maximum(sums[i + 1], 1.0) for i in (0, 2))
    return own_m2, shared_m2


def _lags(poll_s: float) -> Int64[Array, "L"]:
    """Return lags in polls: every short one, ever fewer of the long ones."""
    longest = max(int(_LONGEST_LAG_S / poll_s), _MOST_AVERAGED + 1)
    long = np.geomspace(_MOST_AVERAGED, longest, 30).astype(np.int64)
    return np.unique(np.concatenate([np.arange(_MOST_AVERAGED), long]))


def _on_grid(
    tracks: Sequence[_Track], left: Sequence[Float64[Array, "_"]], poll_s: float
) -> Float64[Array, "N T"]:
    """Lay the errors of a run's anchors on one regular timeline; NaN where there is none."""
    start_s = min(float(track.t_s[0]) for track in tracks)
    end_s = max(float(track.t_s[-1]) for track in tracks)
    grid = np.full((len(tracks), int((end_s - start_s) / poll_s) + 2), np.nan)
    for row, (track, error_m) in enumerate(zip(tracks, left, strict=True)):
        grid[row, np.round((track.t_s - start_s) / poll_s).astype(np.int64)] = error_m
    return grid


def _fit_exponential(
    covariance_m2: Float64[Array, "L"], lag_s: Float64[Array, "L"]
) -> tuple[float, float]:
    """Fit ``variance exp(-lag / time)``; return variance and time."""
    basis = np.exp(-lag_s / _CORRELATION_S[:, None])
    variance = np.maximum((basis @ covariance_m2) / (basis**2).sum(axis=1), 0.0)
    misfit = ((covariance_m2 - variance[:, None] * basis) ** 2).sum(axis=1)
    best = int(np.argmin(misfit))
    return float(variance[best]), float(_CORRELATION_S[best])


def _fit_with_noise(
    covariance_m2: Float64[Array, "L"], lags: Int64[Array, "L"], poll_s: float
) -> tuple[float, float, float, int]:
    """Fit drift and averaged noise: variance and time, variance and number of averaged ranges."""
    lag_s = lags * poll_s
    candidates: list[tuple[float, int, float, float, float]] = []
    for averaged in range(1, _MOST_AVERAGED + 1):
        triangle = np.maximum(1.0 - lags / averaged, 0.0)
        for time_s in _CORRELATION_S.tolist():
            basis = np.stack([np.exp(-lag_s / time_s), triangle], axis=1)
            variance, *_ = np.linalg.lstsq(basis, covariance_m2)
            if (variance >= 0).all():
                misfit = float(((covariance_m2 - basis @ variance) ** 2).sum())
                drift_m2, noise_m2 = (float(part) for part in variance)
                candidates.append((misfit, averaged, time_s, drift_m2, noise_m2))
    if not candidates:  # all that is left is noise, or all is drift
        drift_m2, time_s = _fit_exponential(covariance_m2[1:], lag_s[1:])
        return drift_m2, time_s, max(float(covariance_m2[0]) - drift_m2, 0.0), 1
    _, averaged, time_s, drift_m2, noise_m2 = min(candidates)
    return drift_m2, time_s, noise_m2, averaged


def _noise_over_distance(
    tracks: Sequence[_Track], left: Sequence[Float64[Array, "_"]], noise_m2: float
) -> tuple[float, float]:
    """Share the noise out over the distance, as the steps between readings grow with it."""
    far_m = np.concatenate([track.true_m[1:] for track in tracks])
    step_m = np.abs(np.concatenate([np.diff(error_m) for error_m in left]))
    ok = np.isfinite(step_m)
    far_m, step_m = far_m[ok], step_m[ok]
    slope, at_0 = np.polyfit(far_m, step_m, 1)
    growth = max(float(slope), 0.0) / max(float(at_0), 1e-3) if float(slope) > 0 else 0.0
    sigma_m = float(np.sqrt(noise_m2 / ((1.0 + growth * far_m) ** 2).mean()))
    return sigma_m, min(growth * sigma_m, 0.1)


def _rounded(value: float) -> float:
    """Keep four digits: no log tells more."""
    return float(f"{value:.4g}")
