"""GPS time and UTC: how far the one is ahead of the other.

>>> import numpy as np
>>> float(gps_ahead_s(np.array([1_772_528_400.0]))[0])
18.0
"""

from __future__ import annotations

import numpy as np

from gaia_uwb._shared import Array, Float64

GPS_EPOCH_S = 315_964_800.0
"""6 January 1980 in seconds since 1970."""

WEEK_S = 604_800.0

# The last second before 1999 is no matter of UWB logs; the next one will be announced by the IERS.
_LEAPS = (
    (915_148_800.0, 13.0),  # 1999-01-01
    (1_136_073_600.0, 14.0),  # 2006-01-01
    (1_230_768_000.0, 15.0),  # 2009-01-01
    (1_341_100_800.0, 16.0),  # 2012-07-01
    (1_435_708_800.0, 17.0),  # 2015-07-01
    (1_483_228_800.0, 18.0),  # 2017-01-01
)


def gps_ahead_s(t_s: Float64[Array, "R"]) -> Float64[Array, "R"]:
    """Return by how many seconds GPS time is ahead of UTC.

    Parameters
    ----------
    t_s : (R,)
        Seconds since 1970, in either; within 18 s of a leap second the answer is that of one side.
    """
    starts, seconds = np.array(_LEAPS).T
    return np.asarray(seconds[np.clip(np.searchsorted(starts, t_s, "right") - 1, 0, None)])
