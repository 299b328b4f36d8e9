# fogwatch: `make` lists what there is. Prerequisites: Python 3.11 or newer with venv, make, git.

SHELL := /bin/bash
.SHELLFLAGS := -euo pipefail -c
.DEFAULT_GOAL := help
.DELETE_ON_ERROR:
MAKEFLAGS += --no-builtin-rules

# The first Python of 3.11 or newer; say `make install PYTHON=python3.13` for another.
PYTHON ?= $(shell for p in python3 python3.14 python3.13 python3.12 python3.11; do \
	if $$p -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null; then echo $$p; break; fi; done)
VENV := .venv
BIN := $(VENV)/bin
PIP := $(BIN)/python -m pip --disable-pip-version-check --no-input

.PHONY: help
help: ## list the targets
	@grep -hE '^[a-z-]+:.*## ' $(MAKEFILE_LIST) | while IFS= read -r line; do \
		printf '  make %-12s %s\n' "$${line%%:*}" "$${line#*## }"; done

.PHONY: install
install: $(VENV)/.installed ## set up .venv with the locked dependencies, and nothing else

.PHONY: demo
demo: install ## five car-like robots, each a process, patrol `site` for ten simulated minutes
	$(BIN)/fogwatch run site --robots 5 --model car --duration 600

.PHONY: browser
browser: ## a browser for the page's tests, where it may be installed; otherwise they are skipped, and say why
	@command -v chromium chromium-browser >/dev/null || { \
		if [ "$$(id -u)" = 0 ] && command -v apt-get >/dev/null; then \
			echo "installing chromium for the page's tests"; \
			apt-get update -qq && DEBIAN_FRONTEND=noninteractive apt-get install -qq -y --no-install-recommends \
				chromium fonts-dejavu-core >/dev/null; \
		else false; fi; } || { echo "there is no chromium, and it could not be installed" >&2; test -z "$${CI:-}"; }

.PHONY: pictures
pictures: install browser ## the README's pictures of the page, anew
	$(BIN)/python docs/pictures/make.py

.PHONY: test
test: install browser ## style, types, layers and every quick test
	$(BIN)/python -m pytest

# Tests of code that runs kernels, and those that call the kernels themselves, without whole patrols and large maps: these
# take about a minute, compiling included.
KERNEL_TESTS := tests/patrol/ground tests/patrol/regions tests/agent tests/worldsim tests/monitor tests/experiments
QUICK_KERNEL_TESTS := $(addprefix tests/patrol/ground/test_,footprint.py fog.py fields.py swept_path.py swept_path_kernels.py) \
	tests/patrol/regions tests/agent/belief tests/agent/routes tests/agent/bodies/test_goal.py \
	tests/agent/policies/potential_field/test_force.py tests/worldsim/test_motion.py \
	tests/monitor/page/test_tiles.py tests/monitor/replay/test_visits.py
BOUNDS := NUMBA_BOUNDSCHECK=1 NUMBA_CACHE_DIR=$(CURDIR)/build/numba-bounds

.PHONY: test-bounds test-bounds-quick
test-bounds: install ## the tests of kernels, with every index checked
	$(BOUNDS) $(BIN)/python -m pytest -m "not processes and not browser" $(KERNEL_TESTS)

test-bounds-quick: install
	$(BOUNDS) $(BIN)/python -m pytest -m "not processes and not browser" $(QUICK_KERNEL_TESTS) \
		-k "not patrols_on_regions and not patrolled_much and not builtin_terrains"

.PHONY: test-network
test-network: install ## a fleet in network namespaces; as root, on Linux (it skips, and says why, where it cannot)
	$(BIN)/python -m pytest -m network -rs

.PHONY: accept
accept: install ## the long checks: what the project promises, measured
	$(BIN)/python -m pytest -m accept --timeout=3600

.PHONY: bench
bench: install ## the speed of the kernels and of a whole decision
	$(BIN)/python -m pytest -m bench --benchmark-enable --benchmark-columns=min,median,max,rounds

.PHONY: lint
lint: install ## style, types and layers alone
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports --no-cache

.PHONY: lock
lock: ## rewrite requirements.lock from pyproject.toml (fetches uv into build/)
	test -x build/uv/bin/uv || { $(PYTHON) -m venv build/uv && build/uv/bin/python -m pip install -q uv; }
	build/uv/bin/uv pip compile --quiet --universal --python-version 3.11 --extra all --extra dev \
		--generate-hashes --no-header --no-annotate --output-file requirements.lock pyproject.toml

.PHONY: clean
clean: ## remove .venv, caches and build products; runs/ stays
	rm -rf $(VENV) build dist .pytest_cache .mypy_cache .ruff_cache .import_linter_cache .hypothesis .benchmarks
	find . -name __pycache__ -type d -not -path './.git/*' -prune -exec rm -rf {} +

# Three steps, so that a changed pyproject.toml does not fetch everything again.
$(VENV)/.created:
	@test -n "$(PYTHON)" || { echo "fogwatch needs Python 3.11 or newer, and none was found: install one, or say make install PYTHON=/path/to/python3" >&2; exit 1; }
	@"$(PYTHON)" -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
		{ echo "fogwatch needs Python 3.11 or newer; $(PYTHON) is $$("$(PYTHON)" --version 2>&1): say make install PYTHON=/path/to/python3" >&2; exit 1; }
	@"$(PYTHON)" -c 'import ensurepip, venv' 2>/dev/null || \
		{ echo "$(PYTHON) has no venv module: install it (on Debian and Ubuntu the package python3-venv)" >&2; exit 1; }
	"$(PYTHON)" -m venv --clear $(VENV)
	@touch $@

$(VENV)/.locked: requirements.lock | $(VENV)/.created
	@echo "installing the locked dependencies into $(VENV): about a minute"
	$(PIP) install --quiet --only-binary :all: --require-hashes --no-deps -r requirements.lock
	@touch $@

$(VENV)/.installed: pyproject.toml $(VENV)/.locked
	$(PIP) install --quiet --no-deps --no-build-isolation -e .
	$(PIP) check
	@touch $@
