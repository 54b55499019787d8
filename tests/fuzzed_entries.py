"""Every public entry with hostile input: each example ends in a documented error or in an answer that is certified."""

import hashlib
import json
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import click
import mujoco
import numpy as np
import pandas
from hypothesis import strategies as st
from pivoting import PivotingError, attach, load, simulate, sweep
from pivoting.controller import Body, Contact, Law, Motion, WrenchController, WrenchProblem, solve
from pivoting.controller.solution import TOLERANCE
from pivoting.controller.uncertainty.uncertainty import Uncertainty
from pivoting.sim import own_object, read_sweep
from pivoting.sim.console.asked_identification import asked_errors, asked_log
from pivoting.sim.console.asked_run import ask
from pivoting.sim.console.scenario_options import own_scenario, pairs
from pivoting.sim.run_setup import set_up
from pivoting.sim.scenarios.key_declaration import declared_keys
from pivoting.sim.scenarios.scenario import Scenario
from pivoting.sim.scenarios.scenario_file import read
from pivoting.sim.scenarios.scenario_keys import HIDDEN_KEYS, ScenarioKeys

from tests import hostile_input as hostile
from tests.own_files import mjcf

SHORT = {"seconds": 0.25, "hold": 0.05, "theta_end": 15.0}
KEYS = (*declared_keys(ScenarioKeys), *(f"world.{key}" for key in HIDDEN_KEYS))
NONE: dict[str, Any] = {"model": None, "body": None, "contact": None, "support": None, "as_modelled": False}
STEPS = 2000  # of a run, at most


class Entry(NamedTuple):
    """What is drawn, what is done with it, and how many of 50,000 examples are its share."""

    drawn: st.SearchStrategy[Any]
    called: Callable[[Any], object]
    share: int


@contextmanager
def documented() -> Iterator[None]:
    """What may be raised of input that cannot be used: one line."""
    told = "answered"
    try:
        yield
    except click.ClickException as error:
        told = error.format_message()
    except PivotingError as error:
        told = str(error)
    assert len(told.splitlines()) == 1, told


def entries(folder: Path) -> dict[str, Entry]:
    """All of them, by name; their files are in this folder."""
    base = files(folder)
    return {
        "solve": Entry(st.tuples(hostile.seeds, hostile.spoilt(PROBLEM), METHODS), solved, 16000),
        "controller": Entry(st.tuples(hostile.seeds, hostile.spoilt(CONTROLLER)), controlled, 7000),
        "uncertainty": Entry(st.tuples(hostile.seeds, hostile.spoilt(SET), hostile.seeds), guarded, 6000),
        "keys": Entry(hostile.settings(KEYS), asked, 9000),
        "scenario file": Entry(
            st.one_of(hostile.changed_text(base.scenario), hostile.changed_object(json.loads(base.scenario))),
            lambda text: read(written(folder / "hostile.json", text)),
            5000,
        ),
        "log in CSV": Entry(hostile.changed_text(base.csv), lambda text: identified(folder / "log.csv", text), 2000),
        "attach": Entry(hostile.spoilt(ATTACH), lambda spoilt: attached(base.model, spoilt), 1500),
        "vary": Entry(hostile.settings(KEYS), varied, 700),
        "contact": Entry(
            st.one_of(hostile.words, hostile.changed_text("0.05,0.04,-0.06; 0.05,-0.04,-0.06")),
            lambda text: begun(own_scenario(base.xml, "box", text, None, False).change(**SHORT)),
            700,
        ),
        "model": Entry(
            hostile.changed_text(base.xml.read_text()),
            lambda text: begun(own_object(written(folder / "hostile.xml", text), "box", "vertex").change(**SHORT)),
            600,
        ),
        "saved run": Entry(
            st.one_of(
                st.tuples(hostile.changed_object(json.loads(base.run_json)), st.just(base.run_nc), st.just(False)),
                st.tuples(st.just(base.run_json), hostile.changed_bytes(base.run_nc), st.booleans()),
            ),
            lambda drawn: loaded(folder / "run", *drawn),
            500,
        ),
        "log in Parquet": Entry(
            st.one_of(hostile.changed_bytes(base.parquet), st.tuples(st.sampled_from(COLUMNS), hostile.values)),
            lambda drawn: tabled(folder / "log.parquet", drawn),
            400,
        ),
        "recording": Entry(
            hostile.changed_bytes(b"RRF2" + bytes(60)), lambda data: recorded(folder / "hostile.rrd", data), 250
        ),
        "sweep's file": Entry(
            st.tuples(st.sampled_from(SWEPT), st.randoms(use_true_random=False)),
            lambda drawn: resumed(folder, base, *drawn),
            200,
        ),
        "simulate": Entry(hostile.settings(KEYS), simulated, 150),
    }


