"""Margins, against the equations of motion of single worlds and a search for the worst of them.

`worst_case` and `contact_forces` share no formula with what is tested: at a scale just inside no member that is found
is lost, just outside one is; and likewise at the ends of what a single unknown may do.
"""

import os
import re
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from pivoting.controller import Body, Contact, Law, Margins, WrenchController, price, solve
from pivoting.controller.motion import Motion
from pivoting.controller.rotations import rotation_matrix
from pivoting.controller.uncertainty.grip import Beliefs, GivenWrench
from pivoting.controller.uncertainty.uncertainty import Interval, Member, Uncertainty
from pivoting.controller.uncertainty.worst_case import PossibleWorld, contact_forces, worst_case
from pivoting.controller.validate import Array

from tests.test_guarantee import GRAVITY, planar, spatial

CASES = int(os.environ.get("PIVOTING_SETS", "2"))  # of each kind; `make guarantee` tries 500
INSIDE, OUTSIDE = 1.0 - 1e-5, 1.0 + 1e-5
KINDS: dict[str, Callable[[np.random.Generator], tuple[WrenchController, Motion, Motion]]] = {
    "plane, contact": lambda rng: planar(rng, "contact"),
    "plane, com": lambda rng: planar(rng, "com"),
    "space": lambda rng: spatial(rng, 1),
    "edge": lambda rng: spatial(rng, 2),
}


