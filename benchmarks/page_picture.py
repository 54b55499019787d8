"""The picture that the code of a page draws, put where the page shows it.

Called with the page and the picture: docs/notes/pivot.md docs/wrench-along-the-arc.png.
"""

import shutil
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

sys.path.insert(0, str(Path(__file__).parent.parent))  # the same blocks as the tests run
from tests.page_blocks import blocks, started


def drawn(page: Path, picture: Path) -> None:
    """Run the page's block of Python that saves a picture of that name.

    Raises:
        SystemExit: there is no such block, or it fails.
    """
    python = [block.code for block in blocks(page.resolve()) if block.language == "python"]
    found = [code for code in python if picture.name in code]
    if len(found) != 1:
        raise SystemExit(f"{page}: {len(found)} blocks of Python name {picture.name}; must be one")
    with TemporaryDirectory() as folder:
        done = started(["-c", found[0]], Path(folder))
        if done.returncode:
            raise SystemExit(f"{page}: the block that draws {picture.name} fails\n{done.stderr}")
        shutil.copyfile(Path(folder) / picture.name, picture)


if __name__ == "__main__":
    drawn(*map(Path, sys.argv[1:]))
