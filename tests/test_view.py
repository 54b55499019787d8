"""The live page: its loop without a browser, and all of it in a real one without a window."""

import re
import shutil
import signal
import socket
import subprocess
import sys
import urllib.request
from collections.abc import Callable, Iterator
from pathlib import Path
from threading import Event, Thread
from time import monotonic, sleep
from typing import Any

import numpy as np
import pytest
from pivoting.controller import MinimumJerk
from pivoting.controller.references import Sine
from pivoting.controller.validate import InputError
from pivoting.models.errors import ModelError
from pivoting.sim import Run
from pivoting.sim.scenarios.shipped_scenarios import scenario
from pivoting.sim.viewing.later_references import Redirected, from_now
from pivoting.sim.viewing.live_loop import LiveLoop
from pivoting.sim.viewing.live_page import LivePage
from pivoting.sim.viewing.verdict_so_far import as_html, in_words, verdict_so_far

from tests.own_files import mjcf, own
from tests.processes import pivoting, started

CHROMIUM = next(
    filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable"))), None
)
QUIET = (
    "--no-sandbox", "--disable-gpu", "--headless=new", "--disable-background-networking",
    "--disable-component-update", "--disable-sync", "--no-first-run",
)  # fmt: skip


OF_VISER = "Unable to preventDefault inside passive event listener invocation."  # at a click on its canvas
LOCAL = re.compile(r"(https?|ws)://127\.0\.0\.1:|data:|blob:")


def turned(run: Run) -> float:
    """Where it is now [deg]."""
    return float(np.rad2deg(run.theta[0, -1]))


def test_a_lap_is_the_run_of_simulate_and_goes_on_into_the_next(shipped: Callable[[str], Run]) -> None:
    """The same stages: the first lap to the last bit, in whatever pieces it is made."""
    loop, run = LiveLoop(scenario("pivot-2d")), shipped("pivot-2d")
    loop.advance(1234)
    loop.advance(run.time.size - 1 - 1234 - 1)
    last = loop.run()
    for live, then in (
        (last.log.states, run.log.states[:, :-1]),
        (last.log.answers.values, run.log.answers.values[:, :-1]),
        (last.force_measured, run.force_measured[:, :-1]),
    ):
        np.testing.assert_array_equal(live, then)
    loop.advance(2)
    assert (loop.lap, loop.made, loop.passed, loop.failed) == (2, 1, 1, 0)
    np.testing.assert_array_equal(loop.run().log.states[:, 0], run.log.states[:, -1])
    loop.advance(1000)
    assert verdict_so_far(loop.run()).verdict == "pass"


def test_a_motion_that_ends_elsewhere_begins_again_with_the_object_put_back() -> None:
    loop = LiveLoop(scenario("snap-2d"))
    loop.advance(round(loop.seconds / loop.dt))
    assert loop.notes == ["Lap 1 of 0.8 s: pass. The object was put back to its start."]
    loop.advance(1)
    assert turned(loop.run()) == pytest.approx(10.0, abs=0.02)


def test_a_redirected_reference_is_smooth_and_arrives() -> None:
    """Its rate and acceleration are those of its angle, by differences; redirected again on its way as well."""
    first = Redirected(from_now(Sine(0.5, 0.3, 1.5), 0.4), 1.2, 0.8)
    for reference, target in ((first, 1.2), (Redirected(from_now(first, 0.3), 0.1, 0.8), 0.1)):
        times, h = np.linspace(0.01, 0.79, 79), 1e-5  # at the ends the jerk jumps
        angle, rate, acceleration = (np.asarray(values) for values in reference(times))
        before, after = (np.asarray(reference(times + step).orientation) for step in (-h, h))
        np.testing.assert_allclose((after - before) / (2.0 * h), rate, atol=1e-7)
        np.testing.assert_allclose((after - 2.0 * angle + before) / h**2, acceleration, atol=1e-4)
        assert [*map(float, reference(0.8))] == pytest.approx([target, 0.0, 0.0], abs=1e-12)
    now, then = first(0.3), from_now(first, 0.3)(0.0)
    np.testing.assert_allclose(np.array(then), np.array(now))
    assert from_now(first, 0.8)(5.0).orientation == 1.2
    rest = Redirected(MinimumJerk((0.2, 0.2), 1.0), 0.9, 0.8)(times)  # of one that rests: minimum jerk itself
    np.testing.assert_allclose(np.array(rest), np.array(MinimumJerk((0.2, 0.9), 0.8)(times)), atol=1e-12)


