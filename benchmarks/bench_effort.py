"""What planning the whole arc gains over the smallest wrench of each step: effort, and time where it is bounded.

Effort is the integral of 1/2 w'Q_w w + 1/2 f'Q_f f over the arc from 10 to 80 deg, from rest to rest, without the cost
of tracking. Equal tracking means: the same arc in the same time, at rest at both ends, and no farther (RMS) from the
same minimum-jerk reference. Whatever poses a plan goes through, its wrenches are the smallest of each step there: all
that it gains is in the choice of the poses, and the per-step law along them, in MuJoCo, costs as much.

The shortest time in which the arc is possible within bounds on the wrench, by bisection over plans: along the
minimum-jerk reference, and with a timing of its own. Beside it the time of the greatest torque about the contact that
the bounds allow, whatever friction allows, switched once; nothing can be faster. The contact is kept above 1 N, because
the fastest plans would let it go at the top.
"""

from pathlib import Path

import numpy as np
from harness import main
from pivoting.controller import (
    Body,
    BodyState,
    Contact,
    Horizon,
    Law,
    MinimumJerk,
    Motion,
    Plan,
    Planner,
    WrenchBounds,
    WrenchController,
    WrenchProblem,
    solve,
)
from pivoting.sim import Run, simulate
from rich.progress import track

MASS, INERTIA, SIDE, G, MU, MARGIN = 1.0, 1.0 / 6.0, 1.0, 10.0, 0.3, 1.0 / 6.0
LEVER, WEIGHT = SIDE / np.sqrt(2.0), MASS * G
START, END = np.deg2rad(10.0), np.deg2rad(80.0)
SECONDS = (1.0, 2.0)
WEIGHTS = (1e10, 1e4, 1e3, 300.0, 100.0, 30.0, 10.0, 3.0, 1.0, 0.1, 1e-6)  # on poses, in squares of the weight
BANDWIDTHS = (100.0, 40.0, 30.0, 20.0, 15.0, 10.0, 8.0)  # [rad/s] of per-step laws that lag
AT_REST = 1e10  # on the last two poses: there, and no longer moving
BOUNDS = ((0.8, 0.3), (0.8, 0.1), (1.2, 0.1), (2.0, 0.1))  # |force| / (m g), |moment| / (m g side)
ARRIVED = 1e-3  # [deg]


def believed(law: Law, floor: float = 0.0) -> WrenchController:
    """The block of the scenes, its normal force kept above `floor` [N]."""
    corner = Contact((-SIDE / 2, -SIDE / 2), MU, f_min=floor)
    return WrenchController(Body(MASS, INERTIA), [corner], law, (0.0, -G), margin=MARGIN)


FLOOR = 1.0  # [N] for the shortest times
BLOCK, PRESSED = believed(Law.dynamic()), believed(Law.dynamic(), FLOOR)


def planned(seconds: float, steps: int, weight: float, end: float, bounds: WrenchBounds | None = None) -> Plan:
    """The whole arc in one plan; `weight` on its poses, `end` on the last two."""
    unit = np.diag([WEIGHT / LEVER, WEIGHT / LEVER, WEIGHT]) ** 2
    Q = np.tile(weight * unit, (steps, 1, 1))
    Q[-2:] = end * unit
    horizon = Horizon(
        BLOCK if bounds is None else PRESSED,
        steps,
        seconds / steps,
        integrator="semi-implicit",
        Q=Q,
        bounds=bounds,
        stick=True,
        edges=0,
    )
    up = START + np.pi / 4
    com = LEVER * np.array([np.cos(up), 0.0, np.sin(up)])
    state = BodyState(com, BLOCK.space.orientation(START), np.zeros(3), np.zeros(3))
    return Planner(horizon).plan(state, horizon.arc(BLOCK.space.orientation(reference(seconds, steps)), state))


def reference(seconds: float, steps: int) -> np.ndarray:
    """(steps,) angles of the minimum-jerk arc after each step [rad]."""
    arc = MinimumJerk((START, END), seconds)
    return np.asarray(arc(np.linspace(0.0, seconds, steps + 1)[1:]).orientation)


def angles(plan: Plan) -> np.ndarray:
    """(N+1,) [rad]."""
    return np.asarray(BLOCK.space.angle(plan.orientation))


def off(plan: Plan) -> np.ndarray:
    """(N,) degrees from the minimum-jerk reference."""
    steps = plan.horizon.steps
    return np.rad2deg(angles(plan)[1:] - reference(steps * plan.horizon.h, steps))


