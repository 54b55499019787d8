"""`pivoting` and `python -m pivoting`: the command line, and what it owes the process around it.

Whatever takes time is imported within `main`, where an interrupt meets a handler, and what a library prints as it is
imported is kept off stdout.
"""

import os
import signal
import sys
from collections.abc import Callable
from functools import partial
from threading import Timer, get_ident
from time import monotonic
from types import FrameType
from typing import Any, NoReturn

from pivoting.compile_hooks import before_compiling


def main() -> NoReturn:
    """Run the command line and exit with its code.

    Ctrl-C at any moment ends in one line and exit code 130, after half-written files are removed. A reader of stdout
    that has gone, as in `pivoting list | head -1`, ends it by SIGPIPE, as it does other tools.
    """
    interrupt = _Interrupt()
    code = 0
    try:
        _open_streams()
        code = _command(interrupt)()
        sys.stdout.flush()
        interrupt.ignore()
    except BrokenPipeError:
        _end_by_broken_pipe()
    except BaseException:
        if not interrupt.came:
            raise
    if interrupt.came:  # whatever the libraries on the way made of it
        interrupt.ignore()
        print("pivoting: interrupted", file=sys.stderr, flush=True)
        os._exit(130)  # libraries that are imported by half need not survive their own tidying up
    sys.exit(code)


class _Interrupt:
    """SIGINT raises KeyboardInterrupt, so that what is open is tidied up; that it came is remembered, as not every
    library hands that on. Where SIGINT is ignored, as of a job in the background, it stays so."""

    def __init__(self) -> None:
        self.came = self._due = False
        self._compilers = 0  # within one another
        self._last = -1.0
        if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
            signal.signal(signal.SIGINT, self._handle)

    def ignore(self) -> None:
        """From here on: all is said and written, or tidied up."""
        signal.signal(signal.SIGINT, signal.SIG_IGN)

    def compiling(self, change: int) -> None:
        """A compiler begins (1), ends (-1), or goes on (0) with its next pass, where it may be interrupted.

        Anywhere else in it LLVM calls back into Python, and a KeyboardInterrupt there is lost, or crashes the process.
        """
        self._compilers += change
        if self._due and change <= 0:
            self._due = False
            raise KeyboardInterrupt

    def _handle(self, number: int, frame: FrameType | None) -> None:
        if monotonic() - self._last < 1.0:  # the same wish again would only disturb the tidying up
            return
        self.came, self._last = True, monotonic()
        sys.excepthook = lambda *_: None  # C extensions print what they cannot raise
        sys.unraisablehook = self._again
        if self._compilers:
            self._due = True
        else:
            raise KeyboardInterrupt

    def _again(self, lost: Any) -> None:
        """Raised in a callback or finalizer it would be lost: it comes again, when that is over."""
        if issubclass(lost.exc_type, KeyboardInterrupt):
            self._last = -1.0
            Timer(0.01, signal.pthread_kill, (get_ident(), signal.SIGINT)).start()


def _open_streams() -> None:
    """Where stdout or stderr is closed the next file that is opened would be in its place, and get what is printed."""
    for name, descriptor in (("stdout", 1), ("stderr", 2)):
        if getattr(sys, name) is None:
            os.dup2(os.open(os.devnull, os.O_WRONLY), descriptor)
            setattr(sys, name, open(descriptor, "w", closefd=False))  # noqa: SIM115


def _command(interrupt: _Interrupt) -> Callable[[], int]:
    """The command line; what libraries print on stdout as they are imported goes to stderr."""
    kept = os.dup(1)
    os.dup2(2, 1)
    graphics = os.environ.get("MUJOCO_GL")
    os.environ["MUJOCO_GL"] = "disable"  # else a missing library fails every command; `render` looks for one itself
    try:
        before_compiling.append(partial(_watch_compilers, interrupt))
        from pivoting.sim.console.command_line import main as command

        sys.stdout.flush()
    finally:
        os.dup2(kept, 1)
        os.close(kept)
        os.environ.pop("MUJOCO_GL")
        if graphics is not None:
            os.environ["MUJOCO_GL"] = graphics
    return command


def _watch_compilers(interrupt: _Interrupt) -> None:
    """One line on stderr when, and only when, something is compiled rather than taken from the cache."""
    from numba.core import event

    class _Watch(event.Listener):  # type: ignore[misc]
        said = False

        def on_start(self, started: event.Event) -> None:
            if started.kind == "numba:compiler_lock":  # also held to load from the cache
                interrupt.compiling(1)
            else:
                interrupt.compiling(0)
                self.said = self.said or _say_that_it_compiles()

        def on_end(self, ended: event.Event) -> None:
            interrupt.compiling(-1 if ended.kind == "numba:compiler_lock" else 0)

    watch = _Watch()
    event.register("numba:compiler_lock", watch)
    event.register("numba:run_pass", watch)


def _say_that_it_compiles() -> bool:
    from pivoting.controller.kernels.compilation import CACHE  # whatever compiles has imported it

    if CACHE is None:
        where = "in memory, in every run: no folder for a cache can be written to; NUMBA_CACHE_DIR sets one"
    else:
        where = f"what such runs need, once, for up to a minute; later ones take it from {CACHE}"
    print(f"pivoting: compiling {where}", file=sys.stderr, flush=True)
    return True


def _end_by_broken_pipe() -> NoReturn:
    if hasattr(signal, "SIGPIPE"):  # else Windows, which has no such end
        signal.signal(signal.SIGPIPE, signal.SIG_DFL)
        os.kill(os.getpid(), signal.SIGPIPE)
    os._exit(1)


if __name__ == "__main__":
    main()