@pytest.mark.parametrize("name", ["pivot-2d", "mpc-2d"])
def test_it_is_sent_to_another_angle_on_its_way(name: str) -> None:
    loop = LiveLoop(scenario(name))
    loop.advance(700)
    angle, rate = (values[-1] for values in loop.run().reference[:2])
    assert rate > 0.3
    loop.go_to(35.0)
    loop.advance(1)
    begun = loop.run().reference
    assert [begun[0][0], begun[1][0]] == pytest.approx([angle, rate], abs=1e-12)
    loop.advance(4000)
    run = loop.run()
    assert turned(run) == pytest.approx(35.0, abs=1e-3)
    assert verdict_so_far(run).verdict == "pass", run.checks
    with pytest.raises(InputError, match=r"theta = 120.0: must be in \[0.1, 89.9\] deg"):
        loop.go_to(120.0)


def test_a_shove_acts_in_the_plant_alone_and_is_recovered_from() -> None:
    """MuJoCo is given the push on top of the wrench of the control for 20 ms, which is all that the log shows."""
    loop = LiveLoop(scenario("balance-2d"))
    loop.advance(600)
    applied = loop._batch.bind("xfrc_applied")[0, loop.world.truth.index]
    at = loop.states.position[0] + [0.0, 0.0, 0.3]
    loop.shove(np.array([0.3, 0.0, 0.0]), at)
    seen = []
    for _ in range(25):
        loop.advance(1)
        seen.append(applied - loop.run().wrench_world[0, -1])
    pushed = np.array(seen)
    np.testing.assert_allclose(pushed[:20], np.tile([15.0, 0.0, 0.0, 0.0, 4.5, 0.0], (20, 1)), atol=1e-9)
    assert not pushed[20:].any()
    error = np.abs(np.rad2deg(loop.run().angle_error[0]))
    assert error[600:].max() > 0.1 > 1000.0 * error[400:600].max()
    loop.advance(1000)
    assert abs(np.rad2deg(loop.run().angle_error[0, -1])) < 1e-4


def test_dragging_pulls_until_it_is_let_go() -> None:
    loop = LiveLoop(scenario("balance-2d"))
    loop.advance(600)
    loop.pull(np.array([1.0, 0.0, 0.0]), loop.states.position[0] + [0.0, 0.0, 0.3])
    loop.advance(1000)
    held = abs(np.rad2deg(loop.run().angle_error[0, -1]))
    loop.let_go()
    loop.advance(1000)
    assert held > 0.01 > 100.0 * abs(np.rad2deg(loop.run().angle_error[0, -1]))


def test_less_friction_than_the_controller_believes_slips_and_fails() -> None:
    loop = LiveLoop(scenario("pivot-2d"))
    loop.advance(300)
    at = turned(loop.run())
    loop.change(**{"world.mu": 0.05})
    loop.advance(1)
    assert turned(loop.run()) == pytest.approx(at, abs=0.01), "it goes on from where it was"
    assert loop.world.mu == 0.05
    assert loop.run().attached.controller.contacts[0].mu == 0.3
    loop.advance(600)
    run = loop.run()
    found = verdict_so_far(run)
    assert found.verdict == "fail"
    assert run.measures.slip_max_m[0] > 1e-3
    assert re.fullmatch(r"The contact has slipped by \S+ mm, and 0.02 mm are allowed\.", in_words(found, run))
    assert "FAIL" in as_html(found, run)
    loop.change(mu=0.6)
    assert loop.world.mu == loop.run().attached.controller.contacts[0].mu if loop.made else loop.world.mu == 0.6


