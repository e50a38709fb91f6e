"""Find spikes: short bursts of readings far off their neighbours, of either sign.

UWB radios of the DW1000 family often report a moving average of three ranges, so one wrong range
shows as a burst of two or three readings with one offset, most often negative. The gate looks at
the residual of each reading against the range predicted from the vehicle's pose, where the range's
own curvature at vehicle speed is gone, and compares it with the median of its neighbours (Hampel
1974). A burst is a minority of its neighbourhood, so its members do not vouch for each other. A
reading that repeats the one before it (held by the radio) is off by what the vehicle moved since:
at walking pace that is little and it passes, at speed it is gated like any other spike.
"""

from __future__ import annotations

import numpy as np

from gaia_uwb._shared import Array, Bool, Float64

_BLOCK = 65_536  # readings processed together, which bounds the memory


def gate_spikes(
    t_s: Float64[Array, "R"],
    residual_m: Float64[Array, "R"],
    *,
    neighbours: int = 10,
    within_s: float = 1.5,
    threshold_sigma: float = 5.0,
    threshold_m: float = 0.25,
) -> Bool[Array, "R"]:
    """Return which readings of one anchor are not spikes.

    Parameters
    ----------
    t_s : (R,)
        Increasing time of the readings, in seconds.
    residual_m : (R,)
        Measured minus predicted range, in metres.
    neighbours, within_s
        A reading is compared with up to so many readings before and after it, no further away than
        this, in seconds.
    threshold_sigma, threshold_m
        A spike differs from the neighbours' median by more than so many of their robust standard
        deviations and by more than so many metres.

    Returns
    -------
    (R,) boolean
        True where a reading may be used.

    Examples
    --------
    >>> import numpy as np
    >>> residual_m = np.zeros(20)
    >>> residual_m[7:10] = -6.2
    >>> np.flatnonzero(~gate_spikes(np.arange(20) * 0.1, residual_m))
    array([7, 8, 9])
    """
    keep = np.ones(len(t_s), dtype=np.bool_)
    for _ in range(2):  # the second look is not disturbed by what the first one found
        kept = np.flatnonzero(keep)
        centre, spread = _neighbourhood(t_s[kept], residual_m[kept], neighbours, within_s)
        bound = np.maximum(threshold_m, threshold_sigma * spread)
        keep[kept[np.abs(residual_m[kept] - centre) > bound]] = False
    return keep


def _neighbourhood(
    t_s: Float64[Array, "K"], value: Float64[Array, "K"], neighbours: int, within_s: float
) -> tuple[Float64[Array, "K"], Float64[Array, "K"]]:
    """Return each value's neighbours' median and robust standard deviation; 0 where alone."""
    window = np.arange(-neighbours, neighbours + 1)
    centre, spread = np.empty(len(t_s)), np.empty(len(t_s))
    for start in range(0, len(t_s), _BLOCK):
        rows = np.arange(start, min(start + _BLOCK, len(t_s)))
        index = rows[:, None] + window
        inside = (index >= 0) & (index < len(t_s))
        index = np.clip(index, 0, len(t_s) - 1)
        inside &= np.abs(t_s[index] - t_s[rows, None]) <= within_s
        near = np.where(inside, value[index], np.inf)
        centre[rows] = _masked_median(near)
        spread[rows] = 1.4826 * _masked_median(np.abs(near - centre[rows, None]))
    return centre, spread


def _masked_median(values: Float64[Array, "K W"]) -> Float64[Array, "K"]:
    """Return the median of each row's finite values (there is at least one)."""
    ordered = np.sort(values, axis=1)
    count = np.isfinite(ordered).sum(axis=1)
    rows = np.arange(len(values))
    low, high = ordered[rows, (count - 1) // 2], ordered[rows, count // 2]
    return np.asarray(0.5 * (low + high))
