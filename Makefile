# The two commands of the README, and what a developer needs. Each target sets itself up on a fresh machine.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
# What a robot may need; `docs` and `bench` come with the targets that want them.
EXTRAS := sim,dashboard,thymio,foxglove
STAMP := $(VENV)/.installed
ROS_VENV := .venv-ros
ROS_STAMP := $(ROS_VENV)/.installed
BENCH_STAMP := $(VENV)/.bench-installed
DOCS_STAMP := $(VENV)/.docs-installed

.PHONY: demo test test-slow lint bench bench-short studies-quick docs docs-site install ros-venv clean

install: $(STAMP)

$(STAMP): pyproject.toml constraints.txt
	@$(PYTHON) -c 'import sys; v = sys.version_info; sys.exit(None if (3, 11) <= v < (3, 14) else f"llrp-online needs Python 3.11 to 3.13, this is {v.major}.{v.minor}: run make PYTHON=python3.11")'
	@$(PYTHON) -c 'import venv, ensurepip' 2>/dev/null || { echo "The venv module is missing: apt-get install python3-venv"; exit 1; }
	$(PYTHON) -m venv $(VENV)
	$(BIN)/pip install --quiet --disable-pip-version-check --constraint constraints.txt --editable '.[$(EXTRAS),dev]'
	@touch $(STAMP)

demo: $(STAMP)
	$(BIN)/llrp demo $(DEMO_ARGS)

# On every core what only computes; then, one after the other, what wants the clock to itself.
PYTEST := $(BIN)/python -m pytest -W error
ON_EVERY_CORE := -n logical --dist loadfile

test: $(STAMP)
	$(PYTEST) $(ON_EVERY_CORE) -m "not live and not slow"
	$(PYTEST) -m "live and not slow"

test-slow: $(STAMP)
	$(PYTEST) $(ON_EVERY_CORE) -m "slow and not live"
	$(PYTEST) -m "slow and live"

lint: $(STAMP)
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/pyright
	$(BIN)/lint-imports

$(BENCH_STAMP): $(STAMP)
	$(BIN)/pip install --quiet --disable-pip-version-check --constraint constraints.txt --editable '.[$(EXTRAS),bench,dev]'
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

# Every study in its small form, from nothing: that each runs, and which takes more than the three minutes it may.
studies-quick: $(STAMP)
	@rm -rf build/studies && mkdir -p build
	@set -e; for study in $$($(BIN)/python -c 'from agents.commands.experiment import STUDIES; print(*STUDIES)'); do \
		began=$$(date +%s); \
		$(BIN)/llrp experiment $$study --quick --output build/studies/$$study > build/$$study.txt || { cat build/$$study.txt; exit 1; }; \
		took=$$(( $$(date +%s) - began )); echo "$$study: $$took s; $$(tail -1 build/$$study.txt)"; \
		[ $$took -lt 180 ] || echo "$$study --quick took $$took s, where 180 are allowed"; \
	done

docs: $(STAMP)
	$(BIN)/python docs/generate.py

$(DOCS_STAMP): $(STAMP)
	$(BIN)/pip install --quiet --disable-pip-version-check --constraint constraints.txt --editable '.[$(EXTRAS),docs,dev]'
	@touch $(DOCS_STAMP)

# A warning is an error, and so is what comes from elsewhere. The search works where the pages are served:
# python3 -m http.server --directory build/site
docs-site: $(DOCS_STAMP)
	$(BIN)/zensical build --strict --clean
	@! grep -rE '<(script|link|img)[^>]*(src|href)="(https?:)?//' build/site --include='*.html'

# Clients of ROS 2 that the tests talk to, and `llrp ros2`: half a gigabyte, apart. What the project itself needs is
# taken from its own environment.
ros-venv: $(ROS_STAMP)

$(ROS_STAMP): $(STAMP)
	$(PYTHON) -m venv $(ROS_VENV)
	$(ROS_VENV)/bin/pip install --quiet --disable-pip-version-check --constraint constraints.txt \
		ros-rclpy ros-rmw-fastrtps-cpp ros-sensor-msgs ros-nav-msgs ros-geometry-msgs ros-std-msgs ros-diagnostic-msgs \
		eclipse-zenoh pyzeros zenoh-ros2-sdk
	$(BIN)/python -c 'import site; print(*site.getsitepackages(), sep="\n")' \
		> "$$($(ROS_VENV)/bin/python -c 'import site; print(site.getsitepackages()[0])')/llrp.pth"
	@touch $(ROS_STAMP)

clean:
	rm -rf $(VENV) $(ROS_VENV) build .cache *.egg-info .pytest_cache .hypothesis .ruff_cache
