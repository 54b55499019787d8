"""The rooms: who may import whom, how long a file may be, and that what is declared is what is used."""

import ast
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
ROOMS = {"controller": {"controller"}, "models": {"models"}, "sim": {"controller", "models", "sim"}}
OPTIONAL, EXTRAS = (
    "optional-dependencies",
    ("data", "video", "view", "sweep"),
)  # which users install who need what they are for
FILES = [path for room in ROOMS for path in sorted((ROOT / room).rglob("*.py"))]
FILES += sorted((ROOT / "pivoting").glob("*.py"))  # the front of all rooms
SHARED = {"compile_hooks", "errors"}  # of the front, for every room: they import nothing


def imported(path: Path) -> set[str]:
    names = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: relative import"
            names.add(node.module or "")
    return names


@pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.relative_to(ROOT)))
def test_rooms_import_only_what_they_may(path: Path) -> None:
    room = path.relative_to(ROOT).parts[0]
    own = {name.split(".")[1] for name in imported(path) if name.startswith("pivoting.")} - {"__main__"}
    # What belongs to no room is for all: one `except` must catch the errors of all three, which share nothing else.
    assert own - SHARED <= ROOMS.get(room, set(ROOMS))
    if room == "controller":
        assert not {name for name in imported(path) if name.split(".")[0] in ("mujoco", "rerun")}
    assert not {name.split(".")[0] for name in imported(path)} & set(ROOMS), "bare room names"


@pytest.mark.parametrize(
    "path", [*FILES, *sorted((ROOT / "tests").glob("*.py"))], ids=lambda path: str(path.relative_to(ROOT))
)
def test_no_file_is_too_long(path: Path) -> None:
    assert len(path.read_text().splitlines()) <= 400


@pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.relative_to(ROOT)))
def test_everything_public_is_documented(path: Path) -> None:
    tree = ast.parse(path.read_text())
    if path.stat().st_size:
        assert ast.get_docstring(tree), path
    for node in ast.walk(tree):
        public = isinstance(node, ast.ClassDef | ast.FunctionDef) and not node.name.startswith("_")
        if isinstance(node, ast.FunctionDef) and "overload" in map(ast.unparse, node.decorator_list):
            continue  # its signature alone, of a function that is documented
        if public:
            inner = isinstance(node, ast.FunctionDef) and any(
                node in ast.walk(other) and other is not node
                for other in ast.walk(tree)
                if isinstance(other, ast.FunctionDef)
            )
            assert inner or ast.get_docstring(node), f"{path.name}: {node.name}"


def test_what_is_imported_is_declared() -> None:
    """A dependency that happens to be installed is missing on the next machine; that of an extra is imported late."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    needed, optional = project["dependencies"], [line for lines in EXTRAS for line in project[OPTIONAL][lines]]
    declared, extra = ({line.split(">")[0].split("<")[0].strip() for line in lines} for lines in (needed, optional))
    packages = {"rerun": "rerun-sdk", "mpl_toolkits": "matplotlib", "PIL": "pillow", "lazy_loader": "lazy-loader"}
    for path in FILES:
        for name in imported(path):
            top = name.split(".")[0]
            if top in extra:
                early = [node for node in ast.parse(path.read_text()).body if isinstance(node, ast.Import)]
                assert top not in {alias.name for node in early for alias in node.names}, f"{path}: {top}"
            elif top not in sys.stdlib_module_names and top != "pivoting":
                assert packages.get(top, top) in declared, f"{path}: {top}"


@pytest.mark.parametrize(
    ("module", "others"),
    [
        ("pivoting.controller", ("mujoco", "rerun", "matplotlib")),
        ("pivoting.errors", ("numpy", "numba", "mujoco", "pivoting.controller", "pivoting.models", "pivoting.sim")),
    ],
)
def test_what_an_import_does_not_bring_along(module: str, others: tuple[str, ...]) -> None:
    """The mathematics leave out the simulator, the base of all errors everything."""
    code = f"import sys, {module}; print([name for name in {others} if name in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


@pytest.mark.parametrize("module", ["pivoting", "pivoting.sim", "pivoting.sim.console.scenario_tables"])
def test_what_answers_at_once_imports_neither_compiler_nor_simulator(module: str) -> None:
    code = f"import sys, {module}; print([m for m in ('numba', 'mujoco', 'scipy', 'rerun') if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def public_classes() -> dict[str, list[str]]:
    found: dict[str, list[str]] = {}
    for path in FILES:
        for node in ast.parse(path.read_text()).body:
            if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                found.setdefault(node.name, []).append(str(path.relative_to(ROOT)))
    return found


def test_no_two_public_classes_share_a_name() -> None:
    assert {name: where for name, where in public_classes().items() if len(where) > 1} == {}


def functions(path: Path) -> Iterator[tuple[str, int, int, bool]]:
    """Name, lines, positional arguments but for self, and whether it is compiled, of every function."""
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.FunctionDef):
            names = [argument.arg for argument in (*node.args.posonlyargs, *node.args.args)]
            compiled = {decorator.id for decorator in node.decorator_list if isinstance(decorator, ast.Name)}
            lines = (node.end_lineno or node.lineno) - node.lineno + 1
            own = names[0] in ("self", "cls") if names else False
            yield node.name, lines, len(names) - own, bool(compiled & {"kernel", "subroutine"})


@pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.relative_to(ROOT)))
def test_functions_are_short_and_take_few_arguments(path: Path) -> None:
    for name, lines, arguments, compiled in functions(path):
        assert lines <= (80 if compiled else 60), name
        assert arguments <= (12 if compiled else 8), name


def test_one_base_catches_every_error() -> None:
    """Those that are raised by others, ValueError and its like, stay what they are as well."""
    errors = {
        node.name: {ast.unparse(base) for base in node.bases}
        for path in FILES
        for node in ast.walk(ast.parse(path.read_text()))
        if isinstance(node, ast.ClassDef) and node.name.endswith("Error") and node.name != "PivotingError"
    }
    assert {"SolveError", "PlanError", "InputError", "ModelError", "ControlError"} <= set(errors)
    for name, bases in errors.items():
        assert "PivotingError" in bases, name
        assert bases & {"RuntimeError", "ValueError", "OSError"}, name


CALLS = {"clarabel": "clarabel_backend.py", "qpsolvers": "qpsolvers_backend.py", "piqp": "qpsolvers_backend.py"}


def test_each_solver_is_called_in_one_place() -> None:
    for solver, name in CALLS.items():
        assert [path.name for path in FILES if solver in imported(path)] == [name]
