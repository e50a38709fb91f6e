"""The library's front door: a reconstruction from whatever names a log.

>>> from gaia_uwb.api import reconstruct
>>> result = reconstruct("sim:lane-closure")
>>> [anchor.status.value for anchor in result.anchors[:3]]
['ok', 'ok', 'ok']
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from gaia_uwb import pipeline
from gaia_uwb.config import PipelineConfig
from gaia_uwb.pipeline import Reconstruction
from gaia_uwb.scene import Scene
from gaia_uwb.sources import read


def reconstruct(
    log: Scene | str | Path | Sequence[Scene | str | Path],
    config: PipelineConfig = PipelineConfig(),
    *,
    data_dir: Path | None = None,
) -> Reconstruction:
    """Reconstruct a work zone from the log of one drive, or of several drives past it.

    Parameters
    ----------
    log
        A :class:`Scene`, or what :func:`read` takes: the place of a log, the name of a part of a
        data set, or a simulated pass such as ``"sim:lane-closure"``. A list of these are passes of
        one zone, which are fused. Their truth is not looked at.
    config
        All settings.
    data_dir
        Folder that holds the data sets; by default ``GAIA_DATA_DIR``, else the user's cache.

    Returns
    -------
    Reconstruction
        Ranges, anchors and boundary; positions are east and north in metres in the log's local
        frame, of several logs in that of the first by name. ``status`` says whether the boundary
        can be relied upon, and ``reasons`` why not.

    Raises
    ------
    SourceError
        If there is no such log, or several.
    InputError
        If the log is wrong (the message names the file and the row), the clocks do not overlap, or
        no range is usable, or passes have no frame in common or hold the same drive.
    ConfigError
        If a ``gaia.yaml`` is wrong or the denoiser's name is unknown.

    Examples
    --------
    >>> import gaia_uwb
    >>> result = gaia_uwb.reconstruct("sim:straight/4")
    >>> result.status.value
    'unreliable'
    >>> print(result.anchors[0].status.message)
    side unknown: the mirror image across the path fits nearly as well

    A second pass in another lane settles the sides:

    >>> from gaia_uwb.simulate import PRESETS, simulate_zone
    >>> result = gaia_uwb.reconstruct(simulate_zone(PRESETS["straight"], seed=0))
    >>> [anchor.status.value for anchor in result.anchors[:3]]
    ['ok', 'ok', 'ok']
    """
    if isinstance(log, (Scene, str, Path)):
        return pipeline.reconstruct(_scene(log, data_dir), config)
    return pipeline.reconstruct([_scene(each, data_dir) for each in log], config)


def _scene(log: Scene | str | Path, data_dir: Path | None) -> Scene:
    return log if isinstance(log, Scene) else read(log, data_dir=data_dir)
