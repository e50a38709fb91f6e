"""Reconstruct many zones, in processes or on the workers of a Dask scheduler."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
