"""What the horizon must reduce to: per-step laws, balance, MuJoCo's free body, a stationary point; what it refuses."""

import mujoco
import numpy as np
import pytest
from pivoting.controller import (
    Body,
    BodyState,
    Contact,
    Horizon,
    Law,
    Motion,
    Plan,
    Planner,
    WrenchBounds,
    WrenchController,
    solve,
)
from pivoting.controller.planning.equations_of_motion import Path
from pivoting.controller.planning.horizon_program import Guess
from scipy.optimize import lsq_linear, minimize

from tests.horizon_draws import INTEGRATORS
from tests.horizon_equations import Equations, Poses
from tests.test_horizon import block, poses, turn

TILT = np.deg2rad(10.0)


def desired(horizon: Horizon, state: BodyState, step: float) -> tuple[np.ndarray, np.ndarray]:
    """An arc about the contacts by `step` [rad] each time."""
    return horizon.arc([turn(TILT + step * t) for t in range(1, horizon.steps + 1)], state)


class Program:
    """The nonlinear program about a plan, by the independent equations: x are corrections of poses, then w and f."""

    def __init__(self, plan: Plan, state: BodyState, wanted: tuple[np.ndarray, np.ndarray]):
        self.eq = Equations(plan.horizon, state, wanted)
        self.about: Poses = poses(self.eq, plan)
        self.answer = self.eq.joined(plan.wrench, plan.force)

    def cost(self, x: np.ndarray) -> float:
        d, w, f = self.eq.split(x)
        return self.eq.objective(self.eq.corrected(self.about, d), w, f) / self.eq.weight**2

    def zero(self, x: np.ndarray) -> np.ndarray:
        d, w, f = self.eq.split(x)
        terms = self.eq.terms(self.eq.corrected(self.about, d), w, f)
        motion = terms.motion / self.eq.units[self.eq.nq : 2 * self.eq.nq]
        return np.append(motion, terms.sticking / self.eq.lever if self.eq.horizon.stick else [])

    def positive(self, x: np.ndarray) -> np.ndarray:
        _, w, f = self.eq.split(x)
        dim, horizon = self.eq.dim, self.eq.horizon
        mu = np.array([contact.mu for contact in horizon.controller.contacts])
        cones = mu * f[..., -1] - np.linalg.norm(f[..., :-1], axis=-1)
        bound = horizon.bounds.force - np.linalg.norm(w[:, :dim], axis=1)
        rate = horizon.bounds.force_rate * horizon.h - np.linalg.norm(np.diff(w[:, :dim], axis=0), axis=1)
        return np.concatenate([cones.ravel(), f[..., -1].ravel(), bound, rate]) / self.eq.weight

    def unstationary(self, x: np.ndarray) -> float:
        """|gradient - multipliers' pull|, the best multipliers with the right signs, relative to the gradient."""
        gradient = derivative(self.cost, x)[0]
        active = self.positive(x) < 1e-5
        rows = np.vstack([derivative(self.zero, x), derivative(self.positive, x)[active]])
        free = len(rows) - np.count_nonzero(active)
        lower = np.where(np.arange(len(rows)) < free, -np.inf, 0.0)
        found = lsq_linear(rows.T, gradient, (lower, np.inf), tol=1e-14)
        return float(np.abs(found.fun).max() / np.abs(gradient).max())


def derivative(of, x: np.ndarray, step: float = 1e-4) -> np.ndarray:  # type: ignore[no-untyped-def]
    """(m, n), central differences."""
    columns = [(np.atleast_1d(of(x + e)) - np.atleast_1d(of(x - e))) / (2.0 * step) for e in step * np.eye(len(x))]
    return np.array(columns).T


def tilting(dim: int, stick: bool) -> tuple[Plan, Program]:
    """Three steps up from 10 degrees, |F| and its rate bounded below what they would be, friction at its edge."""
    controller, state = block(dim, 0.4)
    free, bounds = None, WrenchBounds()
    for _ in range(2):
        horizon = Horizon(
            controller, 3, 0.05, integrator="semi-implicit", Q=3e3 * np.eye(len(controller.Q_w)), stick=stick, edges=0,
            bounds=bounds,
        )  # fmt: skip
        wanted = desired(horizon, state, 0.03)
        free = Planner(horizon).plan(state, wanted)
        assert free.status == "solved"
        F = free.wrench[:, :dim]
        change = np.linalg.norm(np.diff(F, axis=0), axis=1).max()
        bounds = WrenchBounds(0.95 * np.linalg.norm(F, axis=1).max(), force_rate=0.8 * change / 0.05)
    return free, Program(free, state, wanted)


