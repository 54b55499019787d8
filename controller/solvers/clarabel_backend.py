"""Calls the solver Clarabel: it is set up once, its data are replaced in place, and a poor answer is solved again."""

from dataclasses import replace
from time import perf_counter
from typing import Any

import numpy as np
from pivoting.controller.solvers.conic_program import USABLE, ConicAnswer, ConicProgram
from pivoting.controller.validate import fail

POOR = 1e-8  # relative KKT residual beyond which a program is solved again, carefully

_WRENCH: dict[str, Any] = {
    "tol_gap_abs": 1e-11,
    "tol_gap_rel": 1e-11,
    "tol_feas": 1e-11,
    "max_step_fraction": 0.95,  # at its default of 0.99, 9 of 20,000 planar problems ended in MaxIterations
}
_HORIZON: dict[str, Any] = {
    # an answer is off by the square root of its gap: 1e-10 leaves contact forces 1e-5 of the weight from the optimum
    "tol_gap_abs": 1e-12,
    "tol_gap_rel": 1e-12,
    "tol_feas": 1e-10,
    "static_regularization_constant": 1e-11,  # at its own 1e-8 it gives up where sticking leaves no freedom
    "max_threads": 1,
}
_REPLACEABLE: dict[str, Any] = {  # what replacing the data needs: the pattern that it was set up with
    "presolve_enable": False,
    "chordal_decomposition_enable": False,
    "input_sparse_dropzeros": False,
}
# By purpose, because no regularization serves both: with that of horizons, 15 of 4,000 wrench problems with one contact
# in space end with a relative KKT residual of 1e-5 to 6e-3, with that of wrenches 1 of 1,000 horizons has no answer.
SETTINGS: dict[str, dict[str, Any]] = {
    "wrench": _WRENCH,
    "wrench, in place": {
        **_WRENCH,
        **_REPLACEABLE,
        "equilibrate_enable": False,  # it would be that of the first problem for good
    },
    "horizon": {
        **_HORIZON,
        **_REPLACEABLE,
        "max_step_fraction": 0.99,
        # every answer is certified, and programs are in units of the order of one: a third less time
        "equilibrate_max_iter": 1,
        "iterative_refinement_enable": False,
    },
    "horizon, carefully": {
        **_HORIZON,
        **_REPLACEABLE,
        "max_step_fraction": 0.95,
        "equilibrate_max_iter": 10,
        "iterative_refinement_enable": True,
    },
}


class Clarabel:
    """Clarabel, set up for one program, whose data other programs with the same pattern and cones may replace.

    Args:
        program: the first program.
        settings: of Clarabel, see `SETTINGS`.

    Raises:
        ValueError: a setting that Clarabel does not have.
    """

    def __init__(self, program: ConicProgram, settings: dict[str, Any]):
        import clarabel

        chosen = clarabel.DefaultSettings()
        chosen.verbose = False
        for key, value in settings.items():
            if not hasattr(chosen, key):
                raise fail("options", key, "a setting of Clarabel")
            setattr(chosen, key, value)
        zero, linear, orders = program.cones
        cones = [clarabel.ZeroConeT(zero), clarabel.NonnegativeConeT(linear)]
        cones += [clarabel.SecondOrderConeT(order) for order in orders]
        self.program = program
        P, A = program.P.csc(), program.A.csc()
        self._solver = clarabel.DefaultSolver(P, program.q, A, program.b, cones, chosen)

    @property
    def replaceable(self) -> bool:
        """Whether the settings allow the data to be replaced."""
        return bool(self._solver.is_data_update_allowed())

    def replace(self, program: ConicProgram) -> None:
        """Replace the program that is solved by this one."""
        data = {"P": program.P.data, "q": program.q, "A": program.A.data, "b": program.b}
        self._solver.update(**{key: values.tolist() for key, values in data.items()})  # it reads arrays slower
        self.program = program

    def solve(self, began: float | None = None) -> ConicAnswer:
        """Solve the program; its time counts from `began`, a reading of `perf_counter`, or else from now."""
        start = perf_counter() if began is None else began
        found = self._solver.solve()
        x, z = np.array(found.x), np.array(found.z)
        return ConicAnswer(self.program, x, z, str(found.status), perf_counter() - start)


class ClarabelWithRetry:
    """Solves one program after another with Clarabel, which is set up once for as long as their pattern is the same.

    The first try is fast because it uses the scaling of the first program and no iterative refinement. If its residual
    is `POOR`, or if there is no answer, the program is solved once more, carefully: with a scaling of its own, with
    refinement, and with shorter steps. The better of the two answers is returned, and its message says so. A proof that
    there is no answer is returned if no answer is `USABLE`.

    Args:
        step: share of the way to the boundary of the cones that the first try goes in one step.
        options: of Clarabel, for both tries, on top of `SETTINGS`.
    """

    def __init__(self, step: float = 0.99, **options: Any):
        self._first = {**SETTINGS["horizon"], "max_step_fraction": step, **options}
        self._second = {**SETTINGS["horizon, carefully"], **options}
        self._clarabel: Clarabel | None = None

    def __call__(self, program: ConicProgram) -> ConicAnswer:
        """Solve a program; the answer is nan where there is none.

        Raises:
            ValueError: an option that Clarabel does not have.
        """
        began = perf_counter()
        if self._clarabel is None or self._clarabel.program.cones != program.cones:
            self._clarabel = Clarabel(program, self._first)
        else:
            self._clarabel.replace(program)
        answer = self._clarabel.solve(began)
        if answer.residual <= POOR:
            return answer
        again = Clarabel(program, self._second).solve(began)
        again = replace(again, message=f"{again.message}, carefully")
        proven = "infeasible" in again.message.lower() and not answer.residual <= USABLE
        return again if proven or (not answer.residual <= again.residual and np.isfinite(again.residual)) else answer
