"""Chains of lines of sight, compiled from _sight.c; used by line_of_sight.py only."""

from gaia_uwb._shared.arrays import Array

def smooth(
    visible: Array,
    still_visible: Array,
    newly_hidden: Array,
    still_hidden: Array,
    share: Array,
    same: Array,
    hidden: Array,
    evidence: Array,
    after_hidden: Array,
    after_visible: Array,
    /,
) -> None: ...
