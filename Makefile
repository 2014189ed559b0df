# From nothing to a picture: make demo. Nothing here needs root; Python >= 3.12 is found by itself
# (or set PYTHON=/path/to/python3.12). Everything is installed into .venv in this folder.

VENV := .venv
PYTHON_IN_VENV := $(VENV)/bin/python
STAMP := $(VENV)/.installed

.PHONY: setup demo test lint clean
.DELETE_ON_ERROR:

setup: $(STAMP)

demo: $(STAMP)
	$(VENV)/bin/lic demo

test: $(STAMP)
	$(PYTHON_IN_VENV) -m pytest -n 2 -m "not slow"

lint: $(STAMP)
	$(PYTHON_IN_VENV) -m ruff check .
	$(PYTHON_IN_VENV) -m ruff format --check .
	$(PYTHON_IN_VENV) -m mypy

# The stamp is written last, so an interrupted installation is taken up again. Drake's wheel needs
# one system library that pip cannot bring.
$(STAMP): pyproject.toml
	@PYTHON=$(PYTHON_IN_VENV) scripts/find_python.sh >/dev/null 2>&1 || { \
	  python=$$(scripts/find_python.sh) && echo "creating $(VENV) with $$python" && \
	  "$$python" -m venv --clear $(VENV); }
	$(PYTHON_IN_VENV) -m pip install --disable-pip-version-check --quiet --editable '.[dev,cluster]'
	@$(PYTHON_IN_VENV) -c 'import pydrake.common' || { \
	  echo "Drake does not load; on Debian and Ubuntu: apt-get install libglib2.0-0" >&2; exit 1; }
	@touch $@
	@echo "ready: try 'make demo', 'make test', '$(VENV)/bin/lic --help'"

# Keeps .venv (rm -r .venv for a fresh one) and out/, which may hold hours of reaches.
clean:
	rm -rf build dist .pytest_cache .mypy_cache .ruff_cache .hypothesis
	find lic_drake tests scripts .ci -name __pycache__ -type d -prune -exec rm -rf {} +
