"""What the controller believes of a scenario: the object, where it is placed, and the controller made for them."""

from dataclasses import replace
from functools import partial
from typing import NamedTuple

import mujoco
import numpy as np
from pivoting.controller.uncertainty.uncertainty import Uncertainty
from pivoting.controller.validate import fail
from pivoting.controller.wrench_controller import WrenchController
from pivoting.models.friction_coefficient import read_friction
from pivoting.models.names import body_id, geom_id
from pivoting.models.scenes import Scene
from pivoting.sim.attachment import Attached, attach
from pivoting.sim.pace import closing_force
from pivoting.sim.placement import Placement, placed
from pivoting.sim.scenario_uncertainty import refuse_across_the_plane, scenario_uncertainty
from pivoting.sim.scenarios.intervals import middle
from pivoting.sim.scenarios.scenario import PACE, Scenario
from pivoting.sim.scenarios.scenario_keys import CONTROL_KEYS, LOWEST
from pivoting.sim.stances import Stance

Controllers = WrenchController | list[WrenchController] | tuple[WrenchController, ...] | None
"""What may be given in place of a scenario's own controller: another, or one for each world."""


class Believed(NamedTuple):
    """scene: as the controller knows it.  attached: the controller on it.  placement: of the object there.

    stances: one after another; the first controller of the first is that of `attached`.
    uncertainty: the set about what it knows, in which it believes the world to be; None: it knows it exactly.
    """

    scene: Scene
    attached: Attached
    placement: Placement
    stances: tuple[Stance, ...]
    uncertainty: Uncertainty | None = None

    @property
    def controllers(self) -> tuple[WrenchController, ...]:
        """Of the first stance: one for each world, or one that they share."""
        return self.stances[0].controllers

    def part(self, first: int, worlds: int) -> "Believed":
        """The same for some of the worlds, from that with the index `first` on."""
        if len(self.controllers) == 1:
            return self
        some = slice(first, first + worlds)
        stances = tuple(Stance(each.held, each.controllers[some]) for each in self.stances)
        attached = Attached(self.attached.model, self.attached.body, stances[0].controllers[0])
        return self._replace(attached=attached, stances=stances)


def believe(case: Scenario, read: Scene, worlds: int = 1, given: Controllers = None) -> Believed:
    """What the scenario's controller, or others, believe.

    Args:
        read: the scene of the scenario's file.
        given: in place of the scenario's own controller another, or one for each of the worlds.

    Raises:
        ModelError: the object cannot be served, or placed on its contact.
        ValueError: a controller that is given is not for these contacts.
    """
    scene = read.changed(case.believed)
    case = replace(case, body=scene.body, support=scene.support)
    there = placed(case, scene.compiled, read.unit)
    refuse_across_the_plane(case, there.body)
    believed = scenario_uncertainty(case, there.body, read.unit)
    if case.chosen and case.mu is None:  # what the file itself says of friction holds: it may have none
        read_friction(read.read, body_id(read.read, read.body), geom_id(read.read, read.support), there.contacts)
    controllers = _given(given, worlds)
    for controller in controllers:
        _check(controller, case, there)
    floors = [controller.belief.contacts.f_min.max() for controller in controllers]
    floor = min(floors, default=case.f_min or 0.0)
    if there.load.force == 0.0 and floor == 0.0:
        raise fail("gravity", 0.0, "> 0, or f_min > 0: without a load nothing presses the object on its support")
    K, L = len(there.contacts), len(there.landing)
    if controllers:
        attached = Attached(scene.compiled, there.body, controllers[0])
        return Believed(scene, attached, there, (Stance.of(K * [True], controllers),), believed)
    own = partial(
        attach,
        scene.compiled,
        body=case.body,
        law=case.control_law(),
        mu=middle(case.mu),
        margin=case.margin,
        f_min=_floor(case.absolute(there.load), there) / read.unit,
        Q_w=case.wrench_weight(there.body.dim, read.unit),
        support=case.support,
        uncertainty=believed if case.guarantee == "set" else None,
    )
    attached = own(contacts=list(there.contacts), radius=there.radius)
    if case.landing == "ignored":
        return Believed(scene, attached, there, (Stance.of(K * [True], (attached.controller,)),), believed)
    if refused := _no_landing(case, scene.compiled, there):
        raise fail("landing", "held", f"ignored: {refused}")
    landed = own(contacts=[*there.contacts, *there.landing]).controller
    on_contact = Stance.of(K * [True] + L * [False], (attached.controller,))
    return Believed(scene, attached, there, (on_contact, Stance.of((K + L) * [True], (landed,))), believed)


def _no_landing(case: Scenario, model: mujoco.MjModel, there: Placement) -> str:
    """Why the object cannot be held on what it lands on; "" if it can."""
    first, index = int(model.body_geomadr[there.body.index]), there.body.index
    kinds = model.geom_type[first : first + int(model.body_geomnum[index])]
    if there.body.dim == 2 or case.about != "tilt":
        return "only what is tilted in space lands on a face"
    if kinds.tolist() != [int(mujoco.mjtGeom.mjGEOM_BOX)] or len(there.landing) != 2:
        return "of other objects than a single box, on an edge, it is not known that they touch at their corners alone"
    if not case.limits.contacts_end:
        return "nothing is to land without limit.contacts_end, the contacts at the end"
    whole = case.absolute(there.load)
    angle = whole.samples(np.linspace(0.0, whole.duration, PACE))[0]
    lowest = int(angle.argmin())
    if angle[-1] > np.deg2rad(LOWEST) or np.ptp(angle[lowest:]) > np.deg2rad(LOWEST):
        return f"the reference {whole.reference} does not set it down and leave it there, as arc to theta_end=0 does"
    if whole.force_rate is not None or whole.moment_rate is not None:
        return "a bound on a rate does not let the wrench change as the contacts do"
    return ""


def _given(given: Controllers, worlds: int) -> tuple[WrenchController, ...]:
    """The controllers that were given; none, where the scenario's own is to be made."""
    if given is None:
        return ()
    if not isinstance(given, list | tuple):
        return (given,)
    if len(given) != worlds:
        raise fail("controller", f"{len(given)} of them", f"one, or one for each of the {worlds} worlds")
    return tuple(given)


def _floor(case: Scenario, there: Placement) -> float:
    """Of each contact's normal force [N]."""
    if case.f_min is not None:
        return float(case.f_min)
    return closing_force(there.body.mass, there.unit * there.arm, case.pace[1])


def _check(controller: WrenchController, case: Scenario, there: Placement) -> None:
    """Refuse a controller that is not for these contacts, or that the loop would not ask."""
    if not isinstance(controller, WrenchController):
        raise fail("controller", controller, "a WrenchController, or a list of one for each world")
    if [contact.dim for contact in controller.contacts] != [there.body.dim] * len(there.contacts):
        kind = "planar" if there.body.dim == 2 else "spatial"
        given = f"one with {len(controller.contacts)} contacts in dimension {controller.space.dim}"
        raise fail("controller", given, f"of {len(there.contacts)} {kind} contact{'s' * (len(there.contacts) > 1)}")
    for name in ("problem", "jacobian"):
        if getattr(getattr(controller, name), "__func__", None) is not getattr(WrenchController, name):
            allowed = (
                f"without a {name}() of its own: the compiled loop states the problems of all worlds from `belief`"
            )
            raise fail("controller", type(controller).__name__, allowed + ", and would never call it")
    ignored = [key for key in CONTROL_KEYS if key in case.changes]
    if ignored:
        raise fail(ignored[0], case.changes[ignored[0]], "left out: the controller that is given has its own")
