# Two commands do everything: `make run` and `make test`. Each sets up its own environment in .venv.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
INSTALLED := $(VENV)/.installed
OUT ?= out/run

.PHONY: run test coverage lint types layers check docs docs-outputs benchmark clean

run: $(INSTALLED)  ## the main job on a simulated pass, made on the spot
	$(BIN)/gaia reconstruct sim:lane-closure --out $(OUT)

test: $(INSTALLED)  ## all tests
	$(BIN)/pytest -n 2 --dist worksteal --durations=10 $(TEST_OPTIONS)

coverage:  ## all tests, with line coverage, which takes half as long again
	$(MAKE) test TEST_OPTIONS='--cov --cov-report=term:skip-covered --cov-fail-under=97'

lint: $(INSTALLED)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

types: $(INSTALLED)
	$(BIN)/mypy

layers: $(INSTALLED)  ## imports go one way
	$(BIN)/pytest -q tests/test_layers.py

check: lint types coverage  ## everything that CI runs

docs: $(INSTALLED)  ## the site, into site/; open site/index.html
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict --quiet

docs-outputs: $(INSTALLED)  ## run the pages' blocks and write their outputs anew
	$(BIN)/python tools/page_blocks.py --update $$(grep -rl '<!-- output -->' docs)

benchmark: $(INSTALLED)  ## speed and memory, side by side with SciPy
	$(BIN)/python benchmarks/speed/solver.py
	$(BIN)/python benchmarks/speed/command_time.py

# The stamp is newer than everything that the installation depends on, the compiled part included.
$(INSTALLED): pyproject.toml setup.py constraints.txt src/gaia_uwb/locate/_covariances.c \
    src/gaia_uwb/locate/_readings.c src/gaia_uwb/solver/_solver.c src/gaia_uwb/zone/_tour.c
	test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --constraint constraints.txt --editable '.[dev]'
	touch $@

clean:
	rm -rf $(VENV) build out site src/gaia_uwb/*/*.so src/*.egg-info
