"""Judge: how good a log, a result, a method or a bound is, and what limited a result."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
