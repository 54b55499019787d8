"""Sweeps: thousands of worlds of a scenario whose object is not known exactly, and what comes of them."""
