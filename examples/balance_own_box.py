"""Balance a box of your own MJCF file on one of its vertices, and see what MuJoCo measured."""

import tempfile
from pathlib import Path

from pivoting import own_object, simulate

CRATE = """
<mujoco>
  <worldbody>
    <geom name="floor" type="plane" size="2 2 .1"/>
    <body name="crate" pos="0 0 .15">
      <freejoint/>
      <geom type="box" size=".2 .15 .15" mass="3" friction="0.6"/>
    </body>
  </worldbody>
</mujoco>
"""

with tempfile.TemporaryDirectory() as folder:
    file = Path(folder) / "crate.xml"
    file.write_text(CRATE)
    run = simulate(own_object(file, "crate", "vertex"), reference="constant", theta=30.0, seconds=2.0)

force = run.wrench_world[0, -1, :3]
weight = 3 * 9.81
print(f"{run.verdict}: slip {1e3 * run.measures.slip_max_m[0]:.4f} mm")
print(f"at rest the wrench carries {force[2] / weight:.0%} of the weight, and the vertex the rest")
