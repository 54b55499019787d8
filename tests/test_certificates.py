"""What cannot hold is said with a proof: against other solvers, and with the proof checked by arithmetic alone."""

from dataclasses import replace

import cvxpy as cp
import numpy as np
import pytest
from pivoting.controller import Body, Contact, Law, Motion, Uncertainty, WrenchBounds, WrenchController, WrenchProblem
from pivoting.controller.uncertainty.farkas_certificate import FarkasCertificate
from pivoting.controller.uncertainty.feasibility import MOST, Feasibility, _state, feasibility
from pivoting.controller.uncertainty.feasible_scale import feasible_scale
from scipy.optimize import linprog

G, CLEAR = 9.81, 1e-7  # of the load: a margin beyond which every solver has to agree


def accepted(said: dict) -> bool:
    """A reader's own check of the numbers in a file: plain arithmetic."""
    y, A, b = (np.array(said[name]) for name in ("y", "A", "b"))
    first = said["equalities"]
    last = first + said["half_lines"]
    good = bool((y[first:last] >= 0.0).all())
    for order in said["second_order_cones"]:
        good &= bool(y[last] >= np.sqrt((y[last + 1 : last + order] ** 2).sum()))
        last += order
    return good and last == len(y) and float(y @ b + said["radius"] * np.sqrt(((y @ A) ** 2).sum())) < 0.0


def random_problem(rng: np.random.Generator, dim: int) -> WrenchProblem:
    """With one to three contacts anywhere and, in half of all cases, several cones at each."""
    K, nw = int(rng.integers(1, 4)), 3 * dim - 3
    points, load = rng.normal(size=(K, dim)), 10.0 ** rng.uniform(-1.0, 2.0)
    up = np.zeros(dim)
    up[-1] = 1.0
    blocks = []
    for point in points:
        normal = up + 0.4 * rng.normal(size=dim) * (rng.random() < 0.5)
        axes = np.linalg.qr(np.column_stack([normal, rng.normal(size=(dim, dim - 1))]))[0]
        axes = np.column_stack([axes[:, 1:], axes[:, 0] * np.sign(axes[:, 0] @ normal)])
        turning = (
            [point[0] * axis[1] - point[1] * axis[0] for axis in axes.T] if dim == 2 else np.cross(point, axes.T).T
        )
        blocks.append(np.vstack([axes, np.reshape(turning, (nw - dim, dim))]))
    required = load * np.r_[up + 0.3 * rng.normal(size=dim), 0.5 * rng.normal(size=nw - dim)]
    several = int(rng.integers(1, 6)) if rng.random() < 0.5 else 1
    apex = 0.3 * load * rng.normal(size=(several, K, dim)) * (several > 1)
    floors = load * rng.uniform(0.0, 0.5, K)
    return WrenchProblem(np.hstack(blocks), required, rng.uniform(0.1, 0.9, K), f_min=floors, margin=0.1, apex=apex)


def random_bounds(rng: np.random.Generator, problem: WrenchProblem, linear: bool) -> WrenchBounds:
    """On components where they are to be `linear`, else on sizes; in a third of all cases not on forces."""
    load = float(np.abs(problem.required).max())
    size, dim, kind = load * 10.0 ** rng.uniform(-1.5, 0.3), problem.dim, rng.integers(3)
    if not linear:
        return WrenchBounds(
            force=np.inf if kind == 0 else size * rng.uniform(0.5, 2.0), moment=size if kind != 1 else np.inf
        )
    most = size * rng.uniform(0.3, 1.0, len(problem.required))
    most[:dim] = np.inf if kind == 0 else most[:dim]
    return WrenchBounds(component=most)


def checked(problem: WrenchProblem, bounds: WrenchBounds, found: Feasibility) -> None:
    """The answer's own evidence, against the problem and nothing else."""
    load = float(np.abs(problem.required).max())
    if found.answer == "yes":
        assert found.wrench is not None
        assert found.force is not None
        made = problem.jacobian @ found.force.ravel() + found.wrench
        assert np.abs(made - problem.required).max() <= 1e-12 * load
        above = found.force - problem.apex
        along = np.linalg.norm(above[..., :-1], axis=-1)
        assert (along <= problem.mu_planned * above[..., -1] + 1e-12 * load).all()
        assert (found.force[:, -1] >= problem.f_min - 1e-12 * load).all()
        assert bounds.excess(found.wrench) <= 1e-12
    else:
        assert found.answer == "no"
        assert found.certificate is not None
        assert accepted(found.certificate.as_dict())
        assert found.margin < 0.0


