"""Planning over a horizon: the program, its solution by sequential convex programming, and the receding horizon."""
