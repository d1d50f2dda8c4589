# `make run` and `make test` set up what is missing, then do their job. See README.md.
PYTHON ?= python3
VENV   := .venv
BIN    := $(VENV)/bin
SIM    ?= verilator
# Tests in a browser are left out only where there is none; `system` says so.
BROWSER = $(shell command -v chromium >/dev/null 2>&1 && command -v chromedriver >/dev/null 2>&1 || echo "and not browser")
OUT    ?= out
export SIM

.PHONY: setup system run test test-long sim lint types formal synth pnr mutate coverage coverage-python registers bench blind blind-long fuzz docs clean

setup: $(VENV)/.ready

# Icarus comes from Debian; without root and without it the Icarus half is left out, and said.
system:
	@command -v iverilog >/dev/null 2>&1 || { \
	  if [ "$$(id -u)" = 0 ] && command -v apt-get >/dev/null 2>&1; then \
	    { apt-get update -qq && apt-get install -y -qq --no-install-recommends iverilog; } >/dev/null 2>&1 || true; fi; \
	  command -v iverilog >/dev/null 2>&1 || echo "note: iverilog is not installed (apt-get install iverilog); going on without it"; }
	@command -v chromium >/dev/null 2>&1 && command -v chromedriver >/dev/null 2>&1 || { \
	  if [ "$$(id -u)" = 0 ] && command -v apt-get >/dev/null 2>&1; then \
	    { apt-get update -qq && apt-get install -y -qq --no-install-recommends chromium chromium-driver; } >/dev/null 2>&1 || true; fi; \
	  command -v chromedriver >/dev/null 2>&1 || echo "note: chromium is not installed (apt-get install chromium chromium-driver); the tests of the report in a browser are left out"; }

$(VENV)/.ready: pyproject.toml
	@$(PYTHON) -c 'import sys; v = sys.version_info[:2]; sys.exit(0 if (3, 10) <= v <= (3, 14) else "Python 3.10 to 3.14 is needed, this is %d.%d; set PYTHON=" % v)'
	@$(PYTHON) -c 'import sys; v = sys.version_info[:2]; v > (3, 11) and print("note: PyBullet has no wheel for Python %d.%d; MuJoCo is the robot\x27s engine" % v)'
	@command -v g++ >/dev/null 2>&1 || { echo "g++ is missing: apt-get install g++" >&2; exit 2; }
	$(PYTHON) -m venv $(VENV)
	@# The pip that comes with Python 3.10 looked for versions for 40 minutes without an end; pip 26 finds them.
	$(BIN)/python -m pip install -q --disable-pip-version-check -U 'pip>=25'
	$(BIN)/python -m pip install -q --disable-pip-version-check -e '.[dev]'
	@touch $@

run: setup
	$(BIN)/rtds run all --robot paper --out $(OUT)

test: setup system
	$(BIN)/python -m pytest -n 2 --dist loadfile -m "not long $(BROWSER)"

test-long: setup system
	$(BIN)/python -m pytest -n 2 --dist loadfile -m "(long or not long) $(BROWSER)"

sim: setup system
	SIM_ONLY=$(SIM) $(BIN)/python -m pytest tb

types: setup
	$(BIN)/mypy

lint: setup
	$(BIN)/ruff check python tb sim examples setup.py
	$(BIN)/mypy
	$(BIN)/python tb/lint/lint.py

formal: setup
	$(BIN)/python tb/formal/formal.py

synth: setup
	$(BIN)/python tb/synth/synth.py

# Place and route on an ECP5: minutes for each of eight seeds, two at a time. What was run is kept in build/pnr.
pnr: setup
	$(BIN)/python tb/pnr/pnr.py

mutate: setup system
	$(BIN)/python tb/mutate/mutate.py

coverage: setup
	$(BIN)/python tb/rtl_coverage/coverage_report.py

# Which lines and branches of the Python code the tests reach; compiled loops count as not reached.
coverage-python: setup system
	$(BIN)/python -m coverage erase
	$(BIN)/python -m coverage run -m pytest -n 2 --dist loadfile -m "not long $(BROWSER)" python/tests; \
	status=$$?; $(BIN)/python -m coverage combine -q && $(BIN)/python -m coverage report && exit $$status

# After a change of python/rtds_host/link/registers.toml.
registers: setup
	$(BIN)/python -m rtds_host.link.register_files .

# With AGAINST=COMMIT, the loops of that state and of the present one in turn.
bench: setup
	$(BIN)/python -m rtds_host.bench $(if $(AGAINST),--against $(AGAINST))
	$(if $(AGAINST),,$(BIN)/python -m rtds_host.bench.ways)

# Sealed cases for the diagnosis, 60 in about 15 minutes or 310; both go on where they stopped.
blind: setup
	@test -f build/blind/public/SEALS.json || $(BIN)/rtds blind make --out build/blind --n 60
	$(BIN)/rtds blind answer --out build/blind --quick
	$(BIN)/rtds blind score --out build/blind

blind-long: setup
	@test -f build/blind-long/public/SEALS.json || $(BIN)/rtds blind make --out build/blind-long --n 310
	$(BIN)/rtds blind answer --out build/blind-long --quick
	$(BIN)/rtds blind score --out build/blind-long

# Inputs that are almost right: logs, robots, diagnoses, mappings, tables, bags, frames. About ten minutes on an idle core.
fuzz: setup
	nice -n 19 $(BIN)/python python/tests/fuzz/fuzz.py

# The documentation as a site in build/site; a broken link ends it.
docs: setup
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict

clean:
	rm -rf build $(OUT) .pytest_cache .ruff_cache .mypy_cache
