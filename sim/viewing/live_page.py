"""`pivoting view`: the page in the browser, and the loop behind it in real time."""

import socket
from collections.abc import Callable
from contextlib import redirect_stdout
from io import StringIO
from time import perf_counter, sleep
from typing import Any

import click
import numpy as np
from pivoting.controller.validate import fail
from pivoting.errors import PivotingError
from pivoting.models.support_surfaces import upward
from pivoting.sim.drawing.drawn_world import Array
from pivoting.sim.run import Run
from pivoting.sim.scenarios.scenario import Scenario
from pivoting.sim.viewing.live_controls import LiveControls
from pivoting.sim.viewing.live_loop import LiveLoop
from pivoting.sim.viewing.live_plots import LivePlots
from pivoting.sim.viewing.live_scene import WORDS, Grab, LiveScene
from pivoting.sim.viewing.verdict_so_far import as_html, verdict_so_far
from pivoting.sim.viewing.wrench_space_picture import wrench_space_picture

FRAME, PANELS = 1.0 / 30.0, 0.15  # [s] from one drawing of the scene, and of the panels, to the next
BUSY = 0.06  # [s] of steps at once: what takes longer is no longer in real time
BEHIND = 0.25  # [s] that the loop may be behind; more it gives up
PIECE = 10  # steps between two looks at the clock
TOLD = 3  # notes that are shown