def test_what_cannot_be_is_refused_and_changes_nothing() -> None:
    loop = LiveLoop(scenario("pivot-2d"))
    loop.advance(100)
    asked, lap = loop.asked, loop.lap
    for keys, error, told in (
        ({"margin": 1.2}, InputError, "margin = 1.2: must be a finite number < 1 and >= 0"),
        ({"world.mu": 1e-5}, ModelError, "mu = 1e-05: must be > 1e-05"),
        ({"world.margin": 0.1}, InputError, "world.margin = 0.1: must be one of world.mu"),
    ):
        with pytest.raises(error, match=re.escape(told)):
            loop.change(**keys)
        assert (loop.asked, loop.lap, loop.made) == (asked, lap, 100)
    loop.advance(10)


def test_what_counts_at_the_end_fails_nothing_before() -> None:
    loop = LiveLoop(scenario("settle-3d"))
    loop.advance(1000)
    found = verdict_so_far(loop.run())
    assert found.verdict == "pass"
    assert [check.name for check in found.checks if not check.passed] == ["contacts_missing"]
    assert "contacts missing at the end" in as_html(found, loop.run())


def test_an_object_whose_file_is_in_millimetres_is_shoved_by_the_same_impulse(tmp_path: Path) -> None:
    """100 mm, 0.96 kg: 20 ms of 1 N in newtons are what its model calls 1000."""
    box = '<geom name="g" type="box" size="50 40 60" mass="0.96"/>'
    text = mjcf(box, pose='pos="0 0 60"', option='gravity="0 0 -9810"')
    loop = LiveLoop(own(tmp_path, text))
    loop.advance(200)
    assert loop.world.unit == 1e-3
    loop.shove(np.array([0.02, 0.0, 0.0]))
    assert loop._apply.push[0] == pytest.approx(1000.0)
    assert loop.momentum == pytest.approx(0.1 * 0.96 * np.sqrt(9.81 * loop.run().load.lever))


def test_the_command_says_where_the_page_is_and_ends_in_a_line() -> None:
    process = started("view", "balance-2d", "--port", "0")
    assert process.stdout is not None
    line = process.stdout.readline()
    found = re.fullmatch(r"balance-2d is live at (http://127\.0\.0\.1:\d+) \(Ctrl-C ends it\)\n", line)
    if not found:
        process.kill()
    assert found, (line, process.communicate())
    with urllib.request.urlopen(found[1], timeout=10) as page:
        assert b"<html" in page.read(2000)
    process.send_signal(signal.SIGINT)
    said, told = process.communicate(timeout=20)
    assert (process.returncode, said, told.splitlines()[-1]) == (130, "", "pivoting: interrupted")


def test_wrong_use_ends_in_one_line() -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        for words, told in (
            ((), "Missing argument 'SCENARIO', or --model FILE.xml --body NAME."),
            (("balance-2d", "--port", str(port)), f"port = {port}: must be one that is free on 127.0.0.1"),
            (("balance-2d", "--host", "no.such.host.invalid"), "host = 'no.such.host.invalid': must be a name"),
        ):
            done = pivoting("view", *words)
            assert (done.returncode, done.stdout, len(done.stderr.splitlines())) == (2, "", 1), done.stderr
            assert told in done.stderr


def test_without_viser_the_extra_is_named() -> None:
    code = "import sys; sys.modules['viser'] = None; sys.argv[1:] = ['view', 'balance-2d']; "
    code += "from pivoting.__main__ import main; main()"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False, timeout=60)
    assert done.returncode == 2
    assert done.stderr == "pivoting: view needs viser, which is not installed: pip install 'pivoting[view]'\n"


@pytest.fixture(scope="module")
def page() -> Iterator[LivePage]:
    """A live page, in a thread."""
    live, stop, lost = LivePage(LiveLoop(scenario("pivot-2d")), "127.0.0.1", 0), Event(), []

    def run() -> None:
        try:
            live.run(stop.is_set)
        except BaseException as error:
            lost.append(error)

    thread = Thread(target=run)
    thread.start()
    yield live
    stop.set()
    thread.join()
    live.stop()
    assert not lost


