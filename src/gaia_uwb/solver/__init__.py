"""Many anchors from many ranges at once: one compiled solver under every step that locates."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
