"""``raw``: the ranges as they are, with the noise that they show."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from gaia_uwb.denoisers._base import ColumnDenoiser, ColumnRanges, Columns
from gaia_uwb.denoisers._robust import local_line, noise_m

_NEIGHBOURS = 10


class Raw(ColumnDenoiser):
    """Leave the ranges as they are; sigma is each anchor's robust noise about local lines.

    Examples
    --------
    >>> from gaia_uwb.denoisers import make_denoiser
    >>> make_denoiser("raw").uses_pose
    False
    """

    keeps_ranges: ClassVar[bool] = True

    def denoise(self, columns: Columns) -> ColumnRanges:
        """Return the ranges and one standard deviation per column; see the base class."""
        noise = noise_m(local_line(columns.t_s, columns.range_m, _NEIGHBOURS))
        sigma = np.where(np.isfinite(columns.range_m), noise, np.nan)
        return ColumnRanges(columns.range_m, sigma)
