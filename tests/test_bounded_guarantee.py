"""The guarantee within bounds: in MuJoCo, against a search for the worst world, and against any other acceleration."""

import numpy as np
import pytest
from pivoting.controller import Motion, WrenchBounds, WrenchController, WrenchProblem, worst_case
from pivoting.controller.bounded_solver import BoundedSolver, BoundedWrench
from pivoting.controller.solution import BOUNDED, UNGUARANTEED
from pivoting.controller.solvers.solve import solve
from pivoting.controller.uncertainty.feasibility import feasibility
from pivoting.sim import Run, simulate
from pivoting.sim.pipeline import bounded_control

from tests.test_guarantee import load, planar, spatial

TOLD = {"mu": 0.25, "mass": (0.8, 1.2), "com": (-0.05, 0.05), "inertia": (0.8, 1.2)}
WORST = 10  # of the 16 vertices


class Nominal(BoundedSolver):
    """As it was before bounds and guarantee went together: the cones of the believed world."""

    def _moved(self, *_: object) -> object:  # type: ignore[override]
        return self._nominal

    def _slack(self, *_: object) -> float:  # type: ignore[override]
        return 0.0


def held(**keys: object) -> Run:
    """A block that is to be held at 30 degrees in the vertex of the set that slides most easily."""
    return simulate("balance-2d", first_world=WORST, worlds_at="vertices", limits={"settle_s": 0.1}, **TOLD, **keys)


def test_bounds_that_used_to_let_it_slide_no_longer_do(monkeypatch: pytest.MonkeyPatch) -> None:
    """It gives up the angle for it, and says so."""
    bounds = {"force_max": 4.0, "moment_max": 0.9, "seconds": 0.25}
    kept = held(**bounds)
    monkeypatch.setattr(bounded_control, "BoundedSolver", Nominal)
    slid = held(**bounds)
    assert kept.measures.slip_max_m[0] < 1e-6
    assert slid.measures.slip_max_m[0] > 1e-3
    for run in (kept, slid):
        assert WrenchBounds(force=4.0, moment=0.9).excess(run.wrench) < 1e-6
    assert (kept.status == BOUNDED).any()
    assert kept.summary()["unguaranteed_steps"] == 0


def test_a_run_says_in_how_many_steps_nothing_was_guaranteed() -> None:
    run = held(force_max=1.0, moment_max=0.1, seconds=0.12)
    lost = int(np.count_nonzero(run.status == UNGUARANTEED))
    summary = run.summary()
    assert summary["unguaranteed_steps"] == lost > 0
    assert summary["bounded_steps"] == lost + np.count_nonzero(run.status == BOUNDED)
    assert run.measures.unsolved_steps[0] == 0.0


def bounded(
    controller: WrenchController, state: Motion, desired: Motion, share: float
) -> tuple[BoundedWrench, WrenchProblem, WrenchBounds]:
    """With so much of the smallest force and moment."""
    problem, dim = controller.problem(state, desired), controller.space.dim
    smallest = solve(problem).wrench
    bounds = WrenchBounds(
        force=share * float(np.linalg.norm(smallest[:dim])), moment=share * float(np.linalg.norm(smallest[dim:]))
    )
    q, omega, _ = controller.space.lift_motion(state)
    return BoundedSolver(controller, bounds, 1e-3)(q, problem.required, None, omega), problem, bounds


@pytest.mark.parametrize("dim", [2, 3])
def test_no_world_of_the_set_slides_where_a_grip_is_guaranteed(dim: int) -> None:
    """Whatever a search finds, by 1e-7 of the load; most of these answers give up acceleration."""
    rng, given_up, count = np.random.default_rng(dim), 0, 0
    for _ in range(12 if dim == 2 else 4):
        case = planar(rng, "contact") if dim == 2 else spatial(rng, 1 + count % 2)
        answer, _, bounds = bounded(*case, rng.uniform(0.3, 0.95))
        count += 1
        assert bounds.excess(answer.wrench) < 1e-6
        if not answer.guaranteed:
            continue
        found = worst_case(case[0], case[1], answer.wrench)
        assert found.slack > -1e-7 * load(case[0])
        given_up += not answer.exact
    assert given_up >= 2


def test_where_none_is_guaranteed_no_other_acceleration_allows_one() -> None:
    """On a grid of accelerations that any answer could give up."""
    rng, lost = np.random.default_rng(5), 0
    for _ in range(20):
        controller, state, desired = planar(rng, "contact")
        answer, problem, bounds = bounded(controller, state, desired, rng.uniform(0.2, 0.6))
        if answer.guaranteed or lost == 3:
            continue
        lost += 1
        q, omega, _ = controller.space.lift_motion(state)
        B = controller.problem(Motion(*state), Motion(*state[:2], 1.0)).required - controller.problem(state).required
        most = 40.0 * np.linalg.norm(problem.required) / np.linalg.norm(B)
        for a in np.linspace(-most, most, 61):
            apex, floors = controller.moved_cones(q, omega, problem.required + a * B)
            moved = WrenchProblem(
                problem.jacobian, problem.required + a * B, controller.belief.contacts.mu, f_min=floors, apex=apex
            )
            assert feasibility(moved, bounds).answer != "yes", a
        assert bounds.excess(answer.wrench) < 1e-6
    assert lost == 3
