# make demo   run the main job on data it makes itself
# make test   run all tests
# make lint   check format, style and types
# make bench  measure speed and accuracy beside other libraries
# The first call makes a virtual environment in $(VENV) and installs into it.

VENV ?= .venv
PYTHON ?= python3
BIN := $(VENV)/bin

.PHONY: demo test lint bench clean

$(VENV)/.made:
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --upgrade pip
	touch $@

$(VENV)/.%: $(VENV)/.made pyproject.toml
	$(BIN)/python -m pip install --quiet --editable ".[all,$*]"
	touch $@

demo: $(VENV)/.test
	$(BIN)/northdown demo --out demo-output

test: $(VENV)/.test
	$(BIN)/python -m pytest -n auto

lint: $(VENV)/.lint
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy

bench: $(VENV)/.peers
	$(BIN)/python benchmarks/speed.py
	$(BIN)/python benchmarks/accuracy.py
	$(BIN)/python benchmarks/flagship.py --part accuracy,ablation,coverage,time

clean:
	rm -rf $(VENV) demo-output benchmarks/_build
