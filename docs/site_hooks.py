"""What the site adds to its pages: formulas as MathML, and the files outside docs/ that pages link to.

A browser draws MathML itself, so that formulas need neither a script nor a network. The font (STIX Two, Open Font
License) comes with the package ziamath, since few systems have one whose brackets grow. Pages are read on the site and
in the checkout, and a link to ../benchmarks/results/loop.json has to work in both.
"""

import posixpath
import re
from html import unescape
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from latex2mathml.converter import convert
from mkdocs.structure.files import File

ROOT = Path(__file__).parent.parent
PAGES = {"CONTRIBUTING.md": "project/contributing.md", "CHANGELOG.md": "project/changelog.md"}  # files that are pages
COPIED = ("benchmarks/results/*.json", "examples/*.py", "lock/*.txt", "LICENSE")  # files that a page may link to
LINK = re.compile(r"(?<=\]\()([^)#\s:]+)((?:#[^)\s]*)?)(?=\))")
FONT = "fonts/STIXTwoMath-Regular.ttf"
BOLD = re.compile(
    r'<mi mathvariant="bold">([A-Za-z])</mi>'
)  # which browsers no longer heed: the letters themselves are bold
FORMULA = re.compile(r'<(span|div) class="arithmatex">\\([(\[])(.*?)\\[)\]]</\1>', re.DOTALL)


def on_files(files: Any, config: Any) -> Any:
    """Add the pages and the files that live outside docs/."""
    for source, page in PAGES.items():
        files.append(File.generated(config, page, content=(ROOT / source).read_text()))
    for pattern in COPIED:
        for path in sorted(ROOT.glob(pattern)):
            files.append(File.generated(config, f"files/{path.relative_to(ROOT)}", abs_src_path=str(path)))
    (package,) = find_spec("ziamath").submodule_search_locations or ()
    files.append(File.generated(config, FONT, abs_src_path=f"{package}/{FONT}"))
    return files


def on_page_markdown(markdown: str, page: Any, **_: Any) -> str:
    """Point links that lead out of docs/ to where those files are in the site."""
    sources = {page: source for source, page in PAGES.items()}
    uri = page.file.src_uri
    base = posixpath.dirname(sources.get(uri, f"docs/{uri}"))

    def moved(match: re.Match[str]) -> str:
        target = posixpath.normpath(posixpath.join(base, match[1]))
        inside = target.startswith("docs/")
        place = target.removeprefix("docs/") if inside else PAGES.get(target, f"files/{target}")
        return posixpath.relpath(place, posixpath.dirname(uri) or ".") + match[2]

    return LINK.sub(moved, markdown)


def on_page_content(html: str, **_: Any) -> str:
    """Formulas, from LaTeX to MathML."""

    def drawn(match: re.Match[str]) -> str:
        display = "block" if match[2] == "[" else "inline"
        return BOLD.sub(bold, convert(unescape(match[3]).strip(), display=display))

    return FORMULA.sub(drawn, html)


def bold(match: re.Match[str]) -> str:
    """The bold letter of Unicode's mathematical alphabet."""
    letter = match[1]
    code = 0x1D400 + ord(letter) - ord("A") if letter.isupper() else 0x1D41A + ord(letter) - ord("a")
    return f"<mi>&#x{code:X};</mi>"
