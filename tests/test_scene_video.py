"""Pictures of runs: what is drawn is what the run holds, where it is; files of the length and size asked for.

They need OpenGL, but no display, see CONTRIBUTING.md. Without it these tests fail: none is skipped.
"""

import sys
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path

import av
import mujoco
import numpy as np
import pytest
from PIL import Image
from pivoting.controller.validate import InputError
from pivoting.sim import Run, own_object, simulate
from pivoting.sim.drawing.colours import GREEN, GREY, ORANGE, PURPLE, RED, TEAL, Colour
from pivoting.sim.drawing.drawn_world import DrawnWorld
from pivoting.sim.drawing.mujoco_scene import MujocoScene
from pivoting.sim.drawing.offscreen import GraphicsError, OffScreen, check_graphics
from pivoting.sim.drawing.picture_files import SAMPLES
from pivoting.sim.drawing.scene_geoms import add_arrow
from pivoting.sim.drawing.scene_video import Output, render
from scipy.spatial.transform import Rotation

from tests.own_files import mjcf, pivoted
from tests.processes import pivoting

Shipped = Callable[[str], Run]
ARROW, TRIANGLE, CAPSULE = (getattr(mujoco.mjtGeom, f"mjGEOM_{kind}") for kind in ("ARROW", "TRIANGLE", "CAPSULE"))
SMALL = (240, 240)


@pytest.fixture(scope="module")
def quick() -> Run:
    """Half a second of a block that is turned."""
    return simulate("pivot-2d", seconds=0.2, hold=0.05, f_min=50.0)


def geoms(scene: mujoco.MjvScene, kind: int, colour: Colour) -> list[mujoco.MjvGeom]:
    """Those of this kind and colour that were added to the model's own."""
    return [
        geom
        for geom in scene.geoms[: scene.ngeom]
        if geom.type == kind and np.allclose(geom.rgba[:3], np.array(colour) / 255.0, atol=1e-6)
    ]


def arrow(geom: mujoco.MjvGeom) -> np.ndarray:
    """The vector that is drawn: half as long as MuJoCo counts, see `test_an_arrow_ends_where_its_vector_does`."""
    return 0.5 * geom.size[2] * np.asarray(geom.mat).reshape(3, 3)[:, 2]


def table(run: Run) -> np.ndarray:
    """The table's axes as columns."""
    return Rotation.from_quat(np.roll(run.truth.table, -1)).as_matrix()


@pytest.mark.parametrize("name", ["pivot-2d", "incline-2d", "pivot-3d", "spin-3d", "settle-3d"])
def test_arrows_are_the_arrays_of_the_run(name: str, shipped: Shipped) -> None:
    """At one scale the applied force at the CoM, and what MuJoCo measured at each contact; in the plane, the weight."""
    run = shipped(name)
    shown = MujocoScene(DrawnWorld(run, 0), 640, 480)
    axes, d, K, scales = table(run), run.truth.dim, len(run.points), []
    front = axes[:, 1] * (d == 2)  # in the plane all that is drawn is before the block, by as much
    ahead = np.eye(3) - np.outer(front, front)
    for row in np.linspace(0, run.time.size - 2, 7).astype(int):
        scene = shown.show(int(row))
        (force,), contacts = geoms(scene, ARROW, GREEN), geoms(scene, ARROW, RED)
        held = np.flatnonzero(run.standing[0, row])
        assert len(contacts) == (len(held) if name == "settle-3d" else K)
        assert np.allclose(ahead @ (force.pos - run.position[0, row]), 0.0, atol=1e-5)
        pairs = [(arrow(force), run.wrench_world[0, row, :3])]
        for geom, f, corner in zip(contacts, run.force_measured[0, row, held], run.corner[0, row, held], strict=True):
            lifted = np.array([f[0], 0.0, f[1]]) if d == 2 else f
            assert np.allclose(ahead @ (geom.pos - run.truth.origin - axes @ corner), 0.0, atol=1e-5)
            pairs.append((arrow(geom), axes @ lifted))
        if d == 2:
            (weight,) = geoms(scene, ARROW, GREY)
            pairs.append((arrow(weight), run.truth.mass * run.truth.gravity))
        for drawn, newtons in pairs:
            scales.append(float(drawn @ newtons / (newtons @ newtons)))
            assert np.allclose(drawn, scales[-1] * newtons, atol=1e-6)
        assert not geoms(scene, ARROW, ORANGE)
    assert np.ptp(scales) < 1e-5 * np.mean(scales)
    assert np.mean(scales) > 0.0