# A problem, and a controller


PROBLEM = ("jacobian", "required", "mu", "f_min", "margin", "Q_w", "Q_f", "apex", "tolerance")
METHODS = st.sampled_from(["closed-form"] * 6 + ["clarabel", "qp:daqp", "qp:", "fast", 3])


def solved(drawn: tuple[int, dict[str, Any], Any]) -> None:
    """A wrench problem, of numbers of any size."""
    seed, spoilt, method = drawn
    rng = np.random.default_rng(seed)
    dim, K, size = int(rng.integers(2, 4)), int(rng.integers(1, 4)), 10.0 ** rng.uniform(-3, 3)
    nw = 3 * dim - 3
    given: dict[str, Any] = {
        "jacobian": rng.normal(size=(nw, K * dim)) * 10.0 ** rng.uniform(-2, 2),
        "required": size * rng.normal(size=nw),
        "mu": rng.uniform(0.05, 1.5, K),
        "f_min": size * rng.uniform(0.0, 0.2),
    }
    given |= spoilt
    tolerance = {"tolerance": given.pop("tolerance")} if "tolerance" in given else {}
    problem = WrenchProblem(**given)
    certify(solve(problem, method, **tolerance), tolerance.get("tolerance", TOLERANCE))


def certify(answer: Any, tolerance: float = TOLERANCE) -> None:
    """Within tolerance, finite, and in its cones."""
    assert answer.residual <= tolerance
    assert np.isfinite(answer.wrench).all()
    assert np.isfinite(answer.force).all()
    problem = answer.problem
    moved = answer.force - problem.apex
    within = problem.mu_planned * moved[..., -1] - np.linalg.norm(moved[..., :-1], axis=-1)
    size = max(np.abs(answer.force).max(), np.abs(answer.wrench).max(), np.abs(problem.required).max())
    if tolerance <= TOLERANCE and answer.edges == 0:
        assert min(within.min(), (answer.force[:, -1] - problem.f_min).min()) >= -1e-5 * size


CONTROLLER = ("mass", "inertia", "point", "mu", "f_min", "radius", "gravity", "margin", "bandwidth", "base",
              "orientation", "velocity", "acceleration", "external")  # fmt: skip


def controlled(drawn: tuple[int, dict[str, Any]], known: Uncertainty | None = None) -> None:
    """What a controller makes of a state and a reference."""
    seed, spoilt = drawn
    rng = np.random.default_rng(seed)
    dim = int(rng.integers(2, 4)) if known is None else known.dim
    sides, mass = 10.0 ** rng.uniform(-2, 0.5, dim), 1.0 if known is not None else 10.0 ** rng.uniform(-3, 3)
    squares = sides**2
    given: dict[str, Any] = {
        "mass": mass,
        "inertia": mass / 12.0 * (squares.sum() if dim == 2 else np.diag(squares.sum() - squares)),
        "point": -0.5 * sides,
        "mu": rng.uniform(0.05, 1.5),
        "f_min": 0.1 * mass,
        "radius": 0.0,
        "gravity": np.r_[np.zeros(dim - 1), -9.81],
        "margin": 0.1,
        "bandwidth": 40.0,
        "base": (1.0, 0.0, 0.0, 0.0),
        "orientation": rng.normal() if dim == 2 else unit(rng.normal(size=4)),
        "velocity": rng.normal() if dim == 2 else rng.normal(size=3),
        "acceleration": rng.normal() if dim == 2 else rng.normal(size=3),
        "external": None,
    }
    given |= spoilt
    contact = Contact(given["point"], given["mu"], given["f_min"], radius=given["radius"])
    law = Law.dynamic(given["bandwidth"])
    more = {name: given[name] for name in ("base", "margin")}
    controller = WrenchController(
        Body(given["mass"], given["inertia"]), [contact], law, given["gravity"], uncertainty=known, **more
    )
    moves = given["orientation"], given["velocity"], given["acceleration"]
    certify(solve(controller.problem(Motion(*moves), Motion(*moves), external=given["external"])))


