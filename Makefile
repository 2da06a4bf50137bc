# Daily commands; CONTRIBUTING.md says when to use which.  PYTHON=python3.12 make setup  picks another interpreter.
PYTHON ?= python3
CLANG_FILES = $(shell find core benchmarks -name '*.hpp' -o -name '*.cpp' 2>/dev/null)
# The editable install knows packages by name: a new one needs it again.
CORE_FILES := $(shell find core -name '*.hpp' -o -name '*.cpp') CMakeLists.txt pyproject.toml \
              $(shell find src -name __init__.py)
PIP_INSTALL := .venv/bin/python -m pip --disable-pip-version-check install --quiet
NODE_OPCUA := tests/opcua_client/node_modules/.package-lock.json
LOCK = uv pip compile --quiet $(UPGRADE) --generate-hashes --no-header --no-annotate --no-emit-index-url --universal \
        --python-version 3.11
# Before anything is downloaded.
COMPILER := command -v $${CXX:-c++} > /dev/null || { echo "no C++ compiler here; type:  $$(command -v dnf > /dev/null \
        && echo sudo dnf install gcc-c++ python3-devel || echo sudo apt install g++ python3-dev python3-venv)"; exit 1; }
export PATH := $(CURDIR)/.venv/bin:$(PATH)
# The tests start hundreds of processes; without bytecode each of them would compile the program once more.
unexport PYTHONDONTWRITEBYTECODE

.NOTPARALLEL:
.PHONY: help demo setup core test test-slow mutants coverage pytest lint types layers test-core test-core-clang coverage-core format lock licences dist try-wheels clean page page-check screenshots site wasm soak virtual-soak fuzz
help:
	@echo "make demo       the accuracy test on the virtual gantry, with a report"
	@echo "make test       lint, types, layers, the core's tests, the built page, the site, the Python tests: what CI runs"
	@echo "make soak       hours of the real service with two pages, OPC UA and a stepped clock: HOURS=24, LOG=soak.jsonl"
	@echo "make mutants    bugs planted in the sources: which of them no test finds; coverage: branches that no test runs"
	@echo "make virtual-soak  10,000 h of treatment days in virtual time: HOURS=10000, FOLDER=build/virtual_soak"
	@echo "make fuzz       looks for inputs that break a reader of files or messages: MINUTES=10 of each, TARGETS=eds"
	@echo "make test-slow  the long tests;  setup  core  pytest  lint  types  layers  test-core  test-core-clang  format  lock  licences  site  wasm  dist  clean"

# --- environment: made again only when a lock file changes; the core, only when its sources change ---------------------
.venv/run.stamp: requirements/run.txt requirements/build.txt
	@$(COMPILER)
	@test -x .venv/bin/python || { echo "creating .venv"; $(PYTHON) -m venv .venv; }
	@echo "installing what the program needs"
	@$(PIP_INSTALL) --require-hashes -r requirements/run.txt -r requirements/build.txt
	@touch $@

.venv/dev.stamp: .venv/run.stamp requirements/dev.txt
	@echo "installing what the tests need"
	@$(PIP_INSTALL) --require-hashes -r requirements/dev.txt
	@touch $@

.venv/core.stamp: .venv/run.stamp $(CORE_FILES)
	@$(COMPILER)
	@echo "building the core"
	@$(PIP_INSTALL) --no-deps --no-build-isolation --editable .
	@touch $@

core: .venv/core.stamp
setup: .venv/dev.stamp .venv/core.stamp

# --- use --------------------------------------------------------------------------------------------------------------
demo: core
	.venv/bin/gantryctl accuracy run --ensemble 8 --out demo_report --fresh

# --- checks -----------------------------------------------------------------------------------------------------------
test: setup lint types layers test-core page-check site pytest

# pytest compiles each file of tests once more for its assertions. Four workers that begin at once would all do so, 20 s of
# a processor each; here two processes share the files, and every worker finds them compiled.
.venv/tests.stamp: .venv/dev.stamp .venv/core.stamp $(shell find tests -name '*.py')
	@echo "compiling the tests"
	@.venv/bin/python -m pytest --collect-only -qq -p no:xdist tests/unit > /dev/null & first=$$!; \
	.venv/bin/python -m pytest --collect-only -qq -p no:xdist --ignore tests/unit > /dev/null; wait $$first; touch $@

pytest: setup .venv/tests.stamp $(NODE_OPCUA)
	.venv/bin/python -m pytest -n 4 --dist loadfile  # by tests/support/in_files.py

test-slow: setup .venv/dist.stamp $(NODE_OPCUA) hmi/node_modules/.package-lock.json
	@! command -v clang++ > /dev/null || $(MAKE) test-core-clang
	.venv/bin/python -m pytest -m slow --hypothesis-profile fresh
	.venv/bin/python -m pytest tests/property tests/states --hypothesis-profile fresh --hypothesis-show-statistics

