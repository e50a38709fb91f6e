"""Locate anchors: both places of each that the ranges allow, from one drive or several."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
