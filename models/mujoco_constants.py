"""Constants of MuJoCo's that its Python module does not have."""

LEAST_FRICTION = 1e-5  # mjMINMU: a coefficient of 0 counts as this
