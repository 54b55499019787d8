"""The code blocks of a page of README or docs/, and how they are run: each alone, as it is pasted.

A block of python is run in an interpreter of its own; a block of text right after it is what it prints. A block with a
title is a file that the other blocks of its page use. In a console block each command `pivoting` or `pytest` is run,
and what is shown below it has to appear in its output, in order; the comment "exits with 1" is the status expected.
"""

import os
import re
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).parent.parent
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
FENCE = re.compile(r"^```(\w+)(?: title=\"(.+?)\")?\n(.*?)^```$", re.MULTILINE | re.DOTALL)
COMMANDS = {"pivoting": ["-m", "pivoting"], "pytest": ["-m", "pytest", "-p", "no:cacheprovider"]}


class Block(NamedTuple):
    """A fenced block.

    Attributes:
        place: page and number, for the name of a test.  language, title, code: of the fence.
        printed: the block of text that follows at once, what it should print; or None.
    """

    place: str
    language: str
    title: str | None
    code: str
    printed: str | None


def blocks(page: Path) -> list[Block]:
    """All fenced blocks of a page, in their order."""
    text, found = page.read_text(), []
    matches = list(FENCE.finditer(text))
    for i, match in enumerate(matches):
        after = matches[i + 1] if i + 1 < len(matches) else None
        follows = after is not None and after[1] == "text" and not text[match.end() : after.start()].strip()
        printed = after[3] if after is not None and follows else None
        found.append(Block(f"{page.relative_to(ROOT)}:{i}", match[1], match[2], match[3], printed))
    return found


def write_files(page: Path, folder: Path) -> None:
    """The page's blocks that have a title, as files."""
    for block in blocks(page):
        if block.title:
            (folder / block.title).write_text(block.code)


def started(words: list[str], folder: Path) -> subprocess.CompletedProcess[str]:
    """python with these words, to the end."""
    environment = {**os.environ, "COLUMNS": "100"}
    return subprocess.run(
        [sys.executable, *words], capture_output=True, text=True, cwd=folder, env=environment, timeout=300, check=False
    )


def commands(code: str) -> list[tuple[list[str], int, list[str]]]:
    """Of a console block: words, expected status and expected lines of each command that a test can run."""
    found: list[tuple[list[str], int, list[str]]] = []
    known = False
    for line in code.splitlines():
        if line.startswith("$ "):
            command, _, comment = line[2:].partition("  #")
            name, *words = re.findall(r'"[^"]*"|\S+', command)
            known = Path(name).name in COMMANDS
            if known:
                words = [word.strip('"') for word in words]
                found.append(([*COMMANDS[Path(name).name], *words], int("exits with 1" in comment), []))
        elif known and line.strip():
            found[-1][2].append(line)
    return found


def squeezed(text: str) -> str:
    """Without what depends on the width of the screen."""
    return " ".join(text.split())
