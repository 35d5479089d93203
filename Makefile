# Everything here sets up what it needs: python3 (3.11 or newer, with venv), make and cc are enough.
# Tests, types and benchmarks use the installed wheel, not the source tree: what is checked is what ships.
PYTHON ?= python3
VENV ?= .venv
OUT ?= results
BIN := $(VENV)/bin
# One worker per core, a file stays with one worker; pytest-benchmark has no place beside others.
PARALLEL := -n auto --dist loadfile -p no:benchmark
FOLDERS := robots solvers formulations codegen baselines control benchmarks cli configs testing
SOURCES := pyproject.toml README.md py.typed $(shell find $(FOLDERS) -type f -not -path '*/__pycache__/*')

.PHONY: help bench perf test test-long test-arm fuzz browser lint format types clean

help:
	@echo "make bench      the semicircle: formulations x solvers, one table (results in $(OUT)/)"
	@echo "make perf       the generated tick beside DAQP and Pink, ratios against targets; every solver per solve"
	@echo "make test       the tests, under 5 minutes"
	@echo "make test-long  the same tests with more states"
	@echo "make test-arm   generated code and solver on 64- and 32-bit ARM, emulated (Debian packages: see the target)"
	@echo "make fuzz       libFuzzer on URDF files and on generated C, FUZZ_SECONDS=600 each (wants clang)"
	@echo "make browser    Chromium and its driver (Debian packages), where they are missing: tests of the report's page use them"
	@echo "make lint       ruff"
	@echo "make types      mypy --strict on the installed library"
	@echo "make format     let ruff format the sources"
	@echo "make clean      remove what the above made, results aside"

bench: $(VENV)/.installed
	$(BIN)/kinqp sweep --overwrite --out $(OUT)

# Ratios first, then times per call. Not part of the tests: times are only worth something on a machine that is at rest.
perf: $(VENV)/.installed $(VENV)/.perf
	$(BIN)/python benchmarks/suite/ratios.py
	$(BIN)/python -m pytest benchmarks/suite --benchmark-only

test: $(VENV)/.installed
	$(BIN)/python -m pytest -m "not long" $(PARALLEL)

test-long: $(VENV)/.installed
	$(BIN)/python -m pytest $(PARALLEL)

# apt-get install gcc-aarch64-linux-gnu gcc-arm-linux-gnueabihf libc6-dev-arm64-cross libc6-dev-armhf-cross qemu-user
test-arm: $(VENV)/.installed
	$(BIN)/python -m pytest tests/codegen/test_arm.py

# Hostile files, and any bits in generated C under sanitizers; FUZZ="urdf step guiding" chooses. What is found stays in
# $(OUT)/fuzz. clang brings libFuzzer for C (Debian: apt-get install clang libclang-rt-14-dev), the wheel atheris for Python.
FUZZ_SECONDS ?= 600
FUZZ ?= urdf step guiding
fuzz: $(VENV)/.installed $(VENV)/.fuzz
	@command -v $${CLANG:-clang} >/dev/null || \
	  { echo "make fuzz needs clang with libFuzzer: apt-get install clang libclang-rt-14-dev"; exit 1; }
	$(BIN)/python fuzz/run.py $(FUZZ) --seconds $(FUZZ_SECONDS) --out $(OUT)/fuzz

# Without a browser the tests of the report's page are skipped, and say so.
browser:
	@command -v chromium >/dev/null && command -v chromedriver >/dev/null || { \
	  sudo=$$(test "$$(id -u)" = 0 || echo sudo -n); \
	  $$sudo apt-get update -q && $$sudo apt-get install -q -y --no-install-recommends chromium chromium-driver; }

lint: $(VENV)/.dependencies
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

format: $(VENV)/.dependencies
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

types: $(VENV)/.installed
	$(BIN)/mypy --strict -p kinqp

$(VENV)/.dependencies: pyproject.toml constraints.txt
	@$(PYTHON) -c 'import sys, venv; sys.exit(sys.version_info < (3, 11))' || \
	  { echo "kinqp needs Python 3.11 or newer with its venv module; name one with: make PYTHON=python3.12"; exit 1; }
	$(PYTHON) -m venv --clear $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --constraint constraints.txt --upgrade pip
	$(BIN)/python -m pip install --quiet --constraint constraints.txt ".[test,lint]"
	@rm -rf build *.egg-info
	@touch $@

$(VENV)/.installed: $(VENV)/.dependencies $(SOURCES)
	@rm -rf build dist *.egg-info
	$(BIN)/python -m pip wheel --quiet --constraint constraints.txt --no-deps --wheel-dir dist .
	$(BIN)/python -m pip install --quiet --no-deps --force-reinstall dist/*.whl
	@rm -rf build *.egg-info
	@touch $@

$(VENV)/.perf: $(VENV)/.dependencies | $(VENV)/.installed
	$(BIN)/python -m pip install --quiet --constraint constraints.txt "$$(echo dist/*.whl)[perf]"
	@touch $@

$(VENV)/.fuzz: $(VENV)/.dependencies | $(VENV)/.installed
	$(BIN)/python -m pip install --quiet --constraint constraints.txt "$$(echo dist/*.whl)[fuzz]"
	@touch $@

clean:
	rm -rf $(VENV) build dist *.egg-info .mypy_cache .pytest_cache .ruff_cache .hypothesis
