"""The passes that a source's name asks for: what follows ``sim:``."""

from __future__ import annotations

from dataclasses import replace

from gaia_uwb._shared import ConfigError, SourceError
from gaia_uwb.scene import Scene
from gaia_uwb.simulate.batches import simulate
from gaia_uwb.simulate.presets import DEFAULT_PRESET, find_preset


def load(part: str = "") -> list[Scene]:
    """Simulate the passes that a source's name asks for.

    Parameters
    ----------
    part
        ``PRESET/SEED/N``, ``PRESET/SEED`` (one pass), ``PRESET`` (seed 0) or nothing (the default
        preset): what follows ``sim:`` in a source's name.

    Raises
    ------
    SourceError
        If there is no such preset, the seed is no whole number, or N none of at least 1.

    Examples
    --------
    >>> [scene.name for scene in load("straight/7")]
    ['sim:straight/7']
    """
    preset, *numbers = (part or DEFAULT_PRESET).split("/")
    try:
        config = find_preset(preset)
    except ConfigError as error:
        raise SourceError(f"sim:{part}: {error}") from error
    if len(numbers) > 2 or not all(text.isascii() and text.isdigit() for text in numbers):
        problem = f"expected whole numbers as seed and count, got {'/'.join(numbers)!r}"
        raise SourceError(f"sim:{part}: {problem}")
    seed, n = [*map(int, numbers), 0, 1][:2] if len(numbers) != 1 else (int(numbers[0]), 1)
    if n < 1:
        raise SourceError(f"sim:{part}: expected at least one pass, got 0")
    name = f"sim:{preset}/{seed}"
    return [
        replace(scene, name=name if n == 1 else f"{name}/{k}")
        for k, scene in enumerate(simulate(config, n, seed))
    ]