class LivePage:
    """A page of a loop.

    Attributes:
        loop: behind it.  url: of the page.  refused: why the last wish was, or "".
    """

    def __init__(self, loop: LiveLoop, host: str, port: int):
        """Serve the page; `run` then makes it live.

        Raises:
            ModuleNotFoundError: viser is not installed.
            ValueError: there can be no server at this address.
        """
        import viser

        _check_address(host, port)
        with redirect_stdout(StringIO()):  # a banner
            self._server = viser.ViserServer(host=host, port=port, label="pivoting", verbose=False)
        bound = self._server.get_port()
        if port not in (0, bound):  # taken since: viser goes on to the next one
            self._server.stop()
            raise fail("port", port, "one that is free")
        self.loop, self.url = loop, f"http://{host}:{bound}"
        self.refused = ""
        self._grab: Grab | None = None
        loop.advance(1)
        self._build(loop.run())

    def _build(self, run: Run) -> None:
        server, gui = self._server, self._server.gui
        gui.configure_theme(dark_mode=False, show_logo=False, show_share_button=False)
        server.scene.set_up_direction(tuple(upward(run.model)))
        self._scene: LiveScene = LiveScene(server.scene, run)
        self._aim(self._scene)
        self._listen()
        gui.main_panel.dock_left()
        gui.main_panel.set_width(330)
        self._controls = LiveControls(gui, self.loop)
        with gui.add_folder("the solution space, object axes"):
            self._space = gui.add_html("")
        measured = gui.add_panel()
        measured.dock_right()
        measured.set_width(400)
        with measured.add_tab("Measured in MuJoCo"):
            self._verdict = gui.add_html("")
            self._plots = LivePlots(gui, run, self.loop.seconds)
        self._show_panels()

    def _aim(self, scene: LiveScene) -> None:
        """The view that new clients begin with: that of the recordings."""
        world, camera = scene.world, self._server.initial_camera
        camera.fov = float(np.deg2rad(35.0))
        camera.near, camera.far = 0.01 * world.side, 100.0 * world.side
        camera.look_at = tuple(world.centre)
        camera.position = tuple(world.centre + 2.5 * world.eye(world.away if world.dim == 2 else world.along_axis))

    def _listen(self) -> None:
        """To clicks on the object and to drags of it."""
        body = self._scene.body

        @body.on_click
        def _(event: Any) -> None:
            ray = np.array(event.ray_origin), np.array(event.ray_direction)
            self._controls.ask("click", lambda: self._clicked(*ray))

        @body.on_drag
        async def _(event: Any) -> None:  # a coroutine keeps the order of the phases
            phase, at, pointer = event.phase, np.array(event.start_position), np.array(event.end_position)
            self._controls.ask("drag", lambda: self._dragged(phase, at, pointer))

    def _clicked(self, origin: Array, direction: Array) -> None:
        """Shove the object where it is clicked, along the view; in the plane sideways, away from the side clicked."""
        at = self._scene.hit(origin, direction)
        if at is None:
            return
        run = self._scene.world.run
        push = direction / np.linalg.norm(direction)
        if self._scene.world.dim == 2:
            side = float((at - run.position[0, -1]) @ self.loop.sideways)
            push = -np.copysign(1.0, side) * self.loop.sideways
        self.loop.shove(self._controls.strength * push, at)

    def _dragged(self, phase: str, at: Array, pointer: Array) -> None:
        if phase == "end":
            self._grab = None
            self.loop.let_go()
        else:
            held = self._grab
            self._grab = self._scene.grabbed(at, pointer) if held is None else held._replace(pointer=pointer)

    def run(self, stop: Callable[[], bool] = lambda: False) -> None:
        """Make steps in real time, and show them, until `stop` says so."""
        owed, before, drawn = 0.0, perf_counter(), 0.0
        while not stop():
            now = perf_counter()
            self._obey()
            if self._controls.paused:
                owed = 0.0
            else:
                owed = min(owed + (now - before) * self._controls.pace, BEHIND)
                owed -= self._advance(int(owed / self.loop.dt), now + BUSY) * self.loop.dt
            before = now
            if self._server.get_clients():
                self._scene.show(self._last(), self._grab)
                if now - drawn > PANELS:
                    took = perf_counter()
                    self._show_panels()
                    drawn = max(now, now + 3.0 * (perf_counter() - took) - PANELS)  # a quarter of the time at most
            sleep(max(0.0, FRAME - (perf_counter() - now)))

    def stop(self) -> None:
        """Take the page from the net."""
        with redirect_stdout(StringIO()):
            self._server.stop()

    def _last(self) -> Run:
        """The last step."""
        if not self.loop.made:
            self.loop.advance(1)
        return self.loop.run(self.loop.made - 1)

    def _advance(self, steps: int, until: float) -> int:
        """Make up to so many steps, until a time; how many were made."""
        made = 0
        while made < steps and perf_counter() < until:
            if self._grab is not None:
                held = self._scene.held(self._grab)
                self.loop.pull((self._grab.pointer - held) / self._scene.world.scale, held)
            now = min(PIECE, steps - made)
            self.loop.advance(now)
            made += now
        return made

    def _obey(self) -> None:
        """Do what was asked for on the page; what cannot be done is said there."""
        for wish in self._controls.wishes():
            lap = self.loop.lap
            try:
                wish()
                self.refused = ""
            except PivotingError as error:
                self.refused = str(error)
            if self.refused or self.loop.lap != lap:
                self._controls.show_values()
                self._scene.renew(self._last())

    def _show_panels(self) -> None:
        run, loop = self.loop.run(), self.loop
        found = verdict_so_far(run) if run.time.size > 2 else None
        if found is not None:
            self._verdict.content = as_html(found, run)
            self._plots.show(run, loop.seconds)
        self._space.content = wrench_space_picture(self._scene.world)
        self._controls.status.content = self._status()
        self._controls.notes.content = self._notes()

    def _status(self) -> str:
        loop, asked = self.loop, self.loop.asked
        swatches = " ".join(
            f"<span style='white-space:nowrap;margin-right:0.8em'><span style='color:rgb{colour}'>&#9632;</span>"
            f" {word}</span>"
            for word, colour in WORDS
        )
        laps = f"{loop.passed} passed, {loop.failed} failed" if loop.passed + loop.failed else "none is over yet"
        return (
            "<div style='padding:0.2em 0.6em;font-size:0.85em;line-height:1.4'>"
            f"<b>{asked.name}</b>: {asked.summary}.<br>"
            f"Lap {loop.lap}: {loop.time:.1f} of {loop.seconds:.2f} s. Laps: {laps}.<br>"
            f"<div style='font-size:0.9em;margin-top:0.3em'>{swatches}</div></div>"
        )

    def _notes(self) -> str:
        told = "".join(f"<div style='opacity:0.75'>{note}</div>" for note in self.loop.notes[: -TOLD - 1 : -1])
        refused = f"<div id='refused' style='color:#d62728'>Refused: {self.refused}</div>" if self.refused else ""
        style = "padding:0 0.6em;font-size:0.8em;line-height:1.3;height:4em;overflow:auto"
        return f"<div style='{style}'>{refused}{told}</div>"


def _check_address(host: str, port: int) -> None:
    """Refuse one that cannot be served; viser would take another port in silence, or fail in a thread."""
    try:
        family, kind, protocol, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0]
        with socket.socket(family, kind, protocol) as tried:
            tried.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            tried.bind(address)
    except socket.gaierror as error:
        raise fail("host", host, f"a name or address of this machine ({error.strerror})") from None
    except OSError as error:
        raise fail("port", port, f"one that is free on {host} ({error.strerror})") from None


def view(asked: Scenario, host: str, port: int, seed: int = 0) -> None:
    """Serve the page of a scenario until an interrupt; tell its address in a line."""
    page = LivePage(LiveLoop(asked, seed), host, port)
    click.echo(f"{asked.name} is live at {page.url} (Ctrl-C ends it)")
    try:
        page.run()
    finally:
        page.stop()