@pytest.mark.parametrize("stick", [False, True])
@pytest.mark.parametrize("dim", [2, 3])
def test_the_converged_plan_is_a_stationary_point(dim: int, stick: bool) -> None:
    """KKT conditions of the nonlinear program, to 1e-5; a plan that is off by 1e-3 fails them."""
    _, program = tilting(dim, stick)
    assert np.count_nonzero(program.positive(program.answer) < 1e-5) >= 2
    assert program.unstationary(program.answer) <= 1e-5
    off = program.answer + 1e-3 * np.random.default_rng(0).normal(size=program.answer.size)
    assert program.unstationary(off) > 1e-4


def test_an_nlp_solver_finds_nothing_better() -> None:
    """SLSQP, from the answer disturbed by a tenth, comes back to it."""
    _, program = tilting(2, False)
    away = program.answer + 0.1 * np.random.default_rng(1).normal(size=program.answer.size)
    found = minimize(
        program.cost,
        away,
        jac=lambda x: derivative(program.cost, x)[0],
        constraints=[
            {"type": "eq", "fun": program.zero, "jac": lambda x: derivative(program.zero, x)},
            {"type": "ineq", "fun": program.positive, "jac": lambda x: derivative(program.positive, x)},
        ],
        method="SLSQP",
        options={"ftol": 1e-14, "maxiter": 500},
    )
    assert found.fun == pytest.approx(program.cost(program.answer), rel=1e-7)
    np.testing.assert_allclose(found.x, program.answer, atol=1e-7)


@pytest.mark.parametrize("dim", [2, 3])
def test_one_stiff_step_is_the_quasi_dynamic_law(dim: int) -> None:
    """With tracking met exactly and N = 1; the law takes J_c before the step, the notes after it: first order."""
    h = 0.05
    controller, state = block(dim)
    law = WrenchController(
        controller.body, controller.contacts, Law.quasi_dynamic(h), controller.gravity, Q_w=controller.Q_w
    )
    horizon = Horizon(controller, 1, h, Q=1e11 * np.eye(len(controller.Q_w)))
    off = []
    for step in (1e-2, 1e-3, 1e-4):
        plan = Planner(horizon).plan(state, desired(horizon, state, step))
        now, then = (TILT, TILT + step) if dim == 2 else (turn(TILT), turn(TILT + step))
        wanted = solve(law.problem(Motion(now), Motion(then)))
        off.append(np.abs(plan.wrench[0] - wanted.wrench).max() / 10.0)
        assert plan.status == "solved"
    assert off[0] < 0.1
    assert off[1] < 0.12 * off[0]
    assert off[2] < 0.12 * off[1]


@pytest.mark.parametrize("integrator", INTEGRATORS)
@pytest.mark.parametrize("dim", [2, 3])
def test_at_rest_it_is_balance(dim: int, integrator: str) -> None:
    """Every step of a stiff horizon that is to stay where it is; what is left falls as 1 / Q."""
    controller, state = block(dim)
    balance = solve(controller.problem(Motion(TILT if dim == 2 else turn(TILT))))
    off = []
    for stiff in (1e6, 1e8):
        horizon = Horizon(controller, 4, 0.05, integrator=integrator, Q=stiff * np.eye(len(controller.Q_w)))
        plan = Planner(horizon).plan(state, desired(horizon, state, 0.0))
        assert plan.status == "solved"
        off.append(max(np.abs(plan.wrench - balance.wrench).max(), np.abs(plan.force - balance.force).max()) / 10.0)
    assert off[0] < 0.2
    assert off[1] < 0.02 * off[0]


@pytest.mark.parametrize("integrator", ["quasi-dynamic", "implicit"])
def test_slow_steps_balance_wherever_they_are(integrator: str) -> None:
    """h large: no inertia, and at each pose that is chosen the wrench is the balance problem's answer there."""
    controller, state = block()
    horizon = Horizon(controller, 3, 1e3, integrator=integrator, Q=20.0 * np.eye(3), stick=True)
    plan = Planner(horizon).plan(state, desired(horizon, state, 0.1))
    angles = controller.space.angle(plan.orientation)
    assert plan.status == "solved"
    assert np.abs(angles[1:] - TILT - [0.1, 0.2, 0.3]).max() > 0.01  # it gives way where that is cheaper
    for angle, wrench in zip(angles[1:], plan.wrench, strict=True):
        np.testing.assert_allclose(wrench, solve(controller.problem(Motion(angle))).wrench, atol=2e-5)


