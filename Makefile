# SPDX-License-Identifier: Apache-2.0
# `make` without a target lists the targets. Live runs need root or the group docker; without both they are started through sudo. Virtual runs (ENGINE=virtual) need neither.

SHELL := /bin/bash
.DEFAULT_GOAL := help
.PHONY: help packages setup setup-dev build experiment paper kept plots shell check tidy smoke test test-all test-browser test-asan test-tsan fuzz bench bench-against test-netem data images wheel docs doctor clean
# The Python environment and the C++ programs are built in parallel: one downloads while the other compiles.
MAKEFLAGS += -j2

NAME ?= quickstart
DATASET ?= quickstart
ENGINE ?= auto
PAPER ?= all
SECONDS ?= 20
ROUNDS ?= 7
HISTORY ?= build-bench/history.jsonl
comma := ,
BUILD := build
VENV := .venv/bin
SLAMBED := $(VENV)/slambed
# sudo keeps the variables with the places of data and caches.
UNPRIVILEGED := $(filter-out 0,$(shell id -u))
VIRTUAL := $(filter virtual,$(ENGINE))
WITHOUT_DOCKER := $(if $(filter local,$(ENGINE)),yes,$(if $(UNPRIVILEGED),$(if $(VIRTUAL),,$(shell docker info >/dev/null 2>&1 || echo yes))))
SUDO := $(if $(UNPRIVILEGED),$(if $(WITHOUT_DOCKER),sudo --preserve-env=SLAMBED_DATA$(comma)SLAMBED_DATASETS$(comma)SLAMBED_SYSTEMS$(comma)SLAMBED_CACHE$(comma)HOME))

help: ## This list
	@grep -hE '^[a-z-]+:.*## ' $(MAKEFILE_LIST) | awk -F ':.*## ' '{printf "  make %-13s %s\n", $$1, $$2}'
	@echo
	@echo "  Start with: make experiment NAME=quickstart [RUNS=1] [ENGINE=docker|local|virtual]"

packages:
	@tools/setup.sh run $(if $(VIRTUAL),,live)

setup: packages ## Install what is missing (apt, .venv)
	@tools/venv.sh

setup-dev: packages
	@tools/venv.sh dev

build: packages ## Compile the C++ programs (inside the image build where Docker is)
	@tools/build.sh $(ENGINE)

experiment: setup build ## Run an experiment and show its report: NAME=quickstart [RUNS=3] [ENGINE=auto]
	@$(SUDO) $(SLAMBED) run $(NAME) $(if $(RUNS),--runs $(RUNS)) $(if $(filter-out auto,$(ENGINE)),--engine $(ENGINE))

paper: setup build ## Run or reuse a paper's experiments and write its page, by default of all papers, each experiment with the engine of its file: for example PAPER=dynnetslam RUNS=plan ENGINE=virtual BUDGET=2h PART=1/3
	@$(SUDO) $(SLAMBED) papers run $(PAPER) $(if $(RUNS),--runs $(RUNS)) $(if $(filter-out auto,$(ENGINE)),--engine $(ENGINE)) $(if $(BUDGET),--budget $(BUDGET)) $(if $(PART),--part $(PART))

kept: setup ## Write the papers' pages from the packed runs; runs nothing
	@$(SLAMBED) papers kept

plots: setup ## Draw all reports again without running anything
	@$(SLAMBED) report all

shell: setup ## A shell in which `slambed` is a command
	@PATH="$(CURDIR)/.venv/bin:$$PATH" $${SHELL:-/bin/bash}

check: setup-dev ## Before trying a change: ruff, mypy, codespell, import contracts, C++ headers one by one, tests without programs
	@tools/setup.sh build test
	@tools/check.sh

tidy: setup-dev ## clang-tidy on the C++ of the product: [ONLY=systems/core/map]
	@tools/setup.sh build test
	@tools/tidy.sh $(BUILD) $(ONLY)

smoke: setup ## Three seconds of every experiment in virtual time: one run per system and dataset
	@tools/build.sh virtual
	@tools/smoke.sh all

test: setup-dev ## All tests and checks: ctest, pytest, lint and format of both languages, mypy, import contracts, smoke
	@tools/setup.sh build test
	@tools/test.sh $(BUILD)

test-all: setup-dev ## make test, and what only the nightly needs: slow tests, every experiment in smoke, clang-tidy everywhere
	@tools/setup.sh build test
	@tools/test.sh $(BUILD) all

test-browser: setup-dev ## Tests that open the pages in Chromium, which this installs; make test runs them where it is there
	@tools/setup.sh browser
	@$(VENV)/pytest -m browser --browser=chromium harness/tests

test-asan: setup ## The C++ tests under AddressSanitizer and UBSan
	@tools/setup.sh build test
	@tools/sanitize.sh asan

test-tsan: setup ## The C++ tests under ThreadSanitizer
	@tools/setup.sh build test
	@tools/sanitize.sh tsan

fuzz: packages ## Every fuzz target under AddressSanitizer for a while: [SECONDS=20]
	@tools/setup.sh build fuzz
	@tools/fuzz.sh $(SECONDS)

bench: packages ## Google Benchmarks of every stage, and how times grow with the map
	@tools/setup.sh build bench
	@tools/bench.sh

bench-against: packages ## Google Benchmarks in turn with those of another commit, by default the newest other one of the history: [BASE=COMMIT] [ROUNDS=7] [HISTORY=build-bench/history.jsonl]
	@tools/setup.sh build bench
	@python3 tools/bench_against.py $(BASE) --rounds $(ROUNDS) --history $(HISTORY)

test-netem: setup-dev build ## The kernel's own netem and cgroup v2, in a small virtual machine (user-mode Linux)
	@tools/netem_vm.sh

data: setup build ## Prepare a sequence: DATASET=quickstart (see 'slambed data list')
	@$(SUDO) $(SLAMBED) data prepare $(DATASET)

images: packages ## Build the node image
	@tools/build.sh docker

wheel: setup-dev ## A wheel with all programs, which installs without a compiler: build/dist
	@tools/build.sh local
	@tools/wheel.sh $(BUILD) $(BUILD)/dist

docs: setup-dev ## The documentation as a site, build/site/html; a link that leads nowhere is an error
	@$(VENV)/python tools/site.py $(BUILD)

doctor: setup ## Show what this machine can do
	@$(SUDO) $(SLAMBED) doctor

clean: ## Remove build products and what killed campaigns left; results, measured times and found crashes stay
	@if [ -x $(SLAMBED) ]; then $(SUDO) $(SLAMBED) clean; fi
	@rm -rf $(BUILD) build-asan build-tsan build-alone .mypy_cache .ruff_cache .pytest_cache .import_linter_cache
