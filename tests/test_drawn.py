"""What a recording draws is what happened: the wrench that was applied, what was required, the object's own shape."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
from pivoting.controller import Body, Contact, Law, WrenchController
from pivoting.controller.solution import BOUNDED, FAILED
from pivoting.sim import Run, own_object, simulate
from pivoting.sim.drawing.recorded_world import Film
from pivoting.sim.drawing.recording_id import digest
from pivoting.sim.drawing.rerun_recording import record
from scipy.spatial.transform import Rotation

from tests.altered_runs import altered
from tests.own_files import mjcf, pivoted
from tests.recordings import one_each, read, steps

RUNS: dict[str, tuple[str, dict[str, Any]]] = {
    "a law": ("snap-2d", {}),
    "another world": ("snap-2d", {"world.mu": 0.28, "world.mass": 1.05, "world.incline": 1.0, "world.gravity": 9.5}),
    "an incline": ("incline-2d", {"seconds": 1.0}),
    "a bound": ("pivot-2d", {"force_max": 8.0, "seconds": 1.0}),
    "short of bounds": ("pivot-2d", {"force_max": 6.0, "moment_max": "0.2w", "seconds": 0.4}),
    "rates": ("balance-2d", {"reference": "sine", "amplitude": 2.0, "seconds": 0.8, "force_rate": 8.0}),
    "plans": ("mpc-2d", {}),
    "plans short of bounds": ("mpc-2d", {"seconds": 0.6, "plan_step": 0.02, "force_max": "0.6w", "moment_max": "0.3w"}),
    "open loop": ("mpc-2d", {"open_loop": True}),
}
SHORT = {"short of bounds", "plans short of bounds"}


@pytest.fixture(scope="module", params=RUNS)
def case(request: pytest.FixtureRequest) -> tuple[str, Run]:
    name, keys = RUNS[request.param]
    return request.param, simulate(name, **keys)


def replayed(run: Run) -> np.ndarray:
    """(N, 3) the applied wrench in object axes, of the forces on the body and the orientation that MuJoCo has."""
    data, body = mujoco.MjData(run.model), run.truth.index
    data.qpos[:], data.qvel[:] = run.start[0][0], run.start[1][0]
    out = []
    for applied in run.wrench_world[0]:
        mujoco.mj_kinematics(run.model, data)
        R = data.xmat[body].reshape(3, 3).T
        force, torque = R @ applied[:3], R @ applied[3:]
        out.append([force[0], force[2], -torque[1]])
        data.xfrc_applied[body] = applied
        mujoco.mj_step(run.model, data)
    return np.array(out)


def test_the_wrench_drawn_is_the_one_applied(case: tuple[str, Run], tmp_path: Path) -> None:
    """Against the log, bit for bit; against MuJoCo; and in the file, to single precision."""
    _, run = case
    film = Film(run, 0, None, None)
    k, load, length = film.space_rows, run.load.force, film.length
    assert len(k) > 15
    assert np.array_equal(film.space.wrench, run.wrench[0, k])
    assert np.abs(film.space.wrench - replayed(run)[k]).max() < 1e-12 * load
    entities = read(record(run, tmp_path / "run.rrd"))
    assert np.array_equal(steps(entities["/wrench_space/wrench"]), k)
    for part, values in (("wrench", run.wrench), ("required", run.required)):
        drawn = one_each(entities[f"/wrench_space/{part}"]["Arrows3D:vectors"])
        assert np.array_equal(drawn, (values[0, k] / [1.0, 1.0, length]).astype(np.float32)), part


def test_the_polygon_closes_where_all_was_given(case: tuple[str, Run], tmp_path: Path) -> None:
    """w + J f = required to 1e-12 of the load, with J f from the pose; else what is lacking is drawn."""
    name, run = case
    film = Film(run, 0, None, None)
    k, space = film.space_rows, film.space
    weights = np.abs(space.lacking / (run.load.force * np.array([1.0, 1.0, run.load.lever]))).max(axis=1)
    solved, bounded = run.status[0, k] == 0, run.status[0, k] == BOUNDED
    assert solved.any()
    assert weights[solved].max() < 1e-12
    every = [
        run.attached.controller.jacobian(q) @ f[0] for q, f in zip(run.quaternion[0, :-1], run.force[0], strict=True)
    ]
    gaps = (run.required[0] - run.wrench[0] - every)[run.status[0] == 0]  # also of the steps that are not drawn
    assert np.abs(gaps).max() < 1e-12 * run.load.force
    assert bounded.any() == (name in SHORT)
    assert (solved | bounded).all()
    assert (weights[bounded] > 1e-6).all()
    controller = run.attached.controller
    table = Rotation.from_quat(np.roll(run.attached.body.table, -1)).as_matrix()[:, [0, 2]]
    turned = Rotation.from_quat(np.roll(run.quaternion[0, k], -1, axis=1)).inv()
    push = turned.apply(run.force[0, k, 0] @ table.T)[:, [0, 2]]
    x, z = controller.contacts[0].point
    contact = np.column_stack([push, x * push[:, 1] - z * push[:, 0]])
    assert np.abs(space.contact - contact).max() < 1e-12 * run.load.force
    entities = read(record(run, tmp_path / "run.rrd"))
    contact = one_each(entities["/wrench_space/contact"]["Arrows3D:vectors"])
    cone = np.array(entities["/wrench_space/cone/fill"]["Mesh3D:vertex_positions"].to_pylist())
    admissible = np.array(entities["/wrench_space/admissible/fill"]["Mesh3D:vertex_positions"].to_pylist())
    required = one_each(entities["/wrench_space/required"]["Arrows3D:vectors"])
    scale = np.abs(required).max()
    assert np.allclose(cone + admissible, required[:, None], atol=1e-5 * scale)
    across = np.cross(cone[:, 1], cone[:, 2])
    assert np.abs(np.einsum("ij,ij->i", contact, across)).max() < 1e-5 * np.abs(across).max() * scale  # in its plane
    short = [entity for entity in entities if entity.startswith("/wrench_space/lacking")]
    assert short == ["/wrench_space/lacking/bounded"] * (name in SHORT)
    for entity in short:
        arrows = entities[entity]
        lacking, begin = (arrows[f"Arrows3D:{part}"].to_pylist() for part in ("vectors", "origins"))
        assert [bool(row) for row in lacking] == bounded.tolist()
        tips = np.array(begin)[bounded, 0] if all(begin) else np.array([row[0] for row in begin if row])
        assert np.allclose(tips + [row[0] for row in lacking if row], required[bounded], atol=1e-5 * scale)
        assert arrows["static Points3D:labels"].to_pylist() == [["bounded: lacking"]]


def test_without_an_answer_nothing_is_drawn_of_one(tmp_path: Path) -> None:
    """The arrow is of no wrench, as none was applied, and all that was required is lacking."""
    run = simulate("balance-2d", seconds=0.6)
    status, wrench, world = np.array(run.status), np.array(run.wrench), np.array(run.wrench_world)
    status[0, 300:], wrench[0, 300:], world[0, 300:] = FAILED, np.nan, 0.0
    entities = read(record(altered(run, status=status, wrench=wrench, wrench_world=world), tmp_path / "run.rrd"))
    late = steps(entities["/wrench_space/wrench"]) >= 300
    assert late.any()
    assert not one_each(entities["/wrench_space/wrench"]["Arrows3D:vectors"])[late].any()
    assert [bool(row) for row in entities["/wrench_space/contact"]["Arrows3D:vectors"].to_pylist()] == (~late).tolist()
    lacking = entities["/wrench_space/lacking/failed"]
    assert [bool(row) for row in lacking["Arrows3D:vectors"].to_pylist()] == late.tolist()
    drawn = np.array([row[0] for row in lacking["Arrows3D:vectors"].to_pylist() if row])
    assert np.array_equal(drawn, one_each(entities["/wrench_space/required"]["Arrows3D:vectors"])[late])
    assert "nothing applied" in lacking["static Points3D:labels"].to_pylist()[0][0]
    predicted = entities["/world/contact/predicted"]
    assert [bool(row) for row in predicted["Arrows3D:vectors"].to_pylist()] == (steps(predicted) < 300).tolist()


def test_ids_tell_models_contacts_and_controllers_apart(tmp_path: Path) -> None:
    """Equal runs have the same; a digest is of what was run, not of what came out."""
    box = """<mujoco><worldbody><geom type="plane" size="1 1 1"/><body name="box" pos="0 0 .1"><freejoint/>
    <geom type="box" size=".05 .04 {height}" mass=".4"/></body></worldbody></mujoco>"""
    models = []
    for height in (0.1, 0.11):
        (tmp_path / str(height)).mkdir()
        models.append(tmp_path / str(height) / "box.xml")
        models[-1].write_text(box.format(height=height))
    keys = {"seconds": 0.2}
    corner = [Contact((-0.5, -0.5), 0.3)]
    runs = {
        "box": simulate(own_object(models[0], "box", "edge"), **keys),
        "another box": simulate(own_object(models[1], "box", "edge"), **keys),
        "another contact": simulate(own_object(models[0], "box", "vertex"), **keys),
        "its own friction": simulate(own_object(models[0], "box", "edge", chosen=False), **keys),
        "block": simulate("pivot-2d", **keys),
        "floor": simulate("pivot-2d", **keys, f_min=1.0),
        "bound": simulate("pivot-2d", **keys, force_max=50.0),
        "world": simulate("pivot-2d", **keys, **{"world.mu": 0.31}),
    }
    for name, Q_w in (("given", np.eye(3)), ("given with other weights", 2.0 * np.eye(3))):
        given = WrenchController(Body(1.0, 1 / 6), corner, Law.dynamic(), (0.0, -10.0), margin=0.1, Q_w=Q_w)
        runs[name] = simulate("pivot-2d", **keys, controller=given)
    digests = {name: digest(run) for name, run in runs.items()}
    assert len(set(digests.values())) == len(runs), digests
    again = simulate("pivot-2d", **keys)
    assert digest(again) == digests["block"]
    assert (
        digest(replace(again, log=again.log._replace(control_ns=0.0 * again.control_us), wall_s=1.0))
        == digests["block"]
    )
    assert runs["box"].scenario.label == runs["another box"].scenario.label  # which did not tell them apart


PLANAR = """<mujoco><worldbody><geom name="floor" type="plane" size="2 2 .1"/>
<body name="L" pos="0 0 .1"><joint type="slide" axis="1 0 0"/><joint type="slide" axis="0 0 1"/>
<joint type="hinge" axis="0 -1 0"/><geom type="box" size=".2 .05 .1" mass="1"/>
<geom type="box" size=".05 .08 .1" pos=".15 0 .2" mass=".3"/></body></worldbody></mujoco>"""


def test_a_planar_object_of_ones_own_has_its_own_shape(tmp_path: Path) -> None:
    """The corners of its geoms, where MuJoCo has them; what is drawn before it is before the nearest."""
    model = tmp_path / "l.xml"
    model.write_text(PLANAR)
    run = simulate(own_object(model, "L", "vertex"), seconds=0.5)
    entities = read(record(run, tmp_path / "l.rrd"))
    solid = entities["/world/block/solid"]
    vertices = np.array(solid["static Mesh3D:vertex_positions"].to_pylist()[0])
    k, block = -1, entities["/world/block"]
    at, turn = one_each(block["Transform3D:translation"])[k], one_each(block["Transform3D:quaternion"])[k]
    drawn = np.unique(np.round(at + Rotation.from_quat(turn).apply(vertices), 5), axis=0)
    data = mujoco.MjData(run.model)
    data.qpos[:], data.qvel[:] = run.start[0][0], run.start[1][0]
    for applied in run.wrench_world[0]:
        data.xfrc_applied[run.truth.index] = applied
        mujoco.mj_step(run.model, data)
    mujoco.mj_kinematics(run.model, data)
    signs = np.stack(np.meshgrid(*[[-1.0, 1.0]] * 3), axis=-1).reshape(-1, 3)
    geoms = [i for i in range(run.model.ngeom) if run.model.geom_bodyid[i] == run.truth.index]
    corners = np.concatenate(
        [data.geom_xpos[i] + signs * run.model.geom_size[i] @ data.geom_xmat[i].reshape(3, 3).T for i in geoms]
    )
    assert len(drawn) == 16
    gaps = np.linalg.norm(drawn[:, None] - corners, axis=2)
    assert gaps.min(axis=0).max() < 1e-4
    assert gaps.min(axis=1).max() < 1e-4
    front = one_each(entities["/world/wrench"]["Transform3D:translation"])[:, 1]
    assert (front < -0.08).all()


TABLES = [
    'type="box" size=".3 .2 .25" pos="0 0 -.3" euler="90 0 0"',
    'type="box" size=".2 .3 .4" pos=".1 0 -.3" euler="0 90 25"',
    'type="cylinder" size=".3 .1" pos=".05 0 -.2" euler="180 0 0"',
]


@pytest.mark.parametrize("table", TABLES)
def test_a_table_is_drawn_where_mujoco_has_it(table: str, tmp_path: Path) -> None:
    """A box on any of its sides, and a cylinder: corners, or axis and sizes, are those of geom_xpos and geom_xmat."""
    run = pivoted(tmp_path, mjcf(floor=f'<geom name="t" {table}/>'), "vertex")
    drawn = read(record(run, tmp_path / "table.rrd"))["/world/table"]
    kind = "Boxes3D" if 'type="box"' in table else "Cylinders3D"
    values = {name.split(":")[1]: column.to_pylist()[0] for name, column in drawn.items() if kind in name}
    at, turn = (drawn[f"static Transform3D:{key}"].to_pylist()[0][0] for key in ("translation", "quaternion"))
    turned, geom, data = Rotation.from_quat(turn), run.model.geom("t").id, mujoco.MjData(run.model)
    mujoco.mj_kinematics(run.model, data)
    axes, size = data.geom_xmat[geom].reshape(3, 3), run.model.geom_size[geom]
    middle = at + turned.apply(values["centers"][0])
    if kind == "Cylinders3D":
        np.testing.assert_allclose(middle, data.geom_xpos[geom], atol=1e-6)
        assert abs(turned.as_matrix()[:, 2] @ axes[:, 2]) == pytest.approx(1.0)
        assert (values["radii"], values["lengths"]) == (pytest.approx([size[0]]), pytest.approx([2.0 * size[1]]))
        return
    signs = np.stack(np.meshgrid(*[[-1.0, 1.0]] * 3), axis=-1).reshape(-1, 3)
    corners = middle + turned.apply(signs * values["half_sizes"][0])
    gaps = np.linalg.norm(corners[:, None] - (data.geom_xpos[geom] + signs * size @ axes.T), axis=2)
    assert max(gaps.min(axis=0).max(), gaps.min(axis=1).max()) < 1e-6