def effort(wrench: np.ndarray, force: np.ndarray, dt: float) -> float:
    """Of wrenches (N, 3) and forces (N, 1, 2), each for dt [s]; in N^2 s."""
    f = force.reshape(len(force), -1)
    return 0.5 * dt * float(((wrench @ BLOCK.Q_w) * wrench).sum() + ((f @ BLOCK.Q_f) * f).sum())


def step_by_step(plan: Plan) -> float:
    """Effort of the smallest wrench of each step along a plan's poses."""
    h, theta, com = plan.horizon.h, angles(plan), plan.position[:, [0, 2]]
    theta, com = np.insert(theta, 0, theta[0]), np.insert(com, 0, com[0], axis=0)  # it starts from rest
    total = 0.0
    for t in range(plan.horizon.steps):
        acceleration, alpha = np.diff(com[t : t + 3], n=2, axis=0)[0] / h**2, np.diff(theta[t : t + 3], n=2)[0] / h**2
        c, s = np.cos(theta[t + 1]), np.sin(theta[t + 1])
        force = np.array([[c, s], [-s, c]]) @ (MASS * (acceleration + np.array([0.0, G])))
        jacobian = BLOCK.jacobian(plan.orientation[t])
        problem = WrenchProblem(
            jacobian, np.append(force, INERTIA * alpha), [MU], margin=MARGIN, Q_w=BLOCK.Q_w, Q_f=BLOCK.Q_f
        )
        total += h * solve(problem).objective
    return total


class Played:
    """A plan's accelerations, each for its step, as a reference that rests when they are over."""

    def __init__(self, plan: Plan):
        self._h, theta = plan.horizon.h, angles(plan)
        rates = np.append(0.0, np.diff(theta) / self._h)
        self._alpha = np.append(np.diff(rates) / self._h, 0.0)
        self._rate = np.append(rates[:-1], 0.0)
        self._angle = np.append(theta - 0.5 * self._h * rates, END)[: len(theta)]
        self.angles = float(theta.min()), float(theta.max())

    def __call__(self, times: np.ndarray) -> Motion:
        k = np.clip((np.asarray(times) / self._h + 1e-9).astype(int), 0, len(self._alpha) - 1)
        tau, alpha = times - k * self._h, self._alpha[k]
        rate = self._rate[k]
        return Motion(self._angle[k] + rate * tau + 0.5 * alpha * tau**2, rate + alpha * tau, alpha)


def spent(run: Run, seconds: float) -> float:
    """Effort of a run's first seconds."""
    n = round(seconds / run.dt)
    return effort(run.wrench[0, :n], run.force[0, :n], run.dt)


def efforts(seconds: float, steps: int) -> dict[str, float]:
    """Effort against distance from the reference: the horizon's, and that of per-step laws that lag behind it."""
    out, head = {}, f"effort, {seconds:g} s; "
    arc = MinimumJerk((START, END), seconds)
    least = {"reference": arc, "seconds": seconds, "spread": 0.0}
    law = simulate("pivot-2d", **least)
    out[head + "per-step law on the reference, in MuJoCo, N^2 s"] = spent(law, seconds)
    base = played = differ = 0.0
    for weight in WEIGHTS:
        plan = planned(seconds, steps, weight, AT_REST)
        assert plan.status == "solved", plan
        label, cost = f"{head}weight {weight:g}: ", effort(plan.wrench, plan.force, seconds / steps)
        alone = step_by_step(plan)
        if weight == max(WEIGHTS):
            base = alone
            out[head + "per-step law on the reference's poses, N^2 s"] = base
            out[head + "horizon with tight tracking, relative difference"] = abs(cost / base - 1.0)
        differ = max(differ, abs(cost / alone - 1.0))
        follow = simulate("pivot-2d", **{**least, "reference": Played(plan)})
        played = played or spent(follow, seconds)  # the tightest comes first
        out[label + "RMS from the reference, deg"] = float(np.sqrt(np.mean(off(plan) ** 2)))
        out[label + "saved, %"] = 100.0 * (1.0 - cost / base)
        out[label + "saved in MuJoCo, %"] = 100.0 * (1.0 - spent(follow, seconds) / played)
        out[label + "without contact, s"] = float(follow.measures.contact_lost_s[0])
    out[head + "horizon against the per-step law on its own poses, relative difference"] = differ
    for bandwidth in BANDWIDTHS:
        lags = believed(Law("dynamic", bandwidth**2, 2.0 * bandwidth, 0.0, 1.0))
        run = simulate("pivot-2d", controller=lags, **least)
        if run.measures.contact_lost_s[0] == 0.0:
            label = f"{head}lagging law, {bandwidth:g} rad/s: "
            out[label + "RMS from the reference, deg"] = float(np.rad2deg(np.sqrt(np.mean(run.angle_error[0] ** 2))))
            out[label + "saved in MuJoCo, %"] = 100.0 * (1.0 - spent(run, seconds) / spent(law, seconds))
    return out


