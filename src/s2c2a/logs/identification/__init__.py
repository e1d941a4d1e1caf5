"""System identification: fit of a simulated arm to a recording of an arm."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