# The power of the tests (docs/decisions/0028): which test runs which line, planted bugs, mutants, branches of the areas.
MUTATION := PYTHONPATH=tools .venv/bin/python -m mutation
MUTANTS ?= --severe
build/mutation/coverage: setup
	@# The longest first; a part is recorded again by its own command (CONTRIBUTING.md).
	for part in unit/program unit/operation unit/drives unit/service unit/commissioning unit/gateway plant bus; do \
	    $(MUTATION) record $$(echo $$part | tr / _) tests/$$part || exit 1; done
	$(MUTATION) record others tests --ignore=tests/system $$(printf -- '--ignore=tests/%s ' unit/program unit/operation \
	    unit/drives unit/service unit/commissioning unit/gateway plant bus)

# Those of the core: which test in Python passes which change of it; half of it is the build with all its changes.
build/mutation/coverage/core: build/mutation/coverage
	$(MUTATION) record --core core tests/physics tests/parity tests/plant tests/unit/motion

mutants: build/mutation/coverage build/mutation/coverage/core
	$(MUTATION) planted
	$(MUTATION) run $(MUTANTS)
	$(MUTATION) write $(MUTANTS)

coverage: build/mutation/coverage
	$(MUTATION) branches

HOURS ?= 24
LOG ?= soak.jsonl
soak: setup
	.venv/bin/python benchmarks/soak.py --hours $(HOURS) --log $(LOG)

# Days of treatment in virtual time; it goes on where it ended.
FOLDER ?= build/virtual_soak
virtual-soak: HOURS = 10000
virtual-soak: setup
	.venv/bin/python benchmarks/virtual_soak.py --hours $(HOURS) --folder $(FOLDER)

# Coverage-guided fuzzing, so many minutes at each door; TARGETS="eds sdo" for some. atheris has wheels for x86-64 Linux.
MINUTES ?= 10
TARGETS ?=
.venv/fuzz.stamp: .venv/dev.stamp requirements/fuzz.txt
	@echo "installing what fuzzes"
	@$(PIP_INSTALL) --require-hashes --only-binary :all: -r requirements/fuzz.txt || { echo "no wheel of atheris for \
	this Python: 3.11 to 3.13 on x86-64 Linux have one; the kept corpus runs in make pytest"; exit 1; }
	@touch $@

fuzz: setup .venv/fuzz.stamp
	PYTHONPATH=tests .venv/bin/python -m support.coverage_fuzz --minutes $(MINUTES) $(TARGETS)

lint: .venv/dev.stamp
	.venv/bin/ruff check
	.venv/bin/ruff format --check
	.venv/bin/clang-format --dry-run --Werror $(CLANG_FILES)
	.venv/bin/python tools/check_core_layers.py
	.venv/bin/python tools/check_house.py

types: setup
	.venv/bin/mypy

layers: setup
	.venv/bin/lint-imports --no-cache --no-logo

# The core's own tests: once as shipped, once with the address and undefined-behaviour sanitizers (optimised little,
# assertions on).
test-core: .venv/dev.stamp
	cmake -S . -B build/core-tests -G Ninja -DGANTRYCTL_PYTHON=OFF -DGANTRYCTL_CORE_TESTS=ON --log-level=WARNING
	cmake --build build/core-tests
	ctest --test-dir build/core-tests --output-on-failure --no-tests=error
	cmake -S . -B build/core-tests-sanitized -G Ninja -DGANTRYCTL_PYTHON=OFF -DGANTRYCTL_CORE_TESTS=ON \
	    -DGANTRYCTL_SANITIZE=address,undefined -DCMAKE_BUILD_TYPE=Debug -DCMAKE_CXX_FLAGS_DEBUG="-O1 -g" --log-level=WARNING
	cmake --build build/core-tests-sanitized
	ctest --test-dir build/core-tests-sanitized --output-on-failure --no-tests=error

# The same by another compiler, where it is installed: a minute of one core.
test-core-clang: .venv/dev.stamp
	cmake -S . -B build/core-tests-clang -G Ninja -DCMAKE_CXX_COMPILER=clang++ -DGANTRYCTL_PYTHON=OFF \
	    -DGANTRYCTL_CORE_TESTS=ON --log-level=WARNING
	cmake --build build/core-tests-clang
	ctest --test-dir build/core-tests-clang --output-on-failure --no-tests=error

