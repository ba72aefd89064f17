# Ricochet. `make` builds the program, `make help` lists everything.
#
#   BUILD=folder      where everything built goes; other flags need another folder
#   DEBUG=1, V=1      all checks, no optimisation, in build/debug; shows commands
#   ARCH=x86-64-v3    code for other machines, as a cluster; default: this one
#   FFLAGS, LDFLAGS   replaced as a whole; HINTS= without hints about memory
#   PFUNIT_DIR=folder an installed pFUnit; default: found, or a substitute
#
# Modules and their order are derived from the files in src/ by src/modules.awk: file name = module name.
# src/build_info.sh writes one module more, src/install.sh installs, .ci/set-up fetches what is missing.
MAKEFLAGS += --no-print-directory
comma := ,
PREFIX ?= /usr/local
BUILD ?= build$(if $(DEBUG),/debug)
$(if $(word 2,$(BUILD)),$(error BUILD=$(BUILD): the folder name may not contain spaces))

# HDF5's own wrapper knows the compiler, the folders and the libraries.
ifndef H5FC
export H5FC := $(shell src/find_h5fc.sh)
endif
hdf5 := $(shell $(H5FC) -show 2>/dev/null)
ifeq ($(origin FC),default)
FC = $(or $(firstword $(hdf5)),$(error No $(H5FC): gfortran or HDF5 for Fortran is missing; `make set-up` installs them on Debian and Ubuntu))
endif
hdf5_flags := $(filter -I%,$(hdf5))
hdf5_libs := $(filter-out -I%,$(wordlist 2,$(words $(hdf5)),$(hdf5)))

# Most flags are gfortran's; another compiler gets plain optimisation, and FFLAGS.
gnu = $(eval gnu := $(findstring GNU Fortran,$(shell $(FC) --version 2>/dev/null)))$(gnu)
ARCH ?= native
# Usual flags, with which the event loop is optimised as a whole; any other flags are the same for all files.
usual := $(if $(DEBUG)$(filter-out undefined,$(origin OPT) $(origin FFLAGS)),,1)
OPT ?= $(if $(DEBUG),-O0 $(if $(gnu),-Wno-maybe-uninitialized),-O2 $(if $(gnu),$(if $(ARCH),-march=$(ARCH)) -fno-backtrace $(quiet)))
# These warnings of gfortran 13 and later are false alarms about array descriptors. `make lint` has them on.
quiet := -Wno-maybe-uninitialized -Wno-uninitialized
# For the event loop: inlining across modules, and a version of the kernel for each of its cases.
hot := -flto=auto -finline-limit=1000 -fipa-cp-clone --param=ipa-cp-eval-threshold=1 \
  --param=ipa-cp-unit-growth=200 --param=inline-unit-growth=200 -fno-trapping-math -fno-tree-vectorize
# For what writes files, and for what only reads the input and sets up a run: compiled twice as fast, and a run is not slower.
cold := -O1
once := -O0
CHECKS := $(if $(DEBUG),-fcheck=all$(comma)no-array-temps -finit-real=snan -ffpe-trap=invalid$(comma)zero$(comma)overflow)
FFLAGS ?= $(if $(gnu),-std=f2008 -Wall -Wextra -Wno-compare-reals -Wno-unused-dummy-argument) $(if $(DEBUG),-g) $(OPT)
# Contraction off, whatever FFLAGS says: only then do all builds give the same bits. Position independent, because the program and
# both libraries are linked from the same objects.
flags = $(FFLAGS) -fPIC -ffp-contract=off $(if $(gnu),-fno-semantic-interposition -fopenmp $(CHECKS) -ffpe-summary=none)
# gfortran compiles C, too, so that link-time optimisation can make an instruction of a prefetch.
c_compiler = $(if $(gnu),$(FC),$(CC))
c_flags = -Wall -Wextra -fPIC $(filter -fno-semantic-interposition -O% -g -march=% -flto% -fsanitize% -fno-sanitize% --coverage -pedantic -Werror,$(flags))
wrapped := -Wl,--wrap=malloc,--wrap=realloc
hints = $(if $(HINTS),$(wrapped))

announce := . src/progress.sh; announce
PYTHON := $(if $(wildcard .venv/bin/python),.venv/bin/python,python3)
Q := $(if $(V),,@)

