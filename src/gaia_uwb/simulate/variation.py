"""What differs from one pass of a batch to the next, and which layouts are kept for the test.

A layout's *cell* is its kind of zone, its sides, its number of anchors, its posted speed and the
lengths of its buffer and work space in steps of 10 m. A fifth of all cells, picked by a checksum,
belongs to the test; so a network that is tested there has never seen such a layout.
"""

from __future__ import annotations

from typing import Any
from zlib import crc32

import numpy as np

from gaia_uwb.errors import ConfigError
from gaia_uwb.simulate.settings import SECTIONS, Choice, PassConfig, is_span

_CELL_M = 10.0
_TEST_PART = 5  # one cell in five is the test's
_TRIES = 1000
_WHOLE_NUMBERS = {
    (section, setting)
    for section, model in SECTIONS.items()
    for setting, field in model.model_fields.items()
    if field.annotation is int
}


def draw_config(config: PassConfig, rng: np.random.Generator) -> PassConfig:
    """Draw what a batch varies, for one pass.

    Parameters
    ----------
    config
        Settings of the batch.
    rng
        Source of the numbers.

    Returns
    -------
    PassConfig
        Settings of the pass, in which nothing varies.

    Raises
    ------
    ConfigError
        If no layout that the settings give is in the part that ``split`` asks for.

    Examples
    --------
    >>> batch = PassConfig(vary={"closure.n_anchors": [4, 12]})
    >>> draw_config(batch, np.random.default_rng(0)).closure.n_anchors
    9
    """
    for _ in range(_TRIES):
        drawn = _draw_once(config, rng)
        if config.split in ("all", layout_part(drawn)):
            return drawn
    raise ConfigError(f"split: no layout of these settings is in the {config.split} part")


def layout_part(config: PassConfig) -> str:
    """Tell to which part a layout belongs: ``training`` or ``test``.

    Parameters
    ----------
    config
        Settings of a pass.
    """
    closure = config.closure
    cell = (
        f"{closure.kind} {closure.both_sides} {closure.n_anchors} {config.road.speed_limit_mph} "
        f"{closure.buffer_m // _CELL_M:.0f} {closure.work_m // _CELL_M:.0f}"
    )
    return "test" if crc32(cell.encode()) % _TEST_PART == 0 else "training"


def _draw_once(config: PassConfig, rng: np.random.Generator) -> PassConfig:
    if not config.vary:
        return config
    changes: dict[str, dict[str, Any]] = {}
    draws = rng.random(len(config.vary)).tolist()
    for (key, values), draw in zip(config.vary.items(), draws, strict=True):
        section, _, setting = key.partition(".")
        changes.setdefault(section, {})[setting] = _pick(section, setting, values, draw)
    # Every end of a span was checked when the settings were built: no need to check again.
    sections = {
        name: getattr(config, name).model_copy(update=update) for name, update in changes.items()
    }
    return config.model_copy(update=sections | {"vary": {}})


def _pick(section: str, setting: str, values: list[Choice], draw: float) -> Choice:
    if not is_span(values):
        return values[int(draw * len(values))]
    low, high = float(values[0]), float(values[1])
    if (section, setting) in _WHOLE_NUMBERS:
        return int(low + draw * (high + 1 - low))
    return low + draw * (high - low)
