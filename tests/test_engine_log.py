"""What MuJoCo warns of is told with the run and leaves no file behind."""

import re
from pathlib import Path

import mujoco
import pytest
from mujoco.batch import Batch
from pivoting.sim import simulate
from pivoting.sim.engine_log import engine_log

from tests.own_files import mjcf, own

BALL = mujoco.MjModel.from_xml_string(
    '<mujoco><option><flag autoreset="disable"/></option><worldbody><body><freejoint/><geom size=".1"/></body>'
    "</worldbody></mujoco>"
)


@pytest.mark.parametrize("worlds", [1, 8])
def test_a_world_that_diverges(
    worlds: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    run = simulate("balance-2d", worlds=worlds, bandwidth=5000, seconds=0.6)
    assert list(tmp_path.iterdir()) == []
    assert capfd.readouterr() == ("", "")
    assert run.engine_warnings
    assert run.summary()["engine_warnings"] == list(run.engine_warnings)
    assert all(
        re.match(r"Nan, Inf or huge value in Q.* unstable\. t = 0\.0\d+ s", told) for told in run.engine_warnings
    )
    assert simulate("balance-2d", seconds=0.6).engine_warnings == ()


def test_a_run_that_is_replayed_leaves_nothing_either(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """To name what it touched."""
    coarse = mjcf().replace('timestep="0.001"', 'timestep="0.05"')
    run = simulate(own(tmp_path, coarse, chosen=False))
    (empty := tmp_path / "empty").mkdir()
    monkeypatch.chdir(empty)
    assert run.verdict == "fail"
    assert run.strays
    assert list(empty.iterdir()) == []


def test_each_is_told_once_at_its_first_time_from_any_thread(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    with engine_log() as said:
        batch = Batch(BALL, 16, nthread=2, persistent=True)
        push = batch.bind("xfrc_applied")
        for step in range(30):
            push[(16 - step if step < 16 else 0) :, 1, 0] = 1e300  # world 15 first, at step 1
            batch.step()
        assert said == []
    (told,) = [line for line in said if "QACC at DOF 0" in line]
    assert told == "Nan, Inf or huge value in QACC at DOF 0. The simulation is unstable. t = 0.002 s, 16 times"
    assert list(tmp_path.iterdir()) == []


def test_what_was_set_is_restored(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """The user's own log, also where the run ends in an exception, and where nothing temporary can be made."""
    before = mujoco.MjLogConfig.get()
    mine = mujoco.MjLogConfig.get()
    mine.logfile, mine.logto_console = str(tmp_path / "mine"), False
    mujoco.MjLogConfig.set(mine)
    try:
        with pytest.raises(RuntimeError), engine_log():
            raise RuntimeError
        with engine_log():
            assert mujoco.MjLogConfig.get().logfile != mine.logfile
        monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "nowhere"))
        with engine_log() as said:
            assert mujoco.MjLogConfig.get().logto_console
            assert not mujoco.MjLogConfig.get().logto_file
        assert said == []
        now = mujoco.MjLogConfig.get()
        assert (now.logfile, now.logto_file, now.logto_console) == (mine.logfile, True, False)
    finally:
        mujoco.MjLogConfig.set(before)


def test_a_handler_of_the_users_own_still_gets_them() -> None:
    heard: list[str] = []
    before = mujoco.get_mju_user_warning()
    mujoco.set_mju_user_warning(heard.append)
    try:
        simulate("balance-2d", bandwidth=5000, seconds=0.6)
    finally:
        mujoco.set_mju_user_warning(before)
    assert any("unstable" in message for message in heard)
