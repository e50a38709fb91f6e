"""Random processes in time, drawn for many rows at once without a loop over time."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np

from gaia_uwb._shared import Array, Bool, Float64, Int64

Column: TypeAlias = "float | Float64[Array, 'N 1']"
"""A number for all rows, or one for each."""

_NOTHING = 1e-12  # a correlation this small counts as none


def two_state(
    draw: Float64[Array, "N P"], off_s: Column, on_s: Column, step_s: Column
) -> Bool[Array, "N P"]:
    """Sample a two-state Markov process in continuous time at even steps, from its stationary law.

    A step's number between 0 and 1 says "switch on", "switch off" or "leave it", so the state is
    that of the last step that said something.

    Parameters
    ----------
    draw : (N, P)
        Independent numbers, uniform between 0 and 1.
    off_s, on_s
        Mean durations of the two states, in seconds, of all rows or of each (N, 1); a process
        whose ``off_s`` is infinite is never on.
    step_s
        Time between two steps, in seconds, of all rows or of each (N, 1).

    Returns
    -------
    (N, P)
        True where the process is on.

    Examples
    --------
    >>> two_state(np.array([[0.9, 0.5, 0.001, 0.5, 0.99]]), 10.0, 1.0, 0.1)
    array([[False, False,  True,  True, False]])
    """
    share = on_s / (off_s + on_s)
    forgotten = -np.expm1(-step_s / on_s - step_s / off_s)
    value = draw < share * forgotten
    says = value | (draw >= 1 - (1 - share) * forgotten)
    value[:, :1] = draw[:, :1] < share
    last = np.maximum.accumulate(np.where(says, np.arange(draw.shape[1]), 0), axis=1)
    return at_steps(value, last)


def at_steps(value: Array, step: Int64[Array, "N P"]) -> Array:
    """Return each row's values at other steps: ``value[n, step[n, p]]``.

    Parameters
    ----------
    value : (N, P)
        Any values.
    step : (N, P)
        Which step's value to take.
    """
    first = value.shape[1] * np.arange(len(value))[:, None]
    taken: Array = value.ravel().take(step + first)  # much faster than take_along_axis
    return taken


def correlated(white: Float64[Array, "N P"], correlation_s: Column, step_s: Column) -> Array:
    """Turn independent standard normal numbers into an Ornstein-Uhlenbeck process of variance 1.

    Parameters
    ----------
    white : (N, P)
        Independent standard normal numbers.
    correlation_s
        Time in which the correlation falls to 1/e, in seconds, of all rows or of each (N, 1).
    step_s
        Time between two steps, in seconds, of all rows or of each (N, 1).

    Returns
    -------
    (N, P)
        Each row an autoregressive process that is stationary from its first step.
    """
    keep = np.exp(-step_s / correlation_s)
    value = white * np.sqrt(1 - keep * keep)
    value[:, 0] = white[:, 0]
    # x[t] = sum_j keep^j e[t - j]: sums over 1, 2, 4, 8 ... steps, until nothing is left to add.
    reach = 1
    while reach < value.shape[1] and np.any(keep > _NOTHING):
        keep = np.where(keep > _NOTHING, keep, 0.0)  # what a row adds does not depend on the others
        value[:, reach:] += keep * value[:, :-reach]
        reach, keep = 2 * reach, keep * keep
    return np.asarray(value)
