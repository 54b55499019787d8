"""Files that are written together: whatever goes wrong, and whenever, all of them are there, whole, or none."""

import signal
from collections.abc import Callable, Iterator
from pathlib import Path
from time import perf_counter
from types import FrameType

import pytest
from pivoting import load
from pivoting.sim import Run, simulate
from pivoting.sim.whole_files import write_together

from tests.same_runs import assert_same


def text(words: str) -> Callable[[Path], object]:
    return lambda part: part.write_text(words)


def interrupted(part: Path) -> None:
    part.write_text("half")
    signal.raise_signal(signal.SIGINT)


def test_they_are_written_into_a_new_folder(tmp_path: Path) -> None:
    write_together(tmp_path / "a" / "b", {"one": text("1"), "two": text("2")})
    assert {path.name: path.read_text() for path in (tmp_path / "a" / "b").iterdir()} == {"one": "1", "two": "2"}


def test_an_interrupt_leaves_nothing(tmp_path: Path) -> None:
    """Neither files nor folders; and what was there before stays as it was."""
    with pytest.raises(KeyboardInterrupt):
        write_together(tmp_path / "a" / "b", {"one": text("1"), "two": interrupted})
    assert list(tmp_path.iterdir()) == []
    write_together(tmp_path, {"one": text("1"), "two": text("2")})
    with pytest.raises(KeyboardInterrupt):
        write_together(tmp_path, {"one": text("new"), "two": interrupted})
    assert {path.name: path.read_text() for path in tmp_path.iterdir()} == {"one": "1", "two": "2"}


def test_a_folder_in_the_place_of_a_file_is_left_alone(tmp_path: Path) -> None:
    (tmp_path / "two").mkdir()
    with pytest.raises(IsADirectoryError, match="two"):
        write_together(tmp_path, {"one": text("1"), "two": text("2")})
    assert [path.name for path in tmp_path.iterdir()] == ["two"]


def test_where_there_can_be_no_folder_that_is_the_error(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("mine")
    with pytest.raises(OSError, match="file"):
        write_together(tmp_path / "file" / "folder", {"one": text("1")})
    assert (tmp_path / "file").read_text() == "mine"


def test_what_others_put_into_a_new_folder_stays(tmp_path: Path) -> None:
    def wrong(part: Path) -> None:
        (part.parent / "mine").write_text("mine")
        raise OSError

    with pytest.raises(OSError):  # noqa: PT011
        write_together(tmp_path / "new", {"one": wrong})
    assert [path.name for path in tmp_path.rglob("*")] == ["new", "mine"]


@pytest.fixture
def alarm() -> Iterator[Callable[[float], None]]:
    """Has a Ctrl-C come after so many seconds, 0: never."""

    def rung(number: int, frame: FrameType | None) -> None:
        signal.raise_signal(signal.SIGINT)

    before = signal.signal(signal.SIGALRM, rung)
    yield lambda seconds: (signal.setitimer(signal.ITIMER_REAL, seconds), None)[1]
    signal.setitimer(signal.ITIMER_REAL, 0.0)
    signal.signal(signal.SIGALRM, before)


# a Ctrl-C between opening a file and its `with` leaves it to the garbage collector, which says so
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
def test_a_run_is_saved_whole_or_not_at_all(tmp_path: Path, alarm: Callable[[float], None]) -> None:
    """Interrupted at many moments."""
    run: Run = simulate("snap-2d", worlds=4)
    begun = perf_counter()
    run.save(tmp_path / "first")
    takes, stopped = perf_counter() - begun, 0
    for i in range(40):
        folder = tmp_path / str(i)
        try:
            alarm(max(1e-4, 1.2 * takes * i / 40))
            run.save(folder)
            alarm(0.0)
        except KeyboardInterrupt:
            stopped += 1
        assert not list(tmp_path.rglob("*.part"))
        if folder.exists():
            assert_same(run, load(folder))
    assert stopped > 5