def unit(q: np.ndarray) -> np.ndarray:
    return q / np.linalg.norm(q)


SET = ("mass", "com", "inertia", "about", "mu", "shove", "shove_seconds", "theta", "omega", "dim")


def guarded(drawn: tuple[int, dict[str, Any], int]) -> None:
    """A controller of a set."""
    seed, spoilt, other = drawn
    rng = np.random.default_rng(other)
    given: dict[str, Any] = {
        "mass": (0.8, 1.2), "com": 10.0 ** rng.uniform(-6, -2), "inertia": (0.8, 1.2), "mu": (0.2, 0.9),
        "shove": rng.choice([0.0, 0.2]), "theta": rng.choice([0.0, 0.01]), "omega": 0.1, "dim": int(rng.integers(2, 4)),
    }  # fmt: skip
    controlled((seed, {}), Uncertainty(**{**given, **spoilt}))


# Scenarios


def asked(given: tuple[str, ...], name: str = "pivot-2d", more: tuple[str, ...] = ()) -> Scenario:
    """As the command line reads it."""
    file = ask(name, None, worlds=1, seed=0, settings=(*given, *more), limits=(), open_loop=False, **NONE)
    return file.scenario


def begun(case: Scenario) -> object:
    """All that is done before the first step."""
    return set_up(case, None, worlds=1, seed=0, first_world=0)


def varied(given: tuple[str, ...]) -> object:
    """A sweep of no worlds, which is refused last of all."""
    return sweep("pivot-2d", 0, pairs("--vary", given), **SHORT)


def simulated(given: tuple[str, ...]) -> None:
    """A short run; what is left to itself is short."""
    set_already = {pair.partition("=")[0] for pair in given}
    more = tuple(f"{key}={value}" for key, value in SHORT.items() if key not in set_already)
    case = asked(given, more=more)
    if set_up(case, None, worlds=1, seed=0, first_world=0).steps > STEPS:
        return
    run = simulate(case)
    assert run.verdict in ("pass", "fail")
    found = run.residual[np.isin(run.status, (0, 3))]
    assert (found <= TOLERANCE).all()


# Files


class Files(NamedTuple):
    """Of which something is changed."""

    scenario: str
    csv: str
    parquet: bytes
    xml: Path
    model: mujoco.MjModel
    run_json: str
    run_nc: bytes


COLUMNS = ("time_s", "theta_deg", "wrench_Fu_N", "wrench_Fv_N", "wrench_M_N_m", "omega_rad_s", "contact")
GIVEN: dict[str, Any] = {
    "lever": np.array([0.05, 0.06]), "inertia": np.array([0.002]), "mass": (0.8, 1.2),
    "com": np.array([[-0.005, 0.005]]), "factor": (0.8, 1.2),
    "mu": None, "gravity": 9.81, "incline": 0.0, "edge": None, "theta_error": 0.1,
    "omega_error": None, "shove": 0.0, "rate": None, "wrench_error": 0.0, "force_error": None, "position_error": 0.0,
}  # fmt: skip
SWEEP: dict[str, Any] = {"name": "pivot-2d", "worlds": 2, "vary": {"mass": "0.8:1.2"}, "chunk": 1, **SHORT}
SWEPT = ("whole", "plan", "part")


def files(folder: Path) -> Files:
    """All of them as they should be."""
    said = {
        "format": "pivoting 1", "scenario": "pivot", "model": "own.xml", "body": "box",
        "contact": [[0.05, 0.04, -0.06]],
        "support": None, "as_modelled": False, "changes": {"theta_end": 30, "world.mu": 0.4, "limit.slip_m": 0.001},
        "worlds": 2, "seed": 1, "first_world": 0, "open_loop": False, "keep": "all", "python_objects": [],
        "digest": "a", "versions": {"numpy": "2"}, "summary": "mine", "about": "tilt",
    }  # fmt: skip
    t = np.linspace(0.0, 1.0, 12)
    table = pandas.DataFrame({
        "time_s": t, "theta_deg": 10.0 + 60.0 * t**2 * (3.0 - 2.0 * t), "wrench_Fu_N": 1.0, "wrench_Fv_N": 2.0,
        "wrench_M_N_m": 0.1, "omega_rad_s": 0.0, "contact": "sticks",
    })  # fmt: skip
    table.to_parquet(folder / "log.parquet")
    xml = written(folder / "own.xml", mjcf())
    kept = simulate("balance-2d", 2, seconds=0.06, limits={"settle_s": 0.03}).save(folder / "run")
    with np.errstate(all="ignore"):
        sweep(out=folder / "whole.parquet", **SWEEP)
    return Files(
        json.dumps(said), table.to_csv(index=False), (folder / "log.parquet").read_bytes(), xml,
        mujoco.MjModel.from_xml_path(str(xml)), (kept / "scenario.json").read_text(), (kept / "run.nc").read_bytes(),
    )  # fmt: skip


