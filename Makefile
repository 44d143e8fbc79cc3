# The few commands of this project; `make` alone lists them.

# Variables to set on the command line, as in `make ui PORT=8080`.
PYTHON ?=
TORCH_INDEX ?= https://download.pytorch.org/whl/cpu
PORT ?= 5000
MINUTES ?= 30
AGENT ?= *
PRESET ?= default
SEED ?=
TRIALS ?=
SAMPLER ?=
STORAGE ?=
ALL ?=

# Disable the telemetry of all tools.
export DVC_NO_ANALYTICS := true
export ITERATIVE_DO_NOT_TRACK := true
export MLFLOW_DISABLE_TELEMETRY := true
export RAY_USAGE_STATS_ENABLED := 0

# What a login sets, and a container may not: without a name and a home, DVC fails.
ifeq ($(LOGNAME)$(USER),)
export LOGNAME := $(or $(shell id -un 2>/dev/null),$(shell id -u))
endif
ifeq ($(HOME),)
export HOME := $(or $(shell getent passwd $$(id -u) | cut -d: -f6),/)
endif

export PYTHON TORCH_INDEX
export PATH := $(CURDIR)/.venv/bin:$(PATH)

# Containers often set the first. But uv installs packages without byte code, so each of a run's many
# processes would compile what it imports anew: almost half of the CPU time of the smoke preset. ROS
# sets the second, to packages of its own. The last is how other tools know coding agents.
unexport PYTHONDONTWRITEBYTECODE PYTHONPATH PYTHONHOME AGENT

.DEFAULT_GOAL := help
.PHONY: help install shared try repro preset article tune check style test test-all test-quick test-comparison test-smoke test-soak test-training \
	test-pages test-rest bench soak verify publish ui view watch generate lock clean

help: ## list these commands
	@sed -nE 's/^([a-z-]+):.*## (.*)/make \1\t\2/p' Makefile | expand -t 16

install: .venv/.packages .venv/.rendering .venv/.page .venv/bin/ffmpeg ## install what is missing, into .venv (TORCH_INDEX= for CUDA)

ifneq ($(shell cat .venv/.packages 2>/dev/null),$(shell scripts/environment.sh stamp 2>/dev/null))
.PHONY: .venv/.packages
endif
.venv/.packages: requirements.lock pyproject.toml
	@scripts/environment.sh packages

.venv/.rendering: .venv/.packages
	@scripts/environment.sh rendering

.venv/.page: jumping_ant/play/vendor.py .venv/.packages
	@scripts/environment.sh page

# Rerun plays films with the `ffmpeg` that it finds.
.venv/bin/ffmpeg: | .venv/.packages
	@ln -sf "$$(python -c 'import imageio_ffmpeg; print(imageio_ffmpeg.get_ffmpeg_exe())')" $@

.venv/.browser: .venv/.packages
	@scripts/environment.sh browser

.venv/.peers: benchmarks/requirements.lock .venv/.packages
	@scripts/environment.sh peers

.venv/.shared: shared.lock .venv/.packages
	@scripts/environment.sh shared

shared: install .venv/.shared

repro: install ## list, then rerun, what a change to params.yaml or to the code affects
	@$(foreach name,AGENT PRESET SEED STAGES,$(if $(filter command,$(origin $(name))),$(error make repro \
		takes no $(name): `dvc repro STAGE` runs a stage, `make preset` a preset)))
	@python -m scripts.repro

try: install ## see robots learn to jump, and everything that comes of it, in .presets/quick (5 minutes)
	python -m scripts.preset quick

preset: install ## run a preset in a folder of its own, .presets/NAME (PRESET=families STAGES="compare timing")
	@python -m scripts.preset $(PRESET) $(STAGES)

article: install ## reproduce what the article printed, into results/article.json (3.5 hours on 2 cores)
	python -m scripts.article

tune: install
	@python -m scripts.tune $(AGENT:*=) $(if $(TRIALS),--trials $(TRIALS)) $(if $(SAMPLER),--sampler $(SAMPLER)) \
		$(if $(STORAGE),--storage '$(STORAGE)') $(if $(PRESET:default=),--preset $(PRESET))

check: install .venv/.shared ## style, types, and the tests that train nothing: the quick loop
	@$(MAKE) --no-print-directory --jobs=2 style test-quick test-comparison

style:
	ruff check
	ruff format --check
	mypy

test: install .venv/.browser .venv/.shared ## check style, types and behaviour: what a push needs (5 minutes)
	@$(MAKE) --no-print-directory --jobs=3 --keep-going \
		test-smoke test-rest test-training test-soak test-pages style
	@for tool in chromium node; do command -v $$tool >/dev/null || \
		echo "test: no $$tool here, so tests of pages were skipped"; done

test-all: export PYTEST_ADDOPTS := -m 'long or not long'
test-all: test ## all tests: every algorithm, servers, clusters, faults, searches, pages (11 minutes)

QUICK_TESTS = tests/base tests/params tests/sim tests/policies tests/test_layers.py \
	tests/media/test_style.py \
	tests/test_pipeline.py tests/test_publish.py tests/test_documented_commands.py

# Parts that run in parallel, three at a time, as they often wait for processes. The first takes the
# longest, one process after another, so the others give way to it.
SMOKE_TESTS = tests/test_smoke.py tests/tracking
SOAK_TESTS = tests/test_soak.py tests/compute tests/test_fingerprint.py tests/test_verify.py
TRAINING_TESTS = tests/training tests/agents tests/article tests/tuning tests/test_notebook.py
PAGES_TESTS = tests/play tests/report
GIVE_WAY = CI=1 nice -n 15

test-quick:
	pytest -q $(QUICK_TESTS)

test-comparison:
	pytest -q tests/comparison tests/evaluation

test-smoke:
	CI=1 pytest -q $(SMOKE_TESTS)

test-soak:
	$(GIVE_WAY) pytest -q $(SOAK_TESTS)

test-training:
	$(GIVE_WAY) pytest -q $(TRAINING_TESTS)

test-pages:
	$(GIVE_WAY) pytest -q $(PAGES_TESTS)

test-rest:
	$(GIVE_WAY) pytest -q \
		$(addprefix --ignore=,$(SMOKE_TESTS) $(SOAK_TESTS) $(TRAINING_TESTS) $(PAGES_TESTS))

bench: install .venv/.peers
	python -m benchmarks

soak: install
	python -m soak --minutes $(MINUTES)

verify: install
	@python -m scripts.verify $(if $(AGENT:*=),--agent $(AGENT)) $(if $(SEED),--seed $(SEED)) $(if $(ALL),--all)

publish: install ## write the results into README.md and docs/ (PRESET=families after that preset)
	python -m scripts.publish $(PRESET)

ui: install ## bring MLflow up to date and open its pages on this machine (PORT=5000)
	@python -m jumping_ant.tracking.ui --port $(PORT)

view: install ## open the recordings in the Rerun viewer (AGENT=sac for one)
	@python -m scripts.view $(AGENT:*=)

watch: install ## watch a trained policy play, in MuJoCo's viewer (AGENT=sac SEED=30)
	@python -m scripts.watch $(AGENT:*=) $(if $(SEED),--seed $(SEED))

# Of the catalogue: params.schema.json, a list in dvc.yaml.
generate: install
	python -m jumping_ant.params.schema

lock:
	@scripts/environment.sh lock

clean: ## remove .venv and caches; results stay
	rm -rf .venv .mypy_cache .pytest_cache .ruff_cache build *.egg-info
