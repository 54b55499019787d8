"""MJCF scenes and what reads them: from a model to what a controller needs to know about a body in it."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
