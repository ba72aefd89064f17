# Ricochet. `make` builds the program, `make help` lists everything.
#
#   BUILD=folder      where all that is made goes; other flags want another folder
#   DEBUG=1           all run-time checks, no optimisation, in build/debug
#   ARCH=x86-64-v3    code for other machines, as a cluster; default: this one
#   FFLAGS, LDFLAGS   replaced as a whole, as usual
#   PFUNIT_DIR=folder an installed pFUnit; else unit tests run on a substitute
#   V=1               shows the commands
#
# Modules and their order are derived from the files in src/: file name = module name.

MAKEFLAGS += --no-print-directory
comma := ,
BUILD ?= build$(if $(DEBUG),/debug)
$(if $(word 2,$(BUILD)),$(error BUILD=$(BUILD): the folder may hold no space))
ARCH ?= native
OPT ?= $(if $(DEBUG),-O0 -Wno-maybe-uninitialized,-O2 -march=$(ARCH) $(hot) -fno-backtrace)
# For the innermost loops: inlining across modules, and a version of the kernel for each of its cases.
hot := -flto -flto-partition=none -finline-limit=600 -fipa-cp-clone --param=ipa-cp-eval-threshold=1 \
  --param=ipa-cp-unit-growth=200 -fno-trapping-math -fno-tree-vectorize
CHECKS := $(if $(DEBUG),-fcheck=all$(comma)no-array-temps -finit-real=snan -ffpe-trap=invalid$(comma)zero$(comma)overflow)
FFLAGS ?= -std=f2008 -g -Wall -Wextra -Wno-compare-reals -Wno-unused-dummy-argument $(OPT)

# HDF5's own wrapper knows the compiler, the folders and the libraries.
H5FC ?= h5fc
hdf5 := $(shell $(H5FC) -show 2>/dev/null)
ifeq ($(origin FC),default)
FC = $(or $(firstword $(hdf5)),$(error No $(H5FC): gfortran or HDF5 for Fortran is missing; `make set-up` installs them on Debian and Ubuntu))
endif
hdf5_flags := $(filter -I%,$(hdf5))
hdf5_libs := $(filter-out -I%,$(wordlist 2,$(words $(hdf5)),$(hdf5)))
# Arrays on cache lines: see src/base/memory_hints.c.
libraries = -Wl,--wrap=malloc $(hdf5_libs)
# Contraction off, whatever FFLAGS says: only then do all builds give the same bits.
flags = $(FFLAGS) $(CHECKS) -ffp-contract=off -ffpe-summary=none

PYTHON := $(if $(wildcard .venv/bin/python),.venv/bin/python,python3)
Q := $(if $(V),,@)

sources := $(wildcard src/*.f90 src/*/*.f90)
vpath %.f90 $(sort $(dir $(sources)))
vpath %.c src/base
modules := $(filter-out main,$(notdir $(sources:.f90=))) build_info
objects := $(modules:%=$(BUILD)/%.o) $(BUILD)/memory_hints_c.o

.DELETE_ON_ERROR:
.SUFFIXES:
.DEFAULT_GOAL := all
targets := all demo figures test unit-tests check bench bench-check sanitize lint coverage docs set-up clean distclean help
.PHONY: $(targets) FORCE

all: $(BUILD)/ricochet  ## builds the program (default)

$(BUILD)/ricochet: $(BUILD)/main.o $(objects)
	@echo "link    $@"
	$(Q)$(FC) $(flags) $(LDFLAGS) -o $@ $^ $(libraries)

$(BUILD)/%.o: %.f90 $(BUILD)/flags
	@echo "compile $<"
	$(Q)$(FC) $(flags) $(hdf5_flags) -J$(BUILD) -c -o $@ $<

# The one thing that Fortran cannot say, by the same driver; link-time optimisation makes it an instruction.
$(BUILD)/%_c.o: %.c $(BUILD)/flags
	@echo "compile $<"
	$(Q)$(FC) -Wall -Wextra $(filter -O% -g -march=% -flto% -Werror,$(flags)) -c -o $@ $<

