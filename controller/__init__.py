"""The mathematics: contacts, the wrench problem, its solvers, control laws, references and plans. It uses no MuJoCo."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