@pytest.fixture(scope="module")
def browser(page: LivePage) -> Iterator[tuple[Any, list[str]]]:
    """The page in a real browser, and what went wrong in its console."""
    if CHROMIUM is None:
        pytest.skip("no chromium is installed")
    from playwright.sync_api import sync_playwright

    wrong: list[str] = []
    with sync_playwright() as playwright:
        chromium = playwright.chromium.launch(executable_path=CHROMIUM, headless=True, args=QUIET)
        tab = chromium.new_page(viewport={"width": 1100, "height": 600})
        tab.on("console", lambda message: wrong.append(message.text) if message.type == "error" else None)
        tab.on("pageerror", lambda error: wrong.append(str(error)))
        tab.on("request", lambda request: wrong.extend(() if LOCAL.match(request.url) else (request.url[:99],)))
        tab.goto(page.url)
        tab.set_default_timeout(90_000.0)  # of a machine that is busy with other tests
        tab.wait_for_selector("#verdict")
        tab.wait_for_selector("canvas")
        yield tab, wrong
        chromium.close()


def until(seen: Callable[[], object], seconds: float = 60.0) -> None:
    limit = monotonic() + seconds
    while not seen():
        assert monotonic() < limit
        sleep(0.05)


def put(tab: Any, label: str, value: float) -> None:
    """Type a value into the box of a slider, as a user does."""
    box = tab.locator(f"xpath=//*[text()='{label}']/ancestor::*[.//input][1]//input[not(@type='hidden')]").last
    box.fill(str(value))
    box.press("Enter")


def picture(tab: Any) -> np.ndarray:
    """(H, W, 3) what the canvas shows."""
    from io import BytesIO

    from PIL import Image

    return np.asarray(Image.open(BytesIO(tab.locator("canvas").first.screenshot())).convert("RGB"))


def test_the_page_shows_the_scene_the_verdict_and_the_plots(browser: tuple[Any, list[str]]) -> None:
    tab, wrong = browser
    shown: list[np.ndarray] = []
    until(lambda: shown.append(picture(tab)) or (shown[-1].astype(int) @ [-1, 0, 1] > 40).mean() > 0.02)  # blue
    assert "PASS" in tab.locator("#verdict").inner_text() or "SETTLING" in tab.locator("#verdict").inner_text()
    assert tab.locator(".uplot").count() == 4
    assert tab.locator("svg polygon").count() >= 2, "the solution space"
    until(lambda: (shown[-1] != picture(tab)).any())  # it moves
    assert set(wrong) <= {OF_VISER}


def test_the_slider_turns_the_body_to_its_angle(page: LivePage, browser: tuple[Any, list[str]]) -> None:
    tab, _ = browser
    put(tab, "theta [deg]", 40)
    until(lambda: page.loop.laps_left == np.inf and page.loop.time > 2.5)
    assert turned(page.loop.run()) == pytest.approx(40.0, abs=0.01)


def test_the_button_and_a_click_shove_it(page: LivePage, browser: tuple[Any, list[str]]) -> None:
    """What the server logs is off its reference, to the side that was asked for, and back on it."""
    tab, _ = browser
    put(tab, "theta [deg]", 45)
    until(lambda: page.loop.laps_left == np.inf and page.loop.time > 2.5)
    middle = tab.locator("canvas").first.bounding_box()

    def errors() -> np.ndarray:
        return np.rad2deg(page.loop.run().angle_error[0, -150:])

    for act in (
        lambda: tab.get_by_role("button", name="shove", exact=True).click(),
        lambda: tab.mouse.click(middle["x"] + 0.5 * middle["width"] - 30, middle["y"] + 0.5 * middle["height"] + 20),
    ):
        until(lambda: np.abs(errors()).max() < 1e-3)
        act()
        until(lambda: np.abs(errors()).max() > 0.02, 20.0)


def test_a_value_that_cannot_be_is_refused_on_the_page(page: LivePage, browser: tuple[Any, list[str]]) -> None:
    tab, wrong = browser
    put(tab, "friction mu", 0.0)
    told = tab.wait_for_selector("#refused").inner_text()
    assert told == "Refused: world.mu = 0.0: must be a finite number > 0 and <= 10"
    assert dict(page.loop.asked.world) == {}
    put(tab, "friction mu", 0.9)
    until(lambda: page.loop.world.mu == 0.9)
    tab.wait_for_selector("#refused", state="detached")
    assert set(wrong) <= {OF_VISER}
