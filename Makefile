# Everything runs from .venv, which is made from requirements.lock on any machine with Python 3.11+, pip and make.
#
#   make demo     fly an emulated approach, record it, show it in the browser (Ctrl-C ends it)
#   make test     every test; prints part, progress and the time left
#   make quick    the fast tests, in a minute
#   make check    style, types, layers
#   make bench    every benchmark; what they print goes into docs/benchmarks.md, too
#   make wheel    build source archive and wheel below dist
#   make deb      build the Debian package below dist
#   make docs     generate docs/faults.md, docs/topics.md, docs/reference; build the site in the folder site
#   make soak     the tests again, at full scale
#   make lock     choose the versions anew from pyproject.toml (needs uv)

BIN := .venv/bin
READY := .venv/.installed
BESIDE := .venv/.bench-installed
PYTEST := $(BIN)/python -m pytest

.PHONY: help demo test quick check bench wheel deb docs soak lock
.DELETE_ON_ERROR:

help:
	@sed -n 's/^#   make /make /p' $(firstword $(MAKEFILE_LIST))

# fti demo ends with Ctrl-C, exit code 130, which is no error here; without the trap the shell reports an interrupt.
demo: $(READY)
	@trap : INT; $(BIN)/fti demo || [ $$? -eq 130 ]

test: $(READY)
	@$(BIN)/python -m tests.run

quick: $(READY)
	@$(BIN)/python -m tests.run --quick

check: $(READY)
	@rc=0; \
	for step in "ruff check" "ruff format --check" mypy lint-imports; do \
		echo "== $$step"; $(BIN)/$$step || rc=1; \
	done; \
	exit $$rc

bench: $(BESIDE)
	$(BIN)/python -m benchmarks

docs: $(READY)
	$(BIN)/python -m fti.hil.oracle.fault_page docs/faults.md
	$(BIN)/python -m fti.messages.topics_page docs/topics.md
	$(BIN)/python -m fti.user_files.page docs/reference
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict
	@echo "Open site/index.html in a browser."

soak: $(READY)
	$(PYTEST) --scale full --timeout 3600

wheel: $(READY)
	$(BIN)/python packaging/build_wheel.py dist

deb: wheel
	PYTHON=$(BIN)/python packaging/build_deb dist/*.whl dist

lock:
	@command -v uv >/dev/null || { echo "make lock needs uv (https://docs.astral.sh/uv) on the path" >&2; exit 2; }
	uv pip compile pyproject.toml --universal --generate-hashes --no-header --extra test --output-file requirements.lock
	uv pip compile pyproject.toml --universal --generate-hashes --no-header --extra bench \
		--constraint requirements.lock --override packaging/bench-overrides.txt --output-file requirements-bench.lock
	for python in 3.11 3.12 3.13; do for machine in x86_64 aarch64; do \
		uv pip compile pyproject.toml --quiet --only-binary :all: --python-version $$python \
			--python-platform $$machine-manylinux_2_28 >/dev/null || exit 1; \
	done; done

# PYTHON=... chooses the interpreter; otherwise the first of these that runs and is new enough.
CANDIDATES := $(or $(PYTHON),python3 python3.13 python3.12 python3.11)

# Some systems have pip and no ensurepip: then the interpreter's own pip installs into the environment.
$(READY): requirements.lock pyproject.toml
	@set -e; \
	for candidate in $(CANDIDATES); do \
		if "$$candidate" -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null; then python=$$candidate; break; fi; \
	done; \
	if [ -z "$$python" ]; then \
		echo "fti needs Python 3.11 or newer; tried: $(CANDIDATES). Name one with: make PYTHON=/path/to/python" >&2; exit 2; \
	fi; \
	echo "Setting up .venv with $$("$$python" --version) (once, 1 to 3 minutes): 1 of 2, dependencies ..."; \
	"$$python" -m venv .venv >/dev/null 2>&1 || "$$python" -m venv --without-pip .venv; \
	if $(BIN)/python -m pip --version >/dev/null 2>&1; then python=$(BIN)/python; fi; \
	pip="$$python packaging/pip_install.py $(BIN)/python"; \
	$$pip --require-hashes --requirement requirements.lock; \
	echo "Setting up .venv: 2 of 2, fti ..."; \
	$$pip --no-deps --no-build-isolation --editable .; \
	touch $@

# What the benchmarks stand beside, half a gigabyte of it, is installed for them alone.
$(BESIDE): $(READY) requirements-bench.lock
	@set -e; \
	echo "Installing what the benchmarks stand beside (Embree, Open3D; once, some minutes) ..."; \
	if $(BIN)/python -m pip --version >/dev/null 2>&1; then python=$(BIN)/python; else python=$(firstword $(CANDIDATES)); fi; \
	"$$python" packaging/pip_install.py $(BIN)/python --no-deps --require-hashes --requirement requirements-bench.lock; \
	touch $@