def cases(kind: str) -> int:
    """Fewer where the best squeeze of every member is searched for."""
    return max(1, CASES // 2) if kind == "edge" else CASES


def load(controller: WrenchController) -> float:
    return GRAVITY * controller.body.mass


def some_wrench(rng: np.random.Generator, controller: WrenchController, state: Motion, wanted: Motion) -> Array:
    """That of the controller, changed so that it makes another torque, and presses more, so that something is left."""
    wrench = solve(controller.problem(state, wanted)).wrench
    down = controller.gravity if controller.gravity.size == controller.space.dim else controller.gravity[[0, 2]]
    R = rotation_matrix(controller.space.lift_motion(state)[0])
    force = rng.uniform(0.1, 0.6) * controller.body.mass * (R.T @ controller.space.lift(down))
    pressed = controller.belief.source.map @ np.r_[force, np.cross(controller.belief.contacts.pivot, force)]
    return np.asarray(wrench * (1.0 + 0.02 * rng.normal(size=wrench.size)) + pressed)


def world(member: Member, push: float = 0.0) -> PossibleWorld:
    return PossibleWorld(member, np.zeros(3) + push, np.zeros(3), np.zeros(3))


def slack_of(controller: WrenchController, state: Motion, wrench: Array, member: Member, mu: float) -> float:
    """Of one member, by its equations of motion, with a friction coefficient of its own; of one contact."""
    force = contact_forces(controller, state, wrench, world(member))
    use = (1.0 - controller.margin) * mu
    floors = [each.f_min for each in controller.contacts]
    return float(min((force[:, -1] - np.linalg.norm(force[:, :-1], axis=1) / use).min(), (force[:, -1] - floors).min()))


@pytest.mark.parametrize("kind", KINDS)
def test_the_force_of_a_member_is_that_of_its_equations_of_motion(kind: str) -> None:
    """To 1e-9 of the load, also of wrenches that do not make the torque of the law."""
    rng = np.random.default_rng(len(kind))
    for _ in range(4 * CASES):
        controller, state, wanted = KINDS[kind](rng)
        known, grip_state = controller.uncertainty, controller.space.lift_motion(state)[:2]
        assert known is not None
        wrench = some_wrench(rng, controller, state, wanted) + load(controller) * rng.normal(size=controller.widths[0])
        beliefs, grip = Beliefs(controller), GivenWrench(controller, *grip_state, wrench)
        member = known.at(rng.random(known.unknowns))
        alone = beliefs.member._replace(
            mass=np.full(2, member.mass),
            inertia=np.full(2, member.inertia),
            com=np.repeat(controller.space.lift(member.com)[:, None], 2, axis=1),
        )
        wanted_force = contact_forces(controller, state, wrench, world(member))
        force, _ = grip._forces(beliefs.of_member(alone), None)
        if kind.startswith("plane"):  # where the apex stands for the edges of one member's cone
            assert np.abs(force[0] - wanted_force).max() <= 1e-9 * np.abs(wrench).max()
        else:
            assert np.abs(force[0] - wanted_force).max() <= 1e-9 * load(controller)


@pytest.mark.parametrize("kind", KINDS)
def test_slack_is_that_of_the_worst_member(kind: str) -> None:
    """Not more than a search finds; as much, in the plane about the contact, where the guarantee is exact."""
    rng = np.random.default_rng(10 + len(kind))
    for _ in range(cases(kind)):
        controller, state, wanted = KINDS[kind](rng)
        wrench = some_wrench(rng, controller, state, wanted)
        found = worst_case(controller, state, wrench).slack
        mine = controller.margins(state, wrench).slack
        assert mine <= found + 1e-9 * load(controller)
        assert mine >= found - (1e-8 if kind == "plane, contact" else 0.1) * load(controller)


@pytest.mark.parametrize("kind", KINDS)
def test_the_scale_of_a_wrench_is_where_the_first_member_is_lost(kind: str) -> None:
    rng, between = np.random.default_rng(20 + len(kind)), 0
    for _ in range(cases(kind)):
        controller, state, wanted = KINDS[kind](rng)
        wrench = some_wrench(rng, controller, state, wanted)
        scale, known = controller.margins(state, wrench).wrench_scale, controller.uncertainty
        assert known is not None
        if not 0.0 < scale < known.widest:
            continue
        between += 1
        for share, held in ((INSIDE, True), (OUTSIDE, False)):
            there = _with(controller, known.scaled(share * scale))
            slack = worst_case(there, state, wrench).slack
            if held:
                assert slack >= -1e-9 * load(controller)
            elif kind == "plane, contact":
                assert slack < 0.0
    assert between >= cases(kind) // 2


def _with(controller: WrenchController, known: Uncertainty) -> WrenchController:
    """The controller with another set, of which its body need not be a member."""
    there = WrenchController(
        controller.body, controller.contacts, controller.law, controller.gravity, uncertainty=controller.uncertainty
    )
    object.__setattr__(there, "uncertainty", known)
    return there


@pytest.mark.parametrize("kind", KINDS)
def test_a_wrench_for_the_set_has_a_scale_of_one_at_least(kind: str) -> None:
    rng, binding = np.random.default_rng(30 + len(kind)), 0
    for _ in range(4 * cases(kind)):
        controller, state, wanted = KINDS[kind](rng)
        answer = solve(controller.problem(state, wanted))
        found = controller.margins(state, answer)
        assert found.wrench_scale >= 1.0 - 1e-6
        assert found.slack >= -1e-9 * load(controller)
        if len(controller.contacts) == 1:  # where there is no other squeeze than that of the answer
            assert abs(answer.slack - found.slack) <= 1e-9 * load(controller)
            assert abs(answer.share - found.share) <= 1e-9 * max(1.0, abs(found.share))
        binding += abs(found.wrench_scale - 1.0) <= 1e-5
    assert binding or not kind.startswith("plane")


NAMES = ("mass", "inertia", "mu")


@pytest.mark.parametrize("kind", ["plane, contact", "plane, com", "space"])
def test_alone_an_unknown_may_move_to_its_ends(kind: str) -> None:
    """All of the way holds, by the equations of motion of some members on it; beyond an end the next member is lost."""
    rng, ends = np.random.default_rng(40 + len(kind)), 0
    for _ in range(2 * CASES):
        controller, state, wanted = KINDS[kind](rng)
        wrench, known = some_wrench(rng, controller, state, wanted), controller.uncertainty
        assert known is not None
        found, nominal = controller.margins(state, wrench), known.nominal
        assert nominal.mu is not None
        assert nominal.mass is not None
        if slack_of(controller, state, wrench, nominal, nominal.mu) < 0.0:
            assert np.isnan(found.mass).all()
            continue
        for name, interval in alone(found):
            middle, far = placed(name, nominal, controller)
            for end in interval:
                last = end if np.isfinite(end) else middle + np.sign(end) * far
                for share in (*np.linspace(0.0, 0.999, 20), INSIDE):
                    member, mu = moved(name, nominal, middle + share * (last - middle))
                    assert slack_of(controller, state, wrench, member, mu) >= -1e-9 * load(controller), name
                if np.isfinite(end) and end != 0.0:
                    member, mu = moved(name, nominal, middle + OUTSIDE * (end - middle))
                    assert slack_of(controller, state, wrench, member, mu) < 0.0, name
                    ends += 1
    assert ends > 4 * CASES


def alone(found: Margins) -> list[tuple[str, Interval]]:
    return [(name, getattr(found, name)) for name in NAMES] + [(f"com{i}", each) for i, each in enumerate(found.com)]


def placed(name: str, nominal: Member, controller: WrenchController) -> tuple[float, float]:
    """Where an unknown is nominally, and how far it is looked for."""
    if name.startswith("com"):
        return float(nominal.com[int(name[3:])]), 2.0 * controller.units.length
    value = float(getattr(nominal, name))
    return value, 9.0 * value


def moved(name: str, nominal: Member, value: float) -> tuple[Member, float]:
    """The nominal member with one unknown changed, and its friction."""
    if name.startswith("com"):
        com = nominal.com.copy()
        com[int(name[3:])] = value
        nominal = nominal._replace(com=com)
    elif name != "mu":
        nominal = nominal._replace(**{name: max(value, 1e-9)})
    assert nominal.mu is not None
    return nominal, value if name == "mu" else nominal.mu


def test_in_the_plane_a_shove_or_an_error_of_omega_is_exact() -> None:
    """The nominal member just holds in the worst direction of all at the end, and is lost just beyond."""
    rng, checked = np.random.default_rng(5), 0
    for _ in range(4 * CASES):
        controller, state, wanted = planar(rng, "com")
        wrench, known = some_wrench(rng, controller, state, wanted), controller.uncertainty
        assert known is not None
        found, nominal = controller.margins(state, wrench), known.nominal
        assert nominal.mu is not None
        if np.isnan(found.shove.high):
            continue

        def force(push: Array, spin: float) -> Array:
            there = PossibleWorld(nominal, push, np.zeros(3), np.array([0.0, spin, 0.0]))  # noqa: B023
            return contact_forces(controller, state, wrench, there)[0]  # noqa: B023

        rows = np.array([[1.0 / nominal.mu, 1.0], [-1.0 / nominal.mu, 1.0], [0.0, 1.0]])  # edges and floor
        floors, none = np.array([0.0, 0.0, controller.contacts[0].f_min]), force(np.zeros(3), 0.0)
        changed = np.array([force(push, 0.0) - none for push in np.eye(3)[[0, 2]]])  # it is affine in a push
        for share, held in ((INSIDE, True), (OUTSIDE, False)):
            push, spin = share * found.shove.high / known.shove_seconds, share * found.omega.high
            worst = (rows @ none - floors - push * np.linalg.norm(changed @ rows.T, axis=0)).min()
            assert worst >= -1e-9 * load(controller) if held else worst < 0.0
            if np.isfinite(spin):
                turned = min(float((rows @ force(np.zeros(3), way * spin) - floors).min()) for way in (-1.0, 1.0))
                assert turned >= -1e-9 * load(controller) if held else turned < 0.0
                checked += 1
    assert checked >= CASES


def test_disturbances_in_space_are_bounds() -> None:
    """No random push, tilt or spin of the greatest size, of which each alone is allowed, is lost."""
    rng = np.random.default_rng(6)
    for _ in range(CASES):
        controller, state, wanted = spatial(rng, 1)
        wrench, known = some_wrench(rng, controller, state, wanted), controller.uncertainty
        assert known is not None
        found, nominal = controller.margins(state, wrench), known.nominal
        assert nominal.mu is not None
        ends = np.array([found.shove.high / known.shove_seconds, found.theta.high, found.omega.high])
        assert np.isfinite(ends).all()
        for i in range(3):
            for _ in range(60):
                sizes = np.zeros((3, 3))
                sizes[i] = rng.normal(size=3)
                sizes[i] *= ends[i] / np.linalg.norm(sizes[i])
                force = contact_forces(controller, state, wrench, PossibleWorld(nominal, *sizes))[0]
                slack = min(force[2] - np.hypot(*force[:2]) / nominal.mu, force[2] - controller.contacts[0].f_min)
                assert slack >= -1e-9 * load(controller)


def test_frictional_stability_is_the_deviation_that_the_contact_still_bears() -> None:
    """The contact force under a weight that is greater, or acts beside the centre of mass, is that of a push there."""
    rng, ends = np.random.default_rng(7), 0
    for _ in range(3 * CASES):
        controller, state, wanted = planar(rng, "com")
        wrench, known = some_wrench(rng, controller, state, wanted), controller.uncertainty
        assert known is not None
        nominal = known.nominal
        assert nominal.mu is not None
        assert nominal.mass is not None
        if slack_of(controller, state, wrench, nominal, nominal.mu) < 0.0:
            continue
        weight, (along,) = controller.margins(state, wrench).stability
        angle = float(np.asarray(state.orientation))
        turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])  # world to object axes
        down, aside = turn @ np.array([0.0, -1.0]), turn @ np.array([1.0, 0.0])

        def slack(more: float, by: float, pull: Array = down, to: Array = aside) -> float:
            size = nominal.mass * GRAVITY  # noqa: B023
            moment = by * size * (to[0] * pull[1] - to[1] * pull[0])
            heavier = wrench + np.r_[more * pull, moment]  # noqa: B023
            return slack_of(controller, state, heavier, nominal, nominal.mu)  # noqa: B023

        for i, interval in enumerate((weight, along)):
            for end in interval:
                if np.isfinite(end):
                    assert slack(*np.eye(2)[i] * INSIDE * end) >= -1e-9 * load(controller)
                    assert slack(*np.eye(2)[i] * OUTSIDE * end) < 0.0
                    ends += 1
    assert ends > CASES


