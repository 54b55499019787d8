"""Runs whose arrays are altered after the fact, to see what is made of what cannot be simulated on purpose."""

from dataclasses import replace
from typing import Any

import numpy as np
from pivoting.sim import Run
from pivoting.sim.pipeline.stages import POSITION, VELOCITY

COLUMNS = {"position": POSITION, "velocity": VELOCITY}


def altered(run: Run, **arrays: Any) -> Run:
    """The run with other arrays, by the names that they have in `Run` or in its log; forces are given in table axes."""
    states, answers, log = run.log.states.copy(), run.log.answers, run.log
    for name, values in arrays.items():
        if name in COLUMNS:
            states[..., COLUMNS[name]] = values
        elif name == "status":
            answers = answers._replace(status=values)
        elif name in ("required", "wrench", "force", "residual"):
            answers = answers._replace(values=answers.values.copy())
            getattr(answers, name)[...] = values
        elif name == "force_measured":
            with np.errstate(invalid="ignore"):
                force = values @ np.linalg.pinv(run.table_axes @ run.space.force_map)
            log = log._replace(contacts=log.contacts._replace(force=force))
        else:
            log = log._replace(**{name: values})
    return replace(run, log=log._replace(states=states, answers=answers))
