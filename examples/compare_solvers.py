"""Solve one problem by every method that is installed; each answer is certified by the same residual."""

import numpy as np
from pivoting import Body, Contact, Law, WrenchController, solve
from pivoting.controller import Motion, SolveError, methods

corner = Contact(point=(-0.5, -0.5), mu=0.3)
controller = WrenchController(Body(mass=1.0, inertia=1 / 6), [corner], Law.static(), gravity=(0, -10), Q_w=np.eye(3))
problem = controller.problem(Motion(np.deg2rad(70)))

print(f"{'method':14} {'objective':>12} {'KKT residual':>13} {'us':>8}")
for method in methods():
    try:
        solve(problem, method)  # the first call imports the solver
        answer = solve(problem, method)
    except SolveError as refused:
        print(f"{method:14} refused: {refused}")
    else:
        print(f"{method:14} {answer.objective:12.8f} {answer.residual:13.1e} {1e6 * answer.seconds:8.1f}")
