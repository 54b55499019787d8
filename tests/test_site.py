"""The site says only what is true: its code prints what it shows, its links lead somewhere, it needs no network."""

import ast
import re
import subprocess
import sys
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path

import pytest

from tests.page_blocks import PAGES, ROOT, Block, blocks, commands, started, write_files

RUN = [(page, block) for page in PAGES for block in blocks(page) if block.language in ("python", "console")]
PYTHON = [
    pytest.param(page, block, id=block.place) for page, block in RUN if block.language == "python" and not block.title
]


@pytest.mark.parametrize(("page", "block"), PYTHON)
def test_code_runs_and_prints_what_is_shown(page: Path, block: Block, tmp_path: Path) -> None:
    write_files(page, tmp_path)
    done = started(["-W", "error", "-c", block.code], tmp_path)
    assert done.returncode == 0, done.stderr
    if block.printed is not None:
        assert done.stdout.strip() == block.printed.strip()


def test_nothing_on_a_page_escapes_these_tests() -> None:
    """Every fence is of a known kind, and files with a title are used by a block that is run."""
    for page in PAGES:
        found = blocks(page)
        assert page.read_text().count("\n```") == 2 * len(found), page
        assert {block.language for block in found} <= {"python", "console", "text", "xml"}, page
        code = " ".join(block.code for block in found if not block.title)
        assert all(block.title in code for block in found if block.title), page
    assert len(PYTHON) > 15
    assert sum(bool(commands(block.code)) for _, block in RUN if block.language == "console") > 8


def links() -> Iterator[tuple[Path, str]]:
    """Of all pages, without those to other sites."""
    for page in [*PAGES, ROOT / "CONTRIBUTING.md", ROOT / "CHANGELOG.md"]:
        text = re.sub(r"^```.*?^```$", "", page.read_text(), flags=re.MULTILINE | re.DOTALL)
        for target in re.findall(r"\]\(([^)\s]+)\)", text):
            if "://" not in target:
                yield page, target


def test_links_and_pictures_lead_somewhere() -> None:
    for page, target in links():
        path, _, anchor = target.partition("#")
        assert (page.parent / path).exists(), f"{page.name}: {target}"
        if anchor:
            heads = re.findall(
                r"^#+ (.*)$", (page.parent / path).read_text() if path else page.read_text(), re.MULTILINE
            )
            assert anchor in [re.sub(r"[^\w -]", "", head).lower().replace(" ", "-") for head in heads], target


def test_every_picture_is_made_by_make_figures_or_listed_as_a_screenshot() -> None:
    shown = {
        (page.parent / target).resolve().relative_to(ROOT).as_posix()
        for page, target in links()
        if Path(target).suffix in (".png", ".gif")
    }
    recipe = re.search(r"^figures:.*\n((?:\t.*\n)+)", (ROOT / "Makefile").read_text(), re.MULTILINE)
    assert recipe is not None
    made = set(re.findall(r"docs/[\w-]+\.(?:png|gif)", recipe[1]))
    screenshots = set(re.findall(r"^\| `(docs/[\w-]+\.png)`", (ROOT / "CONTRIBUTING.md").read_text(), re.MULTILINE))
    assert not made & screenshots
    assert shown == made | screenshots


@pytest.mark.parametrize("room", ["controller", "models", "sim"])
def test_the_reference_has_every_name_that_is_exported(room: str) -> None:
    page = (ROOT / f"docs/api/{room}.md").read_text()
    tree = ast.parse((ROOT / f"{room}/__init__.pyi").read_text())
    exported = [
        f"pivoting.{room}.{node.module}.{alias.name}"
        for node in tree.body
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    ]
    assert sorted(re.findall(r"^::: (\S+)$", page, re.MULTILINE)) == sorted(exported)


def test_the_front_page_of_the_reference_has_every_name() -> None:
    tree = ast.parse((ROOT / "pivoting/__init__.pyi").read_text())
    exported = [alias.name for node in tree.body if isinstance(node, ast.ImportFrom) for alias in node.names]
    assert re.findall(r"\[`(\w+)`\]", (ROOT / "docs/api/pivoting.md").read_text()) == exported


@pytest.mark.parametrize("name", ["results", "engines"])
def test_pages_of_measured_figures_are_made_of_the_committed_results(name: str) -> None:
    call = [sys.executable, ROOT / "benchmarks/results_page.py", name]
    page = subprocess.run(call, capture_output=True, text=True, check=True).stdout
    assert page == (ROOT / f"docs/{name}.md").read_text(), "make figures"
    template = (ROOT / f"docs/{name}.template.md").read_text().partition("\n## Measured once, by hand\n")[0]
    prose = re.sub(r"\{\{.*?\}\}|`[^`]*`|\]\(.*?\)", "", template, flags=re.DOTALL)
    measured = re.findall(r"\d+\.\d+|\de-\d+", prose)
    assert set(measured) <= {"0.05", "1.5", "1e-5", "1e-10"}, "a figure that is not taken from a result"


@pytest.mark.skipif(find_spec("mkdocs") is None, reason="the extra [docs] is not installed")
def test_the_site_is_built_without_a_warning_and_needs_no_network(tmp_path: Path) -> None:
    call = [sys.executable, "-m", "mkdocs", "build", "--strict", "--quiet", "--site-dir", str(tmp_path / "site")]
    done = subprocess.run(call, capture_output=True, text=True, cwd=ROOT, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    pages = list((tmp_path / "site").rglob("*.html"))
    assert len(pages) > 20
    for page in pages:
        text = page.read_text()
        assert not re.findall(r'<(?:script|link|img|iframe)[^>]+(?:src|href)="?https?://', text), page
        assert "arithmatex" not in text, f"{page}: a formula that was not drawn"