def test_friction_that_may_be_missing() -> None:
    """With so much less of it the worst member is at the edge."""
    rng = np.random.default_rng(9)
    for _ in range(CASES):
        controller, state, wanted = planar(rng, "contact")
        wrench, known = some_wrench(rng, controller, state, wanted), controller.uncertainty
        assert known is not None
        assert known.mu is not None
        share = controller.margins(state, wrench).friction
        if not np.isfinite(share):
            continue
        slacks = []
        for factor in (INSIDE, OUTSIDE):
            there = _with(controller, replace(known, mu=known.mu.low * (1.0 - share) / factor))
            slacks.append(worst_case(there, state, wrench).slack)
        assert slacks[0] >= -1e-9 * load(controller)
        assert slacks[1] < 0.0


def block(known: Uncertainty | None, mu: float = 0.4, **more: float) -> WrenchController:
    body, contact = Body(1.0, 1.0 / 6.0), Contact((-0.5, -0.5), mu=mu)
    return WrenchController(body, [contact], Law.dynamic(), (0.0, -10.0), uncertainty=known, **more)  # type: ignore[arg-type]


def test_without_a_set_there_is_no_scale() -> None:
    """All else is that of the nominal member alone."""
    without, alone = block(None), block(Uncertainty(dim=2))
    answer = solve(without.problem(Motion(0.6)))
    mine, same = without.margins(Motion(0.6), answer), alone.margins(Motion(0.6), answer)
    assert np.isnan(mine.wrench_scale)
    assert same.wrench_scale == np.inf
    assert (mine.slack, mine.mass, mine.mu, mine.stability) == (same.slack, same.mass, same.mu, same.stability)
    assert abs(mine.slack - answer.slack) <= 1e-12
    pressed = without.margins(Motion(0.6), answer.wrench - [0.0, 100.0, 0.0])
    assert pressed.slack != mine.slack