@pytest.mark.parametrize("name", ["pivot-2d", "pivot-3d", "spin-3d"])
def test_the_moment_is_an_arc_in_its_own_sense(name: str, shipped: Shipped) -> None:
    """About the CoM, across the moment, counter-clockwise seen from where it points."""
    run = shipped(name)
    shown = MujocoScene(DrawnWorld(run, 0), 640, 480)
    for row in np.linspace(0, run.time.size - 2, 9).astype(int):
        parts = geoms(shown.show(int(row)), CAPSULE, TEAL)
        arc = np.array([geom.pos for geom in parts])[:24]
        from_com = arc - arc[0] + (arc[0] - run.position[0, row])
        turning = np.cross(from_com[:-1], from_com[1:]).sum(axis=0)
        moment = run.wrench_world[0, row, 3:]
        assert turning @ moment > (
            0.0 if run.truth.dim == 2 else 0.99 * np.linalg.norm(turning) * np.linalg.norm(moment)
        )


@pytest.mark.parametrize("name", ["incline-2d", "snap-2d", "settle-3d"])
def test_cones_are_those_that_the_controller_keeps_to(name: str, shipped: Shipped) -> None:
    """One at every contact, of its slope, from the floor of the normal force on; in space its far side."""
    run = shipped(name)
    shown = MujocoScene(DrawnWorld(run, 0), 640, 480)
    scene = shown.show(100)
    axes, belief = table(run), run.attached.controller.belief
    red = geoms(scene, ARROW, RED)
    triangles = geoms(scene, TRIANGLE, PURPLE)
    if run.truth.dim == 2:
        assert len(triangles) == 1 + (belief.contacts.f_min[0] > 0.0)
    else:
        assert len(red) * 8 < len(triangles) < len(red) * 32
    corners = []
    for geom in triangles:
        mat = np.asarray(geom.mat, float).reshape(3, 3)
        corners += [geom.pos, geom.pos + mat[:, 0], geom.pos + mat[:, 1]]
    at = np.array([geom.pos for geom in red])
    which = np.linalg.norm(np.array(corners)[:, None] - at, axis=2).argmin(axis=1)
    for i, (geom, newtons) in enumerate(zip(red, run.force_measured[0, 100, run.standing[0, 100]], strict=True)):
        local = (np.array(corners)[which == i] - at[i]) @ axes
        assert np.allclose(np.hypot(local[:, 0], local[:, 1]), belief.contacts.mu[i] * local[:, 2], atol=1e-5)
        if run.truth.dim == 3:
            outward = local * [1.0, 1.0, 0.0] @ axes.T @ (np.asarray(scene.camera[0].pos) - at[i])
            assert outward.max() < 0.3 * np.abs(outward).max()
        floor = belief.contacts.f_min[i] * np.linalg.norm(arrow(geom)) / np.linalg.norm(newtons)
        assert local[:, 2].min() == pytest.approx(floor, abs=1e-5)


