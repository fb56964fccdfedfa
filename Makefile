# What a fresh machine needs: Python 3.11 or newer, make and a C compiler. The rest comes from requirements*.lock.
#
#   make demo        the main job on an embedded default, into build/demo
#   make test        the tests that every change must pass: test-fast (in process, two minutes of CPU) and test-system
#   make test-nightly  the long tests that decide accuracy: acceptance, identification, heat, independent programs
#   make release-check  all long tests, property tests with many new examples, 20,000 executions of each fuzzing target
#   make coverage    lines and branches that make test reaches; fails below COVERAGE_MIN percent
#   make check       lint, docs, test
#   make lint        ruff, mypy --strict, the import order
#   make interface  the functions in mrdamper/__init__.py, from the declarations of the jobs
#   make docs        the documentation, into build/docs; a warning is an error
#   make bench       the benchmarks; NAME=peers for one
#   make fuzz        20,000 executions of each fuzzing target; NAME=card for one, RUNS=1000 for fewer
#   make audit       asks which pinned versions have a known vulnerability; needs the network
#   make wheel       a wheel, into dist        make lock         renew requirements.lock (asks the registry)

PYTHON ?= python3
VENV   := .venv
BIN    := $(VENV)/bin
RUN    := $(BIN)/python
# Two workers: limits in the tests are on CPU time, which a neighbour does not lengthen as it does the clock.
# Tests of one module share a worker, and what the module starts.
PYTEST_ARGS ?= -n 2 --dist loadscope
# Property tests draw new examples every day; SEED=... draws those of another day again.
SEED ?= $(shell date -u +%Y%m%d)
override PYTEST_ARGS += --hypothesis-seed=$(SEED)
# Changes of the data that must not change the model selection.
SELECTED := test_file_order_does_not_change_parameters test_time_offset_hardly_changes_fitted_model
# Packages whose nightly tests decide accuracy, and jobs that a page starts.
NIGHTLY ?= $(addprefix tests/,control models rig thermal test_examples.py) \
  $(patsubst %,tests/acceptance/test_%.py,tempered_rig public_rigs tracking asymmetry) \
  $(patsubst %,'tests/acceptance/test_invariances.py::%[selected]',$(SELECTED)) \
  tests/test_docs.py::test_commands_of_page_give_shown_output \
  tests/test_docs.py::test_long_commands_of_page_give_shown_output tests/web/test_user_values.py \
  tests/web/test_worker.py::test_cancel_keeps_best_fit
COVERAGE_MIN ?= 88

export PIP_DISABLE_PIP_VERSION_CHECK := 1
# Compiled once, then read by every worker and every process that the tests start.
export PYTHONDONTWRITEBYTECODE :=

# What the extension and the installed metadata are made of; a change inside a Python file needs no rebuild.
COMPILED := pyproject.toml CMakeLists.txt $(shell find src -name '*.[ch]' 2>/dev/null) cmake/generate_binding.py

.DELETE_ON_ERROR:
.PHONY: help install demo test test-fast test-system test-nightly release-check coverage check lint docs fuzz audit bench interface lock \
  wheel clean FORCE

help:
	@sed -n 's/^#   //p' Makefile

# ------------------------------------------------------------------------------------------------ install

$(VENV)/.made:
	@command -v $(PYTHON) >/dev/null 2>&1 || { \
	  echo "mrdamper needs Python 3.11 or newer, and '$(PYTHON)' is not there; name one: make PYTHON=python3.12 ..." >&2; exit 1; }
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { \
	  echo "mrdamper needs Python 3.11 or newer, and '$(PYTHON)' is $$($(PYTHON) -V 2>&1); name one: make PYTHON=python3.12 ..." >&2; exit 1; }
	@$(RUN) -c 'import sys, pip; sys.exit(sys.version_info < (3, 11))' 2>/dev/null || { \
	  echo "making $(VENV) with $$($(PYTHON) -V 2>&1)"; $(PYTHON) -m venv --clear $(VENV); }
	@touch $@

$(VENV)/.locked: requirements.lock $(VENV)/.made
	@echo "installing from requirements.lock"
	@$(RUN) -m pip install --quiet --require-hashes -r requirements.lock
	@touch $@

$(VENV)/.tested: requirements-test.lock $(VENV)/.locked
	@echo "installing from requirements-test.lock"
	@$(RUN) -m pip install --quiet --require-hashes -r requirements-test.lock
	@touch $@

