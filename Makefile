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

# A recipe notes each variable that it reads; what else is given on the command line is refused.
# What a shell may export for others is no wish of who types: NAME is that of the machine in some.
given := $(foreach name,$(.VARIABLES),$(if $(filter command,$(origin $(name))),$(name)))
typed := NAME YES
read = $(eval taken += $1)$(if $(filter $1,$(typed)),$(if $(filter command,$(origin $1)),$(value $1)),$(value $1))
unread = $(firstword $(filter-out PYTHON $(taken),$(given)))
checked = $(if $(unread),$(error `make $@` has no variable $(unread); \
  it takes $(or $(sort $(taken)),none)$(call near,$(unread),$(taken))))
near = $(addprefix ; did you mean ,$(addsuffix ?,$(shell $(python) -c 'import difflib, sys; \
  print(*difflib.get_close_matches(sys.argv[1].upper(), sys.argv[2:], 1))' $(call quoted,$1) $2)))
run = @$(python) -m $1$(checked)
vsr = $(call run,pipeline $1)

# Values reach the program as they were given: one argument each, whatever characters are in them.
quoted = '$(subst ','\'',$1)'
argument = $(call quoted,$(call read,$1))
flag = $(if $(call read,$2),$1 $(call argument,$2))
switch = $(if $(call read,$2),$(if $(subst =1=,,=$(value $2)=),$(error \
  $2: got $(value $2); it is 1 where it is given; leave it out or give $2=1),$1))
list = $(if $(call read,$2),--set $(call quoted,$1=[$(value $2)]))
derived-flag = $(call flag,--derived,DERIVED)
study-flags = --site $(call argument,SITE) $(call flag,--name,NAME) $(call flag,--study,STUDY) $(call flag,--set,SET) $(derived-flag)
site-flags = $(study-flags) $(call list,yaw,YAW) $(call list,contact.friction,FRICTION)
cell-flags = $(call flag,--yaw,YAW) $(call flag,--friction,FRICTION) $(call flag,--pga,PGA) \
  $(call flag,--pgv-pga,PGV_PGA) $(call flag,--record,RECORD) $(call flag,--and,AND)
where-flags = $(call flag,--workers,WORKERS) $(call flag,--scheduler,SCHEDULER)

.PHONY: help
help:
	@awk -F ' *## *' ' \
	  /^## / { printf "\n%s\n", $$2 } \
	  /^#:/ { sub(/^#: ?/, ""); printf "  %s\n", $$0 } \
	  /^[a-z-]+:.*## / { sub(/:.*/, "", $$1); printf "  make %-12s  %s\n", $$1, $$2 } \
	' Makefile

# What is no target is refused, a folder too.
folders := $(filter-out docs,$(patsubst %/,%,$(wildcard */)))
.PHONY: $(folders)
.DEFAULT $(folders):
	$(error no target `$@`; `make` alone lists those there are)

## A rock
.PHONY: fragility uncertainty observations displacement hazard exclusion archive study replay prep
fragility: setup ## how strong must shaking be to topple SITE: curves and report
	$(call vsr,run fragility $(site-flags) $(where-flags))

uncertainty: setup ## how certain that is, when rock and shaking are known within ranges
	$(call vsr,run uncertainty $(site-flags) $(where-flags))

observations: setup ## what tests of SITE's rock in the field teach, and which would teach most
	$(call vsr,run observations $(site-flags) $(where-flags))

displacement: setup ## where the rock of SITE goes over its terrain: trajectories and report
	$(call vsr,run displacement $(site-flags) $(where-flags))

exclusion: setup ## which earthquakes would topple SITE's rock, and which faults it speaks against
	$(call vsr,run exclusion $(site-flags) $(call flag,--age,AGE) $(call flag,--age-sd,AGE_SD) \
	  $(where-flags))

hazard: setup ## which branches of a hazard model let SITE's rock stand for its age
	$(call vsr,run hazard $(site-flags) $(call flag,--curves,CURVES) $(call flag,--events,EVENTS) \
	  $(call flag,--age,AGE) $(call flag,--age-sd,AGE_SD) $(where-flags))

archive: setup ## boundaries of rocks that nobody scanned, known by two angles, from a table ROCKS
	$(call vsr,archive $(call argument,ROCKS) $(derived-flag))

study: PRODUCT ?= study
study: setup ## what changes in SITE, or in another PRODUCT of it, along the sweep of STUDY
	$(call vsr,run $(call argument,PRODUCT) $(site-flags) $(where-flags))

replay: setup ## a page that plays the run of SITE at YAW, PGA and PGV_PGA, or two with AND
	$(call vsr,replay $(study-flags) $(cell-flags) $(where-flags))

prep: setup ## rock and terrain from SITE's scan, with a page of every step
	$(call vsr,prep $(site-flags))

## How good the method is
.PHONY: accuracy stability drive feasible validate archive-equations
accuracy: setup-dev ## error of SITE's boundary against run time, beside other ways of computing it
	$(call vsr,run accuracy $(site-flags) $(where-flags))

