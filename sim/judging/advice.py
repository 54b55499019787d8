"""Why a run failed, in sentences, and which key would hold it: worked out from the run's own figures, and tried."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from pivoting.sim.run import Run
    from pivoting.sim.scenarios.scenario import Scenario
    from pivoting.sim.world import World

Array = NDArray[np.float64]
SLIDES = 0.999  # of mu f_n: at more a contact slides
ROOM = 0.85  # of the friction found that is planned with
QUICK = 0.2  # of a time step: a law with a greater bandwidth cannot be followed
SHIPPED = {"impedance": 0.5, "impratio": 1000.0}
TRIES = 10  # of remedies, at most
FEW = 4  # of floors under the force, before an arc is made longer


@dataclass(frozen=True)
class Remedy:
    """Keys that would hold a run.

    Attributes:
        keys: of the scenario, with their values.
        why: in words.
    """

    keys: Mapping[str, float]
    why: str

    @property
    def setting(self) -> str:
        """As the command line has it."""
        return " ".join(f"--set {key}={value:.4g}" for key, value in self.keys.items())


@dataclass(frozen=True, eq=False)
class _Case:
    """The worst world of a failing run."""

    run: "Run"

    @property
    def world(self) -> int:
        """Its index."""
        return self.run.worst_world

    @cached_property
    def truth(self) -> "World":
        """As it is alone."""
        return self.run.world.of(self.world)

    def failed(self, name: str) -> bool:
        """Whether it is over the limit of the check of that name."""
        return any(check.name == name and bool(check.failed[self.world]) for check in self.run.checks)

    @property
    def diverged(self) -> float | None:
        """[s], or None."""
        run = self.run
        states = np.hstack([run.position[self.world], run.velocity[self.world], run.angular_velocity[self.world]])
        wrong = ~(np.abs(states) < 1e6).all(axis=1)
        return float(run.time[wrong.argmax()]) if wrong.any() else None

    @property
    def gone_over(self) -> list[str]:
        """That and why it went over to a safe state, if it did; whatever else it failed by follows from that."""
        if not self.run.measures.safe_s[self.world]:
            return []
        return [event.what for event in self.run.events if event.world == self.world and event.state]

    @property
    def slid(self) -> int | None:
        """The first step at which a contact slides."""
        use = np.nan_to_num(self.run.friction_use[self.world]).max(axis=1)
        return int((use >= SLIDES).argmax()) if (use >= SLIDES).any() else None

    @property
    def let_go(self) -> int | None:
        """The first step, once settled, at which nothing pushes on the contacts."""
        run = self.run
        lost = ~(run.force_measured[self.world, :, :, -1] > 0.0).any(axis=1) & (run.time[:-1] >= run.limits.settle_s)
        return int(lost.argmax()) if lost.any() else None

    @property
    def friction(self) -> Array:
        """(N, 1) the friction coefficient of its world."""
        each = self.run.friction
        return each[self.world % len(each)]

    @property
    def friction_found(self) -> float:
        """Greatest |f_t| / f_n of a contact that pushes."""
        return float(np.nanmax(self.run.friction_use[self.world] * self.friction, initial=0.0))

    @property
    def least_push(self) -> float:
        """[N] the least normal force of a contact that the answers count on."""
        push = np.where(self.run.standing[self.world], self.run.force[self.world, :, :, -1], np.nan)
        return self.run.unit * float(np.nanmin(push, initial=np.inf))

    @property
    def weight(self) -> float:
        """[N] as believed."""
        return self.run.load.force

    @property
    def mu(self) -> float:
        """As believed, without the margin."""
        return max(contact.mu for contact in self.run.controller_of(self.world).contacts)


def reasons(run: "Run", strays: list[str] | None = None) -> list[str]:
    """Why a run failed, a sentence each, of its worst world; nothing if it passes.

    Args:
        strays: its contacts that are not declared, in the words of the fleet that it is part of.
    """
    told = run.strays if strays is None else strays
    return list(_reasons(_Case(run), told)) if run.failed_worlds.size else []


def _reasons(case: _Case, strays: list[str]) -> Iterator[str]:
    run, i = case.run, case.world
    theta = np.rad2deg(run.theta[i])
    if case.diverged is not None:
        yield f"the object diverged at {case.diverged:.3g} s"
        return
    if case.gone_over:
        yield from case.gone_over
        return
    yield from strays
    if case.let_go is not None and case.failed("contact_lost_s"):
        k = case.let_go
        lost = float(run.measures.contact_lost_s[i])
        when = f"at {run.time[k]:.3g} s ({theta[k]:.3g} deg), for {lost:.3g} s in all"
        push = f"{case.least_push:.3g} N, {case.least_push / max(case.weight, 1e-300):.2g} weights"
        yield f"the contact let go {when}: it was meant to press with only {push}"
    elif case.failed("contact_lost_s"):
        yield "one of the contacts left the table"
    if case.slid is not None and (case.failed("slip_max_m") or case.failed("friction_use_max")):
        k = case.slid
        at = f"at {run.time[k]:.3g} s ({theta[k]:.3g} deg)"
        yield f"the contact slid {at}: |f_t| reached mu f_n, mu = {float(case.friction[k, 0]):.3g}"
    elif case.failed("slip_max_m"):
        floor, slip = float(run.measures.slip_floor_m[i]), float(run.measures.slip_max_m[i])
        part = "unpredicted"
        if np.isfinite(floor):
            part = f"{100.0 * min(floor / slip, 1.0):.0f} % of it the simulator's own"
        yield f"the contact crept by {1e3 * slip:.3g} mm without sliding, {part}"
    if run.scenario.own and not run.scenario.chosen:
        yield "its contact and solver parameters are the file's: without --as-modelled they are chosen"
    if case.failed("angle_error_rms_deg") or case.failed("angle_error_max_deg"):
        yield f"the angle was off by up to {float(run.measures.angle_error_max_deg[i]):.3g} deg"
    if case.failed("force_mismatch_rel"):
        off = f"({100.0 * float(run.measures.force_mismatch_rel[i]):.3g} %)"
        if run.scenario.uncertain:
            yield f"the contact force was not the one with which the object would stick {off}"
        else:
            yield (
                f"the contact force was not the predicted one {off}:"
                " the world is not as it is believed to be, or its contact does not hold still"
            )
    if case.failed("unsolved_steps"):
        yield f"{float(run.measures.unsolved_steps[i]):.0f} steps had no certified answer"
    if case.failed("penetration_rel"):
        yield "the object was pressed deeper into its support than the soft contact explains"
    if case.failed("bounce_m") or case.failed("contacts_missing"):
        yield "the object did not come to lie on its face without bouncing"


def remedies(run: "Run") -> list[Remedy]:
    """Keys that may hold a failing run, the likeliest first; they are not tried here."""
    if not run.failed_worlds.size or _Case(run).gone_over:
        return []
    found: dict[tuple[tuple[str, float], ...], Remedy] = {}
    for one in _remedies(_Case(run)):
        found.setdefault(tuple(sorted(one.keys.items())), one)
    return list(found.values())


def _remedies(case: _Case) -> Iterator[Remedy]:
    run, scenario, i = case.run, case.run.scenario, case.world
    slid, let_go = case.slid is not None, case.let_go is not None
    if case.diverged is not None or scenario.bandwidth * run.dt > QUICK:
        slower = min(_up(0.5 * QUICK / run.dt), 0.5 * scenario.bandwidth)
        yield Remedy({"bandwidth": slower}, "a slower law")
    softer = Remedy({"timeconst": 3.0 * float(case.truth.model.geom_solref[run.truth.support, 0])}, "a softer contact")
    if case.diverged is not None:
        yield from (Remedy({"dt": run.dt / 4.0}, "a finer time step"), softer)
        return
    first = int((run.log.contacts.strays[i] > 0.0).argmax()) if run.strays else len(run.time)
    if first < (len(run.time) if case.let_go is None else case.let_go):  # else it fell on what it touches
        ends = float(np.rad2deg(run.theta[i, first])) - 1.0
        if "theta_end" in scenario.reference_keys and scenario.theta < ends < scenario.theta_end:
            yield Remedy({"theta_end": round(ends, 2)}, "the arc ends before it touches anything else")
    yield from _contact(case)
    share = 1.0 - ROOM * case.friction_found / case.mu
    spare = {"margin": _up(share)} if slid and 0.0 < share < 1.0 else {}
    if spare:
        yield Remedy(spare, "what friction there was is not used up")
    pressed = list(_pressed(case, spare)) if slid or let_go else []
    yield from pressed[:FEW]
    yield from _slower(case)
    yield from pressed[FEW:]
    if case.failed("angle_error_rms_deg") or case.failed("angle_error_max_deg"):
        over = _over(case, "angle_error_rms_deg", "angle_error_max_deg")
        higher = scenario.bandwidth * np.sqrt(2.0 * over)
        if higher * run.dt <= QUICK:
            yield Remedy({"bandwidth": _up(higher)}, "a stiffer law")
        yield Remedy({"dt": run.dt / 4.0}, "a finer time step")
    if let_go or case.failed("force_mismatch_rel"):
        yield softer


def _pressed(case: _Case, spare: Mapping[str, float]) -> Iterator[Remedy]:
    """Floors under the normal force, the least first, each without and with friction to spare."""
    for floor in _floors(case):
        yield Remedy({"f_min": floor}, "a floor under the normal force presses the contact on the table")
        if spare:
            yield Remedy({"f_min": floor, **spare}, "a floor under the normal force, and friction to spare")


def _floors(case: _Case) -> Iterator[float]:
    """[N] floors of each contact, the least first: against opening by turning, errors of the force, and by weight."""
    run, i = case.run, case.world
    K, belief = int(np.count_nonzero(run.stances[0].held)), run.controller_of(i).belief
    off = np.linalg.norm(run.force_measured[i] - run.force[i], axis=-1)
    error = run.unit * float(np.quantile(np.nan_to_num(off), 0.95))
    spare = max(case.truth.mu - float(np.max(belief.contacts.mu)), 0.1 * case.truth.mu)
    some = {0.5 * case.weight / K, 2.0 * case.weight / K, 5.0 * case.weight / K}
    rows = case.truth.contact_rows
    most = 20.0 * case.weight
    if rows is not None:
        w = run.angular_velocity[i] @ run.table_axes
        arm = run.turning[i] - run.stepped[i, :, None]
        c_n = float(np.nanmax(np.abs(np.cross(w[:, None], np.cross(w[:, None], arm))[..., 2]), initial=0.0))
        opening = c_n * max(1.0 - 0.5 * rows.b * rows.h, 0.0) / rows.regularisation * rows.points / K
        some |= {2.0 * run.unit * opening}
    some |= {1.5 * error * (1.0 + case.truth.mu) / spare}
    least = max(1.2 * run.unit * float(belief.contacts.f_min.min()), 0.05 * case.weight / K)
    yield from sorted({_up(floor) for floor in some if least < floor < most})


def _slower(case: _Case) -> Iterator[Remedy]:
    """A longer arc: what turning causes goes with the square of the rate."""
    scenario, run = case.run.scenario, case.run
    if "seconds" not in scenario.reference_keys:
        return
    seconds = float(scenario.absolute(run.load).seconds)
    over = _over(case, "slip_max_m", "angle_error_rms_deg", "angle_error_max_deg")
    for factor in (1.5, max(2.0, min(1.3 * over, 6.0))):
        yield Remedy({"seconds": _up(factor * seconds)}, "a longer arc turns more slowly")


def _contact(case: _Case) -> Iterator[Remedy]:
    """Contact parameters under which the simulator itself slips less and holds on; see docs/fidelity.md."""
    run, rows = case.run, case.truth.contact_rows
    if rows is None or not (case.failed("slip_max_m") or case.failed("contact_lost_s")):
        return
    if abs(rows.b * rows.h - 1.9) > 0.01 or run.model.opt.impratio < SHIPPED["impratio"]:
        yield Remedy({"timeconst": 2.1 * run.dt, **SHIPPED}, "the contact parameters of the shipped scenes")
    if case.failed("slip_max_m") and case.slid is None:
        more = 2.0 * _over(case, "slip_max_m") * float(run.model.opt.impratio)
        yield Remedy({"impratio": _up(more)}, "friction that creeps less")


def _over(case: _Case, *names: str) -> float:
    """The greatest multiple of its limit among these checks."""
    checks = [check for check in case.run.checks if check.name in names]
    pairs = [(getattr(case.run.measures, check.name)[case.world], check.limit) for check in checks]
    return max((float(value / limit) for value, limit in pairs if limit > 0.0 and np.isfinite(value)), default=1.0)


def _up(value: float) -> float:
    """Two digits, rounded up."""
    step = 10.0 ** (np.floor(np.log10(value)) - 1.0)
    return float(f"{np.ceil(value / step - 1e-9) * step:.2g}")


def tried(run: "Run", simulate: Callable[..., "Run"], most: int = TRIES) -> dict[str, Any]:
    """Try the remedies of a failing run, in their order, until one holds it.

    Args:
        simulate: what runs a scenario.
        most: how many are tried.

    Returns:
        holds: the keys that hold every world, None if none did.  setting, why: in words, of that.
        tried: the settings that were tried and did not hold it.  untried: those that are left.
    """
    left: list[Remedy] = remedies(run)
    failed: list[str] = []
    scenario: Scenario = run.scenario
    while left and len(failed) < most:
        one = left.pop(0)
        try:
            again = simulate(scenario.change(**one.keys), run.worlds, run.seed, first_world=run.first_world)
        except (ValueError, RuntimeError):  # the key does not fit the scenario: it is no remedy
            continue
        if again.verdict == "pass":
            found = {"holds": dict(one.keys), "setting": one.setting, "why": one.why}
            return {**found, "tried": failed, "untried": [other.setting for other in left]}
        failed.append(one.setting)
    return {"holds": None, "setting": "", "why": "", "tried": failed, "untried": [other.setting for other in left]}
