"""The margins of the wrenches that acted in one world of a finished run, and what its guarantee cost."""

from math import ceil
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pivoting.controller.uncertainty.grip import Beliefs, GivenWrench
from pivoting.controller.uncertainty.margins import slack_and_share, wrench_scale
from pivoting.controller.uncertainty.price import nominal, wrench_size
from pivoting.controller.validate import frozen
from pivoting.controller.wrench_controller import WrenchController
from pivoting.sim.joint_drag import drag_wrench
from pivoting.sim.pipeline.law_control import LawSolver
from pivoting.sim.pipeline.stages import ANGULAR_VELOCITY, ORIENTATION, Answers, Desired, States, desired_values

if TYPE_CHECKING:
    from pivoting.sim.run import Run

Array = NDArray[np.float64]
MOMENTS = 100  # at most, evenly spaced over a run; on an edge each takes 40 ms


class MarginsOverTime(NamedTuple):
    """Of one world at M steps, for the set of its controller; read-only. nan where a stance has no margins.

    Attributes:
        steps: (M,) their numbers.
        slack: (M,) [N], share: (M,) and wrench_scale: (M,) of the wrench that acted, at the state that the controller
            was told; see `Margins`.
        price, price_objective: (M,) of the law's answer there, on the reference of the scenario; see `Price`.
    """

    steps: NDArray[np.intp]
    slack: Array
    share: Array
    wrench_scale: Array
    price: Array
    price_objective: Array

    def figures(self) -> dict[str, float]:
        """The least of them, and of what is paid the median."""
        out = {f"{name}_min": _least(getattr(self, name)) for name in ("slack", "share", "wrench_scale")}
        for name in ("price", "price_objective"):
            values = getattr(self, name)
            out[f"{name}_median"] = (
                float(np.median(values[np.isfinite(values)])) if np.isfinite(values).any() else np.nan
            )
        return {"slack_min_N": out.pop("slack_min"), **out}


def margins_over_time(run: "Run", world: int) -> MarginsOverTime | None:
    """Of one world at no more than `MOMENTS` steps, the last among them; None if its controller has no set.

    All is computed here, of the states and the wrenches that were logged. Stances on more than two contacts have a
    price, but no margins.
    """
    if run.controller_of(world).uncertainty is None:
        return None
    steps = np.arange(run.status.shape[1])
    steps = np.union1d(steps[:: ceil(steps.size / MOMENTS)], steps[-1:])
    seen = next(each for each in (run.log.estimated, run.log.measured, run.log.states) if each is not None)
    states = np.ascontiguousarray(seen[world, steps])
    applied = run.wrench if run.log.acting is None else run.log.acting
    applied = np.nan_to_num(applied[world, steps])  # without an answer none is applied
    found = np.full((5, steps.size), np.nan)
    stance = np.zeros(steps.size, np.int8) if run.stance is None else run.stance[world, steps]
    for number in np.unique(stance):
        controller = run.controller_of(world, int(number))
        rows = np.flatnonzero(
            (stance == number) & np.isfinite(states).all(axis=1) & (np.abs(applied) < 1e30).all(axis=1)
        )
        external = _external(run, controller, steps[rows])
        if len(controller.contacts) <= 2:
            found[:3, rows] = _margins(controller, states[rows], applied[rows] + external)
            found[0, rows] *= run.unit
        found[3:, rows] = _price(run, controller, states[rows], steps[rows], external)
    return MarginsOverTime(frozen(steps), *map(frozen, found))


def _external(run: "Run", controller: WrenchController, steps: NDArray[np.intp]) -> Array:
    """(M or 1, nw) the drag of joints that the law has reckoned with."""
    return drag_wrench(run.attached.body, controller, *(each[steps] for each in run.desired))


def _margins(controller: WrenchController, states: Array, wrenches: Array) -> Array:
    """(3, M) slack, share and scale; the search for a scale begins at that of the step before."""
    beliefs, found, near = Beliefs(controller), np.empty((3, len(states))), 1.0
    for i, (state, wrench) in enumerate(zip(states, wrenches, strict=True)):
        grip = GivenWrench(controller, state[ORIENTATION], state[ANGULAR_VELOCITY], wrench)
        found[:2, i] = slack_and_share(beliefs, grip)
        found[2, i] = scale = wrench_scale(beliefs, grip, near)
        near = scale if 0.0 < scale < np.inf else near
    return found


def _price(run: "Run", controller: WrenchController, states: Array, steps: NDArray[np.intp], external: Array) -> Array:
    """(2, M) the prices, by the compiled step of the run, for which the steps are so many worlds."""
    bounds = run.scenario.absolute(run.load).bounds(run.unit)
    desired = Desired(desired_values(*(each[steps] for each in run.desired)))
    none = np.zeros((len(steps), 0))
    sizes = []
    for each in (controller, nominal(controller)):
        out = Answers.empty((len(steps),), *each.widths)
        LawSolver([each], bounds).solve(States(states, none, none, np.zeros(len(steps))), desired, out, external)
        force = np.einsum("mi,ij,mj->m", out.force, each.Q_f, out.force)
        size = wrench_size(each.Q_w, out.wrench)
        sizes.append(np.stack([size, 0.5 * (size**2 + force)]))
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(sizes[0] / sizes[1])


def _least(values: Array) -> float:
    """Of those that are there."""
    return float(np.nanmin(values)) if not np.isnan(values).all() else np.nan
