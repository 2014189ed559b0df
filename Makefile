# From nothing to a picture: make demo. Nothing here needs root; Python >= 3.12 is found by itself
# (or set PYTHON=/path/to/python3.12). Everything is installed into .venv in this folder.

VENV := .venv
PYTHON_IN_VENV := $(VENV)/bin/python
STAMP := $(VENV)/.installed

.PHONY: setup demo test lint docs notebooks tables evaluation clean
.DELETE_ON_ERROR:

setup: $(STAMP)

demo: $(STAMP)
	$(VENV)/bin/lic demo

test: $(STAMP)
	$(PYTHON_IN_VENV) -m pytest -n 2 --dist loadfile --no-loadscope-reorder -m "not slow"

lint: $(STAMP)
	$(PYTHON_IN_VENV) -m ruff check .
	$(PYTHON_IN_VENV) -m ruff format --check .
	$(PYTHON_IN_VENV) -m mypy

# The pages, the lesson and the reference from the docstrings, out/docs/index.html; a warning or a
# link that leads nowhere is an error.
docs: $(STAMP)
	$(PYTHON_IN_VENV) -W error scripts/docs/run.py out/docs

# All notebooks, run as they are, with their outputs in out/notebooks; one that fails is an error.
notebooks: $(STAMP)
	$(PYTHON_IN_VENV) scripts/run_notebooks.py --out out/notebooks notebooks/*.ipynb

# Tables I to IV, bounds and figures from the committed records, in a minute.
tables: $(STAMP)
	$(PYTHON_IN_VENV) scripts/tables/run.py
	$(PYTHON_IN_VENV) scripts/bounds/table.py
	$(PYTHON_IN_VENV) scripts/second_attempts/table.py
	$(PYTHON_IN_VENV) scripts/tables/reliability.py
	$(PYTHON_IN_VENV) scripts/tables/figures.py

# The records themselves, from nothing in some hours; interrupted, it goes on where it was. What is
# there is not simulated again: delete the folders of records that are to be made anew.
evaluation: $(STAMP)
	PATH="$(CURDIR)/$(VENV)/bin:$$PATH" scripts/run_evaluation.sh

# The stamp is written last, so an interrupted installation is taken up again. Drake's wheel needs
# one system library that pip cannot bring.
$(STAMP): pyproject.toml
	@PYTHON=$(PYTHON_IN_VENV) scripts/find_python.sh >/dev/null 2>&1 || { \
	  python=$$(scripts/find_python.sh) && echo "creating $(VENV) with $$python" && \
	  "$$python" -m venv --clear $(VENV); }
	@echo "installing Drake and what else is needed into $(VENV); this takes some minutes"
	$(PYTHON_IN_VENV) -m pip install --disable-pip-version-check --quiet --editable '.[dev,cluster]'
	@$(PYTHON_IN_VENV) -c 'import pydrake.common' || { \
	  echo "Drake does not load; on Debian and Ubuntu: apt-get install libglib2.0-0" >&2; exit 1; }
	@touch $@
	@echo "ready: try 'make demo', 'make test', '$(VENV)/bin/lic --help'"

# Keeps .venv (rm -r .venv for a fresh one) and out/, which may hold hours of reaches.
clean:
	rm -rf build dist .pytest_cache .mypy_cache .ruff_cache .hypothesis
	find lic_drake tests scripts .ci -name __pycache__ -type d -prune -exec rm -rf {} +
