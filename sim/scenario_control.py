"""The control of a scenario: its law on its reference, a horizon, bounds, stances; and the stages around it."""

from collections.abc import Sequence
from itertools import chain
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from pivoting.controller.validate import fail
from pivoting.models.errors import ModelError
from pivoting.sim.joint_drag import drag_wrench
from pivoting.sim.pipeline.bounded_control import BoundedControl
from pivoting.sim.pipeline.law_control import LawControl, LawSolver
from pivoting.sim.pipeline.own_control import OwnControl, OwnControlFunction
from pivoting.sim.pipeline.plan_log import Event
from pivoting.sim.pipeline.stages import Control, Observe, Stages, build_stages, desired_values
from pivoting.sim.pipeline.stance_control import StanceControl
from pivoting.sim.run_setup import Begun
from pivoting.sim.scenario_horizon import plan_playback, receding_horizon_control
from pivoting.sim.stances import Stance


class Decided(NamedTuple):
    """What decides.

    Attributes:
        control: the scenario's own, or the user's.  asked: what is asked at every step, with what stands around it.
        per_step: the law that the first stance ends in.
        stages: around the control.
    """

    control: Control
    asked: Control
    per_step: LawControl
    stages: Stages

    @property
    def events(self) -> list[Event]:
        """What a user has to know of, of the plans and of all stages."""
        inner = self.control.inner if isinstance(self.control, BoundedControl) else self.control
        return [event for each in (inner, *chain(*self.stages)) for event in getattr(each, "events", ())]


def stages_of(begun: Begun, observe: Observe | None = None) -> Stages:
    """The stages around the control that the scenario asks for, and an observer of the user's own."""
    body = begun.belief.attached.body
    if begun.case.disturbance and body.drag is not None:
        raise ModelError(
            f"body = {body.name!r}: a disturbance observer knows no joint damping or friction; must have none"
        )
    return build_stages(begun.case.stages, begun.setting, observe)


def laws_of(begun: Begun, stages: Stages) -> list[LawSolver]:
    """The scenario's law, within its bounds, in each of its stances."""
    return [LawSolver(stance.controllers, begun.bounds, stages.correct) for stance in begun.belief.stances]


def decide(
    begun: Begun,
    stages: Stages,
    solvers: Sequence[LawSolver],
    own: OwnControlFunction | None = None,
    open_loop: bool = False,
) -> Decided:
    """The scenario's control, which ends in these laws, or the user's own."""
    case, stances, dt = begun.case, begun.belief.stances, begun.world.dt
    laws = [_law_control(begun, *each) for each in zip(solvers, stances, strict=True)]
    planned = open_loop or case.plan_hz is not None
    if len(stances) > 1 and (planned or stages.correct):
        raise fail(
            "landing", "held", "ignored with a plan, integral action or a disturbance observer, which know one stance"
        )
    control: Control
    if own is not None:
        control = OwnControl(own, begun.told, dt, begun.setting.first_world)
    elif len(stances) == 1:
        control = _planned(begun, solvers[0], open_loop) if planned else laws[0]
        control = control if open_loop else _bounded(begun, control, stances[0])  # a plan is within them
    else:
        controls = [_bounded(begun, law, stance) for law, stance in zip(laws, stances, strict=True)]
        control = StanceControl(stances, controls, dt, begun.setting.worlds, begun.steps)
    return Decided(control, stages.around(control, desired_values(*begun.told)), laws[0], stages)


def _law_control(begun: Begun, solver: LawSolver, stance: Stance) -> LawControl:
    """The law of a stance on the scenario's own reference."""
    return LawControl(solver, begun.told, known_drag(begun, stance))


def known_drag(begun: Begun, stance: Stance) -> NDArray[np.float64]:
    """(N+1 or 1, W or 1, nw) the drag of the body's joints on the reference, object axes."""
    body = begun.belief.attached.body
    return np.stack([drag_wrench(body, controller, *begun.told) for controller in stance.controllers], axis=1)


def _bounded(begun: Begun, control: Control, stance: Stance) -> Control:
    """A control within the scenario's bounds, where it has any."""
    if not begun.bounds.any:
        return control
    return BoundedControl(control, stance.controllers, begun.bounds, begun.world.dt, known_drag(begun, stance))


def _planned(begun: Begun, law: LawSolver, open_loop: bool) -> Control:
    """The control that makes plans, or plays one."""
    belief, dt = begun.belief, begun.world.dt
    if belief.attached.body.drag is not None:
        name = belief.attached.body.name
        raise ModelError(f"body = {name!r}: a plan knows no joint damping or friction; must have none")
    if not open_loop:
        worlds = begun.setting.worlds
        return receding_horizon_control(begun.case, belief, law, begun.follow, worlds, dt, begun.steps)
    if len(belief.controllers) > 1:
        raise fail("controller", f"{len(belief.controllers)} of them", "one in open loop, where one plan is played")
    return plan_playback(begun.case, belief, begun.follow, dt, begun.steps)
