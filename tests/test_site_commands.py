"""The commands that README and the site show do what is shown below them; a file of its own, run beside test_site."""

from pathlib import Path

import pytest

from tests.page_blocks import PAGES, Block, blocks, commands, squeezed, started, write_files

CONSOLE = [
    pytest.param(page, block, id=block.place)
    for page in PAGES
    for block in blocks(page)
    if block.language == "console" and commands(block.code)
]


@pytest.mark.parametrize(("page", "block"), CONSOLE)
def test_commands_say_what_is_shown(page: Path, block: Block, tmp_path: Path) -> None:
    write_files(page, tmp_path)
    for words, status, shown in commands(block.code):
        done = started(words, tmp_path)
        told = squeezed(done.stdout + done.stderr)
        assert done.returncode == status, told
        for line in shown:
            before, found, told = told.partition(squeezed(line))
            assert found, f"{line!r} is not in {before!r}"
