"""What a log holds: the path, the readings, and what is known beforehand; frozen and checked."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
