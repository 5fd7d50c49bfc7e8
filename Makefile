# Everything happens inside .venv; nothing else is installed or exported.
SHELL := /bin/sh
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/.setup-done
ARGS ?=
# Set-up leaves the libraries uncompiled. Where Python may not write, each process would compile them
# again: seconds of each start.
unexport PYTHONDONTWRITEBYTECODE

# What an installation is made of. The code itself is installed editable and needs no re-run.
INSTALLED_FROM := pyproject.toml package.xml Makefile $(shell find ros -type f)

.DEFAULT_GOAL := help
.PHONY: help setup fly test long slow mutants numbers docs lint clean

help:            ## this list
	@sed -n 's/^\([a-z]*\):.*##/  make \1\t/p' Makefile

setup: $(STAMP)  ## virtual environment, dependencies and the project in .venv
	@:

fly: setup       ## fly the pick-and-place mission; options: make fly ARGS="--controller asmc1"
	@$(BIN)/uam fly $(ARGS)

# Nodes mostly wait for each other, so four tests run at once on two cores. Groups: tests/conftest.py.
AT_ONCE := -n 4 --dist loadgroup --no-loadscope-reorder
MARKS := not slow and not long
test: setup      ## all but the long and the slow tests; options: make test ARGS="tests/unit -x"
	@$(BIN)/python -m uam_lab.flights.direct.warm_up
	@$(BIN)/python -m pytest $(if $(ARGS),$(ARGS),-m "$(MARKS)" $(AT_ONCE) tests)

long: setup      ## further flights, moments and seeds, examples among them; ten minutes more
	@$(BIN)/python -m pytest -m long $(AT_ONCE) tests

slow: setup      ## the slow tests: whole missions, browser, PX4 if it is there; half an hour
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check -e ".[browser]"
	@$(BIN)/python -m pytest -m slow tests

mutants: setup   ## do the unit tests notice small errors? ten minutes; make mutants ARGS="laws/"
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check -e ".[mutation]"
	@$(BIN)/python benchmarks/mutants.py $(ARGS)

numbers: setup   ## fly the numbers of the documentation again, list what moved; half an hour
	@$(BIN)/python benchmarks/numbers_of_docs.py $(ARGS)

docs: setup      ## the documentation as a searchable site, build/site/index.html; fails where a link is broken
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check -e ".[docs]"
	@$(BIN)/zensical build --clean --strict

lint: setup      ## style, errors that need no run, and who may import whom
	@$(BIN)/ruff check . && $(BIN)/ruff format --check --quiet . && $(BIN)/lint-imports --no-cache --no-logo

clean:           ## remove what setup, tests and colcon made; results/ stays
	rm -rf $(VENV) build install log .pytest_cache .hypothesis .ruff_cache
	find . -name __pycache__ -type d -prune -exec rm -rf {} +

# Where ROS 2 is already there (a sourced apt installation) its own rclpy is used, not the wheels.
# --no-compile: Python compiles a module when it is first imported, and most never are. What a flight
# imports and its control path are compiled at the end, so that the first one starts like the others.
$(STAMP): $(INSTALLED_FROM)
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null || { \
	  echo "setup: Python 3.11 or newer is needed and $(PYTHON) is not; try make PYTHON=python3.12 $(MAKECMDGOALS)" >&2; exit 2; }
	@test -x $(BIN)/python || $(PYTHON) -m venv $(VENV) || { rm -rf $(VENV); \
	  echo "setup: $(PYTHON) -m venv failed; on Debian and Ubuntu: apt install python3-venv" >&2; exit 2; }
	@extras=ros,test; $(BIN)/python -c 'import rclpy' 2>/dev/null && test -n "$$ROS_DISTRO" && extras=test; \
	  echo "setup: installing uam[$$extras] into $(VENV), once (a few minutes)"; \
	  $(BIN)/python -m pip install --quiet --disable-pip-version-check --no-compile -e ".[$$extras]" || { \
	  echo "setup: the installation failed; the lines above say why" >&2; exit 2; }
	@$(BIN)/python -m uam_lab.flights.direct.warm_up
	@$(BIN)/python -c "import uam_lab.flights.ros.forker, uam_lab.report.build"
	@touch $@
