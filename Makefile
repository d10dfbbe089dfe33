# `make demo` and `make test` prepare the virtual environment they need, once.
# torch comes from whatever package index pip is configured for; its version is pinned in
# constraints.txt. To get the CPU build on Linux, point pip (PIP_EXTRA_INDEX_URL, PIP_FIND_LINKS)
# at it: the same pin then prefers it.

VENV ?= .venv
PYTHON ?= $(shell python3.11 -c 'print("python3.11")' 2>/dev/null || echo python3)

BIN := $(VENV)/bin
STAMP := $(VENV)/.installed
# Whole files go to one worker, so that a file's kernels are compiled once and not by both.
PYTEST := $(BIN)/python -m pytest -q -n 2 --dist loadfile

.DEFAULT_GOAL := help
.PHONY: help setup demo test test-all lint bench charts failure-map clean

help: ## Show this list
	@sed -n 's/^\([a-z-]*\):.*## \(.*\)/  make \1\t\2/p' $(firstword $(MAKEFILE_LIST)) | expand -t 18

setup: $(STAMP) ## Make the virtual environment with the pinned versions

demo: $(STAMP) ## Train an agent to balance the platform, then compare and show it
	$(BIN)/python -m steelyard_agents.demo

test: lint ## Run the checks and the default tests
	$(PYTEST)

test-all: lint ## Run the checks and all tests, the slow and the training ones too
	$(PYTEST) -m ""

lint: $(STAMP) ## Check style, types and the direction of imports
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports
	$(BIN)/pre-commit validate-config

charts: $(STAMP) ## Chart cost against error on all reference problems
	$(BIN)/python -m benchmarks.laboratory

bench: $(STAMP) ## Measure speed and accuracy against the peers
	$(BIN)/python -m benchmarks.run

failure-map: $(STAMP) ## Draw where methods fail, against the theory
	$(BIN)/python -m benchmarks.failure_map

clean: ## Remove the virtual environment, caches and compiled kernels
	rm -rf $(VENV) build dist .hypothesis .import_linter_cache .mypy_cache .pytest_cache .ruff_cache
	find src envs agents tests benchmarks -name __pycache__ -prune -exec rm -rf {} +

$(STAMP): pyproject.toml constraints.txt
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
		{ echo 'Steelyard needs Python 3.11 or later: make PYTHON=/path/to/python3.11' >&2; exit 1; }
	@echo 'Preparing $(VENV): once, a few minutes'
	@$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check \
		-c constraints.txt -e '.[agents,render,bench,dev]'
	@touch $@
