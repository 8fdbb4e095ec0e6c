# Commands of the project; `make` alone lists them. Every tool can be replaced: make test GHDL=/opt/ghdl/bin/ghdl

.DEFAULT_GOAL := help
SHELL := /bin/bash
.DELETE_ON_ERROR:

# Not made absolute: make splits absolute names at the blanks of a path.
ROOT := $(patsubst %/,%,$(dir $(lastword $(MAKEFILE_LIST))))
VENV := $(ROOT)/.venv
READY := $(VENV)/.ready
SITE_READY := $(VENV)/.site-ready
CLUSTER_READY := $(VENV)/.cluster-ready
RELEASE_READY := $(VENV)/.release-ready

PY ?= $(VENV)/bin/python
# The same from any working directory
PY_HERE = $(if $(filter /%,$(PY)),$(PY),$(CURDIR)/$(PY))
# Commands of your own. Only those that are set are handed on: scripts/setup.sh installs the others.
OWN := PYTHON GHDL VERILATOR YOSYS NEXTPNR YICES
$(foreach name,$(OWN),$(eval $(if $(strip $($(name))),export,unexport) $(name)))

# Processes at a time, tests and synthesis alike
JOBS ?= 2
# 1: make run records every signal of the RTL in build/run.fst
WAVES ?=
# Further arguments of run, test, registers, synth, check, pnr, prove, mutate, torture, upsets, coverage, fuzz, report and release
ARGS ?=
export JOBS

# Replay: files and choices, handed on through the environment so that any path works
DRIVE ?=
IN ?=
OUT ?=
ENGINE ?= rtl
EXPLORERS ?= 2
VARIANT ?= fast
TOP ?=
SEEDS ?= 5
BOARD ?=
CONTROLLER ?= mpdcc
export DRIVE IN OUT ENGINE EXPLORERS VARIANT TOP BOARD CONTROLLER

.PHONY: field-bench field-score help setup run test test-all lint format replay registers synth budgets check pnr sweep prove mutate report fidelity \
  cluster sources generate virtual-board bitstream native netlist layers robustness torture upsets coverage fuzz site release lock clean

help: ## this list
	@echo 'directmpc: direct predictive control of drives in VHDL'
	@echo
	@sed -n 's/^\([a-z-]*\):[^#]*## \(.*\)/  make \1|\2/p' '$(ROOT)/Makefile' | awk -F'|' '{ printf "%-20s %s\n", $$1, $$2 }'
	@echo
	@echo '  make replay DRIVE=f.toml IN=trace.csv OUT=decisions.csv [ENGINE=rtl|ghdl|model|ideal] [EXPLORERS=2] [VARIANT=fast|paper]'
	@echo '  make run [WAVES=1] [ARGS="--trace trace.csv --decisions decisions.csv"]'
	@echo '  make -s sources TOP=mpdcc_core'
	@echo '  make pnr [SEEDS=5] [ARGS=--help]'
	@echo '  make bitstream BOARD=ulx3s-85f [CONTROLLER=mpdcc|kbest|mptc|family]'

$(READY): $(ROOT)/locks/requirements.txt $(ROOT)/locks/requirements-proofs.txt $(ROOT)/scripts/setup.sh
	@'$(ROOT)/scripts/setup.sh' >&2

# Only the site needs them, so that the other commands install less.
$(SITE_READY): $(ROOT)/locks/requirements-site.txt $(READY)
	@echo 'setup: installing the Python packages of requirements-site.txt into .venv' >&2
	@'$(PY)' -m pip install --quiet --disable-pip-version-check --no-input --require-hashes -r '$(ROOT)/locks/requirements-site.txt' >&2
	@touch '$@'

$(CLUSTER_READY): $(ROOT)/locks/requirements-cluster.txt $(READY)
	@echo 'setup: installing the Python packages of requirements-cluster.txt into .venv' >&2
	@'$(PY)' -m pip install --quiet --disable-pip-version-check --no-input --require-hashes -r '$(ROOT)/locks/requirements-cluster.txt' >&2
	@touch '$@'

$(RELEASE_READY): $(ROOT)/locks/requirements-release.txt $(READY)
	@echo 'setup: installing the Python packages of requirements-release.txt into .venv' >&2
	@'$(PY)' -m pip install --quiet --disable-pip-version-check --no-input --require-hashes -r '$(ROOT)/locks/requirements-release.txt' >&2
	@touch '$@'

setup: ## install what is missing: system tools (apt) and .venv
	@'$(ROOT)/scripts/setup.sh' >&2

