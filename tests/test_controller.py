"""`WrenchController` and its compiled loop: the same functions for one state and for many worlds, never stale."""

import os
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from pivoting.controller import Body, Contact, Law, Motion, WrenchController, solve
from pivoting.controller.belief import for_worlds
from pivoting.controller.kernels.compiled_step import apply_wrenches, step_worlds
from pivoting.controller.kernels.kernel_cache import drop_stale
from pivoting.controller.validate import frozen
from scipy.spatial.transform import Rotation

BLOCK = WrenchController(
    Body(2.0, 0.3), [Contact((-0.4, -0.6), 0.35, f_min=3.0)], Law.dynamic(), (1.0, -9.0), margin=0.1
)

EDGE = WrenchController(
    Body(2.0, np.diag([0.4, 0.5, 0.3])),
    [Contact((-0.5, -0.35, -0.7), 0.5, 0.2), Contact((-0.5, 0.35, -0.7), 0.5, 0.2)],
    Law.static(),
    (0.0, 0.0, -10.0),
)


class Stepped(NamedTuple):
    """What `step_worlds` writes."""

    required: np.ndarray
    wrench: np.ndarray
    force: np.ndarray
    residual: np.ndarray
    status: np.ndarray


def states(q: np.ndarray, omega: np.ndarray) -> np.ndarray:
    """(W, 13) of which only orientations (W, 4) and angular velocities (W, 3) matter; read-only, as in the loop."""
    return frozen(np.hstack([np.zeros((len(q), 3)), q, np.zeros((len(q), 3)), omega]))


def stepped(
    controller: WrenchController,
    q: np.ndarray,
    omega: np.ndarray,
    desired: Motion,
    external: np.ndarray | None = None,
    tolerance: float = 1e-9,
) -> Stepped:
    """One step of worlds at q (W, 4), omega (W, 3), with the same reference for all."""
    W, nw, n = len(q), len(controller.Q_w), len(controller.Q_f)
    out, status = np.ones((W, 2 * nw + n + 1)), np.full(W, 9, np.int8)
    reference = np.concatenate(controller.space.lift_motion(desired))[None]
    known = np.zeros((1, nw)) if external is None else external
    belief = for_worlds([controller.belief])
    step_worlds(*belief, None, *controller.workspace(), tolerance, states(q, omega), reference, known, out, status)
    return Stepped(*np.split(out[:, :-1], [nw, 2 * nw], axis=1), out[:, -1], status)


def test_many_worlds_are_as_many_problems() -> None:
    rng = np.random.default_rng(4)
    thetas, omegas, external = rng.uniform(0.1, 1.4, 50), rng.normal(size=50), rng.normal(size=(50, 3))
    desired = Motion(0.7, 0.2, -1.0)
    many = stepped(BLOCK, BLOCK.space.orientation(thetas), BLOCK.space.axial(omegas), desired, external)
    assert not many.status.any()
    for i in range(50):
        solution = solve(BLOCK.problem(Motion(thetas[i], omegas[i]), desired, external=external[i]))
        np.testing.assert_allclose(many.required[i], solution.problem.required, rtol=1e-13, atol=1e-13)
        np.testing.assert_allclose(many.wrench[i], solution.wrench, rtol=1e-12, atol=1e-12)
        np.testing.assert_allclose(many.force[i], solution.force[0], rtol=1e-12, atol=1e-12)
        assert many.residual[i] == pytest.approx(solution.residual, abs=1e-15)


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("shared", [True, False], ids=["the same for all", "of each world"])
def test_with_a_known_wrench_at_work_the_object_balances(dim: int, shared: bool) -> None:
    """Weight, contact forces at their levers, the answer and what is known sum to nothing, worked out in world axes."""
    rng, axes = np.random.default_rng(8), Rotation.from_rotvec
    if dim == 2:
        controller = WrenchController(BLOCK.body, BLOCK.contacts, Law.static(), (1.0, -9.0))
        points, turns = np.array([[-0.4, 0.0, -0.6]]), [axes([0.0, -angle, 0.0]) for angle in (0.2, 0.9)]
        weight = 2.0 * np.array([1.0, 0.0, -9.0])
    else:
        controller, points = EDGE, np.array([[-0.5, -0.35, -0.7], [-0.5, 0.35, -0.7]])
        turns, weight = [axes([0.0, -0.3, 0.1]), axes([0.1, -1.0, 0.0])], np.array([0.0, 0.0, -20.0])
    q = np.array([np.roll(turn.as_quat(), 1) for turn in turns])
    known = rng.normal(size=(1 if shared else 2, len(controller.Q_w)))
    desired = Motion(0.5) if dim == 2 else Motion(q[0])
    out = stepped(controller, q, np.zeros((2, 3)), desired, known)
    assert not out.status.any()
    for i, turn in enumerate(turns):
        state = Motion((0.2, 0.9)[i]) if dim == 2 else Motion(q[i])
        alone = solve(controller.problem(state, external=known[i % len(known)]))
        for wrench, forces in ((out.wrench[i], out.force[i].reshape(-1, dim)), (alone.wrench, alone.force)):
            applied = wrench + known[i % len(known)]
            if dim == 2:  # (F_x, F_z, M about -y)
                force, moment = np.array([applied[0], 0.0, applied[1]]), np.array([0.0, -applied[2], 0.0])
                forces = np.insert(forces, 1, 0.0, axis=1)
            else:
                force, moment = applied[:3], applied[3:]
            levers = turn.apply(points)
            np.testing.assert_allclose(turn.apply(force) + forces.sum(axis=0) + weight, 0.0, atol=1e-12)
            about = np.cross(levers, forces).sum(axis=0)
            np.testing.assert_allclose(turn.apply(moment) + about, 0.0, atol=1e-12)


