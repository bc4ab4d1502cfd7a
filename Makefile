# One door to the project: CI calls these targets and nothing else.
SHELL := /bin/bash
.SHELLFLAGS := -eu -o pipefail -c
.DEFAULT_GOAL := help

VENV := .venv
BIN := $(VENV)/bin
PIP := $(BIN)/python -m pip --disable-pip-version-check install --quiet
# 3.11 first: the version CI runs. Names that exist but do not run (pyenv shims) are passed over.
CANDIDATES := $(PYTHON) python3.11 python3.12 python3.13 python3 python python3.14
DATA ?= data/reman18
DEMO_OUTPUT ?= demo_output
SYNTHETIC ?= runs/synthetic
MODELS ?= runs/models

export PIP_PROGRESS_BAR := off
export MPLBACKEND := Agg

# Blender as a Python module: its wheels are made for one Python, and for the numpy that it ships
BLENDER_VENV := .venv-blender
BLENDER_PYTHON ?= python3.11

.PHONY: help setup fmt check test test-all test-blender test-cluster demo evaluate models trust bench bench-registration bench-factory docs clean

help: ## show this list
	@awk -F ':.*## ' '/^[a-z-]+:.*## / {printf "  make %-18s %s\n", $$1, $$2}' Makefile

setup: $(VENV)/.dev.stamp ## create .venv with everything development needs

fmt: $(VENV)/.dev.stamp ## format the code and fix what ruff can fix
	$(BIN)/ruff check --fix --quiet .
	$(BIN)/ruff format --quiet .

check: $(VENV)/.dev.stamp ## lint, format, types, import layers
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/basedpyright
	$(BIN)/lint-imports

# one thread per worker: two workers fill two cores, and results do not depend on threads
test: $(VENV)/.dev.stamp ## run the tests (set-up included)
	@OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 $(BIN)/python -m pytest -n 2 -m "not slow"

test-all: $(VENV)/.dev.stamp ## run the tests, the slow ones too, with examples of its own
	@OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 $(BIN)/python -m pytest -n 2 \
	  --hypothesis-profile=default

test-blender: $(BLENDER_VENV)/.stamp ## test the Blender add-on in headless Blender (800 MB the first time)
	@OMP_NUM_THREADS=1 $(BLENDER_VENV)/bin/python -m tests.blender.run

test-cluster: $(VENV)/.dev.stamp ## test data sets on a Ray cluster of this machine, a node killed
	$(PIP) -e ".[dev,train,synth,viewer,service,ros2,cluster]"
	@OMP_NUM_THREADS=1 $(BIN)/python -m pytest tests/cluster

demo: $(VENV)/.core.stamp ## build the shipped motor's prior and locate its bolts in the shipped scan
	@$(BIN)/boltpose demo -o $(DEMO_OUTPUT)

evaluate: $(VENV)/.dev.stamp ## leave-one-family-out on reman18 (long); writes docs/results.md
	$(BIN)/boltpose evaluate --data $(DATA)

