# SPDX-License-Identifier: BSD-3-Clause

SHELL := /bin/bash
PACKAGES := grid_map_core_py grid_map_demos_py grid_map_filters_py grid_map_ros_py grid_map_visualization_py
ENTER := . tools/env.sh &&
NO_NODES := --ignore-glob='*/test_node_*.py'
empty :=
SOURCES := $(subst $(empty) ,:,$(addprefix $(CURDIR)/,$(wildcard grid_map_*_py)))

.DEFAULT_GOAL := help
.PHONY: help setup build demo test test-fast test-oldest test-shuffled explore fuzz check format tables requirements docs pictures bench bench-compare soak clean distclean

help:  ## List the targets
	@sed -n 's/^\([a-z-]*\):.*## /\1\t/p' $(MAKEFILE_LIST) | expand -t 16

setup:  ## Create the Python environment .venv (PYTHON=... selects the interpreter)
	@tools/workspace setup

build:  ## Build the packages that have changed, with colcon
	@tools/workspace build

# The demo stays on this computer unless ROS_AUTOMATIC_DISCOVERY_RANGE says otherwise.
demo: build  ## Publish and filter a terrain, write pictures to demo_output/ (VIEW=1: show it in the browser until Ctrl-C, with images and curves; DEMO=elevation_mapping, DEMO=large_map, DEMO=path_planner, DEMO=planar_regions: another demo)
	@ROS_AUTOMATIC_DISCOVERY_RANGE=$${ROS_AUTOMATIC_DISCOVERY_RANGE:-LOCALHOST} \
	    tools/run grid_map_demos_py $(or $(DEMO),filters)_demo $(if $(filter-out 0,$(VIEW)),--view,--report demo_output)

test: build  ## Run all tests
	@tools/workspace browser && tools/test

test-shuffled: build  ## Run all tests in random order (SEED=... repeats an order)
	@seed=$(or $(SEED),$$RANDOM); echo "The order of the tests is that of SEED=$$seed."; \
	    tools/workspace browser && GRID_MAP_SHUFFLE=$$seed tools/test

test-fast: build  ## Run the tests of core and filters that start no node, in less than two minutes
	@$(ENTER) for package in grid_map_core_py grid_map_filters_py; do \
	    (cd $$package && python3 -m pytest -q $(NO_NODES)) || exit 1; \
	done

# Only the built workspace has the command `filter`.
test-oldest:  ## Run the tests of core and filters with the oldest supported NumPy and OpenCV
	@tools/workspace oldest
	@for package in grid_map_core_py grid_map_filters_py; do \
	    (cd $$package && env -u LD_LIBRARY_PATH PYTHONPATH=$(SOURCES) PATH="$(CURDIR)/.venv-oldest/bin:$$PATH" \
	        $(CURDIR)/.venv-oldest/bin/python -m pytest $(NO_NODES) --ignore-glob='*/test_command_*.py') || exit 1; \
	done

explore:  ## Try the property tests with new random examples (`make test` repeats the same ones)
	@$(ENTER) for package in core filters ros visualization; do \
	    (cd grid_map_$${package}_py && PYTHONPATH=$(SOURCES):$$PYTHONPATH python3 -m pytest -q $(NO_NODES) \
	        --hypothesis-profile=explore --timeout=600) || exit 1; \
	done

fuzz: build  ## Feed damaged messages, files and texts to all readers for a minute (FOR=... [s], or INPUTS=... of them)
	@$(ENTER) python3 test/fuzz.py $(if $(INPUTS),--inputs $(INPUTS),--seconds $(or $(FOR),60))

check: build  ## Check style, types, imports, license headers and the list of public names
	@$(ENTER) export MYPYPATH=$(SOURCES) PYTHONPATH=tools:$(SOURCES):$$PYTHONPATH && failed= && \
	    for tool in "ruff check --output-format=concise ." "ruff format --check ." "mypy $(addprefix -p ,$(PACKAGES))" \
	        "mypy --python-version=3.10 --no-warn-return-any --no-warn-unused-ignores -p grid_map_core_py -p grid_map_filters_py" \
	        lint-imports "python3 tools/api.py --check"; do $$tool || failed="$$failed, $$(echo $$tool | cut -d ' ' -f 1-2)"; done; \
	    [ -z "$$failed" ] || { echo "failed: $${failed#, }"; exit 1; }

format:  ## Format the code and apply automatic fixes
	@$(ENTER) ruff check --fix . ; ruff format .

tables: build  ## Update the parameter tables in docs/ and docs/api.txt from the code
	@$(ENTER) export PYTHONPATH=$(SOURCES):$$PYTHONPATH && python3 tools/parameter_tables.py && python3 tools/api.py

# Sphinx imports the packages from their sources, and their libraries from the environment of the build.
docs: build  ## Build the documentation site in build/docs/
	@tools/workspace docs
	@$(ENTER) libraries=$$(python3 -c 'import sysconfig; print(sysconfig.get_path("purelib"))') && \
	    PYTHONPATH=$(SOURCES):$$PYTHONPATH:$$libraries .venv-docs/bin/python -m sphinx -qEW -j auto --keep-going -c docs . build/docs && \
	    PYTHONPATH=$$libraries .venv-docs/bin/python -m pytest -q --noconftest -p no:cacheprovider test/built_site.py && \
	    echo "The site is build/docs/index.html"

pictures: build  ## Check that the scripts in docs/images/ draw the pictures of the documentation
	@$(ENTER) python3 -m pytest -q test/drawn_pictures.py

bench: build  ## Run the benchmarks
	@$(ENTER) python3 -m pytest benchmarks --benchmark-only

bench-compare: build  ## Time the benchmarks of COMMIT=... and of this checkout in turn; fail if a row became slower by more than 10 % (ONLY="bench_core.py ...": some files)
	@$(ENTER) python3 benchmarks/compare.py $(or $(COMMIT),HEAD) $(ONLY)

soak: build  ## Run all nodes at 30 Hz for ten minutes, disturb them and look for leaks (FOR=... [s] for longer)
	@$(ENTER) python3 benchmarks/soak.py --seconds $(or $(FOR),600)

# A requirement of ROS names the outdated lark-parser, which would overwrite files of lark.
requirements:  ## Pin what tools/requirements*.in list and pull in, with hashes (needs uv; keeps the versions that are pinned)
	@cd tools && for file in requirements*.in; do \
	    uv pip compile --no-config --universal --python-version 3.11 --generate-hashes --no-header --no-annotate --quiet \
	        --no-emit-package lark-parser $$file -o $${file%.in}.txt || exit 1; \
	done

clean:  ## Remove build results
	rm -rf build install log demo_output docs/api/generated

distclean: clean  ## Remove the Python environments as well
	rm -rf .venv .venv-docs .venv-oldest .lock
