# The two commands of the README, and what a developer needs. Each target sets itself up on a fresh machine.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/.installed
BENCH_STAMP := $(VENV)/.bench-installed

.PHONY: demo test test-fast lint bench bench-short docs install clean

install: $(STAMP)

$(STAMP): pyproject.toml constraints.txt
	@$(PYTHON) -c 'import sys; v = sys.version_info; sys.exit(None if (3, 11) <= v < (3, 14) else f"llrp-online needs Python 3.11 to 3.13, this is {v.major}.{v.minor}: run make PYTHON=python3.11")'
	@$(PYTHON) -c 'import venv, ensurepip' 2>/dev/null || { echo "The venv module is missing: apt-get install python3-venv"; exit 1; }
	$(PYTHON) -m venv $(VENV)
	$(BIN)/pip install --quiet --disable-pip-version-check --constraint constraints.txt --editable '.[sim,dashboard,dev]'
	@touch $(STAMP)

demo: $(STAMP)
	$(BIN)/llrp demo $(DEMO_ARGS)

test: $(STAMP)
	$(BIN)/python -m pytest -W error

test-fast: $(STAMP)
	$(BIN)/python -m pytest -W error -m "not slow"

lint: $(STAMP)
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/pyright
	$(BIN)/lint-imports

$(BENCH_STAMP): $(STAMP)
	$(BIN)/pip install --quiet --disable-pip-version-check --constraint constraints.txt --editable '.[bench,sim,dashboard,dev]'
	@touch $(BENCH_STAMP)

# The table is written whatever the ratios are; a ratio that is missed then fails the command.
bench: $(BENCH_STAMP)
	@mkdir -p runs
	$(BIN)/python -m pytest bench -v --timeout=1800 --benchmark-json=runs/bench.json $(BENCH_ARGS); \
	status=$$?; $(BIN)/python bench/table.py runs/bench.json --output docs/BENCHMARKS.md && exit $$status

bench-short: $(BENCH_STAMP)
	@mkdir -p runs
	$(BIN)/python -m pytest bench --short --timeout=600 --benchmark-json=runs/bench-short.json $(BENCH_ARGS); \
	status=$$?; $(BIN)/python bench/table.py runs/bench-short.json && exit $$status

docs: $(STAMP)
	$(BIN)/python docs/generate.py

clean:
	rm -rf $(VENV) build *.egg-info .pytest_cache .hypothesis .ruff_cache