def test_semi_implicit_is_mujocos_free_body() -> None:
    """A tumbling body under a wrench fixed in its own axes: MuJoCo's motion has no defect, and is planned back."""
    h, N, mass = 0.01, 8, 2.0
    wrench = np.array([3.0, -5.0, 2.0, 0.4, 0.3, -0.6])
    spec = mujoco.MjSpec.from_string(
        f'<mujoco><option timestep="{h}" gravity="0 0 0" integrator="Euler"/><worldbody><body name="b"><freejoint/>'
        '<inertial pos="0 0 0" mass="2" fullinertia="0.3 0.5 0.4 0.05 -0.04 0.08"/></body></worldbody></mujoco>'
    )
    model = spec.compile()
    data = mujoco.MjData(model)
    inertia = np.array([[0.3, 0.05, -0.04], [0.05, 0.5, 0.08], [-0.04, 0.08, 0.4]])
    data.qpos[:] = [0.2, -0.1, 1.0, *(np.array([0.8, 0.2, -0.4, 0.4]))]
    data.qvel[:] = [0.5, 0.2, -0.3, 4.0, -3.0, 5.0]
    rows, rates = [data.qpos.copy()], [data.qvel.copy()]
    for _ in range(N):
        R = np.empty(9)
        mujoco.mju_quat2Mat(R, data.qpos[3:])
        data.xfrc_applied[1] = np.concatenate([R.reshape(3, 3) @ wrench[:3], R.reshape(3, 3) @ wrench[3:]])
        mujoco.mj_step(model, data)
        rows.append(data.qpos.copy())
        rates.append(data.qvel.copy())
    place, quat = (np.ascontiguousarray(each) for each in np.split(np.array(rows), [3], axis=1))
    R = np.array([mujoco.mju_quat2Mat(m := np.empty(9), q) or m.reshape(3, 3) for q in quat])
    spin = np.einsum("tij,tj->ti", R, np.array(rates)[:, 3:])  # a free joint's rates are in object axes
    state = BodyState(place[0], quat[0], rates[0][:3], spin[0])
    controller = WrenchController(
        Body(mass, inertia), [Contact((0.1, 0.2, -0.3), 0.5)], Law.static(), (0.0, 0.0, 0.0),
        Q_w=1e-4 * np.eye(6), Q_f=1e6 * np.eye(3),
    )  # fmt: skip
    horizon = Horizon(controller, N, h, integrator="semi-implicit", Q=1e10 * np.eye(6))
    planner = Planner(horizon)
    start = horizon.start(state)
    played = Guess(Path(place, quat, start.before, start.arriving), np.tile(wrench, (N, 1)), np.zeros((N, 3)))
    assert planner.program.defects(played)[0] <= 1e-8
    for other in ("implicit", "quasi-dynamic", "forward"):  # which are not MuJoCo's
        of = Planner(Horizon(controller, N, h, integrator=other)).program
        assert of.defects(played)[0] > 1e-3
    plan = planner.plan(state, (place[1:], quat[1:]))
    assert plan.status == "solved"
    np.testing.assert_allclose(plan.position, place, atol=1e-8)
    np.testing.assert_allclose(plan.velocity, np.array(rates)[:, :3], atol=1e-6)
    np.testing.assert_allclose(plan.angular_velocity, spin, atol=1e-6)
    np.testing.assert_allclose(plan.wrench, np.tile(wrench, (N, 1)), atol=1e-4)


def horizon(**change: object) -> Horizon:
    controller, _ = block()
    return Horizon(**{"controller": controller, "steps": 3, "h": 0.05, **change})  # type: ignore[arg-type]


