"""How long a first run waits for the compiler: every scenario in a process of its own, with nothing compiled before.

Seconds of the whole command, `pivoting run NAME --json`, with an empty cache less the same with a full one: the least
of three runs, since a machine is rarely idle. The bounds are for two idle cores.
"""

import os
import subprocess
import sys
import tempfile
from pathlib import Path
from time import perf_counter

from harness import main

COMMAND = Path(sys.executable).with_name("pivoting")
PLANE, SPACE, HORIZON = 10.0, 25.0, 40.0  # [s]
ASKED = {
    **dict.fromkeys(("balance-2d", "incline-2d", "pivot-2d", "snap-2d"), PLANE),
    **dict.fromkeys(("balance-3d", "spin-3d", "pivot-3d", "settle-3d", "pivot"), SPACE),
    **dict.fromkeys(("mpc-2d", "mpc-3d"), HORIZON),
}
BOX = """<mujoco>
  <worldbody>
    <geom name="floor" type="plane" size="2 2 .1"/>
    <body name="box" pos="0 0 .1"><freejoint/><geom type="box" size=".1 .07 .1" mass="1"/></body>
  </worldbody>
</mujoco>
"""


def run(name: str, cache: str, model: Path) -> float:
    """Seconds of one command."""
    own = ["--model", str(model), "--body", "box"] if name == "pivot" else []
    environment = {**os.environ, "NUMBA_CACHE_DIR": cache}
    start = perf_counter()
    subprocess.run([COMMAND, "run", name, "--json", *own], check=True, capture_output=True, env=environment)
    return perf_counter() - start


def measure(quick: bool) -> dict[str, float]:
    """Seconds that a first run waits more than a later one."""
    figures = {}
    with tempfile.TemporaryDirectory() as folder:
        model = Path(folder) / "box.xml"
        model.write_text(BOX)
        for name in ASKED:
            times = []
            for attempt in range(1 if quick else 3):
                cache = str(Path(folder) / f"{name}-{attempt}")
                cold = run(name, cache, model)
                times.append(cold - run(name, cache, model))
            figures[f"{name}: s"] = min(times)
    return figures


if __name__ == "__main__":
    main(__doc__ or "", measure, {f"{name}: s": most for name, most in ASKED.items()})