def feasible(plan: Plan, free: bool) -> bool:
    """It obeys its own equations and bounds, and is where it should be: at the end alone, or all the way.

    Whether its effort is the least does not matter here.
    """
    obeys = plan.status in ("solved", "not converged") and max(plan.motion_defect, plan.stick_defect) < 1e-6
    obeys = obeys and plan.horizon.bounds.excess(plan.wrench) < 1e-6
    return obeys and float(np.abs(off(plan)[-2:] if free else off(plan)).max()) <= ARRIVED


def bounded(seconds: float, steps: int, free: bool, bounds: WrenchBounds) -> Plan:
    """A plan within bounds, at rest at the end; otherwise free, or tight on the reference."""
    return planned(seconds, steps, 1e-6 if free else 1e8, AT_REST if free else 1e8, bounds)


def verified(plan: Plan) -> dict[str, float]:
    """A plan's motion by the per-step law within the same bounds, in MuJoCo, and 0.25 s of rest."""
    bounds, seconds = plan.horizon.bounds, plan.horizon.h * plan.horizon.steps
    limits = {"force_max": bounds.force, "moment_max": bounds.moment, "f_min": FLOOR}
    run = simulate("pivot-2d", reference=Played(plan), seconds=seconds + 0.25, **limits)
    of = {key: float(value[0]) for key, value in vars(run.measures).items()}
    return {
        "slip, mm": 1e3 * of["slip_max_m"],
        "slip, predicted, mm": 1e3 * of["slip_floor_m"],
        "without contact, s": of["contact_lost_s"],
        "angle, greatest, deg": of["angle_error_max_deg"],
        "excess over the bounds": bounds.excess(run.wrench[0]),
    }


def shortest(bounds: WrenchBounds, steps: int, free: bool, precision: float) -> Plan:
    """The plan of the shortest duration."""
    low, high, best = 0.3, 4.0, None
    while high > (1.0 + precision) * low:
        middle = float(np.sqrt(low * high))
        plan = bounded(middle, steps, free, bounds)
        if feasible(plan, free):
            best, high = plan, middle
        else:
            low = middle
    assert best is not None
    return best


def fastest(bounds: WrenchBounds) -> float:
    """Duration [s] with the greatest torque about the contact, M + F lever, until 45 deg and its opposite from there.

    I_c theta'' = torque - m g lever cos(theta + 45 deg), energy from rest, both halves alike: t = 2 int d theta/omega.
    """
    torque, about = bounds.moment + LEVER * bounds.force, INERTIA + MASS * LEVER**2
    root = np.sqrt(np.pi / 4 - START) * (np.arange(20_000) + 0.5) / 20_000  # theta = START + root^2: no singularity
    theta = START + root**2
    work = torque * (theta - START) - WEIGHT * LEVER * (np.sin(theta + np.pi / 4) - np.sin(START + np.pi / 4))
    if (work <= 0.0).any():
        return float("inf")
    return float(2.0 * np.sum(2.0 * root / np.sqrt(2.0 * work / about)) * root[0] * 2.0)


def times(force: float, moment: float, steps: int, precision: float) -> dict[str, float]:
    """Shortest durations within bounds of so many weights and weights times side, and the plans in MuJoCo."""
    bounds = WrenchBounds(force=force * WEIGHT, moment=moment * WEIGHT * SIDE)
    head = f"|force| <= {force:g} m g, |moment| <= {moment:g} m g a; "
    out = {head + "torque alone, s": fastest(bounds)}
    for free, name in ((False, "minimum jerk"), (True, "free timing")):
        plan = shortest(bounds, steps, free, precision)
        seconds = plan.horizon.h * steps
        out[f"{head}{name}, s"] = seconds
        out |= {f"{head}{name}, in MuJoCo: {key}": value for key, value in verified(plan).items()}
        slower = bounded(1.05 * seconds, steps, free, bounds)
        out |= {f"{head}{name}, 5 % slower, in MuJoCo: {key}": value for key, value in verified(slower).items()}
    return out


