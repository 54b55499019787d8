"""The buttons and sliders of the page, and what they ask of the loop.

viser calls back in threads of its own: what is asked waits until the loop takes it between two steps. Of a slider that
is moved only the last value counts.
"""

from collections.abc import Callable
from threading import Lock
from typing import Any

import numpy as np
from pivoting.sim.viewing.live_loop import LiveLoop

SCENE_KEYS = ("mu", "mass", "gravity")  # of the world, and of what the controller believes if it is told
CONTROL_KEYS = ("margin", "length")
LABELS = {
    "mu": ("friction mu", "friction coefficient between the object and its support"),
    "mass": ("mass [kg]", "mass of the object"),
    "gravity": ("gravity [m/s^2]", "magnitude of gravity"),
    "margin": ("friction margin", "share of the friction that the controller keeps unused"),
    "length": (
        "weight: length [m]",
        "lever at which a moment costs as much as a force; less of it makes moments dearer",
    ),
}
SHOVES = {"left": -1.0, "right": 1.0}


class LiveControls:
    """The main panel.

    Attributes:
        paused: whether the loop is to stand still.  pace: 1 is real time.
    """

    def __init__(self, gui: Any, loop: LiveLoop):
        self._gui, self._loop, self._lock = gui, loop, Lock()
        self._waiting: dict[str, Callable[[], None]] = {}
        self.paused, self.pace = False, 1.0
        self._sliders: dict[str, Any] = {}
        self.status, self.notes = gui.add_html(""), gui.add_html("")
        self._running()
        self._reference()
        self._shove()
        self._world()
        self._controller()

    def ask(self, name: str, wish: Callable[[], None]) -> None:
        """Have something done between two steps, in place of what was asked by that name and is still to be done."""
        with self._lock:
            self._waiting[name] = wish

    def wishes(self) -> list[Callable[[], None]]:
        """What was asked since the last call, in the order in which it was."""
        with self._lock:
            waiting, self._waiting = self._waiting, {}
        return list(waiting.values())

    @property
    def strength(self) -> float:
        """Of a shove [N s]."""
        return float(self._strength.value)

    def show_values(self) -> None:
        """Set the sliders to what the loop has: after a refusal the value from before."""
        for key, value in values_of(self._loop).items():
            self._sliders[key].value = value

    def _running(self) -> None:
        gui = self._gui
        buttons = gui.add_button_group("run", ("pause", "go on", "restart"))
        pace = gui.add_slider(
            "speed", 0.1, 2.0, 0.1, 1.0, marks=((0.1, "0.1"), (1.0, "real time"), (2.0, "2")),
            hint="of the simulation, where 1 is real time",
        )  # fmt: skip

        @buttons.on_click
        def _(event: Any) -> None:
            asked = str(buttons.value)
            if asked == "restart":
                self.ask("restart", self._loop.restart)
            self.paused = asked == "pause"

        @pace.on_update
        def _(event: Any) -> None:
            self.pace = float(pace.value)

    def _reference(self) -> None:
        gui, (low, high) = self._gui, self._loop.range
        with gui.add_folder("where it is to be"):
            now = float(np.rad2deg(self._loop.angle))
            theta = gui.add_slider(
                "theta [deg]", round(low, 1), round(high, 1), 0.1, float(np.clip(round(now, 1), low, high)),
                hint="move it, and the object turns there smoothly and stays",
            )  # fmt: skip
            own = gui.add_button("the scenario's own motion", hint="from its beginning")

        @theta.on_update
        def _(event: Any) -> None:
            if event.client_id is not None:
                self.ask("theta", lambda: self._loop.go_to(float(theta.value)))

        @own.on_click
        def _(event: Any) -> None:
            self.ask("restart", self._loop.restart)

    def _shove(self) -> None:
        gui, loop = self._gui, self._loop
        usual = 10.0 ** np.floor(np.log10(max(loop.momentum, 1e-9)))
        with gui.add_folder("shove it"):
            strength = gui.add_slider(
                "strength [N s]", 0.0, float(round(4.0 * usual, 9)), float(round(usual / 20.0, 9)), float(usual),
                hint="impulse of a shove, at the centre of mass or where you click",
            )  # fmt: skip
            way = gui.add_dropdown("direction", tuple(SHOVES))
            button = gui.add_button("shove", color="orange", hint="the controller is not told")
            gui.add_html(
                "<div style='font-size:0.8em;opacity:0.8;padding:0 0.6em'>Or click the object to shove it there, or "
                "drag it: the orange arrow is the force, drawn like the others.</div>"
            )
        self._strength = strength

        @button.on_click
        def _(event: Any) -> None:
            impulse = self.strength * SHOVES[str(way.value)] * loop.sideways
            self.ask("shove", lambda: loop.shove(impulse))

    def _world(self) -> None:
        with self._gui.add_folder("the world"):
            self._knows = self._gui.add_checkbox(
                "controller knows", False, hint="whether the controller is told of what you change here"
            )
            for key in SCENE_KEYS:
                self._slider(key)

    def _controller(self) -> None:
        with self._gui.add_folder("the controller"):
            for key in CONTROL_KEYS:
                self._slider(key)

    def _slider(self, key: str) -> None:
        """For one key of the scenario."""
        value = values_of(self._loop)[key]
        least, most = {"mu": (0.0, max(1.0, 2.0 * value)), "margin": (0.0, 0.95)}.get(key, (0.1 * value, 3.0 * value))
        step = 0.01 if key in ("mu", "margin") else 10.0 ** np.floor(np.log10(max(0.02 * value, 1e-9)))
        if key == "gravity":
            least, most, step = 0.0, max(20.0, 2.0 * value), 0.1
        label, hint = LABELS[key]
        least, most = (float(round(step * round(end / step), 9)) for end in (least, most))
        slider = self._gui.add_slider(label, least, most, float(step), min(max(value, least), most), hint=hint)
        self._sliders[key] = slider

        @slider.on_update
        def _(event: Any) -> None:
            if event.client_id is not None:
                hidden = key in SCENE_KEYS and not self._knows.value
                self.ask(key, lambda: self._loop.change(**{f"world.{key}" if hidden else key: float(slider.value)}))


def values_of(loop: LiveLoop) -> dict[str, float]:
    """What the sliders show: of the world, and of the controller."""
    world, asked = loop.world, loop.asked
    values = {
        "mu": world.mu,
        "mass": world.truth.mass,
        "gravity": world.unit * float(np.linalg.norm(world.truth.gravity)),
        "margin": asked.margin,
        "length": loop.length,
    }
    return {key: float(f"{value:.3g}") for key, value in values.items()}  # a slider is no place for more digits