run: $(READY) ## the RTL controls the 6 kV drive in closed loop; prints and draws the result
	@'$(PY)' -m scripts run $(if $(filter-out 0,$(WAVES)),--waves) $(ARGS)

# worksteal: some of the syntheses take minutes, the others seconds
test: $(READY) ## every kind of check, some of its cases (tb/tiers.toml); half an hour on two cores
	@cd '$(ROOT)' && '$(PY_HERE)' -m pytest -n '$(JOBS)' --dist worksteal -m 'not thorough' $(ARGS)

# without MkDocs or Dask, the test that needs it says that it is skipped
test-all: $(READY) ## every test
	@$(MAKE) --no-print-directory -f '$(firstword $(MAKEFILE_LIST))' '$(SITE_READY)' || echo 'test-all: the packages of the site cannot be installed' >&2
	@$(MAKE) --no-print-directory -f '$(firstword $(MAKEFILE_LIST))' '$(CLUSTER_READY)' || echo 'test-all: the packages of the cluster cannot be installed' >&2
	@cd '$(ROOT)' && '$(PY_HERE)' -m pytest -n '$(JOBS)' --dist worksteal $(ARGS)

lint: $(READY) ## VHDL and Python style, docstrings, layers, analysis as VHDL-93 and VHDL-2008, fresh files
	@'$(PY)' -m scripts lint

format: $(READY) ## rewrite VHDL and Python in house style
	@'$(PY)' -m scripts lint --fix

# $(call need,NAME,what): stop with one line when a variable is empty
need = @if [ -z "$${$(1)}" ]; then echo '$@: $(1) is not set ($(2))$(if $(filter replay,$@),; make replay DRIVE=f.toml IN=trace.csv OUT=decisions.csv)' >&2; exit 2; fi
empty :=
oneof = @case "$${$(1)}" in $(subst $(empty) ,|,$(2))) ;; *) echo "replay: $(1) is '$${$(1)}', but has to be one of: $(2)" >&2; exit 2;; esac

replay: $(READY) ## run a recorded trace through the RTL or a model
	$(call need,DRIVE,the drive file or the name of a shipped one)
	$(call need,IN,the trace)
	$(call need,OUT,the file for the decisions)
	$(call oneof,ENGINE,rtl ghdl model ideal)
	$(call oneof,EXPLORERS,1 2 3 4 5 6 7 8)
	$(call oneof,VARIANT,fast paper)
	@'$(PY)' -m scripts replay --drive "$$DRIVE" --trace "$$IN" --out "$$OUT" --engine "$$ENGINE" --explorers "$$EXPLORERS" --variant "$$VARIANT"

registers: $(READY) ## register values of DRIVE as CSV; a C array with ARGS=--c
	$(if $(filter -h --help,$(ARGS)),,$(call need,DRIVE,the drive file or the name of a shipped one))
	@'$(PY)' -m scripts registers "$$DRIVE" $(ARGS)

synth: $(READY) ## resources of every entity and configuration (Yosys)
	@'$(PY)' -m scripts synth --jobs '$(JOBS)' $(ARGS)

budgets: $(READY) ## measure resources and cycles anew, rewrite what tests hold them to
	@'$(PY)' -m scripts budgets --jobs '$(JOBS)' $(ARGS)

check: $(READY) ## cycles, resources and decisions of a core beside a stored baseline (docs/check.md)
	@'$(PY)' -m scripts check $(ARGS)

pnr: $(READY) ## placed and routed on ECP5, worst-seed Fmax (nextpnr)
	@'$(PY)' -m scripts pnr --jobs '$(JOBS)' --seeds '$(SEEDS)' $(ARGS)

sweep: $(READY) ## cycles, area, clock and accuracy over variants, explorers and word lengths
	@'$(PY)' -m scripts sweep --jobs '$(JOBS)' $(ARGS)

prove: $(READY) ## formal proofs of the design; ARGS=gate_guard for one entity
	@'$(PY)' -m scripts prove --jobs '$(JOBS)' $(ARGS)

mutate: $(READY) ## small changes of the VHDL that no test notices; ARGS=gate_leg for one entity
	@'$(PY)' -m scripts mutate --jobs '$(JOBS)' $(ARGS)

torture: $(READY) ## millions of decisions against slow second writings; goes on where it was stopped
	@'$(PY)' -m scripts torture --jobs '$(JOBS)' $(ARGS)

upsets: $(READY) ## single upsets of every flip-flop of mapped netlists; goes on where it was stopped
	@'$(PY)' -m scripts upsets --jobs '$(JOBS)' $(ARGS)

