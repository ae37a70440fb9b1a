# make demo: set everything up, explore the paper's wire with the simulated finger, say where the report is.
# make test: set everything up and pass the tests.
# Only python3 (3.11 or newer) and make are needed beforehand; another Python: make PYTHON=python3.12 demo

PYTHON ?= python3
BIN := .venv/bin
SCENE := assets/scenes/wire_on_plate.toml
DEMO := out/wire_on_plate
SOURCES := $(shell find explore3d planners mapping hw -name "*.py") $(wildcard assets/meshes/*)
SETUP := pyproject.toml $(wildcard .ci/*.py)

.PHONY: setup setup-dev demo test test-all lint docs clean

setup: .venv/.ready

setup-dev: .venv/.ready-dev

.venv/.ready: $(SETUP)
	@$(PYTHON) .ci/setup.py
	@touch $@

.venv/.ready-dev: $(SETUP)
	@$(PYTHON) .ci/setup.py dev
	@touch .venv/.ready $@

demo: $(DEMO)/report.html
	@echo "The report is $(abspath $(DEMO)/report.html)"

$(DEMO)/report.html: $(SCENE) $(SOURCES) | setup
	@$(BIN)/explore3d run $(SCENE) --out $(DEMO)

test: setup-dev
	@$(BIN)/python -m pytest -n 2 --dist loadfile

test-all: setup-dev
	@$(BIN)/python -m pytest -n 2 --dist loadfile -m "slow or not slow"

lint: setup-dev
	@$(BIN)/ruff check .
	@$(BIN)/ruff format --check .
	@$(BIN)/mypy

docs: setup-dev
	@$(BIN)/python docs/build_site.py

clean:
	rm -rf .venv out build dist *.egg-info .pytest_cache .mypy_cache .ruff_cache .hypothesis
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
