"""The worked example of the notes: the numbers that they print, those of each solver, and whether the digits agree."""

from dataclasses import dataclass

import numpy as np
from pivoting.controller.contacts import Contact
from pivoting.controller.control_laws import Body, Law
from pivoting.controller.errors import SolveError
from pivoting.controller.motion import Motion
from pivoting.controller.solution import Solution
from pivoting.controller.solvers.solve import methods, solve
from pivoting.controller.wrench_controller import WrenchController
from pivoting.controller.wrench_problem import WrenchProblem

THETA = np.deg2rad(30.0)


@dataclass(frozen=True)
class Example:
    """A problem with known numbers.

    Attributes:
        name, summary: what the example is called, and what it is.
        incline: how far the table rises to the right [rad].
        expected: the digits of each quantity, as they are printed.
    """

    name: str
    summary: str
    incline: float
    expected: dict[str, str]

    def controller(self) -> WrenchController:
        """The controller: a = 1 m, m = 1 kg, g = 10 m/s^2, mu = 0.3, Q = I, and gravity in the table's frame."""
        corner = Contact((-0.5, -0.5), mu=0.3)
        gravity = (-10.0 * np.sin(self.incline), -10.0 * np.cos(self.incline))
        return WrenchController(Body(1.0, 1.0 / 6.0), [corner], Law.static(), gravity, Q_w=np.eye(3))

    def problem(self) -> WrenchProblem:
        """The wrench problem of the example: balance at theta = 30 deg."""
        return self.controller().problem(Motion(THETA))


EXAMPLES = (
    Example(
        "printed",
        "as the notes print it: 30 deg on a table inclined by 30 deg (erratum 2)",
        np.deg2rad(30.0),
        {
            "f_t": "1.39789",
            "f_n": "4.65964",
            "f_x": "5.11982",
            "f_y": "1.66358",
            "tau": "-0.10201",
            "x'Qx": "52.6568",
            "x'Qx/2": "26.3284",
        },
    ),
    Example(
        "level",
        "the block that the notes describe: 30 deg on a level table",
        0.0,
        {
            "f_t": "0.2500",
            "f_n": "4.9330",
            "f_x": "2.3170",
            "f_y": "4.5131",
            "tau": "0.7321",
            "x'Qx/2": "25.3349",
        },
    ),
)


@dataclass(frozen=True)
class Digit:
    """One number of an example, as one method computes it.

    Attributes:
        example, method, quantity: which number it is.
        expected: the printed digits.  value: what the method gave.
        agrees: whether |value - expected| is at most one unit of the last printed digit. It is one unit, not a half,
            because the notes' numbers come from a solver with a tolerance of 1e-6: their tau = -0.10201 is -0.1020047,
            which rounds to -0.10200.
        rounds: whether value rounds to exactly these digits.
    """

    example: str
    method: str
    quantity: str
    expected: str
    value: float
    agrees: bool
    rounds: bool


def quantities(solution: Solution) -> dict[str, float]:
    """The quantities that the notes print, taken from a planar solution with one contact."""
    (f_t, f_n), (f_x, f_y, tau) = solution.force[0], solution.wrench
    cost = solution.objective
    return {"f_t": f_t, "f_n": f_n, "f_x": f_x, "f_y": f_y, "tau": tau, "x'Qx": 2.0 * cost, "x'Qx/2": cost}


def compare(example: Example, method: str) -> tuple[list[Digit], Solution]:
    """Compare every number of `example` with what `method` gives; an answer without a certificate shows its status."""
    try:
        solution = solve(example.problem(), method)
    except SolveError as error:
        solution = error.solution
    found = quantities(solution)
    digits = []
    for quantity, written in example.expected.items():
        places = len(written.partition(".")[2])
        value = float(found[quantity])
        off = abs(value - float(written))
        rounds = f"{value:.{places}f}" == written
        digits.append(Digit(example.name, method, quantity, written, value, bool(off <= 10.0**-places), rounds))
    return digits, solution


def compare_all() -> list[tuple[list[Digit], Solution]]:
    """Compare the numbers of every example with those of every method that is installed."""
    return [compare(example, method) for example in EXAMPLES for method in methods()]
