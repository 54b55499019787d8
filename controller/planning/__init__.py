"""Planning over a horizon: its program, the solution by sequential convex programming, and the receding horizon."""
