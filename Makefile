# Two commands do all set-up on a machine that has Python >= 3.11 and nothing else: make demo, make test.
PYTHON ?= python3
BIN := .venv/bin
unexport PYTHONDONTWRITEBYTECODE  # the tests start many processes: compile each file once

.PHONY: demo test test-slow test-all coverage mutations oldest newest check wheel fuzz benchmarks findings docs site pages notebooks pictures interop clean
.DELETE_ON_ERROR:

demo: .venv/ready  ## the paper's Table I, coefficients from the sample log, what K06's model lacked
	$(BIN)/hovercontrol simulate table1 --out out/table1
	$(BIN)/hovercontrol identify --sample --out out/identify
	$(BIN)/hovercontrol simulate k06-field-turn --out out/k06-field-turn
	$(BIN)/hovercontrol simulate k06-field-holdout --out out/k06-field-holdout
	$(BIN)/hovercontrol diagnose out/k06-field-turn/log.csv --holdout out/k06-field-holdout/log.csv \
	  --vehicle hoverdemon --out out/diagnose
	@echo "Look at out/table1/tracking_error.png, out/identify/free_run_rudder_craft.png"
	@echo "and, in a browser, out/diagnose/report.html"

PYTEST := $(BIN)/python -m pytest -n 2 --dist worksteal --durations=30 --durations-min=0.5

COVERAGE ?=
test: .venv/tests check  ## style, types, all tests that are not marked slow; the slowest at the end
	$(PYTEST) $(COVERAGE) -m "not slow"

test-slow: .venv/tests  ## the tests that are marked slow
	$(PYTEST) -m slow

test-all: .venv/tests check  ## the same and the slow ones
	$(PYTEST)

COVERED ?= 90
TESTS ?= -m "not slow"
HTML ?= --cov-report=html:out/coverage
coverage: .venv/tests  ## the quick tests (TESTS= all), and the lines of the package that none of them runs; 90 % must run
	$(PYTEST) $(TESTS) --cov --cov-report=term:skip-covered $(HTML) --cov-fail-under=$(COVERED)

check: .venv/tests
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

FUZZ_SECONDS ?= 600
fuzz: .venv/tests  ## hostile and clumsy inputs; each that breaks something is printed with its seed
	$(BIN)/python -m tests.fuzz --seconds $(FUZZ_SECONDS) $(if $(FUZZ_SEED),--seed $(FUZZ_SEED))

mutations: .venv/tests  ## one-line faults in a copy of the code: does make test notice each?
	$(BIN)/python -m tests.mutations

oldest: .venv/tests  ## the quick tests with the oldest versions that pyproject.toml allows
	$(BIN)/python -m tests.packaging.versions oldest

newest: .venv/tests  ## the first quick test of each file with the newest of every dependency, on the newest Python
	$(BIN)/python -m tests.packaging.versions newest

wheel: .venv/tests  ## wheel and sdist, installed in fresh environments; sizes and times
	$(BIN)/python -m tests.packaging.install

benchmarks: .venv/tests  ## every figure in the README, measured on this machine
	$(BIN)/python -m benchmarks

findings:  ## surprises about other people's tools (findings/README.md), each in a fresh environment; needs the network
	@changed=0; for script in findings/*.sh; do \
	  echo "$$script"; sh $$script || { echo "its behaviour has changed: $$script"; changed=1; }; done; exit $$changed

interop: .venv/ready  ## our FMUs in other importers, theirs here; environments in ~/.cache/hovercontrol-interop; needs the network
	$(BIN)/python -m benchmarks.interop

docs: .venv/docs  ## the site, warnings are errors: out/site/index.html; parts whose sources have not changed are kept
	@begin=$$(date +%s); PATH="$(CURDIR)/$(BIN):$$PATH" $(BIN)/sphinx-build -W --keep-going -q -j auto -d out/doctrees docs out/site \
	  && echo "the site is built: out/site/index.html ($$(( $$(date +%s) - begin )) s)"

site: docs  ## the site in a browser: http://127.0.0.1:8000
	$(BIN)/python -m http.server --directory out/site --bind 127.0.0.1 8000

PAGES ?=
pages: .venv/docs  ## run the cells of pages that have changed (PAGES=--all: of all), and write their outputs into the pages
	PYTHONPATH=docs $(BIN)/python -m generate.cells $(PAGES)

notebooks: .venv/docs  ## the pages as notebooks: out/notebooks
	PYTHONPATH=docs $(BIN)/python -m generate.notebooks out/notebooks

pictures: .venv/docs  ## the site's pictures that take minutes: all analyses, all tables and figures of the papers (half an hour)
	PYTHONPATH=docs $(BIN)/python -m generate.keep out/pictures

.venv/docs: .venv/tests
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e ".[docs]"
	@touch $@

.venv/tests: .venv/ready
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e ".[test]"
	@touch $@

.venv/ready: pyproject.toml constraints.txt
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' \
	  || { echo "hovercontrol needs Python 3.11 or newer: make PYTHON=python3.12 ..."; exit 2; }
	@$(PYTHON) -m venv .venv \
	  || { echo "python3 cannot make a virtual environment: apt-get install python3-venv"; exit 2; }
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e .
	@touch $@

clean:
	rm -rf .venv out .mypy_cache .ruff_cache .hypothesis
