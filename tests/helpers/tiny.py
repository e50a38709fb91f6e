"""A plan so small that everything is over in seconds."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

from gaia_uwb._shared.files import OutputFolder
from gaia_uwb.reproduce.plan import QUICK, Plan
from gaia_uwb.reproduce.workshop import Workshop
from surveyed import make_runs

TINY = replace(
    QUICK,
    n_test=3,
    splits=("layout", "sim"),
    preparations=("aligned",),
    lengths=(64, None),
    stressors=QUICK.stressors[:1],
    n_training=4,
    n_validation=2,
    hidden=4,
    run_s=8.0,
)


def make_workshop(folder: Path, plan: Plan = TINY, **changes: Any) -> Workshop:
    """Return a workshop that trains in this process, on walks instead of the outdoor data."""
    return Workshop(OutputFolder(folder), plan, "1.2.3", make_runs, **({"workers": 0} | changes))
