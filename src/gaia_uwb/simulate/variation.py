"""What differs from one pass of a batch to the next, and which layouts are kept for the test.

A layout's *cell* is its kind of zone, its sides, its number of anchors, its posted speed and the
lengths of its buffer and work space in steps of 10 m. A fifth of all cells, picked by a checksum,
belongs to the test; so a network that is tested there has never seen such a layout.
"""

from __future__ import annotations

from zlib import crc32

import numpy as np

from gaia_uwb._shared import ConfigError
from gaia_uwb.simulate.rows import PassRows, PassSettings
from gaia_uwb.simulate.settings import SECTIONS, Choice, PassConfig, is_span

_CELL_M = 10.0
_TEST_PART = 5  # one cell in five is the test's
_TRIES = 1000
_WHOLE_NUMBERS = {
    f"{section}.{setting}"
    for section, model in SECTIONS.items()
    for setting, field in model.model_fields.items()
    if field.annotation is int
}


def draw_settings(config: PassConfig, rng: np.random.Generator) -> dict[str, Choice]:
    """Draw what a batch varies, for one pass.

    Parameters
    ----------
    config
        Settings of the batch.
    rng
        Source of the numbers.

    Returns
    -------
    dict
        For each ``section.setting`` that varies its value in this pass.

    Raises
    ------
    ConfigError
        If no layout that the settings give is in the part that ``split`` asks for.

    Examples
    --------
    >>> batch = PassConfig(vary={"closure.n_anchors": [4, 12]})
    >>> draw_settings(batch, np.random.default_rng(0))
    {'closure.n_anchors': 9}
    """
    for _ in range(_TRIES):
        draws = rng.random(len(config.vary)).tolist() if config.vary else []
        drawn = {
            key: _pick(key, values, draw)
            for (key, values), draw in zip(config.vary.items(), draws, strict=True)
        }
        if config.split == "all" or config.split == layout_part(PassRows.of(config, [drawn])):
            return drawn
    raise ConfigError(f"split: these settings have no layout in the {config.split} part")


def layout_part(config: PassSettings) -> str:
    """Tell to which part a layout belongs: ``training`` or ``test``.

    Parameters
    ----------
    config
        Settings of one pass.
    """
    closure = config.closure
    cell = (
        f"{closure.kind} {closure.both_sides} {closure.n_anchors} {config.road.speed_limit_mph} "
        f"{closure.buffer_m // _CELL_M:.0f} {closure.work_m // _CELL_M:.0f}"
    )
    return "test" if crc32(cell.encode()) % _TEST_PART == 0 else "training"


def _pick(key: str, values: list[Choice], draw: float) -> Choice:
    if not is_span(values):
        return values[int(draw * len(values))]
    low, high = float(values[0]), float(values[1])
    if key in _WHOLE_NUMBERS:
        return int(low + draw * (high + 1 - low))
    return low + draw * (high - low)
