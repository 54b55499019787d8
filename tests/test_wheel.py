"""A built wheel, installed elsewhere, runs: what is missing from the package is found here and not by its users.

Also where nothing can be written, as in a container: neither in the installation nor in a home.
"""

import ctypes
import json
import os
import shutil
import subprocess
import sys
import zipfile
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
SHORT = "run", "balance-2d", "--set", "seconds=1", "--json"
COMPILING = "pivoting: compiling what such runs need, once"
MEMORY = (
    "pivoting: compiling in memory, in every run: no folder for a cache can be written to; NUMBA_CACHE_DIR sets one"
)


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Built by the locked backend: nothing is asked of a registry."""
    out = tmp_path_factory.mktemp("wheel")
    build = ["-m", "build", "--wheel", "--no-isolation", "--outdir", str(out), str(ROOT)]
    subprocess.run([sys.executable, *build], check=True, capture_output=True)
    (built,) = out.glob("*.whl")
    return built


@pytest.fixture(scope="module")
def site(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder that it is installed in."""
    target = tmp_path_factory.mktemp("site")
    call = [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--no-index", "--target", str(target)]
    subprocess.run([*call, str(wheel)], check=True, capture_output=True)
    return target


def test_everything_is_in_it(wheel: Path) -> None:
    names = set(zipfile.ZipFile(wheel).namelist())
    for room, folder in (("controller/", "controller"), ("models/", "models"), ("sim/", "sim"), ("", "pivoting")):
        for path in (ROOT / folder).rglob("*"):
            if path.suffix in (".py", ".xml", ".typed"):
                assert f"pivoting/{room}{path.relative_to(ROOT / folder)}" in names
    assert not [name for name in names if not name.startswith("pivoting")]


def bound_by_permissions() -> None:
    """In a child: root gives up what lets it write where the permissions do not."""
    with suppress(AttributeError, OSError):
        for capability in (1, 2):  # CAP_DAC_OVERRIDE, CAP_DAC_READ_SEARCH
            ctypes.CDLL(None).prctl(24, capability, 0, 0, 0)  # PR_CAPBSET_DROP


@pytest.fixture
def read_only(site: Path, tmp_path: Path) -> Iterator[dict[str, str]]:
    """An environment in which neither the installation nor the home can be written to."""
    home = tmp_path / "home"
    home.mkdir()
    folders = [home, site, *(path for path in site.rglob("*") if path.is_dir())]
    for folder in folders:
        folder.chmod(0o555)
    try:
        probe = [sys.executable, "-c", f"open({str(site / 'x')!r}, 'w')"]
        if subprocess.run(probe, preexec_fn=bound_by_permissions, capture_output=True, check=False).returncode == 0:
            pytest.skip("permissions do not bind here")
        kept = {key: value for key, value in os.environ.items() if key not in ("NUMBA_CACHE_DIR", "XDG_CACHE_HOME")}
        yield {**kept, "PYTHONPATH": str(site), "HOME": str(home), "MPLCONFIGDIR": str(tmp_path)}
    finally:
        for folder in folders:
            folder.chmod(0o755)


def run(environment: dict[str, str], *words: str, cwd: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "pivoting", *words],
        cwd=cwd,
        env=environment,
        preexec_fn=bound_by_permissions,
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )


def test_where_nothing_can_be_written_it_compiles_in_memory_and_says_so(
    read_only: dict[str, str], tmp_path: Path
) -> None:
    told = run(read_only, "--version", cwd=tmp_path)
    assert told.returncode == 0, told.stderr
    assert told.stdout.startswith("pivoting 0.")
    assert told.stderr == ""
    done = run(read_only, *SHORT, "--out", "out", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["verdict"] == "pass"
    memory, *wrote = done.stderr.splitlines()
    assert memory == MEMORY
    assert wrote[0].startswith("wrote out")
    assert all("out/balance-2d" in line for line in wrote)


@pytest.fixture(scope="module")
def kernels(site: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What an installation elsewhere compiles for the pivot, in the place that NUMBA_CACHE_DIR names."""
    place, cwd = tmp_path_factory.mktemp("place"), tmp_path_factory.mktemp("cwd")
    environment = {**os.environ, "PYTHONPATH": str(site), "NUMBA_CACHE_DIR": str(place)}
    where = [sys.executable, "-c", "import pivoting, pivoting.sim; print(pivoting.__path__, pivoting.sim.__file__)"]
    found = subprocess.run(where, cwd=cwd, env=environment, capture_output=True, text=True, check=True)
    assert found.stdout == f"['{site}/pivoting'] {site}/pivoting/sim/__init__.py\n"
    command = [sys.executable, str(site / "bin" / "pivoting"), "run", "pivot-2d", "--json"]
    done = subprocess.run(command, cwd=cwd, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["verdict"] == "pass"
    assert done.stderr.startswith(COMPILING)
    assert f"{place}/" in done.stderr
    return place


def test_the_variable_that_is_named_sets_a_place(kernels: Path, read_only: dict[str, str], tmp_path: Path) -> None:
    """Installed elsewhere it runs the pivot, and compiles into that place; what is there is not compiled again."""
    again = run({**read_only, "NUMBA_CACHE_DIR": str(kernels)}, *SHORT, cwd=tmp_path)
    assert json.loads(again.stdout)["verdict"] == "pass"
    assert again.stderr == ""


def test_a_home_alone_will_do(kernels: Path, read_only: dict[str, str], tmp_path: Path) -> None:
    """It is written to and read; and kernels that are kept there are dropped when the sources change."""
    home = tmp_path / "other"
    home.mkdir()
    environment = {**read_only, "HOME": str(home)}
    code = "from pivoting.controller.kernels.compilation import CACHE, kernel; print(CACHE)"
    where = subprocess.run(
        [sys.executable, "-c", code], env=environment, cwd=tmp_path, preexec_fn=bound_by_permissions,
        capture_output=True, text=True, check=True,
    ).stdout  # fmt: skip
    cache = Path(where.strip())
    assert cache.is_relative_to(home)
    shutil.copytree(kernels, cache.parent, dirs_exist_ok=True)
    done = run(environment, *SHORT, cwd=tmp_path)
    assert json.loads(done.stdout)["verdict"] == "pass"
    assert done.stderr == ""
    kept = sorted(home.rglob("kernels.sha256"))
    assert {path.parent.name.split("_")[0] for path in kept} >= {"controller", "kernels", "sim"}
    for path in kept:
        path.write_text("other sources")
    process = subprocess.Popen(
        [sys.executable, "-m", "pivoting", *SHORT], env=environment, cwd=tmp_path, preexec_fn=bound_by_permissions,
        stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    with process:
        assert process.stderr is not None
        told = process.stderr.readline()
        process.kill()
    assert told.startswith(COMPILING)
    assert str(home) in told
    assert not list(cache.glob("*.nb[ic]"))
