"""Read the serial logs of UWB tags: stamped lines of text, in the form of one device or another."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