# The editable installation knows each module by its file: one that came, went or moved needs it anew.
$(VENV)/.modules: FORCE | $(VENV)/.made
	@find src -name '*.py' | LC_ALL=C sort | cmp -s - $@ || find src -name '*.py' | LC_ALL=C sort > $@

$(VENV)/.built: $(COMPILED) $(VENV)/.locked $(VENV)/.modules
	@for each in "$(CC)" cc gcc clang; do command -v "$$each" >/dev/null 2>&1 && exit 0; done; \
	  echo "mrdamper needs a C compiler (cc, gcc or clang; or set CC), and none was found" >&2; exit 1
	@echo "building the extension"
	@PATH="$(CURDIR)/$(BIN):$$PATH" $(RUN) -m pip install --quiet --no-build-isolation --no-deps \
	  --config-settings=build-dir=$(VENV)/cmake --editable .
	@touch $@

install: $(VENV)/.built

# ------------------------------------------------------------------------------------------------ jobs

demo: install
	$(BIN)/mrdamper demo --out build/demo

test: install $(VENV)/.tested
	$(RUN) -m pytest $(PYTEST_ARGS)

test-fast: install $(VENV)/.tested
	$(RUN) -m pytest $(PYTEST_ARGS) -m tier_fast

test-system: install $(VENV)/.tested
	$(RUN) -m pytest $(PYTEST_ARGS) -m tier_system

test-nightly: install $(VENV)/.tested
	$(RUN) -m pytest $(PYTEST_ARGS) -m tier_nightly $(NIGHTLY)

# A test that stands still for so long [s of the clock] shows where, and ends its worker.
NO_HANG := -o faulthandler_timeout=900 -o faulthandler_exit_on_timeout=true --max-worker-restart=1

# Processes that the tests start are measured, too.
coverage: install $(VENV)/.tested
	@rm -rf build/coverage && mkdir -p build/coverage
	$(BIN)/coverage run -m pytest $(PYTEST_ARGS) $(NO_HANG)
	@$(BIN)/coverage combine --quiet && $(BIN)/coverage report --skip-covered --fail-under=$(COVERAGE_MIN)

release-check: install $(VENV)/.tested
	$(RUN) -m pytest $(PYTEST_ARGS) -m "tier_nightly or tier_release"
	$(RUN) -m pytest $(PYTEST_ARGS) -m "property and not tier_release" --hypothesis-profile nightly
	MRDAMPER_QUIET=1 $(RUN) -m pytest -n 0 tests/web
	$(RUN) -m fuzz all -runs=20000 -seed=$(SEED)

fuzz: install $(VENV)/.tested
	$(RUN) -m fuzz $(or $(NAME),all) -runs=$(or $(RUNS),20000)

# Strict: a package of which nothing could be asked is a failure, as is a machine without network.
audit:
	@$(PYTHON) -m venv build/audit
	@build/audit/bin/python -m pip install --quiet pip-audit==2.10.1
	@failed=0; for lock in requirements*.lock; do echo "$$lock"; \
	  build/audit/bin/pip-audit --strict --disable-pip --require-hashes --progress-spinner off -r $$lock || failed=1; \
	done; exit $$failed

bench: install $(VENV)/.tested
	$(RUN) -m bench $(NAME)

check: lint docs test

# One page is made of the demo's summary: the demo runs when there is none.
build/demo/summary.json: | install
	$(BIN)/mrdamper demo --out build/demo

docs: install $(VENV)/.tested build/demo/summary.json
	$(BIN)/sphinx-build --quiet --fail-on-warning --keep-going --jobs 2 --builder html docs build/docs

interface: install $(VENV)/.tested
	$(RUN) -m tests.support.interface

lint: install $(VENV)/.tested
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports

# Names, versions and hashes: no address, so that whatever registry or mirror a machine has will do. X
COMPILE = $(BIN)/uv pip compile --quiet --universal --python-version 3.11 --fork-strategy fewest --generate-hashes \
  --no-emit-index-url --no-emit-find-links --no-annotate --custom-compile-command "make lock" $(LOCK_ARGS) pyproject.toml

lock: $(VENV)/.made
	$(RUN) -m pip install --quiet uv
	$(COMPILE) --extra all --group build --output-file requirements.lock
	$(COMPILE) --extra all --extra test --constraint requirements.lock --output-file requirements-test.lock

wheel: $(VENV)/.made
	$(RUN) -m pip wheel --no-deps --wheel-dir dist .

clean:
	rm -rf build dist docs/_api .mypy_cache .pytest_cache .ruff_cache .import_linter_cache .hypothesis
	find src tests bench examples -name __pycache__ -type d -prune -exec rm -rf {} +
