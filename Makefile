# Thin: every target is one command of the program (`.venv/bin/vsr`) or of a tool in .venv.
SHELL := bash
.SHELLFLAGS := -euo pipefail -c
MAKEFLAGS += --no-builtin-rules --no-print-directory
.DELETE_ON_ERROR:
.NOTPARALLEL:
.DEFAULT_GOAL := help

# Only what .venv holds is used, and its bytecode is kept, without which each start is slower.
unexport PYTHONDONTWRITEBYTECODE PYTHONHOME PYTHONPATH

python := .venv/bin/python
vsr := @$(python) -m pipeline

# Values reach the program as they were given: one argument each, whatever characters are in them.
quoted = '$(subst ','\'',$1)'
flag = $(if $(value $2),$1 $(call quoted,$(value $2)))
list = $(if $(value $2),--set $(call quoted,$1=[$(value $2)]))
derived = $(call flag,--derived,DERIVED)
set = $(foreach item,$(value SET),--set $(call quoted,$(item)))
study = --site $(call quoted,$(value SITE)) $(call flag,--study,STUDY) $(set) $(derived)
site = $(study) $(call list,yaw,YAW) $(call list,contact.friction,FRICTION)
cell = $(call flag,--yaw,YAW) $(call flag,--friction,FRICTION) $(call flag,--pga,PGA) \
  $(call flag,--pgv-pga,PGV_PGA) $(call flag,--record,RECORD) $(call flag,--and,AND)
where = $(call flag,--workers,WORKERS) $(call flag,--scheduler,SCHEDULER)

.PHONY: help
help:
	@awk -F ' *## *' ' \
	  /^## / { printf "\n%s\n", $$2 } \
	  /^#:/ { sub(/^#: ?/, ""); printf "  %s\n", $$0 } \
	  /^[a-z-]+:.*## / { sub(/:.*/, "", $$1); printf "  make %-12s  %s\n", $$1, $$2 } \
	' Makefile

## A rock
.PHONY: fragility uncertainty displacement hazard study replay prep
fragility: setup ## how strong must shaking be to topple SITE: curves and report
	$(vsr) run fragility $(site) $(where)

uncertainty: setup ## how certain that is, when rock and shaking are known within ranges
	$(vsr) run uncertainty $(site) $(where)

displacement: setup ## where the rock of SITE goes over its terrain: trajectories and report
	$(vsr) run displacement $(site) $(where)

hazard: setup ## which branches of a hazard model let SITE's rock stand for its age
	$(vsr) run hazard $(site) $(call flag,--curves,CURVES) $(call flag,--age,AGE) \
	  $(call flag,--age-sd,AGE_SD) $(where)

study: PRODUCT ?= study
study: setup ## what changes in SITE, or in another PRODUCT of it, along the sweep of STUDY
	$(vsr) run $(call quoted,$(value PRODUCT)) $(site) $(where)

replay: setup ## a page that plays the run of SITE at YAW, PGA and PGV_PGA, or two with AND
	$(vsr) replay $(study) $(cell) $(where)

prep: setup ## rock and terrain from SITE's scan, with a page of every step
	$(vsr) prep $(site)

## How good the method is
.PHONY: accuracy stability drive feasible validate
accuracy: setup-dev ## error of SITE's boundary against run time, beside other ways of computing it
	$(vsr) run accuracy $(site) $(where)

stability: SITE ?= cuboid_1x1x2
stability: setup-dev ## stiff and extreme cases, each with its verdict
	$(vsr) run stability $(site) $(where)

drive: setup ## how a servo's table follows its motions, and what that does to SITE's boundary
	$(vsr) run drive $(site) $(where)

feasible: LIMITS ?= mini_shake_robot
feasible: setup ## what a table of hardware can do of SITE's pulses
	$(vsr) feasible $(site) --table $(call quoted,$(value LIMITS))

validate: setup ## predict the shake-table tests in the folder TABLE, beside their outcomes
	$(vsr) run validation --table $(call quoted,$(value TABLE)) $(derived) $(where)

