"""What the errors of many ranges are like: size, tails, bursts, memory, distance to one another.

Errors come as *tracks*: one array for each anchor of each run, in the order of time, NaN where
there is no error to speak of. An outlier is an error of more than a threshold in size, of either
sign; a burst is a run of outliers that follow one another in one track, and a NaN ends it.

>>> import numpy as np
>>> from gaia_uwb.simulate.reality.statistics import summarise
>>> track = np.array([0.1, -3.0, -3.1, 0.0, 2.0, np.nan, 2.0, -0.1])
>>> summary = summarise([track], outlier_m=1.0)
>>> summary.burst_mean, round(summary.outlier_rate, 3)
(1.3333333333333333, 0.571)
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import astuple, dataclass, fields

import numpy as np

from gaia_uwb._shared import Array, Bool, Float64, InputError, Int64


@dataclass(frozen=True)
class ErrorSummary:
    """The columns of the paper's Table 5.

    Parameters
    ----------
    mean_m
        Mean of the signed errors, in metres.
    p95_m, p99_m
        Quantiles of the errors' sizes, in metres.
    outlier_rate
        Share of the errors that are outliers.
    burst_mean, burst_p95
        Mean and 95 % quantile of the lengths of the bursts, in samples; 0 where there is none.
    """

    mean_m: float
    p95_m: float
    p99_m: float
    outlier_rate: float
    burst_mean: float
    burst_p95: float

    @classmethod
    def columns(cls) -> tuple[str, ...]:
        """Return the names of the columns, in their order."""
        return tuple(field.name for field in fields(cls))


def summarise(tracks: Sequence[Float64[Array, "_"]], *, outlier_m: float) -> ErrorSummary:
    """Summarise the errors of all tracks together.

    Parameters
    ----------
    tracks : sequence of (R,)
        Errors in metres, one array per anchor and run; NaN is left out.
    outlier_m
        An error of more than this in size is an outlier.

    Raises
    ------
    InputError
        If there is no finite error, or ``outlier_m`` is not above 0.
    """
    return _summary(_pooled(tracks), _bursts(tracks, outlier_m), outlier_m)


def summary_intervals(
    runs: Sequence[Sequence[Float64[Array, "_"]]],
    *,
    outlier_m: float,
    n_resamples: int = 200,
    seed: int = 0,
) -> dict[str, tuple[float, float] | None]:
    """Return 95 % percentile bootstrap intervals of a summary; whole runs are drawn.

    Parameters
    ----------
    runs
        The tracks of each run: what happens in one run is not independent.
    outlier_m
        As in :func:`summarise`.
    n_resamples
        How often to draw as many runs as there are.
    seed
        The same seed gives the same intervals.

    Returns
    -------
    dict
        One interval per column of :class:`ErrorSummary`; ``None`` with a single run, which says
        nothing of how runs differ.

    Raises
    ------
    InputError
        As in :func:`summarise`.
    """
    if len(runs) < 2:
        return dict.fromkeys(ErrorSummary.columns())
    errors = [_pooled(tracks) for tracks in runs]
    bursts = [_bursts(tracks, outlier_m) for tracks in runs]
    draws = []
    for row in np.random.default_rng(seed).integers(len(runs), size=(n_resamples, len(runs))):
        drawn_m, lengths = (np.concatenate([part[k] for k in row]) for part in (errors, bursts))
        draws.append(astuple(_summary(drawn_m, lengths, outlier_m)))
    ends = np.quantile(np.array(draws), [0.025, 0.975], axis=0)
    return {
        name: (float(low), float(high))
        for name, low, high in zip(ErrorSummary.columns(), *ends, strict=True)
    }


def burst_lengths(outlier: Bool[Array, "R"]) -> Int64[Array, "K"]:
    """Return the lengths of all runs of True, in their order.

    Parameters
    ----------
    outlier : (R,)
        Which samples of one track are outliers.

    Examples
    --------
    >>> burst_lengths(np.array([True, False, True, True, True]))
    array([1, 3])
    """
    edge = np.diff(np.concatenate([[False], outlier, [False]]).astype(np.int64))
    return np.asarray(np.flatnonzero(edge < 0) - np.flatnonzero(edge > 0))


def wasserstein_m(
    first: Sequence[Float64[Array, "_"]], second: Sequence[Float64[Array, "_"]]
) -> float:
    """Return the 1-Wasserstein distance between two sets of errors, in metres.

    It is the mean distance that errors must be moved to turn one distribution into the other.

    Parameters
    ----------
    first, second
        Tracks of errors in metres; NaN is left out.

    Raises
    ------
    InputError
        If one of them has no finite error.

    Examples
    --------
    >>> wasserstein_m([np.array([0.0, 1.0])], [np.array([3.0]), np.array([2.0])])
    2.0
    """
    a, b = np.sort(_pooled(first)), np.sort(_pooled(second))
    both = np.sort(np.concatenate([a, b]))
    share_a = np.searchsorted(a, both[:-1], side="right") / len(a)
    share_b = np.searchsorted(b, both[:-1], side="right") / len(b)
    return float((np.abs(share_a - share_b) * np.diff(both)).sum())


def autocorrelation(
    tracks: Sequence[Float64[Array, "_"]], max_lag: int, *, clip_m: float
) -> Float64[Array, "L"]:
    """Return how alike errors are that lie 0, 1, 2 ... samples apart.

    All tracks share one mean: what keeps a whole track off it counts as memory without end.

    Parameters
    ----------
    tracks : sequence of (R,)
        Errors in metres; pairs with a NaN are left out.
    max_lag
        Largest distance, in samples.
    clip_m
        Larger errors count as this, so that a few spikes do not hide the rest.

    Returns
    -------
    (max_lag + 1,)
        The correlation at each lag, 1 at lag 0; NaN where no track is long enough.

    Raises
    ------
    InputError
        If there is no finite error, or all errors are the same.
    """
    mean_m = float(np.clip(_pooled(tracks), -clip_m, clip_m).mean())
    centred = [np.clip(track, -clip_m, clip_m) - mean_m for track in tracks]
    covariance = np.full(max_lag + 1, np.nan)
    for lag in range(max_lag + 1):
        pairs = np.concatenate([x[: max(len(x) - lag, 0)] * x[lag:] for x in centred])
        pairs = pairs[np.isfinite(pairs)]
        if len(pairs):
            covariance[lag] = pairs.mean()
    if covariance[0] == 0.0:
        raise InputError("expected different errors, got the same value everywhere")
    return np.asarray(covariance / covariance[0])


def _summary(
    error_m: Float64[Array, "E"], lengths: Int64[Array, "K"], outlier_m: float
) -> ErrorSummary:
    size_m = np.abs(error_m)
    p95_m, p99_m = np.quantile(size_m, [0.95, 0.99])
    return ErrorSummary(
        mean_m=float(error_m.mean()),
        p95_m=float(p95_m),
        p99_m=float(p99_m),
        outlier_rate=float((size_m > outlier_m).mean()),
        burst_mean=float(lengths.mean()) if len(lengths) else 0.0,
        burst_p95=float(np.quantile(lengths, 0.95)) if len(lengths) else 0.0,
    )


def _bursts(tracks: Sequence[Float64[Array, "_"]], outlier_m: float) -> Int64[Array, "K"]:
    """Return the lengths of the bursts of all tracks."""
    if not outlier_m > 0:
        raise InputError(f"expected a threshold above 0, got {outlier_m}", column="outlier_m")
    lengths: Array = np.concatenate(
        [np.empty(0, np.int64), *(burst_lengths(np.abs(track) > outlier_m) for track in tracks)]
    )
    return lengths


def _pooled(tracks: Sequence[Float64[Array, "_"]]) -> Float64[Array, "E"]:
    """Return all finite errors."""
    error_m: Array = np.concatenate([np.empty(0), *tracks])
    error_m = error_m[np.isfinite(error_m)]
    if not len(error_m):
        raise InputError("expected at least one finite error, got none")
    return error_m
