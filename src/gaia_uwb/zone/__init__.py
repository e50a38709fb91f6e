"""Take all anchors together: the side of each, what a user knows of them, and the boundary."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