models: $(VENV)/.dev.stamp ## make synthetic data, then train, calibrate and describe all networks (hours)
	$(BIN)/boltpose synth motors -n 240 --seed 0 --workers 2 -o $(SYNTHETIC)/motors
	$(BIN)/boltpose synth scenes -n 80 --views 4 --seed 0 --workers 2 -o $(SYNTHETIC)/scenes
	for task in parts:motors scene:scenes; do \
	  $(BIN)/boltpose train $${task%:*} --data $(SYNTHETIC)/$${task#*:} --recipe many \
	    --test $(DATA) --workers 2 --out $(MODELS)/synthetic_$${task%:*}; \
	  $(BIN)/boltpose train $${task%:*} --data $(DATA) --workers 2 --leave-out each \
	    --pretrained $(MODELS)/synthetic_$${task%:*} --out $(MODELS)/$${task%:*}; \
	  $(BIN)/boltpose train $${task%:*} --data $(DATA) \
	    --pretrained $(MODELS)/synthetic_$${task%:*} --out $(MODELS)/$${task%:*}/shipped; \
	done
	$(BIN)/python -m boltpose.training ship --data $(DATA) \
	  --parts $(MODELS)/parts --scene $(MODELS)/scene
	$(BIN)/python -m boltpose.training calibrate --data $(DATA)
	$(BIN)/python -m boltpose.training scores --data $(DATA)
	$(BIN)/python -m boltpose.training cards --data $(DATA)

bench: $(VENV)/.dev.stamp demo ## time the stages, pages and service; compare registration methods (hours)
	$(PIP) -e ".[bench]"
	for script in benchmarks/bench_*.py; do $(BIN)/python "$$script"; done

bench-registration: $(VENV)/.dev.stamp ## registration methods of others beside ours, on 72 views (long)
	$(PIP) -e ".[bench]"
	$(BIN)/python benchmarks/bench_registration.py

trust: $(VENV)/.dev.stamp ## what a pose may be trusted with: hard cases, bolt states, sigmas, variants, views (hours)
	$(PIP) -e ".[bench]"
	$(BIN)/boltpose synth scenes -n 80 --views 4 --seed 0 --workers 2 -o $(SYNTHETIC)/scenes
	$(BIN)/boltpose synth motors -n 126 --seed 3000 --workers 2 -o $(SYNTHETIC)/motors_3000
	$(BIN)/boltpose synth scenes -n 12 --views 1 --angles 4 --seed 4000 --workers 2 \
	  -o runs/several_views/scenes
	for seed in 2000 2001; do $(BIN)/python -m boltpose.synthesis.changed_bolts -n 16 \
	  --clampings 2 --seed $$seed -o $(SYNTHETIC)/changed_$$seed; done
	$(BIN)/python -m boltpose.evaluation.hard_run --factory $(SYNTHETIC)/scenes --workers 2
	$(BIN)/python -m boltpose.evaluation.uncertainty_run
	$(BIN)/python -m boltpose.evaluation.bolt_state --reman18 $(DATA) \
	  --changed $(SYNTHETIC)/changed_2000 --changed-test $(SYNTHETIC)/changed_2001
	$(BIN)/python -m boltpose.evaluation.variants_run --factory $(SYNTHETIC)/motors_3000
	$(BIN)/python -m boltpose.evaluation.several_views_run
	$(BIN)/boltpose reproduce table1
	$(BIN)/boltpose evaluate --report-only

bench-factory: $(VENV)/.dev.stamp ## time motors, scans and views, beside trimesh and Open3D
	$(PIP) -e ".[bench,synth]"
	OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 $(BIN)/python benchmarks/bench_factory.py

docs: $(VENV)/.dev.stamp ## write the tree in ARCHITECTURE.md and docs/results.md again
	$(BIN)/python -m tests.support.tree
	$(BIN)/boltpose evaluate --report-only

clean: ## remove what the targets above made, but not .venv
	rm -rf build dist $(DEMO_OUTPUT) .pytest_cache .ruff_cache .hypothesis .import_linter_cache

# the core alone: what a robot cell installs, and all that the demo needs
$(VENV)/.core.stamp: pyproject.toml
	@python=""; \
	for name in $(CANDIDATES); do \
	  if "$$name" -c 'import sys, venv, ensurepip; sys.exit(sys.version_info < (3, 11))' 2>/dev/null; \
	  then python="$$name"; break; fi; \
	done; \
	if [ -z "$$python" ]; then \
	  echo "no Python >= 3.11 with venv found; set PYTHON=/path/to/python" >&2; exit 1; fi; \
	if [ ! -x $(BIN)/python ]; then echo "creating $(VENV) with $$python"; "$$python" -m venv $(VENV); fi
	@echo "installing boltpose into $(VENV)"
	@$(PIP) -e .
	@touch $@

$(VENV)/.dev.stamp: pyproject.toml | $(VENV)/.core.stamp
	@echo "installing the development tools into $(VENV)"
	@$(PIP) -e ".[dev,train,synth,viewer,service,ros2]"
	@touch $@

# without boltpose's own dependencies: they want numpy 2, Blender 4.5 has numpy 1.26
$(BLENDER_VENV)/.stamp: tests/blender/requirements.txt
	@"$(BLENDER_PYTHON)" -c 'import sys; sys.exit(sys.version_info[:2] != (3, 11))' || \
	  { echo "Blender 4.5 needs Python 3.11; set BLENDER_PYTHON=/path/to/python3.11" >&2; exit 1; }
	@if [ ! -x $(BLENDER_VENV)/bin/python ]; then \
	  echo "creating $(BLENDER_VENV)"; "$(BLENDER_PYTHON)" -m venv $(BLENDER_VENV); fi
	@echo "installing Blender as a Python module into $(BLENDER_VENV)"
	@$(BLENDER_VENV)/bin/python -m pip --disable-pip-version-check install --quiet \
	  -r tests/blender/requirements.txt
	@$(BLENDER_VENV)/bin/python -m pip --disable-pip-version-check install --quiet --no-deps -e .
	@touch $@
