"""Logs out of files, and out of runs, to learn from."""
