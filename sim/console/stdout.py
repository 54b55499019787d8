"""What a command says on stdout: text for people, or one JSON object and nothing else, whatever libraries print."""

import json
import os
import sys
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NoReturn, TypeVar

import click

if TYPE_CHECKING:
    from rich.console import Console

Command = TypeVar("Command", bound=Callable[..., Any])


class JsonOutput:
    """Stdout kept for one object: from here on what this process and its children print there goes to stderr.

    Also below Python: it is the descriptor 1 that is moved, and it stays so to the end, when C flushes what it holds.
    """

    def __init__(self) -> None:
        sys.stdout.flush()
        self._kept = os.dup(1)
        os.dup2(2, 1)

    def __call__(self, value: Any) -> None:
        """Write the object, once, in strict JSON: a nan in it raises ValueError."""
        text = json.dumps(value, allow_nan=False) + "\n"
        with os.fdopen(self._kept, "w") as stdout:
            stdout.write(text)


def console() -> "Console":
    """For people. When its reader has gone that is for the process to say, not for rich, which would exit with 1."""
    from rich.console import Console

    class _Page(Console):
        def on_broken_pipe(self) -> NoReturn:
            raise

    return _Page()


def json_option(help: str) -> Callable[[Command], Command]:
    """The option --json of a command, whose parameter `as_json` is then a `JsonOutput`, or None."""

    def taken(context: click.Context, parameter: click.Parameter, value: bool) -> JsonOutput | None:
        return JsonOutput() if value and not context.resilient_parsing else None

    return click.option("--json", "as_json", is_flag=True, is_eager=True, callback=taken, help=help)
