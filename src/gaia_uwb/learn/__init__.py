"""Train networks: sets, recipes, one training loop for both families; needs PyTorch."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