def test_planar_problems_against_a_linear_program() -> None:
    rng, found = np.random.default_rng(0), []
    for _ in range(200):
        problem = random_problem(rng, 2)
        bounds = random_bounds(rng, problem, linear=True)
        answer = feasibility(problem, bounds)
        form, nw = problem.standard_form(), 3
        limited = answer.certificate is not None and np.isfinite(answer.certificate.limit)
        load = float(np.abs(problem.required).max())
        most = MOST * answer.certificate.force if limited and answer.certificate else None
        sizes = [(-each, each) if np.isfinite(each) else (None, None) for each in bounds.component]
        free = [(None, most if i % 2 else None) for i in range(form.A.shape[1] - nw)]
        unit = np.r_[np.full(form.A.shape[1], load)]
        other = linprog(
            np.zeros(form.A.shape[1]), form.C * unit / load, form.d / load, form.A * unit / load, form.b / load,
            [tuple(None if end is None else end / load for end in pair) for pair in (*free, *sizes)],
        )  # fmt: skip
        checked(problem, bounds, answer)
        if abs(answer.margin) > CLEAR * load:
            assert answer.answer == ("yes" if other.status == 0 else "no"), other.message
        found.append(answer.answer)
    assert min(found.count("yes"), found.count("no")) > 40


def test_spatial_problems_against_another_modelling_layer() -> None:
    rng, found = np.random.default_rng(1), []
    for _ in range(60):
        problem = random_problem(rng, 3)
        bounds = random_bounds(rng, problem, linear=False)
        answer = feasibility(problem, bounds)
        checked(problem, bounds, answer)
        load = float(np.abs(problem.required).max())
        f, w = cp.Variable(problem.jacobian.shape[1]), cp.Variable(6)
        limits = [problem.jacobian @ f + w == problem.required / load]
        for k in range(problem.contacts):
            own = f[3 * k : 3 * k + 3]
            limits += [own[2] >= problem.f_min[k] / load, own[2] <= 2.0 * MOST]
            for tip in problem.apex[:, k] / load:
                limits += [cp.norm(own[:2] - tip[:2]) <= problem.mu_planned[k] * (own[2] - tip[2])]
        for part, most in ((w[:3], bounds.force), (w[3:], bounds.moment)):
            limits += [cp.norm(part) <= most / load] if np.isfinite(most) else []
        other = cp.Problem(cp.Minimize(0), limits)
        other.solve(solver=cp.CLARABEL)
        if abs(answer.margin) > CLEAR * load:
            assert answer.answer == ("yes" if other.status == cp.OPTIMAL else "no"), other.status
        found.append(answer.answer)
    assert min(found.count("yes"), found.count("no")) > 10


def block(**more: object) -> WrenchController:
    """A block on its corner, and what is not known of it."""
    given = {"mass": (0.8, 1.2), "com": 0.05, "inertia": (0.8, 1.2), "mu": (0.25, 0.5), "dim": 2, **more}
    known = Uncertainty(**given)  # type: ignore[arg-type]
    contact = Contact([-0.5, -0.5], mu=0.3)
    return WrenchController(Body(1.0, 1.0 / 6.0), [contact], Law.dynamic(), (0.0, -G), margin=0.1, uncertainty=known)


def proof() -> FarkasCertificate:
    found = feasibility(block().problem(Motion(0.5)), WrenchBounds(force=2.0, moment=0.2))
    assert found.certificate is not None
    return found.certificate


