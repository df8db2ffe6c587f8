# make run | demo | shell | test | test-deep | test-export | browser | mutants | docs | figures |
# coverage | bench | build | wheel | messages | clean; all is set up in .venv and install/.
PYTHON ?= python3
SHELL := /bin/bash
comma := ,

VENV := .venv
SOURCES := $(shell find cpg_ros config launch resource -type f -not -path '*/__pycache__/*') package.xml setup.py setup.cfg
# A sourced ROS 2 is used as it is; elsewhere its wheels from PyPI are installed.
ifeq ($(ROS_DISTRO),)
INSTALLED := $(VENV)/.installed
WHEELS := ros
# Jazzy's wheels end with this Python 3.
NEWEST := 13
PREFIXES := $(CURDIR)/$(VENV)
# A domain of our own, seen by this machine only; both can be overridden from outside.
export ROS_DOMAIN_ID ?= 42
export ROS_AUTOMATIC_DISCOVERY_RANGE ?= LOCALHOST
else
INSTALLED := $(VENV)/.installed-beside-$(ROS_DISTRO)
SITE := --system-site-packages
NEWEST := 14
PREFIXES := $(AMENT_PREFIX_PATH)
endif
# Installs groups of dependencies of pyproject.toml: $(call pip,GROUPS,OPTIONS).
pip = $(VENV)/bin/python -m pip install --quiet --disable-pip-version-check -c .ci/constraints.txt $(2) \
	-r <($(VENV)/bin/python -c 'import sys, tomllib; \
		groups = tomllib.load(open("pyproject.toml", "rb"))["dependency-groups"]; \
		print(*(line for name in sys.argv[1:] for line in groups[name]), sep="\n")' $(1))
# Containers often forbid it, and every process that starts would compile all sources again.
unexport PYTHONDONTWRITEBYTECODE

# Where the build has put the package, for every command that uses it: as install/setup.bash, which
# fails in a folder whose path has a space.
ENTER := set -e; export AMENT_PREFIX_PATH='$(CURDIR)/install/cpg_ros:$(PREFIXES)' \
	PYTHONPATH="$$(echo '$(CURDIR)'/install/cpg_ros/lib/python3*/*-packages)$${PYTHONPATH:+:$$PYTHONPATH}"

# Live tests wait for half of their time: three run at once on two cores.
LIVE ?= $(shell echo $$((($$(nproc) * 3 + 1) / 2)))
# Tests of a file that need no graph run in one process: what they share is made once. Live ones,
# without groups, are dealt out one by one. What hangs ends.
PYTEST = $(VENV)/bin/pytest test --timeout 600
OFFLINE := -n auto --dist loadfile
ONLINE := -n $(LIVE) --dist loadgroup
# What make test-deep, make browser and make docs run.
LEFT_OUT := deep or alone or browser or docs
# A shared machine may stall for seconds: before a commit, a live test that fails runs up to twice
# more, and is listed with what failed. In depth, and without a graph, nothing does.
AGAIN := --reruns 2 --rerun-show-tracebacks -r aR
# Compiled while linters run, before tests in several processes would at once; what a build has
# compiled, and an earlier run, is there.
KERNELS := feedback balance networks

.PHONY: build run demo shell test test-deep test-export browser mutants docs figures coverage \
	bench wheel messages unitree clean

build: install/.built install/.compiled

run: install/.built
	@echo 'Next, in another terminal: make shell; there: cpg gait walk, cpg topic hz joint_states, panel'
	@$(ENTER); exec install/cpg_ros/lib/cpg_ros/generator $(ARGS)

demo: install/.built
	@$(ENTER); exec install/cpg_ros/lib/cpg_ros/demo $(ARGS)

# Whatever the last command in it returned, leaving it is no error of make.
shell: install/.built
	@$(ENTER); export PATH='$(CURDIR)/install/cpg_ros/lib/cpg_ros:$(CURDIR)/$(VENV)/bin':"$$PATH"; \
		echo 'generator, cpg, analyze, inversion ... are on the path (--help); for export type cpg export; exit leaves this shell'; \
		bash --rcfile <(cat ~/.bashrc 2>/dev/null; echo "PATH='$$PATH'"; cpg completion) -i || :

# The tables of topics are read from running nodes, the bridge among them. What the pages let a
# reader type is run.
docs: install/.built messages
	@$(ENTER); $(VENV)/bin/sphinx-build -W --keep-going -q -b html docs docs/_build
	@echo 'built: docs/_build/index.html'
	@$(ENTER); $(PYTEST) $(ONLINE) $(AGAIN) -m docs $(ARGS)

figures: install/.built
	@$(ENTER); $(VENV)/bin/python docs/figures.py $(ARGS)

