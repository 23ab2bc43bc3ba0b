# Two commands do everything on a fresh machine: make dry-run, make test.
# Our own processes and threads share the cores already.
export OPENBLAS_NUM_THREADS = 1
# Compiled modules are kept, also where the environment says otherwise: else each test worker and each sub-process
# compiles all sources anew, 12 of the 20 s that a worker takes before its first test.
unexport PYTHONDONTWRITEBYTECODE
PYTHON ?= python3
BIN := .venv/bin
STAMP := .venv/.installed
TOOLS := .venv/.tools
# What pip says, in few words: a name for each package that it fetches; errors go past it.
TICKS := awk '/^Collecting/ {n++; printf "\r  %3d  %-50.50s", n, $$2; fflush()} /^Installing/ {printf "\r  installing …%-50s\n", ""; fflush()}'

.PHONY: install dry-run test check peers lock bench outputs reference docs clean

install: $(STAMP)

$(STAMP): requirements.lock pyproject.toml
	@echo "Setting up .venv with $$(grep -c == requirements.lock) packages, 255 MB to fetch: one to five minutes, once."
	@$(PYTHON) -m venv .venv
	@$(BIN)/python -m pip install --disable-pip-version-check --require-hashes -r requirements.lock | $(TICKS)
	@$(BIN)/python -m pip install --quiet --no-deps --no-build-isolation -e .
	@$(BIN)/python -m pip check --quiet && touch $(STAMP) && echo "Installed: $$($(BIN)/fidim --version). Next: $(BIN)/fidim --help"

# What tests, types and lint need beside it; the lock of both, so that what is installed stays as it is.
$(TOOLS): tests/requirements.lock $(STAMP)
	@echo "Adding the tools of make test and make check, of $$(grep -c == tests/requirements.lock) packages in all."
	@$(BIN)/python -m pip install --disable-pip-version-check --require-hashes -r tests/requirements.lock | $(TICKS)
	@$(BIN)/python -m pip check --quiet && touch $(TOOLS)

dry-run: install
	$(BIN)/fidim dry-run

test: check
	$(BIN)/python -m pytest -n 2 --dist worksteal -m "not slow"

check: $(TOOLS)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/lint-imports --no-cache
	$(BIN)/basedpyright

# Against what others wrote: what does not install here is skipped, with the reason.
peers: $(TOOLS)
	test -x build/peers/python/bin/python || $(PYTHON) -m venv build/peers/python
	-for peer in numpy motioncapture==1.1 qtm-rt==3.1.0 natnet==0.3.0; do \
	    build/peers/python/bin/python -m pip install --quiet $$peer; done
	-test -d build/peers/remote/can_remote || \
	    build/peers/python/bin/python -m pip install --quiet --no-deps --target build/peers/remote python-can-remote==0.3.0
	-test -d build/peers/node/node_modules/canopen || npm install --silent --prefix build/peers/node canopen@6.2.1
	$(BIN)/python -m pytest -m peer -rs

# The long ones: whole campaigns, real processes, Monte Carlo.
bench: $(TOOLS)
	$(BIN)/python -m pytest -m slow --durations=0
	$(BIN)/python -m benchmarks.safety --runs 1000
	rm -rf build/sealed
	$(BIN)/fidim benchmark explain --campaigns 6 --equilibria 6 --validate 3 --out build/sealed

# The locks name versions and hashes, never an index; needs uv (pip install uv). Tests run on what users run.
LOCK := uv pip compile --universal --generate-hashes --no-annotate --no-header --no-emit-index-url --no-emit-find-links
lock:
	$(LOCK) pyproject.toml --group build -o requirements.lock
	$(LOCK) pyproject.toml --group dev -c requirements.lock -o tests/requirements.lock
	$(LOCK) --group pyproject.toml:docs --python-version 3.11 -o docs/requirements.lock

outputs: $(TOOLS)
	$(BIN)/python docs/outputs.py
	$(BIN)/python docs/faults.py
	$(BIN)/python docs/recording.py

# Pages of docs that are made from the code; tests compare them.
reference: install
	$(BIN)/python -m docs.tools.messages > docs/messages.md
	$(BIN)/python -m docs.tools.commands > docs/commands.md
	$(BIN)/python -m docs.tools.file_keys > docs/file-keys.md

# The documentation as a site, in an environment of its own: build/site/index.html. A link to nowhere is an error.
docs: build/docs/.installed
	NO_MKDOCS_2_WARNING=1 build/docs/bin/mkdocs build --quiet --strict

build/docs/.installed: docs/requirements.lock
	$(PYTHON) -m venv build/docs
	build/docs/bin/python -m pip install --quiet --require-hashes -r docs/requirements.lock
	@touch $@

clean:
	rm -rf .venv build dist
