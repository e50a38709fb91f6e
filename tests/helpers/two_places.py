"""Anchors beside a straight path, each with the two places that its ranges allow."""

import numpy as np

from gaia_uwb.config import SidesConfig
from gaia_uwb.locate.hypotheses import Hypotheses

ALONE = SidesConfig(joint=False)
PATH_M = np.stack([np.arange(-10.0, 2500.0), np.zeros(2510)], axis=1)  # of :func:`make_hypotheses`


def make_hypotheses(n, seed=0, odds=1.0, sigma_m=0.3):
    """Return hypotheses beside a straight path, the anchors on the left, and their true places."""
    rng = np.random.default_rng(seed)
    true_m = np.stack([4.0 * np.arange(n), rng.uniform(3.0, 6.0, n)], axis=1)
    place = true_m + sigma_m * rng.standard_normal((n, 2))
    # The difference of two log likelihoods d is N(m, 2 m) for the right side.
    difference = odds + np.sqrt(2.0 * odds) * rng.standard_normal(n)
    pair = np.stack([place, place * [1.0, -1.0]], axis=1)
    wrong = difference < 0
    pair[wrong] = pair[wrong, ::-1]
    return Hypotheses(
        position_m=pair, covariance_m2=np.tile(sigma_m**2 * np.eye(2), (n, 2, 1, 1)),
        log_odds=np.abs(difference), own_bias_m=np.zeros(n),
        n_ranges=np.full(n, 64), converged=np.ones(n, dtype=bool), fits=np.ones(n, dtype=bool),
    ), true_m  # fmt: skip
