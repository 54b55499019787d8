"""Bounds on the least slack of all worlds: against searches, a closed form, and answers that are guaranteed."""

from dataclasses import replace

import numpy as np
import pytest
from pivoting.controller import Body, Contact, Law, Uncertainty, WrenchController, slack_bounds, solve
from pivoting.controller.motion import Motion
from pivoting.controller.uncertainty.worst_case import worst_case

from tests.test_guarantee import GRAVITY, LARGE, SETS, load, planar, spatial

KINDS = ("contact", "com", "space")


def drawn(rng: np.random.Generator, kind: str, **more: object) -> tuple[WrenchController, Motion, Motion]:
    return spatial(rng, 1, **more) if kind == "space" else planar(rng, kind, **more)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("more", [{}, LARGE], ids=["set", "set and disturbances"])
def test_what_is_guaranteed_is_proved(kind: str, more: dict[str, object]) -> None:
    """To 1e-9 of the load; and with less friction than was counted on it is not."""
    rng = np.random.default_rng(7)
    for _ in range(6 * SETS):
        controller, state, desired = drawn(rng, kind, **more)
        answer = solve(controller.problem(state, desired))
        assert slack_bounds(controller, state, answer.wrench).low >= -1e-9 * load(controller)
        assert controller.uncertainty is not None
        assert controller.uncertainty.mu is not None
        slippery = replace_set(controller, mu=(0.1 * controller.uncertainty.mu.low, 1.0))
        assert slack_bounds(slippery, state, answer.wrench, most=1).low < 0.0


def replace_set(controller: WrenchController, **changes: object) -> WrenchController:
    """The same controller, with another set."""
    assert controller.uncertainty is not None
    known = replace(controller.uncertainty, **changes)  # type: ignore[arg-type]
    return WrenchController(
        controller.body, controller.contacts, controller.law, controller.gravity, uncertainty=known
    )  # fmt: skip


@pytest.mark.parametrize("kind", KINDS)
def test_it_brackets_what_a_search_finds(kind: str) -> None:
    """For wrenches that were computed for nothing in particular, most of which lose their grip."""
    rng, lost = np.random.default_rng(11), 0
    for _ in range(4 * SETS):
        controller, state, desired = drawn(rng, kind)
        wrench = solve(controller.problem(state, desired)).wrench
        wrench = wrench + np.linalg.norm(wrench) * rng.normal(size=wrench.size)
        bounds, small = slack_bounds(controller, state, wrench), 1e-9 * load(controller)
        found = worst_case(controller, state, wrench).slack
        assert bounds.low - small <= found
        assert bounds.low <= bounds.high + small
        if bounds.low < 0.0:
            assert found <= bounds.high + small
            assert bounds.high - bounds.low <= 1e-8 * load(controller)
            lost += 1
    assert lost > 0


@pytest.mark.parametrize("kind", KINDS)
def test_disturbances_are_counted_in_full(kind: str) -> None:
    """A search with pushes and wrong rates finds nothing below."""
    rng, more = np.random.default_rng(13), {**LARGE, "theta": 0.0}
    for _ in range(2 * SETS):
        controller, state, desired = drawn(rng, kind, **more)
        wrench = 0.7 * solve(controller.problem(state, desired)).wrench
        bounds = slack_bounds(controller, state, wrench, most=10)
        assert bounds.low <= worst_case(controller, state, wrench).slack + 1e-9 * load(controller)


def test_an_unknown_mass_is_on_the_ends_of_its_interval() -> None:
    """A block at rest on its corner, held upright by the wrench: f_n = m g - F_n, f_t = -F_t."""
    known = Uncertainty(mass=(0.8, 1.2), dim=2)
    contact = Contact([0.0, -0.5], mu=0.5)
    controller = WrenchController(
        Body(1.0, 0.1), [contact], Law.static(), (0.0, -GRAVITY), uncertainty=known
    )  # fmt: skip
    pushed = np.array([1.0, 2.0, 1.0 * 0.5])  # of which the moment about the contact is 0
    bounds = slack_bounds(controller, Motion(0.0), pushed)
    assert bounds.low == pytest.approx(0.8 * GRAVITY - 2.0 - 1.0 / 0.5, rel=1e-12)
    assert bounds.high == pytest.approx(bounds.low, rel=1e-12)
    assert bounds.boxes == 1


def test_what_it_needs_is_named() -> None:
    controller, state, _ = spatial(np.random.default_rng(1), 2)
    with pytest.raises(ValueError, match="a single contact"):
        slack_bounds(controller, state, np.zeros(6))
    plain = WrenchController(Body(1.0, 0.1), [Contact([0.0, -0.5], mu=0.5)], Law.static(), (0.0, -GRAVITY))
    with pytest.raises(ValueError, match="one with a set"):
        slack_bounds(plain, Motion(0.0), np.zeros(3))