def test_what_does_not_even_hold_the_nominal_member() -> None:
    known = Uncertainty(mass=(0.9, 1.1), dim=2)
    lifted = block(known).margins(Motion(0.6), [0.0, 30.0, 0.0])
    assert lifted.slack < 0.0
    assert lifted.share == -np.inf
    assert lifted.wrench_scale == 0.0
    assert lifted.friction == -np.inf
    assert np.isnan([*lifted.mass, *lifted.com[0], *lifted.theta, *lifted.stability.weight]).all()


def test_a_known_wrench_besides_counts_as_applied() -> None:
    controller, besides = block(Uncertainty(mass=(0.9, 1.1), dim=2)), np.array([0.2, -0.3, 0.1])
    answer = solve(controller.problem(Motion(0.6), external=besides))
    mine = controller.margins(Motion(0.6), answer, external=besides)
    assert mine.slack == controller.margins(Motion(0.6), answer.wrench + besides).slack
    assert mine.slack >= -1e-9


def test_the_price_is_that_of_the_same_controller_without_a_set() -> None:
    """In the metric of the weight; 1 for a set of one member; in the objective never less for a larger one."""
    here, there = Motion(0.4, 0.1), Motion(0.4, 0.1, 1.0)
    for weight in (np.eye(3), np.diag([1.0, 4.0, 9.0])):
        priced = []
        for scale in (0.0, 1.0, 2.0):
            known = Uncertainty(mass=(0.8, 1.2), com=0.05, inertia=(0.8, 1.2), dim=2).scaled(scale)
            with_set, without = (
                solve(block(each, 0.25, Q_w=weight).problem(here, there)) for each in (known, None)
            )  # fmt: skip
            found = price(block(known, 0.25, Q_w=weight), here, there)
            sizes = [each.wrench @ weight @ each.wrench for each in (with_set, without)]
            assert abs(found.wrench - np.sqrt(sizes[0] / sizes[1])) <= 1e-9
            assert abs(found.objective - with_set.objective / without.objective) <= 1e-9
            priced.append(found)
        assert priced[0] == pytest.approx((1.0, 1.0), abs=1e-12)
        assert priced[0].objective < priced[1].objective < priced[2].objective
        assert priced[1].wrench != pytest.approx(1.0, abs=1e-3)
    with pytest.raises(ValueError, match="without one there is nothing to pay for"):
        price(block(None), here)


