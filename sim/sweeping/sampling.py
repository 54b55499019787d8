"""Which members of a set the worlds of a sweep are: drawn at random, spread evenly, or at the vertices."""

import warnings
from collections.abc import Mapping

import numpy as np
from pivoting.controller.uncertainty.uncertainty import Interval
from pivoting.sim.world_values import WorldValues, drawn_values, values_at, vertex_values

SAMPLING = {  # with what it means
    "drawn": "at random, independently; the one of which a bound on the share of failures can be told",
    "sobol": "a scrambled Sobol sequence, which fills the set evenly",
    "lhs": "a Latin hypercube, which fills the range of each key evenly",
    "vertices": "each vertex in turn",
}


def sampled_values(sets: Mapping[str, Interval], sampling: str, seed: int, worlds: int) -> WorldValues:
    """What each of the worlds has of its own.

    Args:
        sets: by key.  sampling: of `SAMPLING`.
    """
    from scipy.stats import qmc

    if sampling == "drawn":
        return drawn_values(sets, seed, worlds, 0)
    if sampling == "vertices":
        return vertex_values(sets, worlds, 0)
    engine = qmc.Sobol(len(sets), rng=seed) if sampling == "sobol" else qmc.LatinHypercube(len(sets), rng=seed)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # of a number of points that is no power of 2
        return values_at(sets, np.asarray(engine.random(worlds)))
