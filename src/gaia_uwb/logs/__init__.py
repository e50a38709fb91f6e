"""Read logs of every format, and write GAIA's own; each becomes a :class:`~gaia_uwb.Scene`."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