sources := $(wildcard src/*.f90 src/*/*.f90)
vpath %.f90 $(sort $(dir $(sources))) $(BUILD)
vpath %.c src/base
modules := $(filter-out main library library_events library_files %_without_hdf5,$(notdir $(sources:.f90=))) build_info
objects := $(modules:%=$(BUILD)/%.o) $(patsubst src/base/%.c,$(BUILD)/%_c.o,$(filter-out %/program_heap.c,$(wildcard src/base/*.c)))
objects_in = $(patsubst %.f90,$(BUILD)/%.o,$(notdir $(wildcard $(1:%=src/%/*.f90))))
# The modules of the event loop and of random insertion, which are optimised as a whole. Those of its folders that it calls seldom or
# never are compiled like the others.
seldom := motions changes clusters collapses rest standstill stop_rules observables sample_values obstacle_cells time_stepped \
  verlet_list recycle drives renumbering partition domain_cuts
hot_objects := $(filter-out $(seldom:%=$(BUILD)/%.o),$(call objects_in,dynamics parallel drives sides laws physics search geometry)) \
  $(patsubst %,$(BUILD)/%.o,random_insertion random_stream sorting memory_hints memory_hints_c)
once_objects := $(call objects_in,. input variables)
cold_objects := $(call objects_in,output files start)

# Unit tests: the same .pf files under pFUnit or the substitute, each in its own folder, with all checks on.
PFUNIT_DIR ?= $(lastword $(sort $(wildcard /usr/local/PFUNIT-* $(HOME)/.local/PFUNIT-*)))
pfunit_mk := $(if $(PFUNIT_DIR),$(firstword $(wildcard $(PFUNIT_DIR)/include/PFUNIT.mk $(PFUNIT_DIR)/PFUNIT-*/include/PFUNIT.mk)))
suites := tests/unit
unit_build := DEBUG=1 OPT='-O1 -Wno-maybe-uninitialized -Wno-uninitialized' BUILD=$(BUILD)/tests
T := $(BUILD)/$(if $(PFUNIT_DIR),pfunit,substitute)
-include $(pfunit_mk)
translator := $(if $(PFUNIT_DIR),$(PFUNIT_BIN_DIR)/funitproc,tests/support/translate_pf.py)
driver := $(or $(PFUNIT_INCLUDE_DIR),tests/support)/driver.F90
test_flags = -cpp $(PFUNIT_EXTRA_FFLAGS) -D_TEST_SUITES='"tests.inc"' -I$(T) -J$(T) -I$(BUILD)
tests = $(filter-out $(if $(HINTS),,%/test_memory_hints.pf),$(wildcard $(suites)/test_*.pf))
shared := $(filter-out $(if $(PFUNIT_DIR),%/funit.f90),$(wildcard tests/support/*.f90))
test_objects = $(tests:$(suites)/%.pf=$(T)/%.o)
shared_objects := $(shared:tests/support/%.f90=$(T)/%.o)

.DELETE_ON_ERROR:
.SUFFIXES:
.DEFAULT_GOAL := all
targets := all library wheel demo film lab notebook figures test unit-tests check bench bench-check bench-lab sanitize lint coverage docs install \
  uninstall dist set-up clean distclean help
.PHONY: $(targets) demo-crater demo-gas FORCE

# --- What is built, by a `make` whose goals are files in $(BUILD) ---------------------------------------------
ifneq ($(filter $(BUILD)/%,$(MAKECMDGOALS)),)
$(shell mkdir -p $(T))
-include $(BUILD)/hints.mk $(BUILD)/deps.mk

# The compilations of a build from the beginning are counted. Of a later one it is not known how many there will be.
goals = $(filter $(1:%=$(BUILD)/%),$(MAKECMDGOALS))
counted = $(objects) $(if $(call goals,ricochet),main program_heap) $(if $(call goals,%.so),library library_events library_files \
  $(filter %_without_hdf5.o,$(without_hdf5))) $(if $(call goals,unit_tests),$(test_objects) $(shared_objects)) $(call goals,%.o)
total := $(if $(V)$(wildcard $(BUILD)/kinds.o),,$(words $(counted)))
$(shell : > $(BUILD)/progress)
say = . src/progress.sh; count $(BUILD)/progress '$(total)'

# Under another name first: a build that is killed leaves no half of a program that looks finished.
define link
	@echo "link $@"
	$(Q)$(FC) $(flags) $(together) $1 -o $@.new $2 $(hints) $(hdf5_libs)
	$(Q)mv $@.new $@
endef

# The event loop becomes one object, which the program and both libraries contain. If the linker cannot make such an object
# (MERGE in hints.mk), each of them optimises the event loop anew.
ifneq ($(and $(usual),$(gnu)),)
$(hot_objects): private of_part := $(hot)
$(cold_objects): private of_part := $(cold)
$(once_objects): private of_part := $(once)
ifneq ($(MERGE),)
linked := $(BUILD)/event_loop.o $(filter-out $(hot_objects),$(objects)) # in this order: other files are compiled meanwhile
else
together := $(hot)
endif
endif
linked ?= $(objects)

$(BUILD)/event_loop.o: $(hot_objects)
	$(Q)$(announce) 'optimise the event loop (10 s on two idle cores)' $(FC) $(filter-out -fopenmp,$(flags)) $(hot) $(merge) -o $@ $^

$(BUILD)/ricochet: $(linked) $(BUILD)/main.o $(BUILD)/program_heap_c.o
	$(call link,$(LDFLAGS),$^)

# Nothing but the C interface is to be seen.
library_flags := -Wl,--version-script=src/library.map -Wl,-z,defs
as_library = -shared $(if $(EXPORTS),$(library_flags))
$(BUILD)/libricochet.so: hdf5_libs :=
$(BUILD)/libricochet.so: $(filter-out $(BUILD)/main.o $(objects),$(without_hdf5)) $(filter $(without_hdf5) %_c.o %/event_loop.o,$(linked))
	$(call link,$(as_library),$(filter %.o,$^))

$(BUILD)/libricochet_files.so: hdf5_libs = $(filter-out -I%,$(wordlist 2,99,$(shell $(H5FC) -shlib -show)))
$(BUILD)/libricochet_files.so: $(linked) $(BUILD)/library.o $(BUILD)/library_events.o $(BUILD)/library_files.o
	$(call link,$(as_library),$^)

$(BUILD)/ricochet.h: src/ricochet.h
	@cp $< $@

$(BUILD)/%.o: %.f90 $(BUILD)/flags
	@$(say) compile $<
	$(Q)$(FC) $(flags) $(of_part) $(hdf5_flags) -J$(BUILD) -c -o $@ $<

$(BUILD)/%_c.o: %.c $(BUILD)/flags
	@$(say) compile $<
	$(Q)$(c_compiler) $(c_flags) $(of_part) $(if $(HINTS),-DMEMORY_HINTS) -c -o $@ $<

# The compiler leaves an interface untouched that has not changed: then nothing that uses it is compiled again.
%.mod: %.o
	@:

# A file that is rewritten only when its text changes, so that what depends on it stays.
keep = cat > $@.$$$$; if cmp -s $@.$$$$ $@; then rm $@.$$$$; else mv $@.$$$$ $@; fi

$(BUILD)/flags: FORCE
	@echo '$(FC) $(flags) $(if $(usual),$(hot) $(cold) $(once) $(seldom)) $(hints)' | { $(keep); }

# Another pFUnit compiles the tests of its folder again, and another runner links its own: of the program nothing.
$(BUILD)/runner $(T)/runner: FORCE
	@echo '$(PFUNIT_DIR)' | { $(keep); }

$(BUILD)/build_info.f90: FORCE
	@src/build_info.sh $(flags) $(if $(usual),$(if $(gnu),$(hot))) | { $(keep); }

$(BUILD)/deps.mk: FORCE
	@awk -v build='$(BUILD)' -v tests='$(T)' -f src/modules.awk $(sources) $(tests) $(shared) /dev/null | sort | { $(keep); }

# Whether compiler, linker and system know what the hints are made of, the flags of the library, and the merging of objects.
merge := -r -nostdlib -flinker-output=nolto-rel
$(BUILD)/hints.mk: src/base/memory_hints.c Makefile
	@echo 'int main(void) { return 0; }' > $@.c; \
	  if $(c_compiler) -DMEMORY_HINTS -include $< $@.c $(wrapped) -o $@.out 2>/dev/null; \
	  then echo 'HINTS ?= 1'; else echo 'HINTS ?='; fi > $@.new; \
	  if $(c_compiler) -fPIC -shared $(library_flags) $@.c -o $@.out 2>/dev/null; \
	  then echo 'EXPORTS ?= 1'; else echo 'EXPORTS ?='; fi >> $@.new; \
	  if $(c_compiler) -fPIC -flto -c $@.c -o $@.o 2>/dev/null && $(c_compiler) -flto $(merge) $@.o -o $@.out 2>/dev/null; \
	  then echo 'MERGE ?= 1'; else echo 'MERGE ?='; fi >> $@.new; rm -f $@.c $@.o $@.out; mv $@.new $@

$(BUILD)/unit_tests: $(driver) $(T)/tests.inc $(test_objects) $(shared_objects) $(linked) $(BUILD)/runner
	$(call link,$(test_flags),$< $(filter %.o,$^) $(PFUNIT_LIBRARIES))

# The engine of docs/tutorials/how-it-works.md.
$(BUILD)/four_disks: docs/four_disks.f90 $(linked)
	$(call link,-I$(BUILD),$^)

$(T)/test_%.F90: $(suites)/test_%.pf $(translator) $(T)/runner
	$(Q)log=$$($(PYTHON) $(translator) $< $@ 2>&1) || { echo "$$log"; false; }

$(test_objects): $(T)/%.o: $(T)/%.F90 $(BUILD)/flags
	@$(say) compile $(<:$(T)/%.F90=$(suites)/%.pf)
	$(Q)$(FC) $(CHECKS) -O0 -g $(test_flags) -ffree-line-length-none $(hdf5_flags) -c -o $@ $<

$(shared_objects): $(T)/%.o: tests/support/%.f90 $(BUILD)/flags
	@$(say) compile $<
	$(Q)$(FC) $(flags) $(hdf5_flags) -I$(T) -J$(T) -I$(BUILD) -c -o $@ $<

$(T)/tests.inc: FORCE
	@printf 'ADD_TEST_SUITE(%s_suite)\n' $(basename $(notdir $(tests))) | { $(keep); }

.PHONY: $(BUILD)/without_hdf5
$(BUILD)/without_hdf5: $(without_hdf5)
endif

# --- What people call ----------------------------------------------------------------------------------------
venv := .venv/bin/python
jobs = $(if $(filter -j%,$(MAKEFLAGS)),,-j$(shell nproc 2>/dev/null || echo 2))

# One `make` at a time works in a folder; a second one waits, and then finds everything done. It does not print that files are up to
# date.
build = mkdir -p $(BUILD) 2>/dev/null && [ -w $(BUILD) ] || { echo 'Cannot write to $(BUILD); BUILD=folder takes another' >&2; exit 2; }; \
  $(if $(shell command -v flock),flock $(BUILD)/lock) $(MAKE) $(if $(V),,--silent)

libraries = $(addprefix $(BUILD)/,libricochet.so libricochet_files.so ricochet.h)
# Both in one `make`, if both are asked for: a second one that waited for the lock would take a core from the first.
all:  ## builds the program (default); library: for C, Python; wheel
	@+$(build) $(BUILD)/ricochet $(if $(filter library,$(MAKECMDGOALS)),$(libraries))

library: $(filter all,$(MAKECMDGOALS))
	@+$(if $<,:,$(build) $(libraries))

# build/wheels/*.whl: all of it with its libraries inside, for pip on machines without a compiler. For any processor
# since 2013 or so, but for GLIBC as old as here: its name says which.
wheel: export BUILD := $(BUILD)/portable
wheel: export ARCH := $(if $(filter x86_64,$(shell uname -m)),x86-64-v3)
wheel:
	@.ci/set-up demo wheel
	@rm -rf '$(BUILD)/bare' && $(venv) -m pip wheel --quiet --no-deps -w '$(BUILD)/bare' .
	@PATH="$$PWD/.venv/bin:$$PATH" $(venv) -m auditwheel repair --plat auto -w build/wheels '$(BUILD)'/bare/*.whl

unit-tests:  ## unit tests; DEBUG=1 tests=tests/unit/test_X.pf: of a module
	@$(foreach test,$(filter-out $(wildcard $(tests)),$(tests)),$(error $(test): is no file with unit tests; $(or \
	  $(patsubst %,did you mean %,$(wildcard $(suites)/$(basename $(notdir $(test))).pf)),they are in $(suites)/test_*.pf)))
	@$(if $(PFUNIT_DIR),$(or $(if $(pfunit_mk),:),$(error PFUNIT_DIR=$(PFUNIT_DIR): no pFUnit is installed there (include/PFUNIT.mk is missing))),:)
	@+$(build) $(BUILD)/unit_tests
	@LIMIT=$${LIMIT:-$(if $(filter -O0,$(OPT)),900,300)} tests/support/run_unit_tests.sh \
	  "$(if $(PFUNIT_DIR),pFUnit $(PFUNIT_VERSION),the substitute for pFUnit)" \
	  $(BUILD)/unit_tests $$(sed 's,.*(\(.*\)_suite),$(suites)/\1.pf,' $(T)/tests.inc)

# Shows a command while it runs, but not the tables that it prints.
shown = @quietly() { "$$@" > /dev/null; }; $(announce) '$(strip $1)' quietly $1
demo:  ## sets up, builds, runs crater and gas, draws both: runs/demo/
	@echo 'make demo, step 1 of 3: packages (half a minute the first time)'
	@.ci/set-up demo
	@echo 'make demo, step 2 of 3: program and library (20 s on two idle cores the first time)'
	@$(MAKE) $(jobs) all library
	@echo 'make demo, step 3 of 3: three simulations, three figures and two films (5 s)'
	@$(MAKE) $(jobs) demo-crater demo-gas
	@echo 'Finished. Open in a browser: runs/demo/crater.html, the film of an impact, or gas.html, that of a gas.'
	@echo 'The figures crater.png, speeds.png and gas.png are in the same folder. Next: make lab, a page with sliders.'

demo-crater:
	$(call shown,$(BUILD)/ricochet input/crater.nml -o runs/demo/crater.h5 --force --set output.frames_every_time=0.002 --set output.event_log=.true.)
	$(call shown,$(venv) post/crater.py runs/demo/crater.h5 -o runs/demo/crater.png)
	$(call shown,$(venv) post/player.py runs/demo/crater.h5 -o runs/demo/crater.html --colour displacement)

demo-gas:
	$(call shown,$(BUILD)/ricochet input/gas.nml -o runs/demo/gas.h5 --force)
	$(call shown,$(BUILD)/ricochet input/gas.nml -o runs/demo/gas_start.h5 --force --set stop.collisions_per_disk=8 \
	  --set output.frames_every_time=0.002 --set output.event_log=.true.)
	$(call shown,$(venv) post/speeds.py runs/demo/gas.h5 -o runs/demo/speeds.png)
	$(call shown,$(venv) post/snapshot.py runs/demo/gas.h5 -o runs/demo/gas.png)
	$(call shown,$(venv) post/player.py runs/demo/gas_start.h5 -o runs/demo/gas.html)

FILM ?= runs/film
film: name = $(FILM)/$(basename $(notdir $(INPUT)))
film: $(if $(wildcard $(BUILD)/ricochet),,all)  ## runs INPUT=FILE.nml SET="group.name=value", opens the film
	@$(if $(INPUT),:,$(error Which input? make film INPUT=input/crater.nml SET=output.frames_every_time=0.002))
	$(BUILD)/ricochet '$(INPUT)' -o '$(name).h5' --force $(addprefix --set ,$(SET))
	$(PYTHON) post/player.py '$(name).h5' -o '$(name).html' --open

lab:  ## builds, opens the laboratory; post/lab.py opens no browser
	@.ci/set-up demo
	@$(MAKE) $(jobs) all library
	@RICOCHET="$$(realpath '$(BUILD)')/ricochet" $(venv) post/lab.py --open

notebook:  ## sets up, and opens the tour in JupyterLab
	@.ci/set-up demo notebook
	@$(MAKE) $(jobs) all library
	$(venv) -m jupyterlab $(if $(filter 0,$(shell id -u)),--allow-root) docs/tutorials/tour.ipynb

figures:  ## draws the figures of all systems in runs/figures/ (long)
	@.ci/set-up demo
	@$(MAKE) $(jobs) all
	@runs/figures.sh

# The unit tests take one core; meanwhile the others build the program and the library. The tests use the library with run-time checks.
# Hundreds of Python processes start, and would compile all modules anew without their files of bytecode.
under_test = PYTHONDONTWRITEBYTECODE= RICOCHET="$$(realpath '$(BUILD)')/ricochet" RICOCHET_LIBRARY="$$(realpath '$(BUILD)')/tests"
test:  ## sets up, then unit tests and whole runs (5 to 10 min)
	@.ci/set-up demo test
	@$(MAKE) $(jobs) $(unit_build) $(BUILD)/tests/unit_tests $(BUILD)/tests/four_disks
	@$(MAKE) $(jobs) checked checked-library all
	@$(under_test) $(venv) -m pytest -q -n auto --dist worksteal tests

.PHONY: checked checked-library
checked:
	@$(MAKE) $(unit_build) unit-tests
checked-library:
	@$(MAKE) $(unit_build) library

# Other systems each day; SEED=20270131 has those of that day again. THOROUGH=1 makes unit tests use all random cases.
SYSTEMS ?= 200
CHANGED ?= 300
SEED ?= $(shell date +%Y%m%d)
optimised = SEED=$(SEED) RICOCHET="$$(realpath '$(BUILD)')/ricochet" RICOCHET_LIBRARY="$$(realpath '$(BUILD)')"
check: export THOROUGH = 1
check:  ## validates physics, provokes faults, runs random systems
	@.ci/set-up demo test check
	@$(MAKE) $(jobs) all
	@$(MAKE) library
	@$(MAKE) $(jobs) $(unit_build) unit-tests
	@LIMIT=1200 $(MAKE) $(jobs) suites=tests/long unit-tests
	@$(optimised) $(venv) -m pytest -q -m 'check or statistics' tests
	@$(optimised) $(venv) -m pytest -q -n auto $(wildcard tests/runs/test_library_*.py)
	@SYSTEMS=$(SYSTEMS) $(optimised) $(venv) -m pytest -q -n auto tests/runs/test_random_systems.py -k all_ways
	@SYSTEMS=$(CHANGED) $(optimised) $(venv) -m pytest -q -n auto tests/runs/test_changes.py -k continues_exactly
	@$(optimised) $(venv) tests/validate.py --report '$(BUILD)/validation'

bench: all  ## measures collisions per second; FULL=1, and more; bench-lab
	@RICOCHET=$(BUILD)/ricochet runs/bench.sh $(if $(FULL),--full)

bench-lab: all library
	@.ci/set-up demo test
	@RICOCHET="$$(realpath '$(BUILD)')/ricochet" $(venv) tests/bench_lab.py

bench-check:  ## counts instructions per collision against what is promised
	@.ci/set-up bench
	@$(MAKE) $(jobs) ARCH=x86-64-v3 BUILD=$(BUILD)/v3 all
	@RICOCHET=$(BUILD)/v3/ricochet runs/bench.sh --check

# Unit tests, runs that write, stop and resume, damaged input. Leaks do not count in unit tests: gfortran 12 never
# frees array constructors of obstacles, which they are full of.
sanitized := $(BUILD)/sanitized
raced := $(BUILD)/raced
sanitize:  ## searches faults of memory, and races, with sanitizers (long)
	@.ci/set-up demo test bench
	@LIMIT=1200 ASAN_OPTIONS=detect_leaks=0 $(MAKE) $(jobs) DEBUG=1 OPT='-O1 -fsanitize=address,undefined -fno-sanitize-recover=all' BUILD=$(sanitized) unit-tests all
	@RICOCHET="$$(realpath '$(sanitized)')/ricochet" $(venv) -m pytest -q tests/runs/test_output_file.py tests/runs/test_restart.py
	@MOST_SECONDS=100 $(venv) tests/runs/fuzz_input.py --count 500 --program $(sanitized)/ricochet
	@$(MAKE) $(jobs) ARCH=x86-64-v3 BUILD=$(BUILD)/v3 all
	@tests/support/run_valgrind.sh $(BUILD)/v3/ricochet
	@$(MAKE) $(jobs) DEBUG=1 OPT='-O1 -fsanitize=thread' BUILD=$(raced) tests=tests/unit/test_parallel_events.pf $(raced)/unit_tests $(raced)/ricochet
	@tests/support/find_races.sh $(raced)

lint:  ## style, rules of the design; coverage: lines that tests reach
	@.ci/set-up lint
	@$(MAKE) $(jobs) --keep-going --output-sync $(lints)

lints := lint-compiler lint-flang lint-fortran lint-python lint-shell
lint-compiler:
	@$(MAKE) -s BUILD=$(BUILD)/lint HINTS= PFUNIT_DIR= OPT='-O2 -pedantic -Wimplicit-interface -Werror' suites=tests/long \
	  $(BUILD)/lint/ricochet $(patsubst %,$(BUILD)/lint/substitute/%.o,$(basename $(notdir $(wildcard tests/support/*.f90 tests/long/*.pf))))
flang = $(lastword $(sort $(wildcard $(foreach name,flang flang-[0-9]* flang-new*,$(addsuffix /$(name),$(subst :, ,$(PATH)))))))
lint-flang:
	@$(if $(flang),$(MAKE) -s BUILD=$(BUILD)/flang FC=$(flang) HINTS= PFUNIT_DIR= OPT=-O0 $(BUILD)/flang/without_hdf5,:)
lint-fortran:
	@$(venv) -m fortitude --quiet check --output-format concise src $(wildcard tests/support/*.f90)
	@! $(dir $(venv))fprettify --diff --disable-indent --line-length 132 $(sources) | grep '^[-+]'
lint-python:
	@$(venv) -m ruff check --quiet --output-format concise post tests docs
	@$(venv) tests/support/check_style.py
	@$(venv) tests/support/check_docstrings.py
	@$(venv) tests/mutants.py --check
	@$(venv) tests/support/check_examples.py $(BUILD)/examples
	@$(venv) -m mypy --no-error-summary --cache-dir $(BUILD)/mypy --scripts-are-modules post/ricochet $(BUILD)/examples
lint-shell:
	@shellcheck --format gcc $(wildcard .ci/* src/*.sh runs/*.sh tests/*.sh tests/support/*.sh docs/*.bash)

coverage:
	@.ci/set-up demo test coverage
	@$(MAKE) $(jobs) BUILD=$(BUILD)/coverage OPT='-O0 --coverage -Wno-maybe-uninitialized' unit-tests all
	@RICOCHET="$$(realpath '$(BUILD)')/coverage/ricochet" $(venv) -m pytest -q tests
	@$(venv) -m gcovr --root . --filter src/ --fail-under-line 95 $(BUILD)/coverage

# The pages need no optimised program, but use it if it exists.
docs: site = $(BUILD)$(if $(wildcard $(BUILD)/ricochet),,/site)
docs:  ## builds the documentation site: build/docs/index.html
	@.ci/set-up demo docs
	@$(MAKE) $(jobs) $(if $(filter %/site,$(site)),OPT=-O1 BUILD=$(site)) all library
	@$(announce) 'ford: pages of the sources' $(venv) -m ford --quiet --no-search --src_dir "$$PWD/src" --output_dir "$$(realpath $(BUILD))/docs/fortran" --config \
	  'project = "Ricochet"; preprocess = false; display = ["public", "private"]; print_creation_date = false' src/README.md
	@$(announce) 'Sphinx: all other pages' env RICOCHET="$$(realpath $(site))/ricochet" $(venv) docs/build_site.py $(BUILD)
	@echo 'The site: $(BUILD)/docs/index.html'

install: $(if $(wildcard $(BUILD)/ricochet),,all library)  ## for all users (PREFIX=, DESTDIR=); uninstall; dist: tarball
install uninstall dist: export BUILD := $(BUILD)
install uninstall dist: export DESTDIR := $(DESTDIR)
install uninstall dist: export PREFIX := $(PREFIX)
install uninstall dist:
	@src/install.sh $@

set-up:  ## installs what `demo` and `test` need: compiler, HDF5, .venv
	@.ci/set-up demo test

clean:  ## removes what was built, not runs/; distclean: .venv, too
	rm -rf '$(BUILD)'

distclean: clean
	rm -rf .venv

nearest = import difflib, sys; near = difflib.get_close_matches(sys.argv[1], sys.argv[2:], 1); \
  print(*(f"; did you mean {name}?" for name in near))
# Folders are no targets either: otherwise `make tests` would do nothing and say that all is done.
folders := $(filter-out $(targets),$(patsubst %/,%,$(wildcard */)))
.PHONY: $(folders)
$(folders):
	@$(no_target)
.DEFAULT:
	@$(no_target)
no_target = echo "There is no target$(if $(wildcard $@),, and no file) $@$$(python3 -c '$(nearest)' '$@' $(targets) 2>/dev/null) (make help lists the targets)" >&2; exit 2

# The targets that match, or do not match, the four that beginners need.
described = awk -F ':.*  \#\# ' '/^[a-z-]+:.*  \#\# / && $$1 $1 /^(demo|lab|film|test)$$/ { printf "  make %-12s %s\n", $$1, $$2 }' Makefile

help:
	@$(call described,~); echo; $(call described,!~); echo; \
	sed -n 's/^#   /  /p' Makefile