# Of what needs no graph, branches included; compiled code is not seen by it. What is measured is
# the installed copy, which is what the tests import.
COVER = --cov=$$(echo install/cpg_ros/lib/python3*/*-packages/cpg_ros) --cov-report=term:skip-covered \
	--cov-report=html:out/coverage $(if $(ARGS),,--cov-fail-under=90)
# Tools run in folders of their own: what they ran is gathered here.
export COVERAGE_FILE := $(CURDIR)/.coverage

coverage: install/.built
	@$(ENTER); $(PYTEST) $(OFFLINE) -m 'not (live or $(LEFT_OUT))' $(COVER) $(ARGS)

# What is run before every commit; with COVERAGE=yes it measures that, too, and takes three
# minutes longer. The kernels of all networks are compiled while linters run.
test: install/.built messages
	@$(ENTER); $(VENV)/bin/python -P -m cpg_ros.ros.cli.precompile $(KERNELS) & \
		$(VENV)/bin/ruff check . && $(VENV)/bin/mypy && $(VENV)/bin/lint-imports --no-logo && wait $$!
	@$(ENTER); for part in '$(OFFLINE) -m "not (live or $(LEFT_OUT))" $(if $(COVERAGE),$(COVER))' \
		'$(ONLINE) $(AGAIN) -m "live and not ($(LEFT_OUT))"'; do \
		eval $(PYTEST) $$part $(ARGS) || [ $$? = 5 ]; done  # 5: none selected

# All tests, all examples of properties; and what measures the machine, by itself. A part that fails
# does not keep the others from being run.
test-deep: install/.built messages
	@$(ENTER); failed=0; for part in '$(OFFLINE) -m "not (live or browser)"' \
		'$(ONLINE) -m "live and not (alone or browser)"' '-m "alone and not browser"'; do \
		eval $(PYTEST) --hypothesis-profile=deep $$part $(ARGS) || [ $$? = 5 ] || failed=1; \
		done; exit $$failed

# Exported gaits as compiled C, and on simulated microcontrollers with their cycles, flash and RAM:
# gcc-avr, avr-libc, simavr, gcc-arm-none-eabi, libnewlib-arm-none-eabi, qemu-system-arm of Debian.
test-export: install/.built
	@$(ENTER); $(VENV)/bin/pytest test/motion/export --timeout 600 -s $(ARGS)

# Small faults, one at a time in a copy of the tree, each of which some test has to notice.
mutants: install/.built messages
	@$(ENTER); $(VENV)/bin/python test/mutants/run.py $(ARGS)

# The panel's page in Chromium, by playwright; none of its own browsers is downloaded.
browser: install/.built
	@command -v chromium chromium-browser google-chrome >/dev/null || \
		{ echo 'there is no Chromium: apt install chromium (on Ubuntu: snap install chromium)' >&2; exit 1; }
	@$(call pip,browser)
	@$(ENTER); $(PYTEST) $(AGAIN) -m browser $(ARGS)

bench: install/.built
	@$(ENTER); for file in benchmarks/bench_*.py; do $(VENV)/bin/python $$file; done

# One file that pip installs without this tree and without colcon: cpg, cpg-demo, cpg-generator ...
wheel: $(INSTALLED)
	@rm -rf build/lib build/bdist* && $(VENV)/bin/python -m pip wheel --quiet --disable-pip-version-check --no-deps \
		--no-build-isolation --wheel-dir out/wheel .
	@ls out/wheel/cpg_ros-*.whl

# Messages that PyPI does not have, for ROS 2 as pip installs it: of Unitree's robots, and of /tf.
messages unitree: $(VENV)/.messages

$(VENV)/.messages: $(INSTALLED) resource/interfaces/build.py $(wildcard resource/interfaces/*/msg/*.msg)
	@$(VENV)/bin/python resource/interfaces/build.py $(wildcard resource/interfaces/*/) >$(VENV)/messages.log 2>&1 || \
		{ tail -n 5 $(VENV)/messages.log >&2; exit 1; }
	@grep ^built $(VENV)/messages.log
	@touch $@

$(INSTALLED): pyproject.toml .ci/constraints.txt
	@$(PYTHON) -c 'import sys; sys.exit(not (3, 11) <= sys.version_info[:2] <= (3, $(NEWEST)))' || \
		{ echo "$(PYTHON) is $$($(PYTHON) --version 2>&1); cpg_ros needs Python 3.11 to 3.$(NEWEST) (PYTHON=...)" >&2; exit 1; }
	@test -x $(VENV)/bin/pip -a -e $@ || $(PYTHON) -m venv --clear $(SITE) $(VENV) || \
		{ echo '$(PYTHON) could not make a virtual environment (on Debian and Ubuntu: apt install python3-venv)' >&2; exit 1; }
	@echo 'installing the dependencies into $(VENV) (the first time takes a few minutes)$(if $(ROS_DISTRO),; ROS 2 is the sourced one$(comma) $(ROS_DISTRO))'
	@$(call pip,core c3d h5 optimize sim fleet panel build test lint docs $(WHEELS))
	@$(call pip,models,--no-deps)
	@$(call pip,numba) || \
		echo 'numba cannot be installed here: the generator will step its network in C, without feedback'
	@touch $(VENV)/COLCON_IGNORE $@

# colcon installs over what is there: modules that have been deleted would stay.
install/.built: $(INSTALLED) $(SOURCES)
	@find build/*/build/lib install/*/lib/python3*/*-packages/cpg_ros -name '*.py' -delete 2>/dev/null || :
	@source $(VENV)/bin/activate; \
		colcon --log-base log build --base-paths . --packages-select cpg_ros --event-handlers console_direct- 
	@touch $@

# Once for each installation: later changes are compiled where they are first used.
# -P: of the installed copy, which is what nodes run.
install/.compiled: | install/.built
	@$(ENTER); $(VENV)/bin/python -P -m cpg_ros.ros.cli.precompile || \
		echo 'the kernels were not compiled: that is done at the first start'
	@touch $@

clean:
	rm -rf build install log out docs/_build $(VENV)
