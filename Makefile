# Needs only make and Python 3.11 or newer. `make help` lists the targets.

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
PIP := $(BIN)/python -m pip --quiet --disable-pip-version-check --no-input

# Extra options, e.g. `make test PYTEST_ARGS="-k rpem -x"` or `make lock LOCK_ARGS=--upgrade`.
PYTEST_ARGS ?= -n auto --dist worksteal
LOCK_ARGS ?=

# Two stamps: new pins rebuild the environment, a change in pyproject.toml alone only redoes the editable install.
PINS := $(VENV)/.pins
READY := $(VENV)/.ready

.DEFAULT_GOAL := help
.DELETE_ON_ERROR:
.PHONY: help install demo live-demo test pytest debian browser postgresql check lint types format docs bench bench-discovery bench-discovery-quick bench-live bench-lanes bench-measured lock clean

help: ## Show this list
	@awk -F ':.*## ' '/^[a-z-]+:.*## / { printf "  make %-21s %s\n", $$1, $$2 }' $(MAKEFILE_LIST)

install: $(READY) ## Create .venv with the pinned dependencies and this project
	@echo "Installed: run $(BIN)/adaptive-flot --help"

demo: $(READY) ## Run the demonstration
	@$(BIN)/python -m adaptive_flot.demo

# What Debian gives is installed beside what Python's index gives, and types are checked beside the tests. Those keep all
# cores busy: a further thread of the linear algebra would only be in their way. Programs that they start find the
# bytecode of those before.
test: ## Run all checks and the test suite
	@$(MAKE) --no-print-directory -j 2 lint debian
	@$(MAKE) --no-print-directory -j 2 types pytest

debian:  # one after the other: there is one lock
	@$(install_chromium)
	@$(install_postgresql)

pytest: export OPENBLAS_NUM_THREADS = 1
pytest: export PYTHONDONTWRITEBYTECODE =
pytest: $(READY)
	$(BIN)/python -m pytest $(PYTEST_ARGS)

browser: ## Install Chromium for the tests of pages where this system lets us; without it they are skipped
	@$(install_chromium)

postgresql: ## Install PostgreSQL for the test of the live link's memory, where this system lets us; else it is skipped
	@$(install_postgresql)

check: lint types ## Run the static checks: ruff, mypy, import contracts

lint: $(READY)
	$(BIN)/ruff check --quiet .
	$(BIN)/ruff format --quiet --check .
	$(BIN)/lint-imports --no-logo

types: $(READY)
	$(BIN)/mypy

format: $(READY) ## Format the code and apply ruff's safe fixes
	$(BIN)/ruff check --fix --quiet .
	$(BIN)/ruff format --quiet .

docs: $(READY) ## Build the documentation site in build/docs
	@rm -rf docs/reference/generated  # a module that has moved leaves its page behind
	$(BIN)/python -m sphinx -q -W --keep-going -j auto -b html docs build/docs
	@echo "Built: build/docs/index.html"

live-demo: $(READY) ## Run a test plant, a live link and its page until Ctrl-C
	@$(BIN)/python -m adaptive_flot.live.demo

bench: $(READY) ## Run the benchmarks
	@$(BIN)/python -m benchmarks

bench-discovery: $(READY) ## Judge 300 records with a hidden effect, rivals beside it (hours)
	@$(BIN)/python -m benchmarks.hidden_effects full $(BENCH_ARGS)

bench-discovery-quick: $(READY) ## The same on the first 30 records, one rival (minutes)
	@$(BIN)/python -m benchmarks.hidden_effects full --count 30 --method drift --out results/hidden-effects-quick $(BENCH_ARGS)

bench-live: $(READY) ## The live link under faults: unsafe writes, lost rows, times (minutes)
	@$(BIN)/python -m benchmarks.live $(BENCH_ARGS)