def test_a_certificate_that_was_tampered_with_is_rejected() -> None:
    whole = proof()
    assert whole.holds()
    assert accepted(whole.as_dict())
    again = FarkasCertificate.from_dict(whole.as_dict())
    assert again.holds()
    assert again.gap == whole.gap
    for i in np.flatnonzero(np.abs(whole.y) > 0.1 * np.abs(whole.y).max()):  # less would leave it a proof
        y = whole.y.copy()
        y[i] *= -1.0
        other = replace(whole, y=y)
        assert not other.holds()
        assert not accepted(other.as_dict())
    wider = whole.b.copy()
    wider[whole.cones.zero :] += 1.0  # looser bounds, cones and floors
    for other in (replace(whole, b=wider), replace(whole, radius=1e20), replace(whole, y=np.zeros_like(whole.y))):
        assert not other.holds()
        assert not accepted(other.as_dict())
    with pytest.raises(ValueError, match="read-only"):
        whole.y[0] = 1.0


@pytest.mark.parametrize("limited", [False, True])
def test_nothing_that_is_sought_is_beyond_the_radius(limited: bool) -> None:
    """In random directions as far as constraints allow; the radius is not much larger than that, either."""
    rng, tight = np.random.default_rng(2), []
    for _ in range(15):
        problem = random_problem(rng, 2)
        load = float(np.abs(problem.required).max())
        bounds = WrenchBounds(component=load * np.array([np.inf if limited else 1.0, 1.0, 1.0]))
        stated = _state(problem, bounds)
        assert np.isfinite(stated.limit) == limited or not limited
        n = stated.A.shape[1]
        far = 0.0
        for _ in range(6):
            found = linprog(
                rng.normal(size=n), stated.A[3:], stated.b[3:], stated.A[:3], stated.b[:3], [(None, None)] * n
            )
            if found.status == 0:
                far = max(far, float(np.linalg.norm(found.x)))
        assert far <= stated.radius
        tight.append(far / stated.radius)
    assert max(tight) > 0.05


def test_on_the_border_it_is_undecided_and_tells_the_margin() -> None:
    """The floor of 12 N leaves just the bound of 2 N: arithmetic accepts neither."""
    J = np.array([[1.0, 0.0], [0.0, 1.0], [0.5, 0.0]])
    problem = WrenchProblem(J, [0.0, 10.0, 0.0], 0.3, f_min=12.0)
    answer = feasibility(problem, WrenchBounds(component=[5.0, 2.0, 5.0]))
    assert answer.answer == "undecided"
    assert abs(answer.margin) < 1e-8
    assert answer.certificate is None
    assert feasibility(problem, WrenchBounds(component=[5.0, 2.0001, 5.0])).answer == "yes"
    assert feasibility(problem, WrenchBounds(component=[5.0, 1.9999, 5.0])).answer == "no"


def test_the_greatest_scale_lies_between_a_wrench_and_a_proof() -> None:
    controller, state, desired = block(), Motion(0.5, 0.3), Motion(0.5, 0.3, 1.0)
    known = controller.uncertainty
    assert known is not None
    last = 0.0
    for moment in (1.5, 2.0, 3.0):
        bounds = WrenchBounds(force=3.0, moment=moment)
        found = feasible_scale(controller, state, desired, bounds=bounds)
        assert found.ends == "bounds"
        assert last < found.scale < found.above <= found.scale * (1.0 + 1.001e-4)
        assert found.certificate is not None
        assert accepted(found.certificate.as_dict())
        for scale, answer in ((found.scale, "yes"), (found.above, "no")):
            scaled = replace(controller, uncertainty=known.scaled(scale))
            assert feasibility(scaled.problem(state, desired), bounds).answer == answer
        last = found.scale


def test_a_scale_ends_in_other_ways_too() -> None:
    controller, state = block(), Motion(0.5)
    assert feasible_scale(controller, state, bounds=WrenchBounds()).scale == np.inf
    heavy = block(com=0.0, inertia=1.0, mu=0.25)
    ample = feasible_scale(heavy, state, bounds=WrenchBounds(force=1e3, moment=1e3))
    assert ample.ends == "worlds"  # a mass of 1 +- 0.2 kg five times as wide is 0 at its low end
    assert ample.scale == pytest.approx(5.0, rel=1e-3)
    assert ample.certificate is None
    none = feasible_scale(controller, state, bounds=WrenchBounds(force=0.1, moment=0.1))
    assert (none.scale, none.ends) == (0.0, "nominal")
    assert none.certificate is not None
    assert none.certificate.holds()
    with pytest.raises(ValueError, match="one with a set"):
        feasible_scale(replace(controller, uncertainty=None), state, bounds=WrenchBounds())
