# libgait - `make help` lists the targets; settings that stay go into Makefile.local.
MAKEFLAGS += -r
.SUFFIXES:
.DELETE_ON_ERROR:
.DEFAULT_GOAL := help

-include Makefile.local

PYTHON ?= python3

# ---- Python environment ------------------------------------------------------------------------------------
VENV  := .venv
READY := $(VENV)/.ready

.PHONY: help setup
help: ## list the targets
	@awk -F ':.*## ' '/^[a-z][a-z-]*:.*## /{printf "  %-14s %s\n", $$1, $$2}' $(firstword $(MAKEFILE_LIST))

setup: $(READY) ## make .venv with the pinned packages (once; later builds work offline)

# The stamp comes last: without it the environment is made anew, with it only changed pins are fetched.
$(READY): python/requirements.txt python/requirements-dev.txt python/pyproject.toml
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 10) and "setup: needs Python >= 3.10, set PYTHON=")'
	@$(PYTHON) -c 'import venv, ensurepip' || \
	    { echo 'setup: $(PYTHON) cannot make environments: install python3-venv or set PYTHON=' >&2; exit 1; }
	$(PYTHON) -m venv $$(test -f $@ || echo --clear) $(VENV)
	@rm -f $@
	$(VENV)/bin/pip install --quiet --disable-pip-version-check $(patsubst %,-r %,$(filter %.txt,$^))
	$(VENV)/bin/pip install --quiet --disable-pip-version-check --no-build-isolation --no-deps \
	    --config-settings editable_mode=compat -e python
	@$(VENV)/bin/python -c 'import lcm' || { echo 'setup: LCM needs libglib-2.0.so.0: install libglib2.0-0' >&2; exit 1; }
	@touch $@
