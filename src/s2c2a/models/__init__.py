"""Learned models: forward models (C2S) and configuration controllers (C2A)."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
