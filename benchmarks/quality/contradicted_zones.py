"""Whether zones in which ranges and network contradict each other are worse than they say.

Usage: python benchmarks/quality/contradicted_zones.py [--passes N]

Passes of whole simulated zones with the default denoiser. A cone is contradicted where the ranges
rule out the network's position or side beyond chance; its zone has the reason ``unlike-zones``.
``expected`` is the sum of the reported mirror probabilities, ``inside`` the share of the 90 %
ellipses that hold the truth, given the better of both sides.
"""

from __future__ import annotations

import argparse

import numpy as np

from _tally import Tally, table_head, table_row
from gaia_uwb import PipelineConfig
from gaia_uwb.estimate import AnchorFix, ReasonKind
from gaia_uwb.pipeline import prepare, reconstruct_episodes
from gaia_uwb.simulate import find_preset, simulate

PRESETS = ("wild-test", "lane-closure", "calibrated")
GROUPS = ("contradicted", "others of their zones", "other zones")
COLUMNS = ("passes of", "cones", "n", "wrong sides", "expected", "inside", "error (m)")


def rows(preset: str, n_passes: int) -> list[str]:
    """Return a line for each group of cones."""
    episodes = [prepare(scene) for scene in simulate(find_preset(preset), n_passes, 7)]
    tallies = {group: Tally() for group in GROUPS}
    expected = dict.fromkeys(GROUPS, 0.0)
    for episode, result in zip(
        episodes, reconstruct_episodes(episodes, PipelineConfig()), strict=True
    ):
        reasons = [r for r in result.reasons if r.kind is ReasonKind.UNLIKE_ZONES]
        cones = {name for reason in reasons for name in reason.cones}
        assert episode.truth is not None
        for fix, true_m in zip(result.anchors, episode.truth.anchor_m, strict=True):
            if not fix.status.has_position:
                continue
            group = GROUPS[0] if fix.anchor_id in cones else GROUPS[1] if cones else GROUPS[2]
            expected[group] += fix.mirror_probability
            places_m, covariances_m2 = both_places(fix)
            tallies[group].add(places_m, covariances_m2, true_m)
    return [row(preset, group, tallies[group], expected[group]) for group in GROUPS]


def both_places(fix: AnchorFix) -> tuple[np.ndarray, np.ndarray]:
    """Return both places of a cone and their covariances."""
    return (
        np.stack([fix.position_m, fix.mirror_position_m]),
        np.stack([fix.covariance_m2, fix.mirror_covariance_m2]),
    )


def row(preset: str, group: str, tally: Tally, expected: float) -> str:
    """Return a line of the table."""
    if not len(tally):
        return table_row([preset, group, 0, "", "", "", ""])
    wrong = int((~tally.right).sum())
    inside, error_m = f"{tally.covered.mean():.2f}", f"{np.median(tally.nearer_m):.2f}"
    return table_row([preset, group, len(tally), wrong, f"{expected:.1f}", inside, error_m])


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("--passes", type=int, default=250)
    given = parser.parse_args()
    print(table_head(COLUMNS))
    for preset in PRESETS:
        print("\n".join(rows(preset, given.passes)), flush=True)


if __name__ == "__main__":
    main()