## Before and after
.PHONY: plan status why index fetch
plan: setup ## what would run for SITE, and what it costs
	$(vsr) plan $(site)

status: setup ## what is done for SITE
	$(vsr) status $(site)

why: setup ## why something of SITE would run again
	$(vsr) why $(site)

index: setup ## a page that leads to all results
	$(vsr) index $(derived)

fetch: setup ## download the public original NAME into data/raw
	$(vsr) fetch $(call quoted,$(value NAME))

## What they take
#: SITE=double_rock       a site in configs/sites, or any YAML file
#: STUDY=friction         a study in configs/studies, or any YAML file; those with a sweep: make study
#: PRODUCT=fragility      what make study makes of each member
#: YAW=0,90               directions of shaking [degree]
#: FRICTION=0.4,0.6       friction of rock on pedestal
#: PGA=0.4 PGV_PGA=0.3    the run to replay [g, s]; RECORD=name in place of PGV_PGA
#: AND=neighbour          a run beside it, e.g. AND=engine=bullet or AND=yaw=30,pga=0.5
#: SET='a.b=1 c.d=2'      any other keys of the configuration
#: CURVES=folder          hazard curves of OpenQuake or nshmp-haz, or OpenQuake's calc_N.hdf5
#: AGE=20000 AGE_SD=3000  how long the rock has stood, and the standard deviation of that [years]
#: LIMITS=my_table.yaml   a table in configs/tables, or any YAML file
#: TABLE=folder           recorded shake-table tests
#: WORKERS=4              worker processes; 0 for none
#: SCHEDULER=tcp://h:8786 a running Dask scheduler
#: DERIVED=folder         where results go, in place of data/derived

## The paper
.PHONY: figures
figures: setup ## every figure of the paper and its table, and which of its claims were found
	$(vsr) figures $(call flag,--fig,FIG) $(call flag,--record,RECORD) $(derived) $(where) \
	  $(foreach item,$(value SET),--set $(call quoted,$(item)))

#:
#: FIG=12                 one of them: 7, 8, 10 to 17, table_1, friction, settings, printed
#: RECORD=file            recorded motion for Fig. 7, in place of the samples

## The project
.PHONY: setup setup-dev test coverage test-slow lint check format options docs docs-links bench lock clean
test: setup-dev ## tests of some minutes at most
	@$(python) -m pytest -n auto --dist loadfile

coverage: setup-dev ## the same tests, in half as much time again, and which lines none reaches
	@$(python) -m pytest -n auto --dist loadfile --cov --cov-report=term:skip-covered

test-slow: setup-dev ## tests that take many minutes
	@$(python) -m pytest -m slow

check: lint test ## lint, format, types and tests

lint: setup-dev ## lint, format and types only
	@$(python) -m ruff check
	@$(python) -m ruff format --check
	@$(python) -m mypy

format: setup-dev ## put the code in the project's format
	@$(python) -m ruff check --fix
	@$(python) -m ruff format

options: setup-dev ## docs/options.md and the schemas in configs/, from the models
	@$(python) -m scripts.options --write

docs: setup-dev ## the documentation as a site, in build/docs/html, readable offline
	@$(python) -m scripts.docs

docs-links: setup-dev ## try every link of the documentation to elsewhere
	@$(python) -m scripts.docs --links

bench: setup-dev ## performance benchmarks, as ratios in one run
	@$(python) -m benchmarks $(call flag,--tests,TABLE)

lock: ## renew both locks from pyproject.toml; UPGRADE=1 for the newest versions
	@scripts/setup.sh lock $(if $(value UPGRADE),--upgrade)

clean: setup ## remove derived data, of SITE or of all; asks first, unless YES=1
	$(vsr) clean $(call flag,--site,SITE) $(derived) $(if $(value YES),--yes)

setup: ## make .venv now, as every target does when it is missing or stale
	@scripts/setup.sh

setup-dev: ## add to .venv what tests and checks need, and MuJoCo
	@scripts/setup.sh dev