def measure(quick: bool) -> dict[str, float]:
    """The figures; see the head of this file."""
    out = {}
    for seconds in SECONDS:
        out |= efforts(seconds, 100 if quick else 200)
    for force, moment in track(BOUNDS[:1] if quick else BOUNDS, "bounds", transient=True):
        out |= times(force, moment, 100 if quick else 200, 0.02 if quick else 0.002)
    return out


def tables(figures: dict[str, float]) -> str:
    """Effort saved against the distance from the reference, and the shortest times."""
    lines = ["| | " + " | ".join(f"{s:g} s: RMS, deg | effort saved, % | in MuJoCo, %" for s in SECONDS) + " |"]
    lines += ["|---|" + "--:|--:|--:|" * len(SECONDS)]
    keys = ("RMS from the reference, deg", "saved, %", "saved in MuJoCo, %")
    for weight in WEIGHTS[2:]:
        heads = [f"effort, {seconds:g} s; weight {weight:g}: " for seconds in SECONDS]
        name = "only the end" if weight == min(WEIGHTS) else f"weight {weight:g}"
        lines.append(f"| {name} | " + " | ".join(f"{figures[head + key]:.2g}" for head in heads for key in keys) + " |")
    names = ("torque alone", "free timing", "minimum jerk")
    checks = ("slip, mm", "slip, predicted, mm", "without contact, s", "angle, greatest, deg")
    lines += ["", f"| F, M | {' | '.join(names)} | free timing in MuJoCo: {' | '.join(checks)} | 5 % slower: without |"]
    lines += ["|---|" + "--:|" * (len(names) + len(checks) + 1)]
    for force, moment in BOUNDS:
        head = f"|force| <= {force:g} m g, |moment| <= {moment:g} m g a; "
        cells = [f"{figures[f'{head}{name}, s']:.3f}" for name in names]
        cells += [f"{figures[f'{head}free timing, in MuJoCo: {check}']:.3g}" for check in checks]
        cells.append(f"{figures[f'{head}free timing, 5 % slower, in MuJoCo: {checks[2]}']:g}")
        lines.append(f"| {force:g}, {moment:g} | " + " | ".join(cells) + " |")
    return "\n".join(lines)


def draw(figures: dict[str, float], path: Path) -> None:
    """Effort against tracking, for each duration."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10.0, 4.2), layout="constrained")
    for axes, seconds in zip(figure.subplots(1, len(SECONDS)), SECONDS, strict=True):
        for kind, style, name in (
            ("weight", "o-", "horizon's poses, per-step law along them, MuJoCo"),
            ("lagging law", "s--", "per-step law without feedforward, MuJoCo"),
        ):
            head = f"effort, {seconds:g} s; {kind}"
            rms = [v for k, v in figures.items() if k.startswith(head) and k.endswith("RMS from the reference, deg")]
            saved = [v for k, v in figures.items() if k.startswith(head) and k.endswith("saved in MuJoCo, %")]
            axes.plot(rms, saved, style, color="#2e8b57" if kind == "weight" else "#2f6db3", label=name)
        axes.axhline(0.0, color="black", linewidth=0.8)
        axes.set_xscale("symlog", linthresh=0.01)
        axes.set(xlim=(0.0, 10.0), xlabel="RMS from the reference [deg]", title=f"10 to 80 deg in {seconds:g} s")
        axes.set_ylabel("effort saved [%]")
        axes.grid(alpha=0.3)
        axes.legend(fontsize=8, loc="best")
    figure.savefig(path, dpi=110)


if __name__ == "__main__":
    bounds = {}
    for each in SECONDS:
        bounds[f"effort, {each:g} s; horizon with tight tracking, relative difference"] = 1e-8
        bounds[f"effort, {each:g} s; horizon against the per-step law on its own poses, relative difference"] = 1e-8
    first = "|force| <= {:g} m g, |moment| <= {:g} m g a; ".format(*BOUNDS[0])
    bounds |= {first + "free timing, s": 0.82, first + "minimum jerk, s": 1.0}
    bounds |= {
        f"{first}{name}, 5 % slower, in MuJoCo: without contact, s": 0.0 for name in ("minimum jerk", "free timing")
    }
    floors = {first + "free timing, s": fastest(WrenchBounds(BOUNDS[0][0] * WEIGHT, BOUNDS[0][1] * WEIGHT * SIDE))}
    main(__doc__ or "", measure, bounds, floors=floors, markdown=tables, draw=draw)