def written(path: Path, text: str) -> Path:
    """The file with this text."""
    path.write_text(text, encoding="utf-8", errors="surrogatepass")
    return path


def identified(path: Path, text: str) -> None:
    log = asked_log(written(path, text), 0, GIVEN).log
    assert np.isfinite(asked_errors(log, GIVEN).rate)


def tabled(path: Path, drawn: Any) -> None:
    """A table whose bytes are others, or one of whose columns is."""
    if isinstance(drawn, bytes):
        path.write_bytes(drawn)
    else:
        column, value = drawn
        table = {name: np.linspace(0.0, 1.0, 5) for name in COLUMNS[:-1]}
        try:
            pandas.DataFrame({**table, column: [value] * 5}).to_parquet(path)
        except Exception:  # what no table can hold, nobody can read of one
            return
    asked_log(path, 0, GIVEN)


ATTACH = ("body", "contacts", "radius", "law", "mu", "margin", "f_min", "Q_w", "Q_f", "support", "uncertainty",
          "reference")  # fmt: skip


def attached(model: mujoco.MjModel, spoilt: dict[str, Any]) -> None:
    """A controller for a body of a model, and its answer."""
    given: dict[str, Any] = {"body": "box", "contacts": [(0.05, 0.04, -0.06)], **spoilt}
    reference = given.pop("reference", (1.0, 0.0, 0.0, 0.0))
    certify(attach(model, **given).solution(mujoco.MjData(model), reference))


def loaded(folder: Path, said: str, arrays: bytes, fitting: bool) -> None:
    """A run of which one of the files is another; `fitting`: the scenario's file says so."""
    if fitting:
        scenario = json.loads(said)
        digest = hashlib.blake2b(arrays, digest_size=16).hexdigest()
        scenario["arrays"] |= {"bytes": len(arrays), "blake2b": digest}
        said = json.dumps(scenario)
    written(folder / "scenario.json", said)
    (folder / "run.nc").write_bytes(arrays)
    load(folder)


def recorded(path: Path, data: bytes) -> None:
    """A recording, which nothing here reads."""
    path.write_bytes(data)
    for reader in (read, load, read_sweep, lambda file: asked_log(file, 0, GIVEN)):
        with documented():
            reader(path)


def resumed(folder: Path, base: Files, which: str, draw: Any) -> None:
    """A sweep whose file, plan or part is another."""
    whole, out = (folder / "whole.parquet").read_bytes(), folder / "s.parquet"
    parts = folder / ".s.parquet.parts"
    shutil.rmtree(parts, ignore_errors=True)
    out.unlink(missing_ok=True)

    def spoil(data: bytes) -> bytes:
        at = draw.randrange(len(data))
        return data[:at] if draw.random() < 0.3 else data[:at] + draw.randbytes(4) + data[at + 4 :]

    if which == "whole":
        out.write_bytes(spoil(whole))
        read_sweep(out)
        return
    parts.mkdir()
    rows = pandas.read_parquet(folder / "whole.parquet")
    for chunk in range(2):
        rows.iloc[[chunk]].to_parquet(parts / f"part-{chunk:06d}.parquet", index=False)
    plan = json.dumps(read_plan(folder / "whole.parquet")).encode()
    (parts / "plan.json").write_bytes(spoil(plan) if which == "plan" else plan)
    if which == "part":
        part = parts / "part-000001.parquet"
        part.write_bytes(spoil(part.read_bytes()))
    sweep(out=out, resume=True, **SWEEP)


def read_plan(path: Path) -> dict[str, Any]:
    from pivoting.sim.sweeping.part_files import plan_of

    return plan_of(path)
