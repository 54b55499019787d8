"""Ctrl-C, held back for as long as something is neither done nor undone."""

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from threading import current_thread, main_thread


@contextmanager
def uninterrupted() -> Iterator[None]:
    """A SIGINT that comes meanwhile is sent again when this is over."""
    if current_thread() is not main_thread():  # an interrupt is raised in that one alone
        yield
        return
    came: list[int] = []
    handler = signal.signal(signal.SIGINT, lambda number, frame: came.append(number))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, handler)
        for number in came[:1]:
            signal.raise_signal(number)
