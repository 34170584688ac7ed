# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause

SHELL := /bin/bash
PACKAGES := grid_map_core_py grid_map_demos_py grid_map_filters_py grid_map_ros_py grid_map_visualization_py
ENTER := . tools/env.sh &&
empty :=
SOURCES := $(subst $(empty) ,:,$(addprefix $(CURDIR)/,$(wildcard grid_map_*_py)))

.DEFAULT_GOAL := help
.PHONY: help setup build demo test test-oldest explore fuzz check format tables docs bench clean distclean

help:  ## Show the targets
	@sed -n 's/^\([a-z-]*\):.*## /\1\t/p' $(MAKEFILE_LIST) | expand -t 16

setup:  ## Make the Python environment .venv (PYTHON=... chooses the Python)
	@tools/workspace setup

build:  ## Build with colcon what has changed
	@tools/workspace build

# Demos of two people on one network keep to their own computers, unless ROS is told otherwise.
demo: build  ## Publish a terrain, filter it, write pictures to demo_output/ (VIEW=1: show it in the browser until Ctrl-C)
	@ROS_AUTOMATIC_DISCOVERY_RANGE=$${ROS_AUTOMATIC_DISCOVERY_RANGE:-LOCALHOST} \
	    tools/run grid_map_demos_py filters_demo $(if $(VIEW),--view,--report demo_output)

test: build  ## Run all tests
	@tools/test

test-oldest:  ## Run the tests of core and filters with the oldest supported NumPy and OpenCV
	@tools/workspace oldest
	@for package in grid_map_core_py grid_map_filters_py; do \
	    (cd $$package && env -u LD_LIBRARY_PATH PYTHONPATH=$(SOURCES) \
	        $(CURDIR)/.venv-oldest/bin/python -m pytest --ignore-glob='*/test_node_*.py') || exit 1; \
	done

explore:  ## Look for counterexamples of the tests' properties at random (make test always tries the same)
	@$(ENTER) for package in core filters ros visualization; do \
	    (cd grid_map_$${package}_py && PYTHONPATH=$(SOURCES):$$PYTHONPATH python3 -m pytest -q --ignore-glob='*/test_node_*.py' \
	        --hypothesis-profile=explore --timeout=600) || exit 1; \
	done

fuzz: build  ## Read damaged messages and files for a minute (FOR=... for longer)
	@$(ENTER) python3 grid_map_ros_py/test/fuzz.py --seconds $(or $(FOR),60)

check: setup  ## Check style, types, imports and licence headers
	@$(ENTER) ruff check --output-format=concise . && ruff format --check . && \
	    export MYPYPATH=$(SOURCES) PYTHONPATH=tools:$(SOURCES):$$PYTHONPATH && \
	    mypy $(addprefix -p ,$(PACKAGES)) && lint-imports

format:  ## Format the code and repair what can be repaired
	@$(ENTER) ruff check --fix . ; ruff format .

tables: build  ## Write the tables of parameters in docs/, from the code
	@$(ENTER) PYTHONPATH=$(SOURCES):$$PYTHONPATH python3 tools/parameter_tables.py

# The packages are imported for the reference, from the sources; what they need is in the environment of the build.
docs: build  ## Build the documentation site in build/docs/
	@tools/workspace docs
	@$(ENTER) libraries=$$(python3 -c 'import sysconfig; print(sysconfig.get_path("purelib"))') && \
	    PYTHONPATH=$(SOURCES):$$PYTHONPATH:$$libraries .venv-docs/bin/python -m sphinx -qEW -j auto --keep-going -c docs . build/docs && \
	    echo "The site is build/docs/index.html"

bench: build  ## Run the benchmarks
	@$(ENTER) python3 -m pytest benchmarks --benchmark-only

clean:  ## Remove what was built
	rm -rf build install log demo_output

distclean: clean  ## Remove the Python environments as well
	rm -rf .venv .venv-docs .venv-oldest .lock
