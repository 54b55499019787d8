"""`python -m pivoting.sim` is the command line, as `python -m pivoting` is."""

from pivoting.__main__ import main

if __name__ == "__main__":
    main()
