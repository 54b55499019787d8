"""Objects that no one here chose: bodies and meshes out of published packages, pivoted by 20 degrees.

`object_list` says which, and puts each alone on a plane. The program itself then pivots it, as a user would:
`pivoting run pivot --model ... --body object --contact vertex --json`, and by edge and lowest; twelve of them also to
60 degrees and in 0.5 s. What is refused is compared with `brute_force`, what fails is stepped again by `replay`.
"""

import json
import random
import resource
import subprocess
import sys
import warnings
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Any, NamedTuple

import mujoco
import numpy as np
from brute_force import contacts
from harness import main
from object_list import SEED, Thing, listed, scene
from replay import Tape, confirms, replay

if TYPE_CHECKING:
    from pivoting.sim import Run

KINDS = ("vertex", "edge", "lowest")
VARIANTS = {"20 deg in 2 s": {}, "to 60 deg": {"theta_end": 60.0}, "in 0.5 s": {"seconds": 0.5}}
USUAL, WIDE, FAST = VARIANTS
TWELVE = 12
FLOOR = 0.05  # relative error of a predicted slip
COMMAND = Path(sys.executable).with_name("pivoting")
WORKERS = 2


class Outcome(NamedTuple):
    """What came of one run.

    Attributes:
        thing, kind, variant: what was run.  there: whether the brute force finds such a contact.
        verdict: pass, fail, refused, or crash: anything that is not one of the three.
        sentence: why not.  confirmed: of a fail, whether the replay bears that out.  facts: of the replay.
        slip_m, floor_m: measured, and what the simulator itself is said to do, nan if that is not known.
        seconds: as a user waits.  cpu: of the processor.
    """

    thing: str
    kind: str
    variant: str
    there: str
    verdict: str
    sentence: str
    confirmed: bool
    facts: str
    slip_m: float
    floor_m: float
    seconds: float
    cpu: float

    @property
    def floor_off(self) -> bool:
        """Whether the predicted slip is wrong: not unknown, and more than 5 % off."""
        return self.verdict == "pass" and not np.isnan(self.floor_m) and abs(self.floor_m / self.slip_m - 1.0) > FLOOR


def run(path: Path, thing: str, kind: str, variant: str, there: str) -> Outcome:
    """One run of the command."""
    settings = [f"--set={key}={value}" for key, value in VARIANTS[variant].items()]
    command = [COMMAND, "run", "pivot", "--model", path, "--body", "object", "--contact", kind, "--json", *settings]
    before, start = resource.getrusage(resource.RUSAGE_CHILDREN), perf_counter()
    done = subprocess.run([str(word) for word in command], capture_output=True, text=True, check=False)
    seconds, after = perf_counter() - start, resource.getrusage(resource.RUSAGE_CHILDREN)
    cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    try:
        summary = json.loads(done.stdout)
    except ValueError:
        summary = {}
    said = (done.stderr.strip().splitlines() or [""])[-1].removeprefix("pivoting: ")
    expected = {0: "pass", 1: "fail"}.get(done.returncode)
    if done.returncode == 2 and not done.stdout and "Traceback" not in done.stderr:
        verdict = "refused"
    else:
        verdict = expected if expected and summary.get("verdict") == expected else "crash"
    confirmed, facts = False, ""
    if verdict == "fail":
        said, confirmed, facts = examined(path, kind, variant, summary)
    slip, floor = (float("nan") if summary.get(key) is None else summary[key] for key in ("slip_max_m", "slip_floor_m"))
    return Outcome(thing, kind, variant, there, verdict, said, confirmed, facts, slip, floor, seconds, cpu)


def examined(path: Path, kind: str, variant: str, summary: dict[str, Any]) -> tuple[str, bool, str]:
    """The reasons that a failed run gave, whether MuJoCo alone bears them out, and what that shows."""
    from pivoting.sim import own_object, simulate

    run = simulate(own_object(path, "object", kind), **VARIANTS[variant])
    facts, lever = replay(taped(run)), float(np.linalg.norm(run.points, axis=1).max())
    shown = str(facts._replace(touching=facts.touching[-1:]))
    return "; ".join(summary["reasons"]), confirms(summary["reasons"], facts, summary["limits"], lever), shown


def taped(run: "Run") -> Tape:
    """The first world of a run."""
    table = np.array(run.table_axes)
    return Tape(
        model=run.model,
        body=run.truth.index,
        qpos=run.start[0][0],
        qvel=run.start[1][0],
        wrench=run.wrench_world[0],
        held=run.truth.com + run.points,
        radius=run.world.radius,
        table=table,
        desired=run.desired[0],
        height=float(run.truth.origin @ table[:, 2]),
        force=np.nan_to_num(run.force[0]) @ table.T,
        settle=round(run.scenario.limits.settle_s / run.dt),
    )