def test_scaling_keeps_the_nominal_member() -> None:
    """Also of intervals that are not about what is believed; and disturbances, which are about 0, vanish."""
    known = Uncertainty(mass=(0.8, 1.4), com=[(-0.1, 0.3), (0.0, 0.2)], inertia=(0.9, 1.3), mu=(0.3, 0.7),
                        shove=(-0.1, 0.3), theta=0.1)  # fmt: skip
    none, half = known.scaled(0.0), known.scaled(0.5)
    assert none.nominal.mass == half.nominal.mass == known.nominal.mass
    assert np.allclose(none.com, [[0.1, 0.1], [0.1, 0.1]])
    assert np.allclose(half.com, [[0.0, 0.2], [0.05, 0.15]])
    assert (none.inertia, none.shove, none.theta) == ((1.0, 1.0), (0.0, 0.0), (0.0, 0.0))
    assert np.allclose(half.shove, (-0.05, 0.15))
    assert known.widest == pytest.approx(0.5 / 0.2)
    assert known.scaled(0.9999 * known.widest).mu.low > 0.0  # type: ignore[union-attr]
    with pytest.raises(ValueError, match=re.escape("scale = 2.5: must be a finite number < 2.5 and >= 0")):
        known.scaled(known.widest)


@pytest.mark.parametrize(("contacts", "message"), [
    ([Contact((-0.1, -0.1), 0.5, radius=0.01)], "one with contacts that roll: must be"),
    ([Contact((x, y, -0.1), 0.5) for x in (-0.1, 0.1) for y in (-0.1, 0.1)], "one with 4 contacts"),
])  # fmt: skip
def test_what_has_no_margins_is_refused(contacts: list[Contact], message: str) -> None:
    dim = contacts[0].dim
    body = Body(1.0, 0.01 if dim == 2 else 0.01 * np.eye(3))
    controller = WrenchController(body, contacts, Law.static(), (0.0, -10.0) if dim == 2 else (0.0, 0.0, -10.0))
    state = Motion(0.1) if dim == 2 else Motion((1.0, 0.0, 0.0, 0.0))
    with pytest.raises(ValueError, match="one with"):
        controller.margins(state, np.zeros(3 * dim - 3))
    assert message
