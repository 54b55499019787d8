"""The solvers: wrench problems and horizons as conic programs; the calls of Clarabel, qpsolvers and the closed form."""