# Branches of core/control that the core's own tests take; 1 at the end when one is left.
coverage-core: .venv/dev.stamp
	cmake -S . -B build/core-coverage -G Ninja -DGANTRYCTL_PYTHON=OFF -DGANTRYCTL_CORE_TESTS=ON --log-level=WARNING \
	    -DCMAKE_BUILD_TYPE=Debug -DCMAKE_CXX_FLAGS_DEBUG="-O0 --coverage -DGANTRY_INLINE=inline"
	cmake --build build/core-coverage --target core_tests
	build/core-coverage/core_tests --gtest_brief=1
	.venv/bin/python tools/core_coverage.py build/core-coverage core/control

# --- upkeep -----------------------------------------------------------------------------------------------------------
format: .venv/dev.stamp
	.venv/bin/ruff check --fix-only --quiet
	.venv/bin/ruff format
	.venv/bin/clang-format -i $(CLANG_FILES)

# Needs `uv` on the path (`pip install uv` anywhere); nobody else does. Each list is held to the ones before it.
# Versions stay as they are where they can; `make lock UPGRADE=--upgrade` takes the newest.
lock:
	$(LOCK) pyproject.toml --extra reports -o requirements/run.txt
	$(LOCK) --group pyproject.toml:build -c requirements/run.txt -o requirements/build.txt
	$(LOCK) --group pyproject.toml:dev -c requirements/run.txt -c requirements/build.txt -o requirements/dev.txt
	$(LOCK) --group pyproject.toml:dist -c requirements/run.txt -c requirements/build.txt -c requirements/dev.txt -o requirements/dist.txt
	$(LOCK) --group pyproject.toml:fuzz -o requirements/fuzz.txt
	$(LOCK) pyproject.toml --extra bench -c requirements/run.txt -c requirements/dev.txt -o requirements/bench.txt

# npm and node come from a wheel of the test list. Packages are installed again only when their lock file changes.
%/node_modules/.package-lock.json: %/package.json %/package-lock.json | .venv/dev.stamp
	cd $* && npm ci --no-progress

# The operator page, and the viewer inside every report; what is built is committed.
page: setup hmi/node_modules/.package-lock.json
	.venv/bin/python tools/page_tables.py hmi/src/lib
	cd hmi && npm run --silent format && npm run --silent check && npm run --silent build
	cd hmi && npm run --silent build-report

# What is committed is what the sources give, byte for byte.
page-check: hmi/node_modules/.package-lock.json
	cd hmi && npm run --silent lint && npm run --silent check && npm run --silent test
	cd hmi && npm run --silent build -- --outDir ../build/page
	diff -r build/page src/gantryctl/gateway/page
	cd hmi && npm run --silent build-report -- --outDir ../build/report
	diff -r build/report src/gantryctl/engineering/report/viewer

# The documentation as a site, in build/site; docs/site says how.
site: .venv/dev.stamp
	.venv/bin/python tools/build_site.py

# The core as WebAssembly with the script around it, in build/wasm: a site that is built then simulates in the browser.
wasm: setup .venv/dist.stamp hmi/node_modules/.package-lock.json
	.venv/bin/python tools/build_wasm.py
	cd hmi && npm run --silent build-gains

screenshots: setup
	PYTHONPATH=tests .venv/bin/python tests/support/first_minutes.py docs/tutorials
	PYTHONPATH=tests .venv/bin/python tests/support/page_screenshots.py docs/hmi

.venv/dist.stamp: .venv/dev.stamp requirements/dist.txt
	@echo "installing what wheels are built with"
	@$(PIP_INSTALL) --require-hashes -r requirements/dist.txt
	@touch $@

# What is released: sdist, wheels for both processors, bill of materials, sums. The same commit gives the same bytes.
# The first time takes long: Zig compiles its C++ library for each processor.
PYTHONS ?= python3.11 python3.12 python3.13
dist: export SOURCE_DATE_EPOCH ?= $(shell git log -1 --format=%ct 2> /dev/null || date +%s)
dist: setup wasm site .venv/dist.stamp
	rm -rf dist
	.venv/bin/python -c "from scikit_build_core.build import build_sdist; build_sdist('dist')"
	.venv/bin/python tools/wheels.py dist $(PYTHONS)
	.venv/bin/python tools/parts.py bill dist
	cd dist && sha256sum *.whl *.tar.gz *.json > SHA256SUMS

# Each wheel in an empty environment without a compiler, and its digits; aarch64 by an emulated processor.
TRY_WITH ?= $(PYTHONS) aarch64
try-wheels: setup
	.venv/bin/python tools/try_wheels.py dist $(TRY_WITH)

licences: setup hmi/node_modules/.package-lock.json
	.venv/bin/python tools/parts.py licences

clean:
	rm -rf build dist .venv hmi/node_modules tests/opcua_client/node_modules demo_report .pytest_cache .mypy_cache .ruff_cache .import_linter_cache
	rm -f src/gantryctl/_core.pyi src/gantryctl/configs
