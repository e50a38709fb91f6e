"""A path without its receiver's noise, and what is left of that noise in its speed.

Positions of a receiver have white noise of a centimetre. Taken for motion, it would tell on which
side of a straight path a cone stands, and what the clock offset of a steady drive is: ranges have
nothing of it, so each would be a coin toss of which the fit is sure. So each position is that of a
parabola through those of half a second before and after it.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gaia_uwb._shared import Array, Float64
from gaia_uwb.scene import Trajectory

_HALF_S = 0.5
_EVEN = 0.2  # times between positions differ by less than this share, where they are even
_FEWEST = 5  # positions under a parabola
_MOST_SIGMA = 5.0  # of noise that a position is moved by


def smooth_path(path: Trajectory, half_s: float = _HALF_S) -> Trajectory:
    """Return a path whose positions are averaged over a second.

    Parameters
    ----------
    path
        Of the tag's antenna. It stays as it is around gaps, where positions come unevenly, and
        where the vehicle moved otherwise than on a parabola, by more than noise explains.
    half_s
        Half of that time.

    Examples
    --------
    >>> t_s = 0.05 * np.arange(200.0)
    >>> rng = np.random.default_rng(0)
    >>> noise_m = 0.01 * rng.normal(size=(200, 2))
    >>> true_m = np.stack([15.0 * t_s, 0.1 * t_s**2], axis=1)
    >>> left_m = smooth_path(Trajectory(t_s, true_m + noise_m)).position_m - true_m
    >>> bool(left_m[20:-20].std() < 0.004)
    True
    """
    step_s = np.diff(path.t_s)
    usual_s = float(np.median(step_s))
    half = round(half_s / usual_s)
    n = 2 * half + 1
    if n < _FEWEST or len(path) < n:
        return path
    even = np.abs(step_s - usual_s) < _EVEN * usual_s
    run = np.concatenate([[0], np.cumsum(even)])
    middle = np.arange(half, len(path) - half)
    whole = run[middle + half] - run[middle - half] == 2 * half
    weights = _parabola(half)
    smooth_m = np.stack(
        [np.convolve(each, weights[::-1], mode="valid") for each in path.position_m.T], axis=1
    )
    moved_m = np.abs(smooth_m - path.position_m[middle]).max(axis=1)
    whole &= moved_m <= _MOST_SIGMA * path.position_noise_m
    position_m = path.position_m.copy()
    position_m[middle[whole]] = smooth_m[whole]
    return replace(path, position_m=position_m)


def speed_noise_mps(path: Trajectory, over_s: float) -> float:
    """Return the noise that is left in the speed of a smoothed path.

    Parameters
    ----------
    path
        As it was recorded.
    over_s
        Time between the positions from which the speed is taken.

    Returns
    -------
    float
        Standard deviation along each axis, in metres per second.
    """
    usual_s = float(np.median(np.diff(path.t_s)))
    half, apart = round(_HALF_S / usual_s), max(round(over_s / usual_s), 1)
    weights = _parabola(half) if 2 * half + 1 >= _FEWEST else np.ones(1)
    difference = np.zeros(len(weights) + apart)
    difference[apart:] += weights
    difference[: len(weights)] -= weights
    return float(path.position_noise_m * np.linalg.norm(difference) / (apart * usual_s))


def _parabola(half: int) -> Float64[Array, "n"]:
    """Return the weights of 2 half + 1 even samples in the parabola's middle value."""
    at = np.arange(-half, half + 1.0)
    basis = np.stack([np.ones(len(at)), at, at**2], axis=1)
    return np.asarray(np.linalg.pinv(basis)[0])