bench-lanes: $(READY) ## Many members side by side, beside SciPy and (BENCH_ARGS="--jax PYTHON") JAX (minutes)
	@$(BIN)/python -m benchmarks.timing.lanes $(BENCH_ARGS)

bench-measured: $(READY) ## Discovery on measured records and shared examples in ../shared (minutes)
	@$(BIN)/python -m benchmarks.real_records.measured $(BENCH_ARGS)
	@$(BIN)/python -m benchmarks.real_records.mining_plant
	@$(BIN)/python -m benchmarks.real_records
	@$(BIN)/python -m benchmarks.real_records.unchanged

lock: ## Pin the dependencies again in requirements.lock (uv, in a throw-away environment)
	@$(require_python)
	@set -e; tmp=$$(mktemp -d); trap 'rm -rf "$$tmp"' EXIT; \
	$(PYTHON) -m venv "$$tmp/venv"; \
	"$$tmp/venv/bin/python" -m pip --quiet --disable-pip-version-check --no-input install 'uv>=0.13'; \
	"$$tmp/venv/bin/uv" pip compile --quiet --no-config --universal --python-version 3.11 --fork-strategy fewest \
	  --generate-hashes --extra dev --custom-compile-command 'make lock' $(LOCK_ARGS) \
	  --output-file requirements.lock pyproject.toml

clean: ## Remove .venv, caches and build output
	rm -rf $(VENV) build dist docs/reference/generated .hypothesis .import_linter_cache .mypy_cache .pytest_cache .ruff_cache
	find . -name __pycache__ -type d -prune -exec rm -rf {} +

$(READY): $(PINS) pyproject.toml
	@$(PIP) install --no-deps --no-build-isolation --editable .
	@touch $@

$(PINS): requirements.lock
	@$(require_python)
	@$(PYTHON) -m venv --clear $(VENV)
	@$(PIP) install --require-hashes --requirement requirements.lock
	@touch $@

define require_python
command -v $(PYTHON) >/dev/null || { \
  echo "adaptive-flot needs Python 3.11 or newer, and '$(PYTHON)' was not found." >&2; \
  echo "Name another one, for example: make PYTHON=python3.12" >&2; exit 1; }; \
$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { \
  echo "adaptive-flot needs Python 3.11 or newer, and '$(PYTHON)' is $$($(PYTHON) --version 2>&1)." >&2; \
  echo "Name another one, for example: make PYTHON=python3.12" >&2; exit 1; }
endef

# Debian, as root, and nothing else: a system of somebody's own is left as it is.
define install_chromium
for name in chromium chromium-browser google-chrome google-chrome-stable; do \
  command -v $$name >/dev/null && exit 0; done; \
if [ "$$(id -u)" = 0 ] && command -v apt-get >/dev/null; then \
  { apt-get -qq update && DEBIAN_FRONTEND=noninteractive apt-get -qq install --yes --no-install-recommends \
    chromium fonts-dejavu-core >/dev/null; } || echo "Chromium could not be installed; tests of pages are skipped" >&2; \
else echo "No Chromium on this system; tests of pages are skipped" >&2; fi
endef

# The test starts a server of its own: no cluster is made by the package, and none is left to run.
define install_postgresql
for place in /usr/lib/postgresql/*/bin $$(echo "$$PATH" | tr : ' '); do \
  test -x "$$place/initdb" && test -x "$$place/pg_ctl" && exit 0; done; \
if [ "$$(id -u)" = 0 ] && command -v apt-get >/dev/null; then \
  { mkdir -p /etc/postgresql-common/createcluster.d && \
    echo 'create_main_cluster = false' > /etc/postgresql-common/createcluster.d/adaptive-flot.conf && \
    apt-get -qq update && DEBIAN_FRONTEND=noninteractive apt-get -qq install --yes --no-install-recommends \
    postgresql >/dev/null; } || echo "PostgreSQL could not be installed; its test is skipped" >&2; \
else echo "No PostgreSQL on this system; its test is skipped" >&2; fi
endef
