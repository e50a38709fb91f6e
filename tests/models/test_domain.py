from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from gaia_uwb._shared.errors import InputError
from gaia_uwb.models.domain import Domain, Normalisation
from tiny_models import make_run


def test_normalisation_centres_the_paths_and_scales_by_the_usable_ranges() -> None:
    runs = [make_run(seed, missing=0.4) for seed in range(3)]
    found = Normalisation.fit(runs)
    assert (found.origin_east_m, found.origin_north_m) == (0.0, -4.0)
    used = np.concatenate([run.range_m[run.valid] for run in runs])
    assert found.scale_m == pytest.approx(np.sqrt(np.mean(used**2)), abs=1e-3)
    with pytest.raises(InputError, match="expected episodes with ranges"):
        Normalisation.fit([make_run(0, missing=1.1)])


def test_the_domain_holds_all_that_it_was_made_of() -> None:
    runs = [make_run(0), make_run(1, n_anchors=5)]
    # A straight path has no width: rounding must not shut it out.
    shifted = [replace(run, position_m=run.position_m + 0.0004) for run in runs]
    domain = Domain.of(shifted)
    assert domain.n_anchors == (3, 5)
    assert [domain.outside_share(run) for run in shifted] == [0.0, 0.0]
    least = min(np.nanmin(run.range_m) for run in runs)
    most = max(np.nanmax(run.range_m) for run in runs)
    assert domain.range_m[0] <= least <= most <= domain.range_m[1]


def test_a_path_beyond_the_domain_is_counted() -> None:
    domain = Domain(east_m=(-10.0, 10.0), north_m=(-5.0, -3.0), range_m=(0, 20), n_anchors=(3, 3))
    run = make_run(0, n_steps=21)
    assert domain.outside_share(run) == 0.0
    beyond = replace(
        run, position_m=run.position_m + np.array([7.0, 0.0])
    )  # -3 to 17 m; slack to 12 m
    assert domain.outside_share(beyond) == pytest.approx(5 / 21)
    beside = replace(run, position_m=run.position_m + np.array([0.0, 1.3]))
    assert domain.outside_share(beside) == 1.0
