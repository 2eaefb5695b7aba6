# Two commands for everyone: `make fly` and `make test`. Each makes the environment it needs.
PYTHON ?= $(shell command -v python3.11 || command -v python3)
VENV := .venv
BIN := $(VENV)/bin
READY := $(VENV)/.ready

.PHONY: fly test check lint types results paper schema diagrams clean

fly: $(READY)
	$(BIN)/rebound fly missions/wall.yaml --sim

test: $(READY)
	$(BIN)/python -m pytest

check: lint types test

lint: $(READY)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

types: $(READY)
	$(BIN)/mypy

results: $(READY)
	$(BIN)/rebound results

# Every version is pinned in requirements.txt, so that a fresh machine gets what was tested.
$(READY): pyproject.toml requirements.txt
	test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -r requirements.txt
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps --no-build-isolation -e .
	touch $(READY)

paper: $(READY)
	$(BIN)/rebound paper --seeds 50

schema: $(READY)
	$(BIN)/rebound check --schema > missions/schema.json

diagrams: $(READY)
	$(BIN)/python -m rebound_cli.diagrams docs/architecture.md

clean:
	rm -rf $(VENV) .pytest_cache .mypy_cache .ruff_cache runs
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
