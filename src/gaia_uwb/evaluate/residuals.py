"""How well measured ranges fit the positions that were found: what a reader checks to trust them.

A residual is the measured range (freed of the radios' common bias) minus the distance to the
anchor's place and minus the anchor's own bias. Where line of sight was blocked it is positive, and
a place that is wrong shows as residuals that change along the path.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gaia_uwb._shared import Array, Float64
from gaia_uwb.episode import Episode
from gaia_uwb.estimate import AnchorFix


def range_residual_m(episode: Episode, anchors: Sequence[AnchorFix]) -> Float64[Array, "T N"]:
    """Return measured minus expected ranges, in metres.

    Parameters
    ----------
    episode
        The ranges and the path.
    anchors
        One fix per anchor of the episode, in its order.

    Returns
    -------
    (T, N)
        NaN where there is no range, or the anchor was not located.

    Examples
    --------
    >>> import numpy as np
    >>> from gaia_uwb.estimate import AnchorFix, AnchorStatus
    >>> path_m, t_s = np.array([[0.0, 0.0], [3.0, 0.0]]), np.array([0.0, 1.0])
    >>> episode = Episode("pass", ("cone-1",), t_s, path_m, np.array([[5.2], [4.0]]),
    ...                   np.ones((2, 1), dtype=np.bool_))
    >>> place_m = np.array([3.0, 4.0])
    >>> fix = AnchorFix("cone-1", place_m, np.eye(2), place_m, 0.0, AnchorStatus.OK, 2)
    >>> range_residual_m(episode, [fix]).round(3).tolist()
    [[0.2], [0.0]]
    """
    place_m = np.stack([anchor.position_m for anchor in anchors])
    bias_m = np.nan_to_num([anchor.range_bias_m for anchor in anchors])
    away_m = episode.position_m[:, None] - place_m
    slant_m = np.sqrt((away_m**2).sum(axis=-1) + episode.height_gap_m() ** 2)
    return np.asarray(episode.range_m - slant_m - np.nan_to_num(bias_m))
