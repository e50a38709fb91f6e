"""What earlier drives say of a zone, as the estimator takes it: a Gaussian for each cone.

It stands in for the priors of a cone that nothing is known of.
"""

from __future__ import annotations

from dataclasses import dataclass

from gaia_uwb._shared import Array, Float64
from gaia_uwb.locate.error_sizes import KeptSizes


@dataclass(frozen=True)
class KeptPrior:
    """What earlier drives say of each cone of one zone: it stands in for the usual priors.

    Parameters
    ----------
    mean, precision : (N, 2, 5), (N, 2, 5, 5)
        Of the unknowns of each cone, given each side.
    loss : (N, 2)
        What earlier drives say against each side.
    sizes
        What they say of the sizes of errors.
    """

    mean: Float64[Array, "N 2 5"]
    precision: Float64[Array, "N 2 5 5"]
    loss: Float64[Array, "N 2"]
    sizes: KeptSizes
