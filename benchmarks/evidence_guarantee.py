"""Slow evidence for the guarantee: random sets against a search for the worst member, vertices in MuJoCo, its cost.

Timings are of one call of the compiled step for 256 worlds, alternating with and without a set, medians of ratios; the
cone program of the same problems through Clarabel is set up once, and its data replaced.
"""

import sys
from pathlib import Path
from time import perf_counter

import numpy as np
from harness import main
from pivoting.controller import ClarabelWorkspace, WrenchController, solve
from pivoting.controller.belief import for_worlds
from pivoting.controller.kernels.compiled_step import step_worlds
from pivoting.controller.uncertainty.worst_case import worst_case
from pivoting.controller.validate import frozen
from pivoting.sim import simulate
from rich.progress import track

sys.path.insert(0, str(Path(__file__).parent.parent))  # the same random sets as the tests
from tests.test_guarantee import by_cutting_planes, load, planar, spatial

TOLD = {"mass": (0.8, 1.2), "inertia": (0.8, 1.2)}
VERTICES = {  # name: what is told, worlds
    "pivot-2d": ({**TOLD, "mu": 0.25, "com": (-0.05, 0.05)}, 16),
    "pivot-3d": ({**TOLD, "mu": (0.25, 0.8), "com": (-0.005, 0.005)}, 64),
}
WORLDS = 256


def sets(kind: str, count: int) -> dict[str, float]:
    """The worst violation of a cone and the excess, both over the load, of so many random sets."""
    rng, worst, excess, gap, price = np.random.default_rng(12), 0.0, [], 0.0, []
    for _ in track(range(count), kind, transient=True):
        if kind.startswith("plane"):
            controller, state, desired = planar(rng, kind.rpartition(" ")[2])
        else:
            controller, state, desired = spatial(rng, 1 if kind == "space" else 2)
        answer = solve(controller.problem(state, desired))
        worst = max(worst, -worst_case(controller, state, answer.wrench).slack / load(controller))
        excess.append(controller.guarantee(state, desired).excess / load(controller))
        nominal = WrenchController(controller.body, controller.contacts, controller.law, controller.gravity)
        price.append(answer.objective / solve(nominal.problem(state, desired)).objective)
        if kind == "plane, contact":
            best = by_cutting_planes(controller, answer.problem, state)
            gap = max(gap, abs(answer.objective - best) / best)
    return {
        f"{kind}: sets": float(count),
        f"{kind}: worst violation over the load": worst,
        f"{kind}: excess over the load, median": float(np.median(excess)),
        f"{kind}: excess over the load, greatest": float(np.max(excess)),
        f"{kind}: cost over the nominal one, median": float(np.median(price)),
        **({f"{kind}: cost off that of cutting planes": gap} if gap else {}),
    }


def vertices(name: str) -> dict[str, float]:
    """Slip of the worst of all vertices in MuJoCo, with and without the guarantee."""
    told, worlds = VERTICES[name]
    out = {f"{name}: vertices": float(worlds)}
    for guarantee in ("none", "set"):
        run = simulate(name, worlds, **told, worlds_at="vertices", disturbance=10.0, guarantee=guarantee)
        out[f"{name}, guarantee={guarantee}: slip_max_m"] = float(run.measures.slip_max_m.max())
        out[f"{name}, guarantee={guarantee}: slip_floor_m"] = float(run.measures.slip_floor_m.max())
        out[f"{name}, guarantee={guarantee}: vertices that fail"] = float(run.failed_worlds.size)
    return out


def called(controller: WrenchController, states: np.ndarray, desired: np.ndarray) -> tuple[float, np.ndarray]:
    """Seconds of one call of the compiled step, and its required wrenches."""
    nw, n = controller.widths
    out, status = np.empty((len(states), 2 * nw + n + 1)), np.empty(len(states), np.int8)
    given = *for_worlds([controller.belief]), None, *controller.workspace(), 1e-9
    none = np.zeros((1, nw))
    step_worlds(*given, states, desired, none, out, status)
    start = perf_counter()
    step_worlds(*given, states, desired, none, out, status)
    spent = perf_counter() - start
    assert (status == 0).all()
    return spent, out[:, :nw]


def cost(kind: str, rounds: int) -> dict[str, float]:
    """How much longer a step takes with a set, and how much longer Clarabel takes for the same problem."""
    rng, ratios, ahead, micro = np.random.default_rng(3), [], [], []
    for _ in track(range(rounds), f"{kind}: time", transient=True):
        make = {
            "plane": lambda: planar(rng, "contact"),
            "space": lambda: spatial(rng, 1),
            "edge": lambda: spatial(rng, 2),
        }
        controller, state, wanted = make[kind]()
        q, omega, _ = controller.space.lift_motion(state)
        states = frozen(np.tile(np.concatenate([np.zeros(3), q, np.zeros(3), omega]), (WORLDS, 1)))  # as in the loop
        desired = np.concatenate(controller.space.lift_motion(wanted))[None]
        plain = WrenchController(
            controller.body, controller.contacts, controller.law, controller.gravity, margin=controller.margin
        )
        with_set, _ = called(controller, states, desired)
        without, _ = called(plain, states, desired)
        ratios.append(with_set / without)
        micro.append(1e6 * with_set / WORLDS)
        workspace = ClarabelWorkspace(controller.problem(state, wanted))
        start = perf_counter()
        for _ in range(5):
            workspace.solve(tolerance=1e-5)
        ahead.append((perf_counter() - start) / 5 / (with_set / WORLDS))
    return {
        f"{kind}: step with a set over one without": float(np.median(ratios)),
        f"{kind}: step with a set, us, 99th percentile": float(np.quantile(micro, 0.99)),
        f"{kind}: Clarabel in place over the step": float(np.median(ahead)),
    }


def measure(quick: bool) -> dict[str, float]:
    """The figures; see the head of this file."""
    share = 20 if quick else 1
    counts = {"plane, contact": 500, "plane, com": 500, "space": 200, "edge": 100}
    figures: dict[str, float] = {}
    for kind, count in counts.items():
        figures |= sets(kind, max(5, count // share))
    for name in VERTICES:
        figures |= vertices(name)
    for kind in ("plane", "space", "edge"):
        figures |= cost(kind, 10 if quick else 60)
    return figures


if __name__ == "__main__":
    kinds = ("plane, contact", "plane, com", "space", "edge")
    main(
        __doc__ or "",
        measure,
        {
            **{f"{kind}: worst violation over the load": 1e-9 for kind in kinds},
            **{f"{kind}: excess over the load, median": 0.05 for kind in kinds},
            "plane, contact: cost off that of cutting planes": 1e-7,
            "plane: step with a set over one without": 5.0,
            "space: step with a set over one without": 12.0,
            "edge: step with a set over one without": 12.0,
            **{f"{kind}: step with a set, us, 99th percentile": 150.0 for kind in ("plane", "space", "edge")},
            **{f"{name}, guarantee=set: vertices that fail": 0.0 for name in VERTICES},
        },
        floors={f"{kind}: Clarabel in place over the step": 5.0 for kind in ("plane", "space", "edge")},
    )
