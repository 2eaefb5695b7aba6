# Two commands for everyone: `make fly` and `make test`. Each makes the environment it needs.
PYTHON ?= $(shell command -v python3.11 || command -v python3)
VENV := .venv
BIN := $(VENV)/bin
WHEEL := $(abspath .venv-wheel)
FLIES := $(VENV)/.flies
READY := $(VENV)/.ready
INSTALL := $(BIN)/python -m pip install --quiet --disable-pip-version-check

.PHONY: fly test rest browser sandbox clients check lint types paper schema docs diagrams pictures site release wheel requirements audit aarch64 clean

fly: $(FLIES)
	$(BIN)/rebound fly missions/wall.yaml

test: $(READY)
	$(BIN)/python -m pytest -m "not slow and not realtime"

# What takes long, such as whole missions, or runs by the clock.
rest: $(READY)
	$(BIN)/python -m pytest -m "slow or realtime"

# The report and the live page in a headless Chromium of the distribution's; fails where there is none.
browser: $(READY)
	$(BIN)/python -m pytest -n 0 tests/browser

# Other people's clients on the simulated vehicle, each in an environment of its own: MAVSDK 3 and 4 cannot share one.
# In real time: some minutes.
CLIENTS := $(abspath .venv-clients)
CLIENT_TEST := -m pytest -q -o addopts= -p no:cacheprovider --rootdir=.

clients: $(READY) $(CLIENTS)/mavsdk3/.ready $(CLIENTS)/mavproxy/.ready
	cd tests/clients && $(abspath $(BIN))/python $(CLIENT_TEST) test_mavutil.py test_mavsdk_v4.py test_mavsdk_guard.py
	cd tests/clients && REBOUND_PYTHON=$(abspath $(BIN))/python $(CLIENTS)/mavsdk3/bin/python $(CLIENT_TEST) test_mavsdk_v3.py
	cd tests/clients && REBOUND_PYTHON=$(abspath $(BIN))/python MAVPROXY=$(CLIENTS)/mavproxy/bin/mavproxy.py \
		$(CLIENTS)/mavproxy/bin/python $(CLIENT_TEST) test_mavproxy.py

$(CLIENTS)/%/.ready: requirements/%.txt
	$(PYTHON) -m venv $(@D)
	$(@D)/bin/python -m pip install --quiet --disable-pip-version-check --require-hashes -r $<
	touch $@

check: lint types test rest

lint: $(READY)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

types: $(READY)
	$(BIN)/mypy

# Every version is pinned, and every file by its hash: a fresh machine gets what was tested, or stops. What flying needs
# comes first, without bytecode: to compile all of scipy and matplotlib would take longer than all else.
$(FLIES): pyproject.toml requirements/sim.txt
	test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	$(INSTALL) --no-compile --require-hashes -r requirements/sim.txt
	$(INSTALL) --no-deps --no-build-isolation -e .
	touch $(FLIES)

$(READY): $(FLIES) requirements.txt
	$(INSTALL) --require-hashes -r requirements.txt
	touch $(READY)

# The pins made anew, for every platform; versions stay as they are but for `make requirements UPGRADE=--upgrade` (or
# `UPGRADE="--upgrade-package numpy"`).
PIN := $(BIN)/uv pip compile --quiet --python-version 3.11 --generate-hashes --no-annotate \
	--custom-compile-command "make requirements" $(UPGRADE)

requirements: $(READY)
	$(PIN) --universal --extra dev pyproject.toml -o requirements.txt
	$(PIN) --universal -c requirements.txt pyproject.toml -o requirements/drone.txt
	printf '%s\n' pytest setuptools==80.9.0 | $(PIN) --universal -c requirements.txt --extra sim pyproject.toml - -o requirements/sim.txt
	printf '%s\n' mavsdk==3.17.4 pytest==9.2.0 | $(PIN) - -o requirements/mavsdk3.txt
	printf '%s\n' MAVProxy==1.8.75 pytest==9.2.0 | $(PIN) - -o requirements/mavproxy.txt

# The service installed, booted, hit, killed and hung under a real systemd; as root, in a checkout outside /tmp and homes.
sandbox: $(READY)
	REBOUND_SANDBOX=1 $(BIN)/python -m pytest -n 0 -rs tests/rebound_cli/service/test_in_systemd.py

# Fails on a known vulnerability of what is pinned; where nobody can be asked, says so.
audit: $(READY)
	@mkdir -p $(WHEEL)
	@for pins in requirements.txt requirements/mavsdk3.txt requirements/mavproxy.txt; do \
		$(BIN)/pip-audit --disable-pip --require-hashes --progress-spinner=off --requirement=$$pins > $(WHEEL)/audit.log 2>&1 \
		&& cat $(WHEEL)/audit.log \
		|| { grep -qE "ConnectionError|ReadTimeout|ServiceError|blocking this service" $(WHEEL)/audit.log \
			&& echo "$$pins: the vulnerability service could not be asked."; } \
		|| { cat $(WHEEL)/audit.log; exit 1; }; done

# A Raspberry Pi builds nothing: every file of the base is a wheel, for glibc 2.28 and later. Pip says "connection broken"
# where there is no way to the index.
aarch64: $(READY)
	@rm -rf $(WHEEL)/aarch64; mkdir -p $(WHEEL)/aarch64
	@$(BIN)/python -m pip download --retries 2 --no-deps --require-hashes --only-binary=:all: \
		--implementation cp --python-version 3.11 --platform manylinux_2_28_aarch64 --platform manylinux2014_aarch64 \
		-d $(WHEEL)/aarch64 -r requirements/drone.txt > $(WHEEL)/aarch64.log 2>&1 \
	&& echo "aarch64: every dependency of the base has a wheel." \
	|| { grep -q "connection broken" $(WHEEL)/aarch64.log && echo "aarch64: the package index could not be asked."; } \
	|| { cat $(WHEEL)/aarch64.log; exit 1; }

# What somebody gets who has no checkout: the wheel in an environment of its own, on a drone and with the simulated vehicle.
wheel: $(READY)
	rm -rf build $(WHEEL)
	$(BIN)/python -m pip wheel --quiet --disable-pip-version-check --no-deps --no-build-isolation -w $(WHEEL)/dist .
	$(MAKE) $(WHEEL)/drone $(WHEEL)/sim
	cd tests/clients && WHEEL=$(WHEEL) $(abspath $(BIN))/python $(CLIENT_TEST) test_wheel.py

$(WHEEL)/%: requirements/%.txt
	$(PYTHON) -m venv $@
	$@/bin/python -m pip install --quiet --disable-pip-version-check --require-hashes -r $<
	$@/bin/python -m pip install --quiet --disable-pip-version-check --no-deps $(WHEEL)/dist/*.whl
	$@/bin/python -m pip check

paper: $(READY)
	$(BIN)/python -m bench paper

schema: $(READY)
	$(BIN)/rebound check --schema > missions/schema.json

# The pages that are written from the code; `diagrams` is their name of before.
docs diagrams: $(READY)
	$(BIN)/python -m bench docs

# The pictures of the manual, from one flight; needs Chromium.
pictures: $(READY)
	$(BIN)/python -m bench pictures

# The manual as a site in build/site; fails on a link that leads nowhere.
site: $(READY)
	$(BIN)/mkdocs build --strict

# A picture or figure of the manual that is of another release fails among the tests.
release: check site

clean:
	rm -rf $(VENV) $(CLIENTS) $(WHEEL) build .pytest_cache .mypy_cache .ruff_cache runs
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
