"""Locate each anchor by itself: both places that its ranges allow, from one pass or several."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
