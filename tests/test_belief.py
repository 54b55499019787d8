"""What controllers believe: apart by what changes apart, shared by the worlds or one for each of them."""

from pathlib import Path

import numpy as np
import pytest
from pivoting import load
from pivoting.controller import Body, Contact, Law, Motion, WrenchController, solve
from pivoting.controller.belief import for_worlds
from pivoting.controller.planning.horizon import Horizon
from pivoting.controller.rotations import rotation_matrix
from pivoting.sim import Run, chunks, simulate
from scipy.spatial.transform import Rotation

from tests.own_files import mjcf, own

CORNER = (-0.5, -0.5)


def believing(mass: float, mu: float = 0.4, com: float = 0.0, law: Law | None = None) -> WrenchController:
    """A controller of the planar scenes that believes in another mass, friction and centre of mass."""
    corner = Contact((com - 0.5, -0.5), mu)
    return WrenchController(Body(mass, mass / 6.0), [corner], law or Law.dynamic(), (0.0, -10.0))


CHANGES = {"pivot-2d": {"seconds": 0.3}, "mpc-2d": {"seconds": 0.03, "force_max": 8.0, "limits": {"settle_s": 0.015}}}


@pytest.mark.parametrize("name", CHANGES)
def test_a_controller_for_each_world_is_as_many_runs(name: str) -> None:
    """Bit for bit, also where each world plans, and is bounded."""
    own = simulate(name, **CHANGES[name]).attached.controller
    controllers = [
        WrenchController(Body(mass, mass / 6.0), own.contacts, own.law, own.gravity, margin=own.margin, Q_w=own.Q_w)
        for mass in (1.0, 1.2, 0.9)
    ]
    fleet = simulate(name, worlds=3, seed=4, controller=controllers, **CHANGES[name])
    for i, controller in enumerate(controllers):
        alone = simulate(name, seed=4, first_world=i, controller=controller, **CHANGES[name])
        assert np.array_equal(fleet.wrench[i], alone.wrench[0])
        assert np.array_equal(fleet.quaternion[i], alone.quaternion[0])
    assert not np.array_equal(fleet.wrench[0], fleet.wrench[1])


def test_a_fleet_in_chunks_has_the_controller_of_each_world(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each of them starts as deep in the table as its own controller lets it rest, and can be run again alone."""
    monkeypatch.setattr(chunks, "CHUNK", 1)
    case = own(tmp_path, mjcf())
    first = simulate(case).attached.controller
    controllers = [
        WrenchController(Body(share * first.body.mass, first.body.inertia), first.contacts, first.law, first.gravity)
        for share in (1.0, 1.15)
    ]
    run = simulate(case, worlds=2, controller=controllers)
    fleet = simulate(case, worlds=2, controller=controllers, keep="measures")
    for name, values in vars(run.measures).items():
        assert np.array_equal(getattr(fleet.measures, name), values, equal_nan=True), name
    assert np.array_equal(fleet.replay(1).position[0], run.position[1])
    assert run.position[0, 0, 2] > run.position[1, 0, 2]  # the heavier one is believed to press it in
    again = load(run.save(tmp_path / "kept"), controller=controllers)
    assert isinstance(again, Run)
    assert np.array_equal(again.wrench, run.wrench)
    assert again.controller_of(1).body.mass == controllers[1].body.mass


def test_beliefs_that_are_shared_are_stacked_once() -> None:
    beliefs, unknown = for_worlds([believing(1.0).belief, believing(2.0, 0.3, 0.1).belief])
    assert unknown is None
    (mass, _, _), contacts, (wrench_map, _), law = beliefs
    assert mass.tolist() == [1.0, 2.0]
    assert contacts[6].tolist() == [[0.4], [0.3]]
    assert wrench_map.shape == (3, 6)
    assert law == believing(1.0).belief.law
    assert for_worlds([believing(1.0).belief])[0][0][0].shape == (1,)


@pytest.mark.parametrize(
    ("controllers", "message"),
    [
        ([believing(1.0)], r"^controller = '1 of them': must be one, or one for each of the 2 worlds$"),
        ([believing(1.0), "mine"], r"^controller = 'mine': must be a WrenchController, or a list"),
        ([believing(1.0), believing(1.0, law=Law.static())], r"^controller\[1\] = 'one of another law"),
    ],
)
def test_controllers_that_do_not_go_together_are_refused(controllers: list, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        simulate("pivot-2d", worlds=2, controller=controllers)


def test_one_plan_is_played_for_one_controller() -> None:
    with pytest.raises(ValueError, match=r"^controller = '2 of them': must be one in open loop"):
        simulate("mpc-2d", worlds=2, controller=[believing(1.0), believing(1.1)], open_loop=True)


SPATIAL = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))[0]


@pytest.mark.parametrize("dim", [2, 3])
def test_a_frame_that_is_fixed_to_the_object_turns_with_it(dim: int) -> None:
    """A corner of the environment on a face of the object: as if the frame were given anew at every orientation."""
    angle = 0.7
    frame = np.array([[np.cos(0.2), -np.sin(0.2)], [np.sin(0.2), np.cos(0.2)]]) if dim == 2 else SPATIAL
    point, gravity = ((0.2, -0.5), (0.0, -10.0)) if dim == 2 else ((0.2, 0.1, -0.5), (0.0, 0.0, -10.0))
    body = Body(2.0, 0.3 if dim == 2 else np.diag([0.3, 0.4, 0.5]))

    def controller(contact: Contact) -> WrenchController:
        return WrenchController(body, [contact], Law.dynamic(), gravity)

    held = controller(Contact(point, 0.5, frame=frame, fixed_to="object"))
    state = Motion(angle) if dim == 2 else Motion(np.roll(Rotation.from_rotvec([0.3, -0.5, angle]).as_quat(), 1))
    R = rotation_matrix(held.space.lift_motion(state)[0])
    turned = R[::2, ::2] @ frame if dim == 2 else R @ frame
    now = controller(Contact(point, 0.5, frame=turned))
    first, second = held.problem(state), now.problem(state)
    assert np.allclose(first.jacobian, second.jacobian, atol=1e-14)
    assert np.allclose(first.required, second.required, atol=1e-13)
    assert np.allclose(solve(first).wrench, solve(second).wrench, atol=1e-9)
    still = controller(Contact(point, 0.5, frame=frame))
    assert not np.allclose(first.jacobian, still.problem(state).jacobian, atol=1e-3)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"fixed_to": "finger"}, r"^fixed_to = 'finger': must be one of environment, object$"),
        ({"fixed_to": "object"}, r"^fixed_to = 'object': must be with a frame"),
        ({"fixed_to": "object", "frame": np.eye(2), "radius": 0.1}, r"^fixed_to = 'object': must be with a frame, and"),
    ],
)
def test_what_a_frame_cannot_be_fixed_to(given: dict, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        Contact(CORNER, 0.3, **given)


def test_a_horizon_is_of_contacts_on_the_environment() -> None:
    held = WrenchController(
        Body(1.0, 0.2), [Contact(CORNER, 0.3, frame=np.eye(2), fixed_to="object")], Law.dynamic(), (0.0, -10.0)
    )
    with pytest.raises(ValueError, match=r"contact on the object': must be one whose contacts are on the environment"):
        Horizon(held, 5, 0.01)
