"""Arm descriptions: parameters of an arm that a user can measure."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
