"""The smallest wrench that balances or pivots an object on a frictional contact, proved in MuJoCo.

The rooms are `pivoting.controller` (the mathematics), `pivoting.models` (scenes) and `pivoting.sim` (the closed loop).
"""

import os

import lazy_loader

__version__ = "0.2.0"

_here = os.path.dirname(os.path.abspath(__file__))
if not os.path.isdir(os.path.join(_here, "controller")):  # a checkout: the rooms lie beside this folder
    __path__.append(os.path.dirname(_here))

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
