"""Make work-zone feeds of a reconstruction, and check feeds (WZDx 4.2 and CWZ 1.0)."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
