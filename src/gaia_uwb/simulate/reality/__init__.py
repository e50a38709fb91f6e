"""Compare simulated range errors with real ones, fit them, and replay real ones."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