def test_the_object_is_where_mujoco_has_it(shipped: Shipped) -> None:
    """The wrenches of the run in bare MuJoCo, step by step; neither the run nor its model is touched."""
    run = shipped("pivot-3d")
    before = np.zeros(mujoco.mj_sizeModel(run.model), np.uint8), np.zeros(mujoco.mj_sizeModel(run.model), np.uint8)
    mujoco.mj_saveModel(run.model, None, before[0])
    shown, data = MujocoScene(DrawnWorld(run, 0), 640, 480), mujoco.MjData(run.model)
    data.qpos[:], data.qvel[:] = run.start[0][0], run.start[1][0]
    block = run.model.geom("block").id
    for row, applied in enumerate(run.wrench_world[0, :801]):
        if row % 200 == 0:
            mujoco.mj_kinematics(run.model, data)
            (geom,) = [g for g in shown.show(row).geoms[: shown.scene.ngeom] if (g.objtype, g.objid) == (5, block)]
            assert np.allclose(geom.pos, data.geom_xpos[block], atol=1e-6)
            assert np.allclose(np.asarray(geom.mat).ravel(), data.geom_xmat[block], atol=1e-6)
            assert geom.rgba[3] < 0.5
        data.xfrc_applied[run.truth.index] = applied
        mujoco.mj_step(run.model, data)
    mujoco.mj_saveModel(run.model, None, before[1])
    assert np.array_equal(*before)