def planned(
    method: str | None = None, options: dict | None = None, state: dict | None = None, **change: object
) -> Plan:
    controller, began = block()
    mine = Horizon(controller, 3, 0.05, bounds=WrenchBounds(force_rate=1e3))
    planner = Planner(mine, method, **(options or {}))
    wanted = change.pop("desired", desired(mine, began, 0.01))
    return planner.plan(began._replace(**(state or {})), wanted, **change)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: horizon(controller=3), "controller = 3.*WrenchController"),
        (lambda: horizon(steps=0), "steps = 0.*whole number from 1 to 1000"),
        (lambda: horizon(steps=2.5), "steps = 2.5.*whole number"),
        (lambda: horizon(steps=True), "steps = True.*whole number"),
        (lambda: horizon(h=0.0), "h = 0.*> 0"),
        (lambda: horizon(h=np.nan), "h = nan.*> 0"),
        (lambda: horizon(integrator="euler"), "integrator = 'euler'.*semi-implicit"),
        (lambda: horizon(Q=np.eye(2)), r"Q = .*shape \(3, 3\)"),
        (lambda: horizon(Q=-np.eye(3)), "Q = .*positive definite"),
        (lambda: horizon(bounds=3.0), "bounds = 3.0.*WrenchBounds"),
        (lambda: horizon(bounds=WrenchBounds(component=np.ones(6))), "component = .*3 numbers"),
        (lambda: horizon(stick="no"), "stick = 'no'.*True or False"),
        (lambda: horizon(clear=[[1.0, 2.0]]), r"clear = .*shape \(any, 3\)"),
        (lambda: horizon(clear=[[1.0, 2.0, np.inf]]), "clear = .*finite"),
        (lambda: horizon(edges=2), "edges = 2.*whole number >= 3"),
        (lambda: horizon(edges=False), "edges = False.*whole number >= 3"),
        (lambda: horizon().arc(np.zeros((2, 4)), block()[1]), r"orientations = .*shape \(3, 4\)"),
        (lambda: WrenchBounds(force=0.0), "force = 0.0.*> 0"),
        (lambda: WrenchBounds(moment=-1.0), "moment = -1.0.*> 0"),
        (lambda: WrenchBounds(force_rate=np.nan), "force_rate = nan.*> 0"),
        (lambda: WrenchBounds(moment_rate="fast"), "moment_rate = 'fast'.*> 0"),
        (lambda: WrenchBounds(component=[1.0, 2.0]), r"component = \[1.0, 2.0\].*3 .*6"),
        (lambda: WrenchBounds(component=[1.0, 0.0, 1.0]), "component = .*> 0"),
        (lambda: WrenchBounds(component="all"), "component = 'all'.*numbers > 0"),
        (lambda: Planner(3), "horizon = 3.*Horizon"),  # type: ignore[arg-type]
        (lambda: planned("simplex"), "method = 'simplex'.*clarabel"),
        (lambda: planned("closed-form"), "method = 'closed-form'.*clarabel"),
        (lambda: Planner(Horizon(block(3)[0], 2, 0.1), "qp:piqp"), "method = 'qp:piqp'.*clarabel.*cones"),
        (lambda: planned("clarabel", {"tolerance": 1.0}), "options = 'tolerance'.*Clarabel"),
        (lambda: planned(passes=0), "passes = 0.*>= 1"),
        (lambda: planned(passes=1.5), "passes = 1.5.*whole number"),
        (lambda: planned(tolerance=0.0), "tolerance = 0.0.*> 0"),
        (lambda: planned(desired=(np.zeros((2, 3)), np.zeros((3, 4)))), r"positions = .*shape \(3, 3\)"),
        (lambda: planned(desired=(np.zeros((3, 3)), np.zeros((3, 4)))), "orientations = .*unit quaternion"),
        (lambda: planned(applied=np.ones(2)), r"applied = .*shape \(3\)"),
        (lambda: planned(applied=np.full(3, np.nan)), "applied = .*finite"),
        (lambda: planned(guess=3), "guess = 3.*Guess"),
        (lambda: planned(forces=3), "forces = 3.*contact forces"),
        (lambda: planned(forces=(np.zeros((3, 2)), np.zeros((3, 2)))), r"forces: wrenches = .*shape \(3, 3\)"),
        (lambda: planned(forces=(np.zeros((3, 3)), np.zeros((2, 2)))), r"forces: forces = .*shape \(3, 2\)"),
        (lambda: planned(forces=(np.full((3, 3), np.nan), np.zeros((3, 2)))), "forces: wrenches = .*finite"),
        (lambda: planned(guess=planned().guess, forces=(np.zeros((3, 3)), np.zeros((3, 2)))), "forces = .*left out"),
        (lambda: planned("qp:piqp", {"kkt_solver": "simplex"}), "options = 'simplex'.*KKT solver"),
        (lambda: planned(state={"position": np.zeros(2)}), r"position = .*shape \(3\)"),
        (lambda: planned(state={"orientation": np.zeros(4)}), "orientation = .*unit quaternion"),
        (lambda: planned(state={"velocity": np.full(3, np.nan)}), "velocity = .*finite"),
        (lambda: planned(state={"angular_velocity": 1.0}), r"angular_velocity = .*shape \(3\)"),
    ],
)  # fmt: skip
def test_bad_input_is_named(make, message: str) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(ValueError, match=message):
        make()
