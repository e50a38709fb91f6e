"""What feeds say in words about cones, and about how well they were located."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gaia_uwb.estimate import AnchorFix
from gaia_uwb.outputs import Json, confidence_ellipse

_CONFIDENCE = 0.95
_MOST_WORDS = 1000  # characters


def cone_messages(cone: AnchorFix) -> list[str]:
    """Return what a device's status messages say about a cone's position."""
    radius_m = confidence_radius_m(cone)
    size = "unknown" if radius_m is None else f"{radius_m:.2f} m"
    words = [cone.status.message, f"95 % confidence radius {size}"]
    if cone.side_is_open:
        words.append(f"probability of the mirror position {cone.mirror_probability:.2f}")
    return words


def cone_extension(cone: AnchorFix) -> Json:
    """Return the member ``gaia`` of a cone's device: what the specification has no member for."""
    known = bool(np.isfinite(cone.covariance_m2).all())
    return {
        "anchor_id": cone.anchor_id,
        "status": cone.status.value,
        "covariance_m2": cone.covariance_m2.tolist() if known else None,
        "mirror_probability": float(cone.mirror_probability),
        "n_ranges": cone.n_ranges,
    }


def confidence_radius_m(cone: AnchorFix) -> float | None:
    """Return the longer semi-axis of the 95 % ellipse, in metres; None where it says nothing."""
    ellipse = confidence_ellipse(cone.covariance_m2, _CONFIDENCE)
    return None if ellipse is None else ellipse.semi_major_m


def listed(names: Sequence[str]) -> str:
    """Name up to five things."""
    more = f" and {len(names) - 5} more" if len(names) > 5 else ""
    return shortened(", ".join(names[:5])) + more


def shortened(text: str) -> str:
    """Return a text of bounded length."""
    return text if len(text) <= _MOST_WORDS else f"{text[:_MOST_WORDS]} ..."
