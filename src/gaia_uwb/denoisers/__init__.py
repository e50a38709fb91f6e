"""Denoisers: from an Episode to DenoisedRanges. A registry, and one file per method.

Each entry is imported when it is used and declares its options (``Options``, a strict model with
physical names, units and bounds) and its abilities (``uses_pose``, ``locates``).

>>> from gaia_uwb.denoisers import DENOISERS, make_denoiser
>>> sorted(DENOISERS)
['gaia', 'gaia-set', 'kalman', 'median', 'mlp', 'pose-kalman', 'pose-mlp', 'raw']
>>> make_denoiser("median", {"window_steps": 7}).options.window_steps
7
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from importlib import import_module
from typing import Any

from pydantic import ValidationError

from gaia_uwb._text import shown
from gaia_uwb.denoisers._base import Denoiser, Options
from gaia_uwb.errors import ConfigError

__all__ = [
    "DENOISERS",
    "Denoiser",
    "Options",
    "denoiser_class",
    "denoiser_identity",
    "make_denoiser",
]

DENOISERS: dict[str, str] = {
    "raw": "gaia_uwb.denoisers.raw:Raw",
    "median": "gaia_uwb.denoisers.median:Median",
    "kalman": "gaia_uwb.denoisers.kalman:Kalman",
    "pose-kalman": "gaia_uwb.denoisers.pose_kalman:PoseKalman",
    "mlp": "gaia_uwb.denoisers.neural:NeuralMlp",
    "pose-mlp": "gaia_uwb.denoisers.neural:NeuralPoseMlp",
    "gaia": "gaia_uwb.denoisers.neural:NeuralGaia",
    "gaia-set": "gaia_uwb.denoisers.gaia_set:NeuralGaiaSet",
}


def denoiser_class(name: str) -> type[Denoiser]:
    """Import the class behind a name; its ``Options`` and ``uses_pose`` say what it can do.

    Parameters
    ----------
    name
        A key of ``DENOISERS``.

    Raises
    ------
    ConfigError
        If no denoiser has this name; the message lists those that exist.
    """
    if name not in DENOISERS:
        raise ConfigError(f"no denoiser is called {shown(name)}; there are {', '.join(DENOISERS)}")
    module, _, attribute = DENOISERS[name].partition(":")
    found: type[Denoiser] = getattr(import_module(module), attribute)
    return found


def make_denoiser(name: str, options: Mapping[str, Any] | None = None) -> Denoiser:
    """Build a denoiser from its name and options.

    Parameters
    ----------
    name
        A key of ``DENOISERS``; for a trained network also ``NAME:MODEL``, which sets its option
        ``model``.
    options
        Values of its options; what is left out keeps its default.

    Raises
    ------
    ConfigError
        If no denoiser has this name, or an option is unknown or impossible; the message lists
        what exists.

    Examples
    --------
    >>> make_denoiser("kalman", {"acceleration_density_m2ps3": 2.0}).options.smooth
    True
    >>> make_denoiser("median", {"window": 5})
    Traceback (most recent call last):
    gaia_uwb.errors.ConfigError: denoiser 'median': window: Extra inputs are not permitted; its \
options are spike_neighbours, spike_threshold_sigma, spike_threshold_m, window_steps
    """
    name, colon, model = name.partition(":")
    kind = denoiser_class(name)
    try:
        checked = kind.Options.model_validate(
            dict(options or {}) | ({"model": model} if colon else {})
        )
    except ValidationError as error:
        problems = "; ".join(
            f"{'.'.join(map(str, e['loc'])) or 'options'}: {e['msg']}" for e in error.errors()
        )
        known = ", ".join(kind.Options.model_fields) or "none"
        raise ConfigError(f"denoiser {name!r}: {problems}; its options are {known}") from error
    return kind(checked)


def denoiser_identity(name: str) -> list[Any]:
    """Return what, beside the code, makes a denoiser what it is, for checksums.

    Parameters
    ----------
    name
        Like :func:`make_denoiser`.

    Returns
    -------
    list
        Its kind, its options and, of a trained network, the checksum of its description, which
        has those of all its files; not where these lie.

    Raises
    ------
    ConfigError
        Like :func:`make_denoiser`.
    """
    from gaia_uwb.models.checkpoint import DESCRIPTION, find_model

    kind = name.partition(":")[0]
    options = make_denoiser(name).options.model_dump()
    model = options.pop("model", None)
    if model is None:
        return [kind, options]
    description = (find_model(kind, model) / DESCRIPTION).read_bytes()
    return [kind, options, hashlib.sha256(description).hexdigest()]
