# Two commands do everything on a fresh machine: make dry-run, make test.
PYTHON ?= python3
BIN := .venv/bin
STAMP := .venv/.installed

.PHONY: install dry-run test check lock bench outputs clean

install: $(STAMP)

$(STAMP): requirements.lock pyproject.toml
	$(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet --require-hashes -r requirements.lock
	$(BIN)/python -m pip install --quiet --no-deps --no-build-isolation -e .
	@touch $(STAMP)

dry-run: install
	$(BIN)/fidim dry-run

test: install check
	$(BIN)/python -m pytest -n 2 --dist worksteal -m "not slow"

check: install
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/lint-imports --no-cache
	$(BIN)/basedpyright

# The long ones: whole campaigns, real processes, Monte Carlo.
bench: install
	$(BIN)/python -m pytest -m slow --durations=0
	rm -rf build/sealed
	$(BIN)/fidim benchmark explain --campaigns 6 --equilibria 6 --validate 3 --out build/sealed

# The lock names versions and hashes, never an index; needs uv (pip install uv).
lock:
	uv pip compile pyproject.toml --group dev --universal --generate-hashes --no-annotate --no-header \
	    --no-emit-index-url --no-emit-find-links -o requirements.lock

outputs: install
	$(BIN)/python docs/outputs.py

clean:
	rm -rf .venv build dist
