# The same commands here and in CI. `make demo` and `make test` work from a fresh clone.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
WHEEL = $(shell ls -t dist/jacokin-*.whl 2>/dev/null | head -n 1)
SOURCES := $(sort pyproject.toml package_page.py $(wildcard build_kernels/*.py) examples/targets.csv constraints.txt README.md LICENSE NOTICE \
	$(shell find jacokin urdf -type f -not -path '*/__pycache__/*' -not -name 'libjacokin.*'))
# Rewritten where it differs, which is when a source was added, renamed or removed.
LIST := build/sources.txt
$(shell mkdir -p build; echo $(SOURCES) | cmp -s - $(LIST) || echo $(SOURCES) > $(LIST))
JOBS ?= 2
# Each process begins with its own part of the tests, so that what a module prepares is prepared once.
PYTEST := pytest -n $(JOBS) --dist worksteal
# Images of containers set it: each of these processes would compile all tests again.
unexport PYTHONDONTWRITEBYTECODE
# These processes fill the cores: more threads in each would wait for one another.
test test-all test-oldest release-check: export OPENBLAS_NUM_THREADS := 1

.PHONY: demo test test-all lint format type docs build web targets wheels old-systems test-oldest bench fuzz release-check address clean

demo: $(VENV)/demo.stamp  ## show branches, a motion around a crate, advice; draw it
	$(BIN)/jacokin demo --output out/jaco.png

test: $(VENV)/test.stamp  ## the quick tests, against the built wheel: at most 4 minutes on two cores
	$(BIN)/$(PYTEST) -m "not slow"

test-all: $(VENV)/test.stamp  ## all tests, against the built wheel
	$(BIN)/$(PYTEST) --durations 40

lint: $(VENV)/test.stamp  ## style, docstrings, formatting
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

format: $(VENV)/test.stamp  ## rewrite to the project's format
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

type: $(VENV)/test.stamp  ## static types, strict
	$(BIN)/mypy

docs: $(VENV)/docs.stamp  ## build the documentation site, with its playground; warnings are errors
	$(BIN)/python integrations/web/build.py
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict

build: dist/wheel.stamp  ## build the wheel

web: $(VENV)/test.stamp  ## the npm package, compiled for WebAssembly and packed; tests against the native library
	$(BIN)/python integrations/web/build.py
	$(BIN)/python -m tests.web.reference integrations/web/test/reference
	cd integrations/web && npm test && npm pack --silent

targets: $(VENV)/test.stamp  ## C libraries for other machines, in build/targets
	$(BIN)/python -m build_kernels --target aarch64-linux --target x86_64-windows --target macos --target wasm32

old-systems: dist/wheel.stamp  ## a wheel that runs on old systems, linked with zig as where there is no C compiler
	CC="python -m ziglang cc -target $(shell uname -m)-linux-gnu.2.17" $(BIN)/python -m build --wheel --outdir build/zig .
	ls build/zig/jacokin-*-manylinux_2_17_*.whl

# Of what developers run, which has its own versions.
DEVELOPING := benchmarks build_kernels fuzz
test-oldest: .venv-oldest/test.stamp  ## the quick tests of the package with the oldest supported versions
	.venv-oldest/bin/$(PYTEST) -m "not slow" $(addprefix --ignore tests/,$(DEVELOPING))

bench: $(VENV)/test.stamp  ## jacokin beside its peers; writes docs/performance.md
	$(BIN)/python -m benchmarks.run

fuzz: $(VENV)/test.stamp  ## random targets, arms, files, motions, ... for at most half an hour; OPTIONS="--seed 1 files"
	$(BIN)/python -m fuzz $(OPTIONS)

MACHINES := x86_64-linux aarch64-linux x86_64-macos aarch64-macos
wheels: $(VENV)/test.stamp  ## wheels for Linux (manylinux_2_17) and macOS, x86-64 and AArch64, in build/wheels
	$(BIN)/python -m build_kernels --whole $(addprefix --target ,$(MACHINES))
	rm -f build/wheels/*.whl
	for target in $(MACHINES); do \
		JACOKIN_TARGET=$$target $(BIN)/python -m build --wheel --outdir build/wheels . || exit 1; \
	done
	$(BIN)/python -m build_kernels.wheels build/wheels

release-check: address wheels $(VENV)/release.stamp  ## build what would be uploaded, and check it; uploads nothing
	rm -rf build/release
	CC="python -m ziglang cc -target $(shell uname -m)-linux-gnu.2.17" $(BIN)/python -m build --outdir build/release .
	for wheel in build/wheels/*.whl; do test -e build/release/$${wheel##*/} || cp $$wheel build/release || exit 1; done
	$(BIN)/python -m build_kernels.wheels build/release
	$(BIN)/python -m twine check --strict build/release/*
	$(BIN)/check-wheel-contents build/release/*.whl
	$(BIN)/python -m release_check build/release
	$(BIN)/python -m pip install --quiet --force-reinstall --no-deps build/release/*linux*_$(shell uname -m).whl
	tar -xzf build/release/*.tar.gz -C build/release
	cd build/release/jacokin-*/ && $(abspath $(BIN))/$(PYTEST) -m "not slow"

address:
	@! grep '^REPOSITORY.*\.invalid/' package_page.py || { echo "package_page.py: fill in the address of the repository first."; exit 1; }

clean:
	rm -rf build dist site out jacokin/kernels/libjacokin.* $(VENV) .venv-oldest .venv-ros2 .venv-bench

$(VENV)/bin/python:
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --upgrade pip build

dist/wheel.stamp: $(VENV)/bin/python $(LIST) $(SOURCES)
	rm -rf dist
	$(BIN)/python -m build --wheel --outdir dist .
	touch $@

$(VENV)/demo.stamp: dist/wheel.stamp
	$(BIN)/python -m pip install --quiet --constraint constraints.txt --force-reinstall --no-deps $(WHEEL)
	$(BIN)/python -m pip install --quiet --constraint constraints.txt $(WHEEL)
	touch $@

$(VENV)/test.stamp: $(VENV)/demo.stamp
	$(BIN)/python -m pip install --quiet --constraint constraints.txt "jacokin[test] @ file://$(abspath $(WHEEL))"
	touch $@

$(VENV)/docs.stamp: $(VENV)/test.stamp
	$(BIN)/python -m pip install --quiet --constraint constraints.txt "jacokin[docs] @ file://$(abspath $(WHEEL))"
	touch $@

$(VENV)/release.stamp: $(VENV)/test.stamp
	$(BIN)/python -m pip install --quiet --constraint constraints.txt "jacokin[release] @ file://$(abspath $(WHEEL))"
	touch $@

.venv-oldest/test.stamp: dist/wheel.stamp constraints-oldest.txt
	$(PYTHON) -m venv .venv-oldest
	.venv-oldest/bin/python -m pip install --quiet --upgrade pip
	.venv-oldest/bin/python -m pip install --quiet --force-reinstall --no-deps $(WHEEL)
	.venv-oldest/bin/python -m pip install --quiet --constraint constraints-oldest.txt "jacokin[test] @ file://$(abspath $(WHEEL))"
	touch $@
