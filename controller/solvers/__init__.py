"""The solvers: conic programs of wrench problems, and the calls of Clarabel, qpsolvers and the closed forms."""
