"""GAIA: from the log of a drive past a work zone to the cones and the boundary.

The names below are the public interface; each is loaded when it is first used, so that importing
the package (and the command line's help) costs nothing.

>>> import gaia_uwb
>>> result = gaia_uwb.reconstruct("sim:lane-closure")  # or the folder of a log
>>> result.boundary.status.value
'ok'
"""

import lazy_loader

__version__ = "0.1.0"

__getattr__, _, __all__ = lazy_loader.attach_stub(__name__, __file__)


def __dir__() -> list[str]:
    """List the public names, loaded or not, for completion in a shell or notebook."""
    return [*__all__, "__version__"]
