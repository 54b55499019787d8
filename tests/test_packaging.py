"""What a checkout needs to become a command, today and in a year: the lock, the targets of make, the import names."""

import os
import re
import subprocess
import sys
import tomllib
from importlib.metadata import version
from pathlib import Path

import pivoting
import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).parent.parent
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())
LOCKS = {"dev": ("video", "view", "test", "dev"), "bench": ("video", "view", "test", "dev", "bench")}


def pins(lock: str) -> dict[str, list[tuple[Requirement, int]]]:
    """By package, as there may be several for different machines: the pin, and how many files it allows."""
    found: dict[str, list[tuple[Requirement, int]]] = {}
    for entry in re.split(r"\n(?=\S)", (ROOT / f"lock/{lock}.txt").read_text()):
        if not entry.startswith("#"):
            pin = Requirement(entry.partition("\\")[0])
            hashes = re.findall(r"^    --hash=sha256:[0-9a-f]{64}(?: \\)?$", entry, flags=re.MULTILINE)
            found.setdefault(canonicalize_name(pin.name), []).append((pin, len(hashes)))
    return found


@pytest.mark.parametrize("lock", LOCKS)
def test_the_lock_holds_all_that_is_declared(lock: str) -> None:
    """After a change of pyproject.toml: make lock."""
    project, locked = PROJECT["project"], pins(lock)
    declared = [*PROJECT["build-system"]["requires"], *project["dependencies"]]
    declared += [line for extra in LOCKS[lock] for line in project["optional-dependencies"][extra]]
    for line in declared:
        wanted = Requirement(line)
        if wanted.name == "pivoting":
            continue
        chosen = locked[canonicalize_name(wanted.name)]
        for pin, _ in chosen:
            (exact,) = pin.specifier
            assert exact.operator == "=="
            assert wanted.specifier.contains(exact.version), f"{line}: {pin} is locked"
        if wanted.marker is None:
            assert any(pin.marker is None or pin.marker.evaluate() for pin, _ in chosen), line


@pytest.mark.parametrize("lock", LOCKS)
def test_the_lock_names_files_by_their_hashes_and_no_place(lock: str) -> None:
    assert all(files > 0 for pinned in pins(lock).values() for _, files in pinned)
    for line in (ROOT / f"lock/{lock}.txt").read_text().splitlines():
        pin, digest = r"[a-z0-9.-]+==\S+( ; [^\\]+)? \\", r"    --hash=sha256:[0-9a-f]{64}( \\)?"
        assert re.fullmatch(rf"#.*|    +#.*|{pin}|{digest}", line), line
        assert not re.search(r"://|file:|@|--index|--find", line), line


def test_the_peers_are_added_to_what_is_locked_already() -> None:
    dev, bench = pins("dev"), pins("bench")
    for name, chosen in dev.items():
        assert {str(pin.specifier) for pin, _ in bench[name]} == {str(pin.specifier) for pin, _ in chosen}


def test_this_machine_has_what_is_locked() -> None:
    """Where it was made by make: `make latest` has newer ones."""
    if ".venv-latest" in sys.prefix or not (Path(sys.prefix) / ".locked").exists():
        pytest.skip("not installed from the lock")
    for name, chosen in pins("dev").items():
        for pin, _ in chosen:
            if pin.marker is None or pin.marker.evaluate():
                assert pin.specifier.contains(version(name)), name


def made(folder: Path, *words: str) -> list[str]:
    """What make would do."""
    call = ["make", "--dry-run", "--no-print-directory", *words]
    return subprocess.run(call, cwd=folder, capture_output=True, text=True, check=True).stdout.splitlines()


def test_make_installs_from_the_lock_once(tmp_path: Path) -> None:
    """Nothing is asked of a registry but what the lock names; again when the lock changes, and only then."""
    (tmp_path / "lock").mkdir()
    for name in ("Makefile", "pyproject.toml", "lock/dev.txt", "lock/bench.txt"):
        (tmp_path / name).write_bytes((ROOT / name).read_bytes())
    for target in ("demo", "test", "check", "bench"):
        installs = [line for line in made(tmp_path, target) if "pip install" in line]
        assert len(installs) == (3 if target == "bench" else 2)
        for line in installs:
            locked = re.search(r"--require-hashes --only-binary :all: --requirement lock/(dev|bench)\.txt", line)
            assert locked or "--no-index --no-deps --no-build-isolation" in line, line
    stamps = [tmp_path / ".venv" / name for name in (".locked", ".installed", ".peers")]
    stamps[0].parent.mkdir()
    for age, stamp in enumerate(stamps):
        stamp.touch()
        os.utime(stamp, (2e9 + age, 2e9 + age))
    for target in ("demo", "test", "check", "bench"):
        assert not [line for line in made(tmp_path, target) if "pip install" in line]
    assert len([line for line in made(tmp_path, "-W", "lock/dev.txt", "test") if "pip install" in line]) == 2
    assert len([line for line in made(tmp_path, "-W", "pyproject.toml", "test") if "pip install" in line]) == 1


def test_make_latest_runs_the_same_tests_without_the_lock() -> None:
    latest, test = made(ROOT, "latest"), made(ROOT, "-o", ".venv/.installed", "test")
    assert not [line for line in latest if "lock/" in line]
    assert latest[-1].partition("bin/python ")[2] == test[-1].partition("bin/python ")[2] != ""


def test_make_help_lists_every_target() -> None:
    alone = {key: value for key, value in os.environ.items() if not key.startswith(("MAKE", "MFLAGS"))}
    done = subprocess.run(["make", "help"], cwd=ROOT, env=alone, capture_output=True, text=True, check=True)
    told = [line.split()[1] for line in done.stdout.splitlines()]
    (targets,) = re.findall(r"^\.PHONY: (.*)$", (ROOT / "Makefile").read_text(), flags=re.MULTILINE)
    assert sorted(told) == sorted(targets.split())
    assert all(len(line.split()) > 3 for line in done.stdout.splitlines())


def test_there_is_one_version() -> None:
    assert pivoting.__version__ == version("pivoting")
    assert f"\nversion: {pivoting.__version__}\n" in (ROOT / "CITATION.cff").read_text()
    assert f"## {pivoting.__version__}" in (ROOT / "CHANGELOG.md").read_text()


ALL = "import pivoting, pivoting.controller, pivoting.models, pivoting.sim; print(pivoting.sim.__file__)"


@pytest.mark.parametrize("where", ["root", "elsewhere"])
@pytest.mark.parametrize("how", ["installed", "bare"])
def test_the_rooms_are_found(where: str, how: str, tmp_path: Path) -> None:
    """From the root, where python finds the folder pivoting/ itself, and from elsewhere; editable, or not installed."""
    folder = ROOT if where == "root" else tmp_path
    environment = dict(os.environ)
    flags: list[str] = []
    if how == "bare":  # the packages that are needed, but no path file of an editable installation
        paths = [path for path in sys.path if "site-packages" in path] + ([str(ROOT)] if where == "elsewhere" else [])
        flags, environment["PYTHONPATH"] = ["-S"], os.pathsep.join(paths)
    for words in (["-c", ALL], ["-m", "pivoting", "--version"], ["-m", "pivoting.sim", "--version"]):
        done = subprocess.run(
            [sys.executable, *flags, *words], cwd=folder, env=environment, capture_output=True, text=True, check=False
        )
        assert done.returncode == 0, done.stderr
        shown = f"{ROOT / 'sim' / '__init__.py'}" if words[0] == "-c" else f"pivoting {pivoting.__version__}"
        assert done.stdout.strip() == shown