def test_an_arrow_ends_where_its_vector_does() -> None:
    """Rendered: MuJoCo draws arrows half as long as it counts them."""
    model = mujoco.MjModel.from_xml_string("<mujoco/>")
    scene, data = mujoco.MjvScene(model, 10), mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    mujoco.mjv_updateScene(model, data, mujoco.MjvOption(), None, mujoco.MjvCamera(), 7, scene)
    for camera in scene.camera:
        camera.pos[:], camera.forward[:], camera.up[:] = (0.0, -5.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
        camera.frustum_near, camera.frustum_top, camera.frustum_bottom, camera.frustum_far = 1.0, 0.4, -0.4, 9.0
    with OffScreen(model, 200, 200) as screen:
        for length, width in ((1.0, 0.02), (1.5, 0.1)):
            scene.ngeom = 0
            add_arrow(scene, np.array([0.0, 0.0, -0.5]), np.array([0.0, 0.0, length]), GREEN, width)
            rows = np.nonzero(screen.draw(scene).any(axis=(1, 2)))[0]
            top, bottom = (2.0 - 4.0 * edge / 200 for edge in (rows[0], rows[-1] + 1))
            assert (top, bottom) == (pytest.approx(length - 0.5, abs=0.03), pytest.approx(-0.5, abs=0.03))


def coloured(picture: np.ndarray, colour: Colour) -> int:
    """Pixels of about this hue, from below the words on."""
    seen = picture[40:].astype(float)
    strong = np.ptp(seen, axis=2) > 60.0
    likeness = seen @ np.array(colour) / (np.linalg.norm(seen, axis=2) + 1e-9) / np.linalg.norm(colour)
    return int(np.count_nonzero(strong & (likeness > 0.97)))


@pytest.mark.parametrize("name", ["pivot-2d", "pivot-3d", "spin-3d", "settle-3d"])
def test_a_picture_shows_every_colour(name: str, shipped: Shipped, tmp_path: Path) -> None:
    assert render(shipped(name), Output(tmp_path / "a.png", time=0.6)) == 1
    with Image.open(tmp_path / "a.png") as file:
        picture = np.asarray(file)
    assert picture.shape == (480, 640, 3)
    assert all(coloured(picture, colour) > 100 for colour in (GREEN, RED, TEAL, PURPLE)), name
    assert [path.name for path in tmp_path.iterdir()] == ["a.png"]


@pytest.mark.parametrize("scale", [0.01, 1.0, 100.0])
def test_all_of_the_motion_is_in_view_whatever_the_size(scale: float, tmp_path: Path) -> None:
    """Of objects of 1 mm, 10 cm and 12 m: their corners at every time, in a picture that they fill."""
    half = scale * np.array([0.05, 0.04, 0.06])
    box = 'type="box" size="{} {} {}"'.format(*half)
    (tmp_path / "own.xml").write_text(mjcf(f'<geom name="g" {box}/>', pose=f'pos="0 0 {half[2]}"'))
    run = simulate(own_object(tmp_path / "own.xml", "box", "edge"), seconds=max(0.3, 0.3 * scale**0.5), hold=0.1)
    shown = MujocoScene(DrawnWorld(run, 0), 400, 300)
    eye, camera = shown.show(0).camera[0], shown.scene.camera[0]
    corners = half * np.stack(np.meshgrid(*[[-1.0, 1.0]] * 3), axis=-1).reshape(-1, 3)
    turned = Rotation.from_quat(np.roll(run.quaternion[0, ::50], -1, axis=1)).as_matrix()
    points = (run.position[0, ::50, None] + corners @ np.swapaxes(turned, 1, 2)).reshape(-1, 3) - eye.pos
    deep = points @ camera.forward
    high = points @ camera.up / deep * camera.frustum_near / camera.frustum_top
    wide = points @ np.cross(camera.forward, camera.up) / deep * camera.frustum_near / camera.frustum_top / (400 / 300)
    assert deep.min() > camera.frustum_near
    assert max(np.abs(high).max(), np.abs(wide).max()) < 1.0
    assert np.ptp(high) > 1.2 or np.ptp(wide) > 1.2  # of 2
    with OffScreen(shown.model, 400, 300) as screen:
        picture = screen.draw(shown.show(run.time.size // 2))
    assert all(coloured(picture, colour) > 30 for colour in (GREEN, RED, TEAL, PURPLE))


def test_what_is_in_the_way_or_moves_is_left_out(tmp_path: Path) -> None:
    """Of a room about the object the walls that the camera is outside of; and another body. What is hidden is shown."""
    walls = {
        "front": (0, -0.2, 0),
        "back": (0, 0.2, 0),
        "left": (-0.2, 0, 0),
        "right": (0.2, 0, 0),
        "roof": (0, 0, 0.25),
    }
    thin = {name: np.where(np.array(at) == 0.0, 1.0, 0.001) for name, at in walls.items()}
    boxes = "".join(
        '<geom name="{}" type="box" pos="{} {} {}" size="{} {} {}" contype="0" conaffinity="0"/>'.format(
            name, *at, *thin[name]
        )
        for name, at in walls.items()
    )
    floor = f'<geom name="floor" type="plane" size="0 0 .1"/>{boxes}'
    ball = '<body pos=".1 .15 .03"><freejoint/><geom name="ball" type="sphere" size=".02"/></body>'
    box = '<geom name="g" type="box" size=".05 .04 .06" group="3"/>'  # a group that MuJoCo does not show
    run = pivoted(tmp_path, mjcf(box, floor=floor, world=ball), "edge")
    shown = MujocoScene(DrawnWorld(run, 0), 640, 480)
    seen = {run.model.geom(g.objid).name for g in shown.show(0).geoms[: shown.scene.ngeom] if g.objtype == 5}
    eye = np.asarray(shown.scene.camera[0].pos, float)
    outside = {name for name, at in walls.items() if eye @ at > np.dot(at, at)}
    assert 1 <= len(outside) <= 3
    assert seen == {"g", *walls} - outside  # of the floor a slab is drawn


def test_frames_and_durations_are_those_asked_for(quick: Run, tmp_path: Path) -> None:
    """In real time and slowly, read back; each frame shows something else than the one before."""
    seconds = quick.time[-1]
    for fps, speed in ((25, 1.0), (30, 0.5)):
        count = round(seconds * fps / speed)
        assert render(quick, Output(tmp_path / "a.gif", SMALL, fps, speed)) == count
        with Image.open(tmp_path / "a.gif") as gif:
            assert (gif.size, gif.n_frames, gif.info["loop"]) == (SMALL, count, 0)
            frames, lasts = [], []
            for k in range(count):
                gif.seek(k)
                frames.append(np.asarray(gif.convert("RGB")).astype(int))
                lasts.append(gif.info["duration"])
        assert abs(sum(lasts) / 1e3 - count / fps) <= 0.005
        assert max(lasts) - min(lasts) <= 10
        assert all(np.abs(after - before).max() > 30 for before, after in pairwise(frames))
        assert all(coloured(frame, GREEN) > 20 for frame in frames)
    assert render(quick, Output(tmp_path / "a.mp4", SMALL, 30, 0.5)) == round(2 * 30 * seconds)
    with av.open(str(tmp_path / "a.mp4")) as file:
        (stream,) = file.streams.video
        films = [frame.to_ndarray(format="rgb24") for frame in file.decode(stream)]
        assert (len(films), float(stream.average_rate or 0)) == (round(2 * 30 * seconds), 30.0)
        assert float(stream.duration * stream.time_base) == pytest.approx(2.0 * seconds, abs=1 / 30)  # type: ignore[operator]
        assert stream.codec_context.name == "h264"
    assert films[0].shape == (*SMALL, 3)
    assert all(coloured(frame, GREEN) > 20 for frame in films)


def test_the_moving_picture_of_the_readme() -> None:
    """Small enough to be loaded by the way, about four seconds, and it ends as it begins."""
    path = Path(__file__).parent.parent / "docs/pivot.gif"
    assert path.stat().st_size < 1.5e6
    with Image.open(path) as gif:
        frames, lasts = [], []
        for k in range(gif.n_frames):
            gif.seek(k)
            frames.append(np.asarray(gif.convert("RGB"))[40:].astype(int))
            lasts.append(gif.info["duration"])
    assert 3.5 < sum(lasts) / 1e3 < 4.6
    changes = [np.abs(frame - frames[0]).mean() for frame in frames]
    assert changes[-1] < 0.1 * max(changes)


def test_a_world_that_diverges_is_drawn_up_to_there(tmp_path: Path) -> None:
    run = simulate("balance-2d", bandwidth=5000.0, seconds=1.0)
    film = DrawnWorld(run, 0)
    assert film.answers < run.time.size - 1
    assert render(run, Output(tmp_path / "a.gif", SMALL)) == max(1, round(25 * run.time[film.answers]))


@pytest.mark.parametrize(
    ("name", "keys", "message"),
    [
        ("a.txt", {}, "must be a .gif, .mp4 or .png file"),
        ("no/a.gif", {}, "must be in a folder that exists"),
        ("folder.gif", {}, "must be a file, not a folder"),
        ("a.gif", {"size": (100, 480)}, "size = '100x480': must be WIDTHxHEIGHT, each from 240 to 4096 pixels"),
        ("a.mp4", {"size": (641, 480)}, "size = '641x480': must be two even numbers, for a .mp4 file"),
        ("a.gif", {"fps": 60}, "fps = 60: must be a whole number from 1 to 50, for a .gif file"),
        ("a.mp4", {"fps": 0}, "fps = 0: must be a whole number from 1 to 120"),
        ("a.gif", {"speed": 0.0}, "speed = 0.0: must be a finite number > 0"),
        ("a.gif", {"speed": float("nan")}, "speed = nan: must be a finite number > 0"),
        ("a.gif", {"speed": 1e-6}, "speed = 1e-06: must be at least"),
        ("a.gif", {"speed": 1e-3, "size": (4096, 4096)}, "a.gif': must be a .mp4 file: 13750 frames of this size"),
        ("a.gif", {"time": 0.1}, "time = 0.1: must be left out"),
        ("a.png", {"fps": 25}, "fps = 25: must be left out"),
        ("a.png", {"speed": 1.0}, "speed = 1.0: must be left out"),
        ("a.png", {"time": 9.0}, "time = 9.0: must be a finite number >= 0 and <= 0."),
    ],
)
def test_what_cannot_be_had_is_named(quick: Run, name: str, keys: dict, message: str, tmp_path: Path) -> None:
    (tmp_path / "folder.gif").mkdir()
    with pytest.raises(InputError) as error:
        render(quick, Output(tmp_path / name, **keys))
    assert message in str(error.value)
    assert [path.name for path in tmp_path.iterdir()] == ["folder.gif"]


def test_a_file_is_whole_or_as_it_was(quick: Run, tmp_path: Path) -> None:
    """Where a picture fails while others are written, what was there stays; a world that there is not is refused."""
    for name in ("a.gif", "a.mp4"):
        (tmp_path / name).write_text("before")
        drawn: list[int] = []

        def stops(done: int, frames: int, drawn: list[int] = drawn) -> None:
            drawn.append(done)
            if len(drawn) > SAMPLES + 3:  # the colours of a .gif are known
                raise KeyboardInterrupt

        with pytest.raises(KeyboardInterrupt):
            render(quick, Output(tmp_path / name, SMALL), progress=stops)
        assert (tmp_path / name).read_text() == "before"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.gif", "a.mp4"]
    with pytest.raises(InputError, match=r"world = 1: must be a whole number in \[0, 1\)"):
        render(quick, Output(tmp_path / "a.png"), world=1)


def test_what_is_missing_is_named_with_what_to_install(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    check_graphics()
    monkeypatch.setenv("MUJOCO_GL", "off")
    with pytest.raises(GraphicsError, match="MUJOCO_GL = 'off': must be one of egl, osmesa"):
        check_graphics()
    monkeypatch.setitem(sys.modules, "av", None)
    with pytest.raises(InputError, match=r"a \.gif or \.png file: for a \.mp4 file, pip install 'pivoting\[video\]'"):
        Output(tmp_path / "a.mp4")
    Output(tmp_path / "a.gif")


def test_render_as_a_stranger_calls_it(tmp_path: Path) -> None:
    (tmp_path / "own.xml").write_text(mjcf())
    own = "--model", "own.xml", "--body", "box", "--contact", "vertex", "--set", "seconds=0.3", "--set", "hold=0.1"
    done = pivoting("render", *own, "--out", "a.png", "--size", "320x240", "--world", "1", cwd=tmp_path)
    assert (done.returncode, done.stdout) == (0, "wrote a.png: 1 frame of a run of 0.5 s, verdict: pass\n"), done.stderr
    with Image.open(tmp_path / "a.png") as picture:
        assert picture.size == (320, 240)


@pytest.mark.parametrize(
    ("words", "environment", "message"),
    [
        ("--out a.gif", {}, "Missing argument 'SCENARIO', or --model FILE.xml --body NAME."),
        ("pivot-2d", {}, "Missing option '--out'"),
        ("pivot-2d --out a.avi", {}, "out = 'a.avi': must be a .gif, .mp4 or .png file"),
        ("pivot-2d --out a.gif --size big", {}, "--size 'big': must be WIDTHxHEIGHT, such as 640x480"),
        ("pivot-2d --out a.gif --body b", {}, "--body: only the scenario pivot takes it"),
        ("fly --out a.gif", {}, "scenario = 'fly': must be one of balance-2d"),
        ("pivot-2d --out a.gif", {"__EGL_VENDOR_LIBRARY_DIRS": "/nowhere"}, "apt-get install libegl1 libgl1"),
        ("pivot-2d --out a.gif", {"MUJOCO_GL": "vulkan"}, "MUJOCO_GL = 'vulkan': must be one of egl, osmesa"),
    ],
)  # fmt: skip
def test_wrong_calls_are_one_line_and_exit_2(words: str, environment: dict, message: str, tmp_path: Path) -> None:
    done = pivoting("render", *words.split(), cwd=tmp_path, **environment)
    assert (done.returncode, done.stdout) == (2, "")
    lines = [line for line in done.stderr.splitlines() if not line.startswith("pivoting: compiling")]
    assert len(lines) == 1
    assert message in lines[0]
    assert list(tmp_path.iterdir()) == []