$(BUILD)/build_info.o: $(BUILD)/build_info.f90 $(BUILD)/flags
	$(Q)$(FC) $(flags) -J$(BUILD) -c -o $@ $<

# A file that is rewritten only when its text changes, so that what hangs on it stays.
keep = cat > $@.new; if cmp -s $@.new $@; then rm $@.new; else mv $@.new $@; fi

$(BUILD)/flags: FORCE | $(BUILD)
	@echo '$(FC) $(flags)' | { $(keep); }

commit = $(shell git describe --always --abbrev=12 --exclude='*' 2>/dev/null || echo unknown)
changed = $(if $(shell git status --porcelain -- src Makefile 2>/dev/null),+changes)
$(BUILD)/build_info.f90: FORCE | $(BUILD)
	@{ echo '!> Where this program comes from. Written by the Makefile.'; \
	  echo 'module build_info'; \
	  echo '  implicit none'; \
	  echo '  private'; \
	  echo '  public :: git_commit, build_flags'; \
	  echo "  character(len=*), parameter :: git_commit = '$(commit)$(changed)'"; \
	  echo "  character(len=*), parameter :: build_flags = '$(firstword $(flags))' &"; \
	  for flag in $(wordlist 2,$(words $(flags)),$(flags)); do echo "    // ' $$flag' &"; done; \
	  echo "    // ''"; \
	  echo 'end module build_info'; } | { $(keep); }

PFUNIT_DIR ?= $(lastword $(sort $(wildcard /usr/local/PFUNIT-* $(HOME)/.local/PFUNIT-*)))

# What tests share, among it the substitute for pFUnit, which pFUnit itself replaces.
suites := tests/unit
tests := $(wildcard $(suites)/test_*.pf)
shared := $(filter-out $(if $(PFUNIT_DIR),%/funit.f90),$(wildcard tests/support/*.f90))
test_objects := $(tests:$(suites)/%.pf=$(BUILD)/%.o)
shared_objects := $(shared:tests/support/%.f90=$(BUILD)/%.o)

# Who uses whom: `x.o: y.o` for every `use y` in x.f90 or x.pf.
$(BUILD)/deps.mk: FORCE | $(BUILD)
	@awk -v build='$(BUILD)' -v known='$(modules) $(basename $(notdir $(shared)))' 'BEGIN { split(known, list); for (i in list) own[list[i]] } \
	  FNR == 1 { me = FILENAME; sub(/.*\//, "", me); sub(/\.[a-z0-9]*$$/, "", me) } \
	  tolower($$1) == "use" { sub(/,.*/, "", $$2); if ($$2 in own && $$2 != me) print build "/" me ".o: " build "/" $$2 ".o" }' \
	  $(sources) $(tests) $(shared) /dev/null | sort -u | { $(keep); }

$(BUILD):
	@mkdir -p $@

ifneq ($(filter-out help clean distclean set-up,$(or $(MAKECMDGOALS),all)),)
-include $(BUILD)/deps.mk
endif

# --- Unit tests: the same .pf files under pFUnit or the substitute, always with all checks on -----------------

unit_build := DEBUG=1 OPT=-O1 BUILD=$(BUILD)/$(if $(PFUNIT_DIR),pfunit,tests)

ifneq ($(PFUNIT_DIR),)
include $(firstword $(wildcard $(PFUNIT_DIR)/include/PFUNIT.mk $(PFUNIT_DIR)/PFUNIT-*/include/PFUNIT.mk) $(PFUNIT_DIR)/PFUNIT.mk)
runner := pFUnit $(PFUNIT_VERSION)
translate = log=$$($(PYTHON) $(PFUNIT_BIN_DIR)/funitproc $< $@ 2>&1) || { echo "$$log"; false; }
driver := $(PFUNIT_INCLUDE_DIR)/driver.F90
test_flags = -cpp $(PFUNIT_EXTRA_FFLAGS) -D_TEST_SUITES='"tests.inc"'
test_libs = $(PFUNIT_LIBRARIES)
else
runner := the substitute for pFUnit
translate = $(PYTHON) tests/support/translate_pf.py $< $@
driver := tests/support/driver.F90
test_flags = -cpp -I$(BUILD)
endif

