"""The data sets that have a name, and the modules that read them.

A registered data set lives in a folder of its name inside the data folder (``fetch.data_folder``).
Its module is imported when it is used.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from typing import Any


@dataclass(frozen=True)
class Dataset:
    """One entry of the registry.

    Parameters
    ----------
    description
        What it is, in one line.
    parts
        How its parts are named.
    licence
        SPDX identifier.
    citation
        What to cite.
    loader
        ``"module:function"``; the function takes the data set's folder and a part and returns
        a list of scenes.
    checker
        ``"module:function"``; the function takes the folder and returns a check report
        on what the scenes do not show, if there is such a thing.
    """

    description: str
    parts: str
    licence: str
    citation: str
    loader: str
    checker: str | None = None


REGISTRY = {
    "outdoor-uwb": Dataset(
        description="8 walks of 3 to 5 minutes around 4 anchors, with and without line of sight",
        parts="LOS or NLOS, /A or /B, /1 to /4: NLOS/B/4 is one walk, NLOS four, no part all",
        licence="Apache-2.0",
        citation="Comprehensive outdoor UWB dataset, Scientific Data (2025), "
        "https://doi.org/10.1038/s41597-025-05887-9",
        loader="gaia_uwb.logs.outdoor_uwb:load",
        checker="gaia_uwb.evaluate.outdoor_check:check_outdoor_static",
    ),
}


def import_function(place: str) -> Callable[..., Any]:
    """Return the function at ``"module:function"``."""
    module, name = place.split(":")
    function: Callable[..., Any] = getattr(import_module(module), name)
    return function
