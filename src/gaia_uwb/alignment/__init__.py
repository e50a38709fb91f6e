"""Bring a log onto one timeline: clock offset, spike gate, gaps, and the radios' range bias."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
