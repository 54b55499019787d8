"""The safe state: with no measurement, answer or contact for too long, or too far off its way, an object is lowered.

Until then the last wrench is held, fixed to the object, where there is no new one: within a few milliseconds the object
turns by little, and so does the contact force, which had friction to spare. For longer that is unsafe, because what is
balanced on a contact falls, faster and faster. Then no one waits for a solver or a sensor: `Lowering` needs neither. It
acts on the state that is measured or, where none is, on that which `PivotModel` makes of the last one. Once the object
touches its support with more contacts than before, it is let go: it falls no further. It is let go, too, where it has
lost its contacts, or its state is no number, because then no wrench is known to be right.
"""

import numpy as np
from numpy.typing import NDArray
from pivoting.controller.lowering import Lowering
from pivoting.controller.pivot_model import PivotModel
from pivoting.controller.rotations import rotation_matrix
from pivoting.controller.solution import BOUNDED, REPEATED, SAFE, SOLVED, STATUS, UNCERTIFIED, UNGUARANTEED
from pivoting.controller.validate import fail
from pivoting.sim.pipeline.plan_log import Event
from pivoting.sim.pipeline.stages import (
    ANGULAR_VELOCITY,
    ORIENTATION,
    Answers,
    Control,
    Desired,
    Setting,
    States,
)

Array = NDArray[np.float64]
LOST = 0.05  # for how long an object that is pressed may have no contact before it is let go [s]
SLID = 0.02  # of the lever: a contact that seems to have moved by more has slid
ANSWERED = np.isin(np.arange(len(STATUS)), (SOLVED, BOUNDED, UNCERTIFIED, UNGUARANTEED))  # by status


class SafeState:
    """Goes over to the safe state, for good, in each world in which it has to.

    Args:
        patience: for how long there may be no valid measurement, no answer or no contact [s].

    Attributes:
        events: which world went over to which state, when and why.

    Raises:
        ValueError: measurements or answers are further apart than that by design, or there are two stances.
    """

    slot = "wrap"

    def __init__(self, patience: float, setting: Setting):
        case, dt = setting.case, setting.dt
        if case.landing == "held":
            raise fail("safe_after", patience, "0 with landing=held: it knows one stance")
        for name in ("measure_hz", "control_hz"):
            rate = getattr(case, name)
            if rate is not None and patience < 1.0 / rate + dt:
                raise fail("safe_after", patience, f">= {1.0 / rate + dt:g} s, a time step more than {name} takes")
        if patience < case.delay + dt:
            raise fail("safe_after", patience, f">= {case.delay + dt:g} s, a time step more than the delay")
        self.setting, self.steps = setting, setting.step("safe_after", patience)
        self.cosine = float(np.cos(0.5 * np.deg2rad(case.safe_angle)))
        self.told = f"{patience:g} s", f"{case.safe_angle:g} deg"
        self.slid = np.array([(SLID * each.units.length) ** 2 for each in setting.controllers])
        self.rolls = any(contact.radius > 0.0 for each in setting.controllers for contact in each.contacts)
        self.table = rotation_matrix(setting.controllers[0].space.base)
        self.lost = max(1, round(LOST / dt))
        self.bounds = case.bounds(setting.unit)
        self.model = PivotModel(setting.controllers, dt)
        self.prepare = self.model.prepare
        press = None if case.safe_press is None else float(case.safe_press) / setting.unit
        self.lowering = [
            Lowering(each, 2.0 * each.units.force if press is None else press) for each in setting.controllers
        ]
        self.events: list[Event] = []

    def __call__(self, control: Control, desired: Array) -> Control:
        """The control that gives way to the safe state."""
        self.events = []
        return _Guarded(control, desired, self)