unit-tests: $(BUILD)/unit_tests
	@tests/support/run_unit_tests.sh "$(runner)" $< $(tests)

$(BUILD)/unit_tests: $(driver) $(BUILD)/tests.inc $(test_objects) $(shared_objects) $(objects)
	@echo "link    $@"
	$(Q)$(FC) $(flags) $(test_flags) -J$(BUILD) -o $@ $< $(filter %.o,$^) $(test_libs) $(libraries)

$(BUILD)/test_%.F90: $(suites)/test_%.pf tests/support/translate_pf.py
	$(Q)$(translate)

$(test_objects): $(BUILD)/%.o: $(BUILD)/%.F90 $(BUILD)/flags
	@echo "compile $(<:$(BUILD)/%.F90=$(suites)/%.pf)"
	$(Q)$(FC) $(CHECKS) -O1 -g $(test_flags) -ffree-line-length-none $(hdf5_flags) -J$(BUILD) -c -o $@ $<

$(shared_objects): $(BUILD)/%.o: tests/support/%.f90 $(BUILD)/flags
	@echo "compile $<"
	$(Q)$(FC) $(flags) $(hdf5_flags) -J$(BUILD) -c -o $@ $<

$(BUILD)/tests.inc: FORCE | $(BUILD)
	@printf 'ADD_TEST_SUITE(%s_suite)\n' $(basename $(notdir $(tests))) | { $(keep); }

# --- What people call ----------------------------------------------------------------------------------------

venv := .venv/bin/python
jobs = $(if $(filter -j%,$(MAKEFLAGS)),,-j$(shell nproc 2>/dev/null || echo 2))

demo:  ## sets up, builds, runs crater and gas, draws both: runs/demo/
	@.ci/set-up demo
	@$(MAKE) $(jobs) all
	$(BUILD)/ricochet input/crater.nml -o runs/demo/crater.h5 --force --set output.frames_every_time=0.002
	$(BUILD)/ricochet input/gas.nml -o runs/demo/gas.h5 --force
	$(venv) post/crater.py runs/demo/crater.h5 -o runs/demo/crater.png
	$(venv) post/player.py runs/demo/crater.h5 -o runs/demo/crater.html --colour displacement
	$(venv) post/speeds.py runs/demo/gas.h5 -o runs/demo/speeds.png
	$(venv) post/snapshot.py runs/demo/gas.h5 -o runs/demo/gas.png
	@echo 'In runs/demo: the crater (crater.png) and a film of it to play with (open crater.html in a browser),'
	@echo 'the speeds of the gas (speeds.png), its last state (gas.png); the data are in crater.h5 and gas.h5.'

figures:  ## draws the figures of all systems in runs/figures/ (long)
	@.ci/set-up demo
	@$(MAKE) $(jobs) all
	@runs/figures.sh

test:  ## sets up, then unit tests and whole runs (two minutes)
	@.ci/set-up demo test
	@$(MAKE) $(jobs) $(unit_build) unit-tests
	@$(MAKE) $(jobs) all
	@RICOCHET="$$(realpath '$(BUILD)')/ricochet" $(venv) -m pytest -q tests

check:  ## validates the physics and provokes faults (minutes)
	@.ci/set-up demo test
	@$(MAKE) $(jobs) all
	@LIMIT=1200 $(MAKE) $(jobs) suites=tests/long unit-tests
	@RICOCHET="$$(realpath '$(BUILD)')/ricochet" $(venv) -m pytest -q -m check tests
	@RICOCHET="$$(realpath '$(BUILD)')/ricochet" $(venv) tests/validate.py --report '$(BUILD)/validation'

bench: all  ## measures collisions per second; FULL=1: and more
	@RICOCHET=$(BUILD)/ricochet runs/bench.sh $(if $(FULL),--full)

bench-check:  ## counts instructions per collision against what is promised
	@.ci/set-up bench
	@$(MAKE) $(jobs) ARCH=x86-64-v3 BUILD=$(BUILD)/v3 all
	@RICOCHET=$(BUILD)/v3/ricochet runs/bench.sh --check

