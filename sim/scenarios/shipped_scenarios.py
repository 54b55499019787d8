"""The shipped scenarios, and the one of an object of your own."""

import os
from dataclasses import replace
from pathlib import Path

from numpy.typing import ArrayLike
from pivoting.controller.validate import fail
from pivoting.sim.judging.verdict import Limits
from pivoting.sim.scenarios.scenario import Scenario

OWN = "pivot"  # the name of the scenario of an object of your own


def own_object(
    model: str | os.PathLike[str],
    body: str,
    contact: str | ArrayLike = "lowest",
    *,
    support: str | None = None,
    chosen: bool = True,
) -> Scenario:
    """A scenario of an object of your own: turned by 20 degrees about a contact, in 2 s.

    Args:
        model: MJCF file.
        body: name of a body that moves freely, or by two slides and a hinge; '#1' of one without a name.
        contact: "vertex", "edge", "lowest", or points (K, 3), body frame [m]; see `contact_candidates.find_pivot`.
        support: name of the geom that it stands on, a plane, a box or an upright cylinder; None: what is under it.
        chosen: simulate it with the contact and solver parameters of the shipped scenes (`models/settings.xml`).
    """
    return Scenario(
        OWN,
        f"{body} of {Path(model).name} about its {contact if isinstance(contact, str) else 'given contact'}",
        scene=Path(model),
        body=body,
        support=support,
        contact=contact,
        chosen=chosen,
        reference="arc",
        theta=5.0,
        theta_end=25.0,
        seconds=2.0,
        f_min=None,
        limits=Limits(slip_m=None, angle_rms_deg=0.1, angle_max_deg=0.2, force_mismatch_rel=0.05, settle_s=0.1),
    )


def shipped(case: Scenario) -> Scenario | None:
    """The scenario that `case` was before anything was changed, if it is not one of your own making."""
    if case.own:
        return own_object(case.scene, case.body)
    return SCENARIOS.get(case.name)


def scenario(name: str) -> Scenario:
    """The shipped scenario of that name."""
    if name not in SCENARIOS:
        raise fail("scenario", name, "one of " + ", ".join(SCENARIOS) + f", or {OWN} with a model")
    return SCENARIOS[name]


_PLANNED = Limits(slip_m=1e-4, angle_rms_deg=0.2, angle_max_deg=0.5, force_mismatch_rel=0.05, settle_s=0.1)
_SPATIAL = Limits(slip_m=1e-4, angle_rms_deg=0.05, angle_max_deg=0.1, force_mismatch_rel=0.03, settle_s=0.1)
SCENARIOS = {
    case.name: case
    for case in (
        Scenario(
            "balance-2d",
            "hold a 1 m, 1 kg block on its corner at 30 deg for 10 s",
            scene="balance-2d",
            limits=Limits(slip_m=2e-5, angle_rms_deg=0.005, angle_max_deg=0.005, force_mismatch_rel=0.01, settle_s=0.5),
        ),
        Scenario(
            "incline-2d",
            "the notes' printed example: 30 deg on a table inclined by 30 deg, on the cone's edge",
            scene="incline-2d",
            mu=0.3,
            world={"mu": 0.4},
            margin=0.0,
            length=1.0,
            seconds=5.0,
            limits=Limits(slip_m=2e-5, angle_rms_deg=0.005, angle_max_deg=0.005, force_mismatch_rel=0.01, settle_s=0.5),
        ),
        Scenario(
            "pivot-2d",
            "turn the block about its corner from 10 to 80 deg in 2 s, and back",
            scene="pivot-2d",
            reference="return",
            theta=10.0,
            seconds=2.0,
            limits=Limits(slip_m=2e-5, angle_rms_deg=0.02, angle_max_deg=0.05, force_mismatch_rel=0.01, settle_s=0.1),
        ),
        Scenario(
            "snap-2d",
            "10 to 80 deg in 0.3 s, with a floor under the normal force",
            scene="snap-2d",
            reference="arc",
            theta=10.0,
            seconds=0.3,
            f_min="5w",
            limits=Limits(slip_m=1e-4, angle_rms_deg=0.1, angle_max_deg=0.2, force_mismatch_rel=0.05, settle_s=0.1),
        ),
        Scenario(
            "mpc-2d",
            "10 to 80 deg in 1 s by a receding horizon, with a force of at most 0.8 of the weight",
            scene="pivot-2d",
            reference="arc",
            theta=10.0,
            seconds="3.760603093T",  # 1 s and 0.02 s of this block where gravity is 10 m/s^2
            plan_hz=100.0,
            plan_step="0.07521206186T",
            force_max="0.8w",
            limits=_PLANNED,
        ),
        Scenario(
            "balance-3d",
            "a 1 x 0.7 x 1.4 m block on one vertex, its body diagonal vertical, for 10 s",
            scene="balance-3d",
            contact="vertex",
            about="yaw",
            theta=0.0,
            limits=_SPATIAL,
        ),
        Scenario(
            "spin-3d",
            "the block on that vertex, 90 deg of yaw in 2 s",
            scene="spin-3d",
            contact="vertex",
            about="yaw",
            reference="arc",
            theta=0.0,
            theta_end=90.0,
            seconds=2.0,
            limits=_SPATIAL,
        ),
        Scenario(
            "pivot-3d",
            "the block about an edge, two contacts, from 10 to 80 deg in 2 s",
            scene="pivot-3d",
            contact="edge",
            reference="arc",
            theta=10.0,
            seconds=2.0,
            limits=_SPATIAL,
        ),
        Scenario(
            "mpc-3d",
            "the block about an edge by a receding horizon, from 10 to 80 deg in 2 s",
            scene="pivot-3d",
            contact="edge",
            reference="arc",
            theta=10.0,
            seconds=2.0,
            plan_hz=100.0,
            force_max="0.8w",
            limits=_PLANNED,
        ),
        Scenario(
            "settle-3d",
            "the block lowered about an edge in 2 s until it lies on its face, without bouncing, and held there",
            scene="settle-3d",
            contact="edge",
            reference="arc",
            theta=20.0,
            theta_end=0.0,
            seconds=2.0,
            landing="held",
            limits=replace(_SPATIAL, contacts_end=4),
        ),
    )
}
