"""Shared by all other folders: arrays, checks, errors, files, text, figures; nothing about UWB."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
