# Three commands, each complete by itself: `make demo`, `make test` and `make test-all`.
PYTHON ?= python3
BIN := .venv/bin
# a worker that has no tests left takes those that another has not begun
PYTEST := $(BIN)/python -m pytest -n 2 --dist worksteal

# What `make docs` runs: make docs PAGES="docs/guides/live.md README.md"
PAGES ?= README.md docs

# Checks of types and imports, and the installation of the browser, run side by side.
MAKEFLAGS += --jobs=2

.PHONY: demo test test-all test-plugins check style types imports docs docs-site bench format setup browser clean

demo: .venv/installed  ## from nothing to a table, a figure and a replay page
	$(BIN)/s2c2a demo --out runs/demo --overwrite

test: check  ## style, types, imports, and the tests that are not marked slow
	$(PYTEST) -m "not slow"

test-all: check browser  ## style, types, imports, and every test
	$(PYTEST)

check: style types imports  ## style, types, imports

style: setup
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .

types: setup
	$(BIN)/mypy

imports: setup
	$(BIN)/lint-imports

test-plugins:  ## the plug-in of LeRobot, in an environment of its own, into which LeRobot is downloaded
	$(PYTHON) -m venv plugins/.venv
	plugins/.venv/bin/pip install . ./plugins/lerobot_robot_s2c2a pytest
	plugins/.venv/bin/python -m pytest plugins/lerobot_robot_s2c2a

docs: docs-site  ## the site with its links checked, then every command and Python block of PAGES, by default of all
	$(BIN)/python -m pytest -p tools.page_blocks -o addopts= -o filterwarnings= -v -rs $(PAGES)
	@echo "the site is in $(CURDIR)/site; start with site/index.html"

docs-site: setup  ## the documentation site in site/, with its links checked
	NO_COLOR=1 PYTHONPATH=. $(BIN)/zensical build --clean
	$(BIN)/python -m tools.check_site

bench: setup  ## how fast everything is, one process a file; options in BENCH="..."
	@mkdir -p runs/bench; failed=0; for part in benchmarks/bench_*.py; do \
		$(BIN)/python -m pytest $$part --benchmark-json=runs/bench/$$(basename $$part .py).json $(BENCH) || failed=1; \
	done; exit $$failed

format: setup
	$(BIN)/ruff format .
	$(BIN)/ruff check --fix .

setup: .venv/ready

browser:  ## what the tests of the pages need; they are skipped without it, and say so
	@command -v chromium > /dev/null || { [ "$$(id -u)" = 0 ] && command -v apt-get > /dev/null && \
		apt-get update -q && apt-get install -y -q --no-install-recommends chromium; } || \
		echo "no Chromium here, and no right to install it: the tests of the pages will be skipped"

.venv/ready: .venv/installed  # what the checks and the tests need, too
	$(BIN)/pip install -c constraints.txt -e ".[dev]" -e ./experiments
	touch .venv/ready

.venv/installed: pyproject.toml experiments/pyproject.toml constraints.txt  # package, experiments and live page
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
		{ echo "$(PYTHON) is older than 3.11; name another one: make $(MAKECMDGOALS) PYTHON=python3.12"; exit 1; }
	$(PYTHON) -m venv .venv
	$(BIN)/pip install -c constraints.txt -e ".[live]" -e ./experiments
	touch .venv/installed

clean:
	rm -rf .venv .pytest_cache .ruff_cache .hypothesis