def test_a_state_that_is_not_a_number_has_no_answer_and_applies_nothing() -> None:
    q = np.stack([BLOCK.space.orientation(0.5), np.full(4, np.nan)])
    out = stepped(BLOCK, q, np.zeros((2, 3)), Motion(0.5))
    assert out.status.tolist() == [0, 2]
    assert np.isnan(out.wrench[1]).all()
    applied, xfrc = np.ones((2, 6)), np.ones((2, 3, 6))
    apply_wrenches(BLOCK.belief.source.map, states(q, np.zeros((2, 3))), out.wrench.copy(), 0, applied, xfrc, 1)
    assert np.array_equal(xfrc[:, 1], applied)
    assert (xfrc[:, [0, 2]] == 1.0).all()
    assert applied[0].any()
    assert not applied[1].any()


def test_a_tolerance_that_is_not_met_is_a_status() -> None:
    q, omega = BLOCK.space.orientation(np.array([0.5])), np.zeros((1, 3))
    assert stepped(BLOCK, q, omega, Motion(0.5), tolerance=-1.0).status.tolist() == [1]


def test_kernels_compiled_of_other_sources_are_dropped(tmp_path: Path) -> None:
    """Also where the new source is the older file, as an installer that keeps dates may leave it."""
    cache = tmp_path / "cache"
    cache.mkdir()
    source, index, code = tmp_path / "law.py", cache / "law.f-1.py311.nbi", cache / "law.f-1.py311.1.nbc"
    source.write_text("mu = 1")
    assert drop_stale(cache, tmp_path) == []
    for path in (index, code):
        path.write_text("")
    os.utime(source, (100.0, 100.0))
    assert drop_stale(cache, tmp_path) == []
    assert index.exists()
    source.write_text("mu = 2")
    os.utime(source, (100.0, 100.0))
    assert set(drop_stale(cache, tmp_path)) == {index, code}
    assert drop_stale(cache, tmp_path) == []
    assert not list(cache.glob("*.nb*"))


@pytest.mark.parametrize(
    "external", [[1.0, 2.0], [0.0, 0.0, float("nan")], "none"], ids=["wrong shape", "not finite", "text"]
)
def test_a_known_wrench_that_is_none_is_refused(external: object) -> None:
    with pytest.raises(ValueError, match=r"external = .*: must be"):
        BLOCK.problem(Motion(0.5), external=external)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"contacts": []}, "contacts = .*at least one"),
        ({"contacts": [Contact((0.0, 0.0), 0.3)]}, "contacts = .*away from the centre of mass"),
        ({"contacts": [Contact((0.0, 1.0), 0.3), Contact((0.0, 1.0, 0.0), 0.3)]}, "contacts = .*all planar"),
        ({"gravity": (0.0, float("nan"))}, "gravity = .*finite"),
        ({"gravity": (0.0,)}, "gravity = .*shape"),
        ({"margin": 1.0}, "margin = 1.0"),
        ({"Q_w": -np.eye(3)}, "Q_w = .*positive definite"),
    ],
)
def test_bad_input_is_named(change: dict, message: str) -> None:
    good = {
        "body": Body(1.0, 0.1),
        "contacts": [Contact((0.0, -1.0), 0.3)],
        "law": Law.static(),
        "gravity": (0.0, -10.0),
    }
    with pytest.raises(ValueError, match=message):
        WrenchController(**{**good, **change})
