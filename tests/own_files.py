"""Files of a user's own for tests: a box of 10 x 8 x 12 cm on a plane, with whatever is odd about it."""

from pathlib import Path

from pivoting.sim import Run, own_object, simulate
from pivoting.sim.scenarios.scenario import Scenario

FLOOR = '<geom name="floor" type="plane" size="2 2 .1"/>'
BOX = '<geom name="g" type="box" size=".05 .04 .06"/>'
QUICK = {"seconds": 0.3, "hold": 0.1}  # of the arc of 20 deg


def mjcf(
    geoms: str = BOX, *, joint: str = "<freejoint/>", pose: str = 'pos="0 0 .06"', floor: str = FLOOR,
    world: str = "", extra: str = "", body: str = "", option: str = "",
) -> str:  # fmt: skip
    """The box of mass 0.96 kg, 1 ms steps, with attributes of its option and body, and more in its world or model."""
    return (
        f'<mujoco><option timestep="0.001" {option}/><worldbody>{floor}<body name="box" {pose} {body}>{joint}{geoms}'
        f"</body>{world}</worldbody>{extra}</mujoco>"
    )


def own(folder: Path, text: str, contact: object = "edge", body: str = "box", **options: object) -> Scenario:
    """The scenario of a body of this file, quick; options of `own_object`, such as support."""
    path = folder / "own.xml"
    path.write_text(text)
    return own_object(path, body, contact, **options).change(**QUICK)  # type: ignore[arg-type]


def pivoted(folder: Path, text: str, contact: object = "edge", body: str = "box", **options: object) -> Run:
    """Its run."""
    return simulate(own(folder, text, contact, body, **options))
