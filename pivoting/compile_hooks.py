"""What is called when the first module with compiled functions is imported, before anything can be compiled."""

from collections.abc import Callable

before_compiling: list[Callable[[], None]] = []