# What the sanitizers watch: the unit tests, runs that write, stop and resume, damaged input. In unit tests leaks
# do not count: gfortran 12 never frees the array constructors of obstacles that they are full of.
watched := $(patsubst %,tests/runs/test_%.py,output_file restart)
sanitized := $(BUILD)/sanitized

sanitize:  ## searches faults of memory: sanitizers, valgrind (long)
	@.ci/set-up demo test bench
	@LIMIT=1200 ASAN_OPTIONS=detect_leaks=0 $(MAKE) $(jobs) DEBUG=1 OPT='-O1 -fsanitize=address,undefined -fno-sanitize-recover=all' BUILD=$(sanitized) unit-tests all
	@RICOCHET="$$(realpath '$(sanitized)')/ricochet" $(venv) -m pytest -q $(watched)
	@$(venv) tests/runs/fuzz_input.py --count 500 --program $(sanitized)/ricochet
	@$(MAKE) $(jobs) ARCH=x86-64-v3 BUILD=$(BUILD)/v3 all
	@tests/support/run_valgrind.sh $(BUILD)/v3/ricochet

lint:  ## warnings, style, and the rules of the design
	@.ci/set-up lint
	@$(MAKE) $(jobs) --keep-going --output-sync lint-compiler lint-fortran lint-python lint-shell lint-design

.PHONY: lint-compiler lint-fortran lint-python lint-shell lint-design
lint-compiler:
	@$(MAKE) BUILD=$(BUILD)/lint OPT='-O2 -pedantic -Wimplicit-interface -Werror' all
lint-fortran:
	@$(venv) -m fortitude --quiet check --output-format concise src $(wildcard tests/support/*.f90)
	@! $(dir $(venv))fprettify --diff --disable-indent --line-length 132 $(sources) | grep '^[-+]'
lint-python:
	@$(venv) -m ruff check --quiet --output-format concise post tests docs
lint-shell:
	@shellcheck --format gcc .ci/run .ci/set-up $(wildcard runs/*.sh tests/*.sh tests/support/*.sh docs/*.bash)
lint-design:
	@$(venv) tests/support/check_style.py

coverage:  ## which lines of src/ the tests reach
	@.ci/set-up demo test coverage
	@$(MAKE) $(jobs) BUILD=$(BUILD)/coverage OPT='-O0 --coverage -Wno-maybe-uninitialized' unit-tests all
	@RICOCHET="$$(realpath '$(BUILD)')/coverage/ricochet" $(venv) -m pytest -q tests
	@$(venv) -m gcovr --root . --filter src/ --fail-under-line 95 $(BUILD)/coverage

docs:  ## pages of the source, with FORD, into build/docs
	@.ci/set-up docs
	@$(venv) -m ford --quiet --no-search --src_dir "$$PWD/src" --output_dir "$$(realpath $(BUILD))/docs" --config \
	  'project = "Ricochet"; preprocess = false; display = ["public", "private"]; print_creation_date = false' src/README.md
	@echo 'open $(BUILD)/docs/index.html'

set-up:  ## installs what `demo` and `test` need: compiler, HDF5, .venv
	@.ci/set-up demo test

clean:  ## removes what was built; runs/ and .venv stay
	rm -rf '$(BUILD)'

distclean: clean  ## removes .venv, too; results in runs/ stay
	rm -rf .venv

nearest = import difflib, sys; near = difflib.get_close_matches(sys.argv[1], sys.argv[2:], 1); \
  print(*(f"; did you mean {name}?" for name in near))
.DEFAULT:
	@echo "There is no target and no file $@$$(python3 -c '$(nearest)' '$@' $(targets) 2>/dev/null)" >&2; \
	  echo '`make help` lists the targets.' >&2; exit 2

help:  ## this list
	@awk -F ':.*  ## ' '/^[a-z-]+:.*  ## / { printf "  make %-12s %s\n", $$1, $$2 }' Makefile
	@echo
	@sed -n 's/^#   /  /p' Makefile
