"""What people read of a run: what was read from the file, in words and units."""

import io
import re
from collections.abc import Callable
from pathlib import Path

from pivoting.sim import Run, own_object, simulate
from pivoting.sim.console.run_tables import print_run
from rich.console import Console

BOX = """<mujoco><worldbody><geom name="floor" type="plane" size="1 1 1"/><body name="box" pos="0 0 .1"><freejoint/>
<geom type="box" size=".05 .04 .1" mass=".4" friction=".7"/></body></worldbody></mujoco>"""


def told(run: Run) -> str:
    out = io.StringIO()
    print_run(Console(file=out, width=100), run)
    return out.getvalue()


def test_what_was_read_from_the_file_is_shown(tmp_path: Path) -> None:
    """Support, mass, inertia, friction, contacts, and which of the file's contact settings gave way to what."""
    model = tmp_path / "box.xml"
    model.write_text(BOX)
    run = simulate(own_object(model, "box", "edge"))
    text = told(run)
    (line,) = re.findall("^read of the object: (.*)$", text, flags=re.MULTILINE)
    assert "support floor, mass 0.4 kg, inertia diag(0.001547, 0.001667, 0.0005467) kg m^2, mu 1, contacts ((" in line
    assert line.count("0.05") == 2
    assert "com" not in line  # nothing is said of zeros
    (line,) = re.findall("^contact: (.*)$", text, flags=re.MULTILINE)
    assert "dt 0.002 s, solref (0.0042, 1), " in line
    assert "in place of the file's (cone pyramidal; " in line
    assert run.summary()["object"]["mass_kg"] == 0.4


def test_without_anything_read_nothing_is_said(shipped: Callable[[str], Run]) -> None:
    run = shipped("snap-2d")

    class Bare:
        def __getattr__(self, name: str) -> object:
            return getattr(run, name)

        def summary(self) -> dict[str, object]:
            return {key: value for key, value in run.summary().items() if key not in ("object", "contact_settings")}

    text = told(Bare())  # type: ignore[arg-type]
    assert "read of the object" not in text
    assert "f_min = 5w: 50 N" in text


def test_failed_worlds_are_named() -> None:
    """The first ten, and how many more; all of them in the summary."""
    run = simulate("snap-2d", worlds=13, seconds=0.3, limits={"slip_m": 1e-6})
    text = " ".join(told(run).split())
    assert f"the worst world is {run.worst_world}; those that fail are 0, 1, 2, 3, 4, 5, 6, 7, 8, 9 and 3 more" in text
    assert run.summary()["failed_worlds"] == list(range(13))
