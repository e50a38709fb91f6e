"""The denoisers by name, each imported when it is used: ours, and those of installed packages.

A package adds a denoiser by an entry point of the group ``gaia_uwb.denoisers``, in its
``pyproject.toml``:

.. code-block:: toml

    [project.entry-points."gaia_uwb.denoisers"]
    mine = "my_package.mine:Mine"

``Mine`` is a subclass of :class:`gaia_uwb.denoisers.Denoiser`, or, if it treats every anchor on its
own, of :class:`gaia_uwb.denoisers.ColumnDenoiser`. Our own names cannot be taken.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from importlib import import_module
from importlib.metadata import EntryPoint, entry_points
from typing import Any

from pydantic import ValidationError

from gaia_uwb._shared import ConfigError, shown
from gaia_uwb.denoisers._base import Denoiser

ENTRY_POINTS = "gaia_uwb.denoisers"
"""The group in which installed packages name their denoisers."""

DENOISERS: dict[str, str] = {
    "raw": "gaia_uwb.denoisers.raw:Raw",
    "median": "gaia_uwb.denoisers.median:Median",
    "kalman": "gaia_uwb.denoisers.kalman:Kalman",
    "pose-kalman": "gaia_uwb.denoisers.pose_kalman:PoseKalman",
    "mlp": "gaia_uwb.denoisers.window_networks:WindowMlp",
    "pose-mlp": "gaia_uwb.denoisers.window_networks:WindowPoseMlp",
    "gaia": "gaia_uwb.denoisers.window_networks:WindowGaia",
    "gaia-set": "gaia_uwb.denoisers.gaia_set:ZoneNetwork",
}


def denoiser_class(name: str) -> type[Denoiser]:
    """Import the class behind a name; its ``Options`` and ``uses_pose`` say what it can do.

    Parameters
    ----------
    name
        A key of ``DENOISERS``, or the name of an installed package's entry point.

    Raises
    ------
    ConfigError
        If no denoiser has this name (the message lists those that exist), or an installed package
        has one that cannot be loaded.
    """
    if name not in DENOISERS:
        return _load(name, _installed(name))
    module, _, attribute = DENOISERS[name].partition(":")
    found: type[Denoiser] = getattr(import_module(module), attribute)
    return found


def _installed(name: str) -> EntryPoint:
    """Return the entry point of an installed package's denoiser."""
    found = entry_points(group=ENTRY_POINTS)
    named = list(found.select(name=name))
    if not named:
        names = ", ".join([*DENOISERS, *sorted(found.names - set(DENOISERS))])
        raise ConfigError(f"no denoiser is called {shown(name)}; available: {names}")
    if len({point.value for point in named}) > 1:
        packages = ", ".join(sorted(_package(point)[0] for point in named))
        raise ConfigError(f"several packages have a denoiser called {shown(name)}: {packages}")
    return named[0]


def _load(name: str, point: EntryPoint) -> type[Denoiser]:
    where = f"denoiser {shown(name)} of {' '.join(_package(point))}"
    try:
        kind = point.load()
    except Exception as error:  # whatever somebody else's module does when it is imported
        what = f"{type(error).__name__}: {error}"
        raise ConfigError(f"{where} cannot be loaded ({what})") from error
    if not (isinstance(kind, type) and issubclass(kind, Denoiser)):
        raise ConfigError(f"{where}: {point.value} is not a subclass of gaia_uwb's Denoiser")
    return kind


def _package(point: EntryPoint) -> tuple[str, str]:
    """Return the name and the version of the package that an entry point belongs to."""
    return (
        ("an unknown package", "") if point.dist is None else (point.dist.name, point.dist.version)
    )


def make_denoiser(name: str, options: Mapping[str, Any] | None = None) -> Denoiser:
    """Build a denoiser from its name and options.

    Parameters
    ----------
    name
        Like that of :func:`denoiser_class`; for a trained network also ``NAME:MODEL``, which sets
        its option ``model``.
    options
        Values of its options; the others keep their defaults.

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
    gaia_uwb.ConfigError: denoiser 'median': window: Extra inputs are not permitted; its \
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
    """Return what, besides the code, defines a denoiser, for checksums.

    Parameters
    ----------
    name
        Like :func:`make_denoiser`.

    Returns
    -------
    list
        Its kind, its options and, of a trained network, the checksum of its description, which
        has those of all its files; not where these lie. Of an installed package also its name and
        version.

    Raises
    ------
    ConfigError
        Like :func:`make_denoiser`.
    """
    from gaia_uwb.models import DESCRIPTION, find_model

    kind = name.partition(":")[0]
    options = make_denoiser(name).options.model_dump()
    if kind not in DENOISERS:
        return [kind, options, *_package(_installed(kind))]
    model = options.pop("model", None)
    if model is None:
        return [kind, options]
    description = (find_model(kind, model) / DESCRIPTION).read_bytes()
    return [kind, options, hashlib.sha256(description).hexdigest()]