stability: SITE ?= cuboid_1x1x2
stability: setup-dev ## stiff and extreme cases, each with its verdict
	$(call vsr,run stability $(site-flags) $(where-flags))

drive: setup ## how a servo's table follows its motions, and what that does to SITE's boundary
	$(call vsr,run drive $(site-flags) $(where-flags))

feasible: setup ## what the table LIMITS, or the mini shake robot, can do of SITE's pulses
	$(call vsr,feasible $(site-flags) $(call flag,--table,LIMITS))

validate: setup ## predict the shake-table tests in the folder TABLE, beside their outcomes
	$(call vsr,run validation --table $(call argument,TABLE) $(derived-flag) $(where-flags))

archive-equations: setup ## the equations of archives anew, and their error; an hour
	$(call vsr,archive-equations --ship $(derived-flag) $(call flag,--workers,WORKERS))

## Before and after
.PHONY: plan status why index fetch doctor
plan: setup ## what would run for SITE, and what it costs
	$(call vsr,plan $(site-flags))

status: setup ## what is done for SITE, or the size and age of all results
	$(call vsr,status $(site-flags))

why: setup ## why something of SITE would run again
	$(call vsr,why $(site-flags))

index: setup ## a page that leads to all results
	$(call vsr,index $(derived-flag))

doctor: setup ## whether this machine can do runs, and what to do where not
	$(call vsr,doctor $(derived-flag) $(call flag,--scheduler,SCHEDULER))

fetch: setup ## download the public original NAME into data/raw
	$(call vsr,fetch $(call argument,NAME))

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
#: EVENTS=folder          in place of curves: a stochastic event set of OpenQuake, or its calc_N.hdf5
#: AGE=20000 AGE_SD=3000  how long the rock has stood, and the standard deviation of that [years]
#: ROCKS=rocks.csv        a table of rocks known by a photograph
#: LIMITS=my_table.yaml   a table in configs/tables, or any YAML file; mini_shake_robot unless given
#: TABLE=folder           recorded shake-table tests
#: WORKERS=4              worker processes; 0 for none
#: SCHEDULER=tcp://h:8786 a running Dask scheduler
#: DERIVED=folder         where results go, in place of data/derived
#: Variables of the environment count, too, but NAME and YES, which others may have set there.

## The paper
.PHONY: figures
figures: setup ## every figure of the paper and its table, and which of its claims were found
	$(call vsr,figures $(call flag,--fig,FIG) $(call flag,--record,RECORD) $(derived-flag) $(where-flags) \
	  $(call flag,--set,SET))

#:
#: FIG=12                 one of them: 7, 8, 10 to 17, 15a, table_1, friction, settings, printed
#: RECORD=file            recorded motion for Fig. 7, in place of the samples

## The project
.PHONY: setup setup-dev setup-lint test coverage test-slow mutants lint check format options docs docs-links bench release lock clean
test: setup-dev ## tests of some minutes at most
	$(call run,pytest -n auto --dist loadfile)

coverage: setup-dev ## the same tests, in half as much time again, and which lines none reaches
	$(call run,pytest -n auto --dist loadfile --cov --cov-report=term:skip-covered)

test-slow: setup-dev ## tests that take many minutes
	$(call run,pytest -m slow -n auto --dist loadfile)

mutants: setup-dev ## which of some 100 faults, put in one by one, the tests notice; an hour
	$(call run,scripts.mutants)

check: lint test ## lint, format, types and tests

lint: setup-lint ## lint, format and types only
	$(call run,ruff check)
	$(call run,ruff format --check)
	$(call run,mypy)

format: setup-dev ## put the code in the project's format
	$(call run,ruff check --fix)
	$(call run,ruff format)

options: setup-dev ## docs/options.md and the schemas in configs/, from the models
	$(call run,scripts.options --write)

docs: setup-dev ## the documentation as a site, in build/docs/html, readable offline
	$(call run,scripts.docs)

docs-links: setup-dev ## the same, and try every link to elsewhere
	$(call run,scripts.docs --links)

bench: setup-dev ## performance benchmarks, as ratios in one run
	$(call run,benchmarks $(call flag,--tests,TABLE))

release: setup-dev ## wheel and source of the last commit in dist/, made twice and tried in an empty environment
	@scripts/release.sh

lock: ## renew both locks from pyproject.toml; UPGRADE=1 for the newest versions
	@scripts/setup.sh lock $(call switch,--upgrade,UPGRADE)$(checked)

clean: setup ## remove derived data, of SITE or of all; asks first, unless YES=1
	$(call vsr,clean $(if $(filter undefined,$(origin SITE)),,--site $(call argument,SITE)) $(derived-flag) \
	  $(call switch,--yes,YES))

setup: ## make .venv now, as every target does when it is missing or stale
	@scripts/setup.sh

setup-dev: ## add to .venv what tests and checks need
	@scripts/setup.sh dev

setup-lint: ## the same, but the machine code of runs
	@scripts/setup.sh lint