def prepared(thing: Thing) -> tuple[Path, dict[str, str], dict[str, str]]:
    """The scene of an object, and by kind whether it has a contact for an arc to 25 and to 60 degrees."""
    warnings.filterwarnings("ignore", "Attach conflict")
    path = scene(thing)
    model = mujoco.MjModel.from_xml_path(str(path))
    return path, contacts(model, "object"), contacts(model, "object", arc=(5.0, 60.0))


def outcomes(quick: bool) -> list[Outcome]:
    """Of every object, or of one of each package, about every kind of contact, and of the twelve."""
    chosen = [*{thing.package: thing for thing in listed()}.values()] if quick else listed()
    with ProcessPoolExecutor(WORKERS) as pool:
        scenes = dict(zip([thing.name for thing in chosen], pool.map(prepared, chosen), strict=True))
        tasks = [(path, name, kind, USUAL, there[kind]) for name, (path, there, _) in scenes.items() for kind in KINDS]
        wide = [
            (name, kinds)
            for name, (_, _, far) in scenes.items()
            if (kinds := [kind for kind in KINDS if far[kind] == "yes"])
        ]
        draw = random.Random(SEED)
        for name, kinds in draw.sample(wide, min(TWELVE, len(wide))):
            kind = draw.choice(kinds)
            tasks += [(scenes[name][0], name, kind, variant, "yes") for variant in (WIDE, FAST)]
        run(*tasks[0])  # compiled before it is timed
        return [*pool.map(partial(_starred, run), tasks)]


def _starred(call: Any, args: tuple[Any, ...]) -> Any:
    return call(*args)


def wrong(one: Outcome) -> str:
    """What is wrong with an outcome, if anything is."""
    if one.verdict == "crash":
        return "neither a verdict nor a refusal"
    if one.verdict == "refused" and one.there == "yes":
        return "refused, and the brute force finds such a contact"
    if one.verdict in ("pass", "fail") and one.there == "no":
        return "run, and the brute force finds no such contact"
    if one.verdict == "fail" and not one.confirmed:
        return "failed, and the replay does not show that reason"
    if one.floor_off:
        return f"the simulator's own slip is said to be {one.floor_m:.3g} m and is {one.slip_m:.3g} m"
    return ""


def measure(quick: bool) -> dict[str, float]:
    """Shares, counts and the longest wait; prints each run that does not pass, with its reason."""
    found = outcomes(quick)
    for one in found:
        if one.verdict != "pass" or wrong(one):
            print(f"{one.verdict:8} {one.thing}, {one.kind}, {one.variant} (brute force: {one.there}): {one.sentence}")
            if wrong(one):
                print(f"         WRONG: {wrong(one)} {one.facts}")
    usual = [one for one in found if one.variant == USUAL]
    there = [one for one in usual if one.there == "yes"]
    passed = {one for one in found if one.verdict == "pass"}
    known = [one for one in passed if not np.isnan(one.floor_m)]
    return {
        "objects": float(len({one.thing for one in usual})),
        "runs": float(len(usual)),
        **{
            verdict: float(sum(one.verdict == verdict for one in usual))
            for verdict in ("pass", "fail", "refused", "crash")
        },
        "share that passes": len(passed & {*usual}) / len(usual),
        "share that passes where there is such a contact": len(passed & {*there}) / len(there),
        "wrong refusals": float(sum(one.verdict == "refused" and one.there == "yes" for one in found)),
        "runs without such a contact": float(
            sum(one.verdict in ("pass", "fail") and one.there == "no" for one in found)
        ),
        "fails without a confirmed reason": float(sum(one.verdict == "fail" and not one.confirmed for one in found)),
        "predicted slips more than 5 % off": float(sum(one.floor_off for one in found)),
        "predicted slips not known": float(len(passed) - len(known)),
        **{
            f"{variant}: not passed": float(sum(one.variant == variant and one not in passed for one in found))
            for variant in (WIDE, FAST)
        },
        "longest run, s": max(one.seconds for one in found),
        "longest run, s of processor": max(one.cpu for one in found),
        **{f"{one.thing}, {one.kind}, {one.variant}: slip_m": one.slip_m for one in found if one in passed},
        **{f"{one.thing}, {one.kind}, {one.variant}: {one.verdict}": 1.0 for one in found if one not in passed},
    }


if __name__ == "__main__":
    none = ("crash", "wrong refusals", "fails without a confirmed reason", "predicted slips more than 5 % off")
    asked = dict.fromkeys((*none, f"{WIDE}: not passed", f"{FAST}: not passed", "runs without such a contact"), 0.0)
    main(
        __doc__ or "",
        measure,
        {**asked, "longest run, s": 20.0},
        floors={"objects": 40.0, "share that passes": 0.78, "share that passes where there is such a contact": 0.95},
        brief=lambda name: ", " not in name.split(": ")[0] or name.startswith("longest"),
    )