coverage: $(READY) ## what vectors reach of VHDL, algorithms and library; mapped netlists; ARGS=mapped for one part
	@'$(PY)' -m scripts coverage $(ARGS)

fuzz: $(READY) ## bytes that nobody meant for the parsers: drive files, traces, frames; ARGS='--minutes 60'
	@'$(PY)' -m scripts fuzz $(ARGS)

report: $(READY) ## every published number, table and plot into reports/
	@'$(PY)' -m scripts report $(ARGS)

fidelity: $(READY) ## decisions and closed loops beside the ideal controller, and the error budget
	@'$(PY)' -m scripts fidelity --jobs '$(JOBS)' $(ARGS)

robustness: $(READY) ## closed loops with noise, on shipped and random drives; goes on where it was stopped
	@'$(PY)' -m scripts robustness --jobs '$(JOBS)' $(ARGS)

field-bench: $(READY) ## states, ideal decisions and costs of all candidates, to measure any implementation on
	@'$(PY)' -m scripts field-bench $(ARGS)

field-score: $(READY) ## score decisions on a set of the bench; ARGS='--set NAME --decisions FILE'
	@'$(PY)' -m scripts field-score $(ARGS)

cluster: $(CLUSTER_READY) ## install Dask, for studies on several machines (docs/cluster.md)
	@echo 'cluster: Dask is installed; docs/cluster.md says how to start a scheduler and workers'

sources: $(READY) ## VHDL files in compile order for TOP, one entity or several
	@if [ -z "$$TOP" ]; then '$(PY)' -m scripts sources '' >&2; exit 2; fi; '$(PY)' -m scripts sources "$$TOP"

virtual-board: $(READY) ## the board top in simulation, its UART or SPI on a pseudo-terminal; ARGS=--help
	@'$(PY)' -m scripts virtual-board $(ARGS)

bitstream: $(READY) ## bitstream for BOARD, timing met from five seeds
	$(call need,BOARD,the board)
	@'$(PY)' -m scripts bitstream --jobs '$(JOBS)' --seeds '$(SEEDS)' --board "$$BOARD" --controller "$$CONTROLLER" $(ARGS)

native: $(READY) ## native libraries of the cores, for the engine "rtl" of the Python library
	@'$(PY)' -m scripts native $(ARGS)

netlist: $(READY) ## netlist of BOARD for its vendor's tools (Verilog, EDIF)
	$(call need,BOARD,the board)
	@'$(PY)' -m scripts netlist --board "$$BOARD" --controller "$$CONTROLLER" $(ARGS)

verilog: $(READY) ## checked Verilog of the public entities, for tools that do not read the VHDL; ARGS=mptc_core for one
	@'$(PY)' -m scripts verilog $(ARGS)

layers: $(READY) ## draw the layers of the project, from its imports, into docs/layers.svg
	@'$(PY)' -m scripts layers $(ARGS)

site: $(SITE_READY) ## the documentation as a site in build/site
	@'$(PY)' -m scripts site $(ARGS)

# Hashes of every file of the pinned versions, for all machines and versions of Python from Debian 12 on.
# INDEX="--index-url ADDRESS" where pip has another index than the usual one.
LOCKED := $(notdir $(wildcard $(ROOT)/requirements*.txt))
lock: $(RELEASE_READY) ## hashes of all requirements, into locks/; after each change of a requirements*.txt
	@for file in $(LOCKED); do '$(PY)' -m uv pip compile '$(ROOT)'/$$file --no-deps --universal --generate-hashes --no-annotate \
	  --no-header --no-emit-index-url --python-version 3.11.5 $(INDEX) --quiet --output-file '$(ROOT)'/locks/$$file || exit 1; done

release: $(SITE_READY) $(CLUSTER_READY) $(RELEASE_READY) ## wheel, netlists, cores, site and bitstreams of a clean commit whose tests are green
	@'$(PY)' -m scripts release --jobs '$(JOBS)' $(ARGS)

generate: $(READY) ## rewrite the files that are generated from the model
	@'$(PY)' -m scripts generate

clean: ## remove what can be made again, but for .venv
	@rm -rf '$(ROOT)/build' '$(ROOT)/model/directmpc/native/verilog' '$(ROOT)/.pytest_cache' '$(ROOT)/.ruff_cache'
	@find '$(ROOT)' -path '$(ROOT)/.venv' -prune -o -name __pycache__ -type d -print0 | xargs -0 rm -rf
