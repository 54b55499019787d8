"""`python -m pivoting.sim` is the command line."""

from pivoting.sim.cli import main

if __name__ == "__main__":
    main()