class _Guarded:
    def __init__(self, inner: Control, desired: Array, stage: SafeState):
        self._inner, self._desired, self._stage = inner, Desired(desired), stage
        self.prepare = inner.prepare
        W = stage.setting.worlds
        # the last step in which there was one
        self._measured, self._answered, self._touched = np.full(W, -1), np.full(W, -1), np.full(W, -1)
        self._safe, self._let_go = np.zeros(W, np.bool_), np.zeros(W, np.bool_)
        self._lost = np.zeros(W, np.int64)
        self._states, self._contacts, self._none = np.zeros((W, 13)), np.zeros(W), np.zeros((W, 3))
        self._values, self._began = np.zeros(0), np.zeros((W, 3))

    def __call__(self, k: int, states: States, before: Array | None, out: Answers) -> None:
        self._inner(k, states, before, out)
        self._follow(k, states, before)
        self._hold(k, out)
        if k > 1:  # contacts are first read in the step before
            self._go_over(k, states)
        for world in np.flatnonzero(self._safe):
            self._act(int(world), k, states, before, out)

    def _follow(self, k: int, states: States, before: Array | None) -> None:
        """The states as they are measured, or as the model has them since."""
        self._contacts = np.where(self._safe, self._contacts, np.maximum(self._contacts, states.touching))
        valid = states.fresh & np.isfinite(states.values[:, :13]).all(axis=1)
        self._measured[valid] = k
        if before is not None and not valid.all():
            self._stage.model.advance(self._states, np.array(before), self._none)
        self._states[valid] = states.values[valid, :13]
        self._touched[(states.touching > 0) | (k == 0)] = k
        if k == 0:
            self._began = self._contact()

    def _contact(self) -> Array:
        """(W, 3) where the contacts' mean seems to be, table axes."""
        return np.asarray(self._stage.model.contacts(self._states) @ self._stage.table)

    def _hold(self, k: int, out: Answers) -> None:
        """The last answer again, where there is none."""
        self._answered[ANSWERED[out.status]] = k
        missing = ~np.isfinite(out.wrench).all(axis=1)
        if missing.any():
            missing &= self._answered >= 0
            out.values[missing], out.status[missing] = self._values[missing], REPEATED
            out.residual[missing] = np.nan
        self._values = out.values.copy()

    def _go_over(self, k: int, states: States) -> None:
        """The worlds in which this step is the first of the safe state."""
        stage, (after, angle) = self._stage, self._stage.told
        cosine = np.abs(self._states[:, ORIENTATION] @ self._desired.orientation[k])  # of half the angle
        shift = (self._contact() - self._began)[:, :2]
        slid = (shift**2).sum(axis=1) > stage.slid
        whys = (
            (k - self._measured > stage.steps, f"no valid measurement for {after}"),
            (k - self._answered > stage.steps, f"no answer for {after}"),
            (k - self._touched > stage.steps, f"no contact for {after}"),
            (cosine < stage.cosine, f"the angle is off by more than {angle}"),
            (slid & (not stage.rolls), f"the contact has slid by more than {100 * SLID:g} % of the lever"),
        )
        for due, why in whys:
            if due.any():
                for world in np.flatnonzero(due & ~self._safe):
                    self._tell(int(world), k, "lowered", f"from step {k} on: {why}")
                self._safe |= due

    def _act(self, world: int, k: int, states: States, before: Array | None, out: Answers) -> None:
        """The safe action in one world."""
        stage = self._stage
        out.values[world], out.residual[world], out.status[world] = 0.0, np.nan, SAFE
        if not self._let_go[world] and (why := self._over(world, states)):
            self._let_go[world] = True
            self._tell(world, k, "let go", f"in step {k}: {why}")
        if self._let_go[world]:
            return
        lowering = stage.lowering[world % len(stage.lowering)]
        orientation, omega = self._states[world, ORIENTATION], self._states[world, ANGULAR_VELOCITY]
        wrench, required = lowering.wrench(orientation, omega, blind=k - self._measured[world] > stage.steps)
        last = None if before is None else np.nan_to_num(before[world])[None]
        out.wrench[world] = stage.bounds.within(wrench[None], last, stage.setting.dt)[0]
        out.required[world], out.force[world] = required, lowering.force.ravel()

    def _over(self, world: int, states: States) -> str:
        """Why an object that is lowered is to be let go now; "" if it is not."""
        found = int(states.touching[world])
        self._lost[world] = 0 if found else self._lost[world] + 1
        if found > self._contacts[world]:
            return f"it touches its support at {found} points"
        if self._lost[world] > self._stage.lost:
            return f"it touches nothing for {LOST:g} s"
        return "" if np.isfinite(self._states[world]).all() else "its state is not known"

    def _tell(self, world: int, k: int, state: str, why: str) -> None:
        said = f"safe state, {state} {why}"
        self._stage.events.append(Event(world, k * self._stage.setting.dt, said, state))
