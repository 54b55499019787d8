# Every target works from a bare checkout: it needs python >= 3.11 and make, and makes .venv itself.
PYTHON ?= python3
BIN := .venv/bin
STAMP := .venv/.installed

.PHONY: demo test check bench evidence figures clean

demo: $(STAMP)
	@mkdir -p out
	$(BIN)/pivoting example --figure out/solution-space.png
	$(BIN)/pivoting run pivot-2d --out out
	@echo "the solution space: out/solution-space.png; the recording: $(BIN)/rerun out/pivot-2d.rrd"

test: $(STAMP)
	$(BIN)/python -m pytest

check: $(STAMP)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

bench: $(STAMP)
	$(BIN)/python benchmarks/bench_loop.py --json benchmarks/results/loop.json

# 200,000 random problems and 256 perturbed worlds of every scenario: minutes, so not in `make test`.
evidence: $(STAMP)
	$(BIN)/python benchmarks/evidence.py --json benchmarks/results/evidence.json

# The pictures that README.md shows.
figures: $(STAMP)
	$(BIN)/pivoting example --figure docs/solution-space.png

$(STAMP): pyproject.toml
	$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "python >= 3.11 is needed: make PYTHON=...")'
	$(PYTHON) -m venv .venv
	$(BIN)/pip install --quiet --disable-pip-version-check --upgrade pip
	$(BIN)/pip install --quiet --disable-pip-version-check -e '.[dev]'
	@mkdir -p out
	@touch $@

clean:
	rm -rf .venv out build dist *.egg-info
