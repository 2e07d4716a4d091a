# headway: set up, show, test. Everything happens in .venv, made from the hashed lock.
PYTHON ?= python3
BIN := .venv/bin
TEST_ARGS ?= --numprocesses auto --dist worksteal

.PHONY: setup demo test lint docs bench lock clean

setup: .venv/ready

.venv/ready: requirements.lock pyproject.toml
	$(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --require-hashes -r requirements.lock
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps --no-build-isolation --editable .
	touch $@

demo: setup  ## the models of the comparative study side by side, also behind real driving; a report
	$(BIN)/headway benchmark --out out/demo

test: setup
	$(BIN)/python -m pytest $(TEST_ARGS)

lint: setup
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports

docs: setup  ## the documentation as a site, out/docs/index.html; a link that leads nowhere ends it
	$(BIN)/python tools/build_docs.py

bench: setup  ## speed and accuracy beside a C loop, SUMO and jitcdde; takes some minutes
	$(BIN)/python -m benchmarks

lock:  ## make the lock anew (needs pip-tools, installed into .venv)
	$(BIN)/python -m pip install --quiet pip-tools
	$(BIN)/pip-compile --quiet --upgrade --generate-hashes --allow-unsafe --strip-extras --no-header --no-annotate \
	  --no-emit-index-url --no-emit-find-links --no-emit-trusted-host --extra test --extra lint --extra docs --extra build \
	  --output-file requirements.lock pyproject.toml

clean:
	rm -rf .venv .cache out build dist .pytest_cache .mypy_cache .ruff_cache .hypothesis .import_linter_cache
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
