# libgait: `make help` lists the targets.  Put permanent settings (CC=clang, PREFIX=...) into Makefile.local.
MAKEFLAGS += -r
.SUFFIXES:
.DELETE_ON_ERROR:
.SECONDARY:
.DEFAULT_GOAL := help

-include Makefile.local

config ?= release
PYTHON ?= python3
PREFIX ?= /usr/local
LIBDIR ?= $(PREFIX)/lib
INCLUDEDIR ?= $(PREFIX)/include

VENV  := .venv
READY := $(VENV)/.ready
SITE  := $(VENV)/site
PY    := $(VENV)/bin/python
PIP_INSTALL := $(VENV)/bin/pip install --quiet --disable-pip-version-check --no-compile
HEADER := libgait/include/gait.h
HEADERS := $(sort $(wildcard libgait/include/*.h))
define_of = $(shell awk '$$2 == "$(1)" { print $$3 }' $(HEADER))
ABI     := $(call define_of,GAIT_ABI)
VERSION := $(call define_of,GAIT_VERSION_MAJOR).$(call define_of,GAIT_VERSION_MINOR).$(call define_of,GAIT_VERSION_PATCH)

# Another compiler has its own tools (CC=aarch64-linux-gnu-gcc) and, for another CPU, its own folder.
found_or = $(if $(shell command -v $(1) 2>/dev/null),$(1),$(2))
CROSS   := $(shell printf '%s\n' $(CC) | sed -n 's/^\(.*-\)g\{0,1\}cc\(-[0-9.]*\)\{0,1\}$$/\1/p')
OBJCOPY := $(or $(OBJCOPY),$(call found_or,$(CROSS)objcopy,objcopy))
ifeq ($(origin AR),default)
AR := $(call found_or,$(CROSS)ar,ar)
endif
ifeq ($(origin CXX),default)
CXX := $(if $(findstring gcc,$(CC))$(findstring clang,$(CC)),$(call found_or,$(subst clang,clang++,$(subst gcc,g++,$(CC))),$(CXX)),$(CXX))
endif
MACHINE := $(shell $(CC) -dumpmachine 2>/dev/null)
cpu_of   = $(firstword $(subst -, ,$(1)))
CPU     := $(call cpu_of,$(MACHINE))
FOREIGN := $(filter-out $(call cpu_of,$(shell cc -dumpmachine 2>/dev/null || uname -m)),$(CPU))
B       := build/$(if $(FOREIGN),$(MACHINE)-)$(config)
BIN     := $(if $(filter build/release,$(B)),build/bin,$(B)/bin)

# Eigen's headers: EIGEN=FOLDER, those of .venv if it is there, the system's, else .venv is made for them.
VENV_EIGEN := $(SITE)/cmeel.prefix/include/eigen3
ifndef EIGEN
EIGEN := $(firstword $(wildcard $(VENV_EIGEN)) $(patsubst -I%,%,$(shell pkg-config --cflags-only-I eigen3 2>/dev/null)) \
         $(wildcard /usr/include/eigen3 /usr/local/include/eigen3) $(VENV_EIGEN))
endif

# ---- flags ---------------------------------------------------------------------------------------------------
include libgait/flags.mk

OPT_release  := $(RELEASE_FLAGS)
OPT_debug    := -O0
OPT_sanitize := -O1 -fsanitize=address,undefined,float-cast-overflow -fno-sanitize-recover=all -fno-omit-frame-pointer
OPT_thread   := -O1 -fsanitize=thread -fno-omit-frame-pointer
OPT_fuzz     := $(OPT_sanitize:-O1=-O2) -fsanitize=fuzzer-no-link
# The library compares in its loops; libFuzzer's record of these takes two thirds of the time.
CODE_FLAGS   += $(if $(filter fuzz,$(config)),-fno-sanitize-coverage=trace-cmp)
# Vector kernels are made of the same sources as the scalar ones, on which every check runs; checks of arithmetic and
# libFuzzer's counters in these loops would take three quarters of the time.
LESS_WATCHED := -fno-sanitize=undefined,fuzzer-no-link -fsanitize=float-cast-overflow
WATCHED = $(if $(filter fuzz,$(config)),$(if $(filter scalar,$(1)),,$(LESS_WATCHED)))$(if $(filter coverage,$(config)),-O1)
# The same in loops over all bytes of a model, and of the record of comparisons in those over a histogram.
$(B)/src/base/hash.c.o: private CFLAGS += $(if $(filter fuzz,$(config)),$(LESS_WATCHED))
$(B)/tools/trackd/timing.c.o: private CFLAGS += $(if $(filter fuzz,$(config)),-fno-sanitize-coverage=trace-cmp)
CXX_FLAGS    += $(if $(filter fuzz,$(config)),-fno-sanitize=function) # needs the C++ runtime
# As slow as under a sanitizer, so that tests use their shorter films; kernels, in which most time is spent, have -O1.
OPT_coverage := -O0 --coverage -fprofile-abs-path -DSANITIZED=1
OPT ?= $(OPT_$(config))
ifeq ($(OPT),)
$(error unknown config=$(config): use release, debug, sanitize, thread, fuzz or coverage)
endif
GCC   := $(if $(findstring clang,$(shell $(CC) --version 2>/dev/null)),,gcc)
TIGHT := $(if $(GCC),$(GCC_TIGHT))
SMALL := $(if $(filter -O3,$(OPT)),-O2 $(TIGHT))
LEAST := $(if $(filter -O3,$(OPT)),-Os $(TIGHT) $(if $(GCC),$(GCC_LEAST)))
SMALL_VECTOR := $(if $(SMALL),$(SMALL) $(if $(GCC),$(GCC_VECTOR),$(CLANG_VECTOR)))
LESS := $(if $(SMALL),$(if $(GCC),$(GCC_LESS) $(if $(findstring aarch64,$(MACHINE)),$(GCC_AARCH64))))
# Flags of a source by its file name; kernels and other sources differ where no list names them.
listed = $(if $(filter $(1),$(VECTOR_SOURCES)),$(SMALL_VECTOR),$(if $(filter $(1),$(O2_SOURCES)),$(SMALL),$(2)))
C_FLAGS = $(if $(filter $(1),$(O3_SOURCES)),,$(call listed,$(1),$(LEAST)))
LESS_OF = $(LESS) $(if $(LESS),$(GCC_LESS_$(1)))
VECTOR_FLAGS = $(if $(filter $(1),$(O3_SOURCES)),$(FAST_FLAGS),$(call listed,$(1),$(SMALL_VECTOR) $(call LESS_OF,$(2))))
SCALAR_FLAGS = $(if $(filter $(1),$(O2_SCALAR_SOURCES)),$(SMALL),$(LEAST))
KERNEL_FLAGS = $(if $(filter scalar,$(2)),$(SCALAR_FLAGS),$(VECTOR_FLAGS)) # of a source and an instruction set
FAST_FLAGS := $(if $(GCC),$(GCC_KERNEL))
WARN   := -Wall -Wextra -Wpedantic -Wshadow -Wconversion -Wundef -Wvla $(if $(GCC),,-Wno-pass-failed) $(if $(werror),-Werror)
CWARN  := $(WARN) -Wstrict-prototypes -Wmissing-prototypes
COMMON := $(OPT) -g -MMD -MP -ffp-contract=off
CALLS := $(shell $(CC) -fcallgraph-info=su -E -x c /dev/null >/dev/null 2>&1 && echo -fcallgraph-info=su)
# Atomics of aarch64 in line: libgcc's would bring a constructor and a writable global.
ATOMICS := $(shell $(CC) -Werror -mno-outline-atomics -E -x c /dev/null >/dev/null 2>&1 && echo -mno-outline-atomics)
LIBGAIT := $(COMMON) $(CODE_FLAGS) $(ATOMICS) -fstack-usage $(CALLS) -Wframe-larger-than=16384 \
           -Ilibgait/include -iquote libgait/src
KERNEL_ISAS := scalar base $(if $(findstring x86_64,$(MACHINE)),$(X86_ISAS))
KERNEL_SRC := $(sort $(wildcard libgait/src/*/*_kernel.c))
own = $(filter-out $(addprefix %/,$(SHARED_$(1))),$(KERNEL_SRC))
KERNEL_OBJ := $(foreach isa,$(KERNEL_ISAS),$(patsubst libgait/src/%.c,$(B)/src/%.$(isa).o,$(call own,$(isa))))
SRC := $(filter-out $(KERNEL_SRC),$(sort $(wildcard libgait/src/*/*.c libgait/src/*/*.cpp)))
OBJ := $(SRC:libgait/src/%=$(B)/src/%.o) $(KERNEL_OBJ)
GONE := $(filter-out $(notdir $(SRC) $(KERNEL_SRC)),$(O3_SOURCES) $(VECTOR_SOURCES) $(O2_SOURCES) $(O2_SCALAR_SOURCES) $(SHARED_sse4) $(SHARED_avx512))
$(if $(GONE),$(error libgait/flags.mk lists $(GONE), which libgait/src does not have))
SRC_DIRS := $(sort $(dir $(OBJ)))
UNIT := $(patsubst tests/unit/%.c,$(B)/unit/%,$(sort $(wildcard tests/unit/test_*.c)))
TOOLS := $(BIN)/gait-trackd
LIBS := $(B)/libgait.so $(B)/libgait.a

.PHONY: help setup lock lib tools test test-all built check unit python-test demo model paper bench bench-board bench-instructions bench-peers size bench-lift detector-profile eval eval-body eval-camera eval-cameras eval-classes eval-gait eval-moving eval-real eval-learn eval-lift eval-paper eval-people eval-studio soak kills mutants asan sanitizers tsan coverage unit-threads fuzz fuzz-run fuzz-long fuzz-targets golden-check lowest \
        docs screenshots sbom lint format wheel sdist wheel-check reproducible install install-daemon uninstall clean

help: ## list the targets
	@echo 'make demo     track a walking clip end to end, results in build/demo (VIDEO= CAMERA= for your own)'
	@echo 'make test     build and test'
	@echo; awk -F ':.*## ' '/^[a-z-]+:.*## / { printf "  %-14s %s\n", $$1, $$2 }' $(firstword $(MAKEFILE_LIST))
	@echo; echo '* needs the data beside the repository (../shared/data); without it, tests that need some are skipped'
	@echo 'targets eval* fail if a bound is missed; bench, bench-lift print MISSED: rates depend on the host'
	@echo 'config=release|debug|sanitize|thread|fuzz|coverage (now $(config)), werror=1: warnings are errors'

# What the objects were built with; when it changes they are rebuilt.
MADE_WITH := CC=$(CC) CXX=$(CXX) OPT=$(OPT) CFLAGS=$(CFLAGS) CXXFLAGS=$(CXXFLAGS) LDFLAGS=$(LDFLAGS)$(if $(SYSROOT), SYSROOT=$(SYSROOT))
MADE := $(B)/.made_with
ifneq ($(strip $(shell cat $(MADE) 2>/dev/null)),$(strip $(MADE_WITH)))
.PHONY: $(MADE)
endif
$(MADE): libgait/flags.mk | $(B)/
	@printf '%s\n' '$(subst ','\'',$(MADE_WITH))' > $@.$$$$ && mv $@.$$$$ $@

# Checked before anything is built or fetched.
COMPILED := $(filter-out help setup $(READY) lint format clean uninstall,$(or $(MAKECMDGOALS),help))
has = $(shell command -v $(firstword $(1)) 2>/dev/null)
ifneq ($(COMPILED),)
$(if $(call has,$(CC)),,$(error no C compiler '$(CC)': install it or set CC=))
$(if $(call has,$(CXX)),,$(error no C++ compiler '$(CXX)': install it or set CXX=))
endif
ifneq ($(and $(FOREIGN),$(filter built test test-all python-test demo,$(COMPILED))),)
$(error what runs on $(MACHINE) is not tested here: `make lib tools CC=$(CC)` builds it)
endif

# ---- python environment --------------------------------------------------------------------------------------
setup: $(READY) ## create .venv with the packages of python/lock.txt (once; later builds work offline)

# The stamp comes last: without it the environment is made anew, with an old one only changed packages are fetched.
$(READY): python/lock.txt python/pyproject.toml
	@command -v $(PYTHON) >/dev/null || { echo 'setup: no $(PYTHON): install it or set PYTHON= (the library alone' \
	    'needs only Eigen: install libeigen3-dev or set EIGEN=)' >&2; exit 1; }
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 10) and "setup: needs Python >= 3.10: set PYTHON=")'
	@$(PYTHON) -c 'import venv, ensurepip' || \
	    { echo 'setup: $(PYTHON) cannot make environments: install python3-venv or set PYTHON=' >&2; exit 1; }
	@test ! -h $(VENV) || { echo 'setup: $(VENV) is a link, an environment belongs to one folder: remove the link' >&2; exit 1; }
	$(PYTHON) -m venv $$(test -f $@ || echo --clear) $(VENV)
	$(PIP_INSTALL) --require-hashes -r python/lock.txt
	$(PIP_INSTALL) --no-deps --no-build-isolation -e ./python
	@ln -sfn "$$(cd $(VENV) && echo lib/python3.*/site-packages)" $(SITE)
	@printf '%s\n' "$$(pwd -P)/python" > $(SITE)/_editable_skbc_libgait.pth # starts 30 ms faster than the hook in it
	@$(PY) -c 'import lcm' || { echo 'setup: LCM needs libglib-2.0.so.0: install libglib2.0-0' >&2; exit 1; }
	@env -u GAIT_WEIGHTS $(VENV)/bin/gait detect --fetch --quiet >/dev/null || echo 'setup: no weights, so gait detect does not work yet;' \
	    'run `$(VENV)/bin/gait detect --fetch` later' >&2
	@env -u GAIT_WEB $(VENV)/bin/gait studio --fetch --quiet >/dev/null || echo 'setup: no parts of pages, so gait studio does not work yet;' \
	    'run `$(VENV)/bin/gait studio --fetch` later' >&2
	@env -u GAIT_AXE $(PY) tests/python/accessibility.py 2>/dev/null || echo 'setup: no axe-core, so the accessibility of' \
	    'pages is not tested; run `$(PY) tests/python/accessibility.py` later' >&2
	@pwd -P > $@

# Programs that make lock files and lists of components, apart from what they list.
PACKAGING := build/packaging
$(PACKAGING)/.ready: python/lock-packaging.txt
	$(PYTHON) -m venv --clear $(@D)
	$(@D)/bin/pip install --quiet --disable-pip-version-check --require-hashes -r $<
	@touch $@

# Exact versions with the hashes of their files, of everything that constraints.txt and what it needs bring, on every
# Python and CPU; and of the packages that other targets install elsewhere.
LOCK_ALONE := $(PACKAGING)/bin/uv pip compile --quiet --universal --generate-hashes --no-header --no-annotate
LOCK := $(LOCK_ALONE) --no-emit-package libgait --constraint python/constraints.txt
LOWEST = $$(grep -oE '"(numpy|scipy)>=[0-9.]+' python/pyproject.toml | sed 's/"//; s/>=/==/' | sort -u)
lock: $(PACKAGING)/.ready ## generate the lock files from constraints.txt and pyproject.toml (needs a network)
	$(LOCK) --python-version 3.10 python/pyproject.toml --extra dev --output-file python/lock.txt
	printf '%s\n' mkdocs-material mkdocstrings-python latex2mathml | $(LOCK) \
	    --python-version 3.11 - --output-file python/lock-docs.txt
	printf '%s\n' uv==0.13.9 cyclonedx-bom==7.5.0 | $(LOCK_ALONE) \
	    --python-version 3.10 - --output-file python/lock-packaging.txt
	printf '%s\n' $(LOWEST) | $(LOCK_ALONE) --no-deps --python-version 3.10 - --output-file python/lock-lowest.txt
	$(LOCK_ALONE) --python-version 3.10 tests/bench/requirements-peers.txt --output-file tests/bench/lock-peers.txt

# An environment does not survive being moved.
MOVED := $(shell test -h $(VENV) || test ! -f $(READY) || test "$$(cat $(READY))" = "$$(pwd -P)" || rm $(READY))

# log CC file: one line for each command, or with V=1 the command itself
log = $(if $(V),,@echo '  $(1)' && )

# ---- library -------------------------------------------------------------------------------------------------
lib: $(LIBS) ## libgait.so and libgait.a in build/<config>

# Linked by the C compiler: a dependency on the C++ runtime would fail to link.
$(B)/libgait.so: $(OBJ)
	$(call log,LD   $@)$(CC) $(OPT) -shared -Wl,--no-undefined,-z,noseparate-code -Wl,-soname,$(@F).$(ABI) $(LDFLAGS) -o $@.$$$$ $(OBJ) -lm -pthread && \
	    mv $@.$$$$ $@.$(ABI)
	@ln -sf $(@F).$(ABI) $@

# One object whose internal names are local, so that they cannot clash with the user's names.
$(B)/libgait.a: $(OBJ)
	$(call log,AR   $@)$(CC) -r -nostdlib -o $(B)/libgait.o $(OBJ)
	@$(OBJCOPY) --localize-hidden $(B)/libgait.o
	@rm -f $@
	@$(AR) rcs $@ $(B)/libgait.o

$(B)/src/%.c.o: libgait/src/%.c Makefile $(MADE) | $(SRC_DIRS)
	$(call log,CC   $<)$(CC) -std=c11 $(LIBGAIT) $(CWARN) $(call C_FLAGS,$(notdir $<)) $(CFLAGS) -c $< -o $@

$(B)/src/%.cpp.o: libgait/src/%.cpp Makefile $(MADE) | $(SRC_DIRS) $(if $(filter $(VENV)/%,$(EIGEN)),$(READY))
	@test -f $(EIGEN)/Eigen/Core || { echo 'lib: no Eigen/Core in EIGEN=$(EIGEN): give the folder that has it, or install' \
	    'libeigen3-dev' >&2; exit 1; }
	$(call log,CXX  $<)$(CXX) -std=c++14 $(LIBGAIT) -isystem $(EIGEN) $(CXX_FLAGS) $(WARN) $(call C_FLAGS,$(notdir $<)) $(CXXFLAGS) -c $< -o $@

define kernel_rule
$(B)/src/%.$(1).o: libgait/src/%.c Makefile $(MADE) | $(SRC_DIRS)
	$$(call log,CC   $$< ($(1)))$(CC) -std=c11 $(LIBGAIT) $(CWARN) -DKERNEL_ISA=$(1) $$(call KERNEL_FLAGS,$$(notdir $$<),$(1)) $(FLAGS_$(1)) $(call WATCHED,$(1)) $(CFLAGS) -c $$< -o $$@
endef
$(foreach isa,$(KERNEL_ISAS),$(eval $(call kernel_rule,$(isa))))

%/:
	@mkdir -p $@

# ---- LCM tools -----------------------------------------------------------------------------------------------
LCM_TYPES := $(sort $(wildcard lcm_types/*.lcm))
# JPEG frames need libjpeg's headers; without them gait-trackd reports that it cannot decode JPEG.
ifndef FOREIGN
LCM := $(SITE)
$(LCM)/lib/liblcm.so: | $(READY) ; # of its package
JPEG_LIBS := $(shell pkg-config --libs libjpeg 2>/dev/null)
JPEG_CFLAGS := $(if $(JPEG_LIBS),-DHAVE_LIBJPEG $(shell pkg-config --cflags libjpeg))
else
# For another CPU: libjpeg of SYSROOT, a copy of that machine's / or a part of it; LCM from its package, or LCM=FOLDER with
# include and lib.  GLib, which LCM needs, is found when the daemon starts.
LCM ?= build/lcm-$(MACHINE)
in_sysroot = $(firstword $(wildcard $(foreach d,$(1)/$(MACHINE) $(1),$(SYSROOT)/usr/$(d)/$(2))))
JPEG_LIBS := $(and $(SYSROOT),$(call in_sysroot,include,jpeglib.h),$(call in_sysroot,lib,libjpeg.so))
JPEG_CFLAGS := $(if $(JPEG_LIBS),-DHAVE_LIBJPEG $(patsubst %,-idirafter $(SYSROOT)/usr/include%,/$(MACHINE) /))
LCM_LDFLAGS := -Wl,--allow-shlib-undefined
endif
LCM_CFLAGS := -isystem $(LCM)/include -isystem build/lcm
# Of programs in a folder.
lcm_libs = -L$(LCM)/lib -llcm $(LCM_LDFLAGS) \
           -Wl,-rpath,'$$ORIGIN/$(shell realpath -ms --relative-to=$(1) $(LCM)/lib):$$ORIGIN/../lib/gait'

build/lcm-%/lib/liblcm.so: python/lock.txt | $(READY) build/lcm-%/
	$(call log,LCM  $@)sed -n '/^lcm==/,/[^\\]$$/p' $< > build/lcm-$*/lock.txt && \
	    $(PIP_INSTALL) --upgrade --require-hashes --no-deps --only-binary :all: --platform manylinux_2_28_$(call cpu_of,$*) \
	    --target build/lcm-$* -r build/lcm-$*/lock.txt || \
	    { echo 'tools: no LCM for $*: give LCM=, a folder with include and lib' >&2; exit 1; }
	@touch $@

tools: $(TOOLS) build/lcm/.stamp ## LCM programs in build/bin, LCM types in build/lcm (CC=aarch64-linux-gnu-gcc SYSROOT= for that CPU)

build/lcm/.stamp: $(LCM_TYPES) | $(READY) build/lcm/python/
	$(call log,LCM  lcm_types)$(VENV)/bin/lcm-gen -c --c-cpath build/lcm --c-hpath build/lcm -p --ppath build/lcm/python $(LCM_TYPES)
	@touch $@

$(B)/libgaitmsg.a: build/lcm/.stamp $(MADE) | $(B)/lcm/ $(LCM)/lib/liblcm.so
	$(call log,AR   $@)for f in $(LCM_TYPES:lcm_types/%.lcm=%); do \
	    $(CC) $(OPT) -g $(LCM_CFLAGS) -c build/lcm/$$f.c -o $(B)/lcm/$$f.o || exit 1; done
	@rm -f $@
	@$(AR) rcs $@ $(LCM_TYPES:lcm_types/%.lcm=$(B)/lcm/%.o)

TOOL_PARTS := $(patsubst tools/%,$(B)/tools/%.o,$(sort $(wildcard tools/trackd/*.c)))
$(BIN)/gait-trackd: $(TOOL_PARTS) $(B)/libgait.a $(B)/libgaitmsg.a | $(BIN)/
	$(call log,LD   $@)$(CC) $(OPT) -pthread $(LDFLAGS) -o $@ $^ $(call lcm_libs,$(BIN)) $(JPEG_LIBS) -lm

$(B)/tools/%.c.o: tools/%.c Makefile $(MADE) build/lcm/.stamp | $(B)/tools/trackd/ $(LCM)/lib/liblcm.so
	$(call log,CC   $<)$(CC) -std=c11 -D_POSIX_C_SOURCE=200809L $(COMMON) $(CWARN) -pthread -Ilibgait/include -Itools $(LCM_CFLAGS) \
	    $(JPEG_CFLAGS) $(CFLAGS) -c $< -o $@

# The daemon's parts beside main(); a program of tests may include some of them instead.
$(B)/libtrackd.a: $(filter-out %/gait-trackd.c.o,$(TOOL_PARTS))
	$(call log,AR   $@)rm -f $@ && $(AR) rcs $@ $^
WITH_TOOLS = $(CC) -std=c11 -D_POSIX_C_SOURCE=200809L $(COMMON:-O3=-O1) -MT $@ -MF $@.d $(CWARN) -pthread \
    -Ilibgait/include -iquote libgait/src -Itools $(LCM_CFLAGS) $(JPEG_CFLAGS) $(CFLAGS) $(LDFLAGS) \
    -o $@ $< $(B)/libtrackd.a $(OBJ) $(B)/libgaitmsg.a $(call lcm_libs,$(@D)) $(JPEG_LIBS) -lm

# ---- tests ---------------------------------------------------------------------------------------------------
test test-all: built check unit python-test
test: ## tests and checks below, without the Python tests marked long
test: MARKED := -m 'not long'
test-all: ## all tests and checks below

# As many compilers at a time as there are processors, unless make has a -j option.
JOBS = $(if $(filter -j% --jobserver%,$(MAKEFLAGS)),,-j$(shell getconf _NPROCESSORS_ONLN))
built:
	@$(MAKE) --no-print-directory $(JOBS) setup lib tools $(UNIT) fuzz-targets

check: lib ## symbols, heap, threads, globals, size, layers, stack, recursion, headers, hygiene
	@B=$(B) CC='$(CC)' CXX='$(CXX)' tests/check/run.sh

unit: $(UNIT) fuzz-targets ## C tests, and the stored inputs of the fuzz targets
	@tests/unit/run.sh $(UNIT) $(if $(FUZZ_ENGINE),$(FUZZ))

# Linked with the objects, so that tests can call internal functions.  Their own code is compiled in a third of the time.
$(B)/unit/test_trackd_%: tests/unit/test_trackd_%.c $(OBJ) $(B)/libtrackd.a $(B)/libgaitmsg.a Makefile $(MADE) | $(B)/unit/
	$(call log,CC   $<)$(WITH_TOOLS)

$(B)/unit/%: tests/unit/%.c $(OBJ) Makefile $(MADE) | $(B)/unit/
	$(call log,CC   $<)$(CC) -std=c11 -D_POSIX_C_SOURCE=200809L $(COMMON:-O3=-O1) -MT $@ -MF $@.d $(CWARN) -pthread -Ilibgait/include -iquote libgait/src $(CFLAGS) \
	    $(LDFLAGS) -o $@ $< $(OBJ) -lm

# A process for each processor and one more, as tests of programs that run side by side wait for them; the tests of a
# file stay together, they share what is slow to make.
# What their many processes import is compiled once, also where the caller's environment forbids it.
COMPILED_ONCE := PYTHONDONTWRITEBYTECODE= PYTHONPYCACHEPREFIX='$(abspath build/pycache)'
PYTEST_AT_ONCE = -n $(shell expr $$(getconf _NPROCESSORS_ONLN) + 1) --maxprocesses 8 --dist loadfile --no-loadscope-reorder
python-test: setup lib tools ## all Python tests (ARGS='-k blob' or '-m long' to select)
	@$(COMPILED_ONCE) $(PY) -m pytest -q -c python/pyproject.toml --rootdir . $(PYTEST_AT_ONCE) $(MARKED) tests/python $(ARGS)

lowest: setup lib tools ## Python tests with the lowest numpy and scipy that pyproject.toml allows (ARGS='-k blob' to select)
	$(PIP_INSTALL) --upgrade --no-deps --require-hashes --target build/lowest -r python/lock-lowest.txt
	@PYTHONPATH='$(abspath build/lowest)' $(MAKE) --no-print-directory python-test

asan: ## C tests under the address and undefined-behaviour sanitizers
	@LIMIT=1200 $(MAKE) --no-print-directory $(JOBS) config=sanitize unit

# Tests that share data among threads; the others have one thread.
THREADED := $(patsubst %,$(B)/unit/test_%,pool task determinism)
unit-threads: $(THREADED)
	@tests/unit/run.sh $^

# With a daemon of this build; no test of speed.
daemon_tests = $(COMPILED_ONCE) GAIT_TRACKD='$(abspath build/$(1)/bin/gait-trackd)' $(PY) -m pytest -q \
    -c python/pyproject.toml --rootdir . $(PYTEST_AT_ONCE) -k 'not newest_frame_wins' $(2)

# A daemon that is killed while it writes its counts leaves a file of which others would complain on stderr; the layer under
# fwrite() would let that fail too.
COVERED := $(filter-out %_fault_layer.py,$(wildcard tests/python/test_lcm_*.py))
coverage: setup lib ## branches that the tests of library and daemon take (ARGS='--all --least-library 97'; --record)
	@rm -f $$(find build/coverage -name '*.gcda' 2>/dev/null)
	@$(MAKE) --no-print-directory config=coverage CC=gcc tools
	@LIMIT=3600 $(MAKE) --no-print-directory config=coverage CC=gcc unit
	@GCOV_ERROR_FILE='$(abspath build/coverage/gcov.log)' $(call daemon_tests,coverage,$(COVERED))
	@$(PY) tests/check/coverage.py build/coverage $(ARGS)

# One build for the sanitizers and for fuzzing, where there is clang.
SANITIZED := $(if $(call has,clang),config=fuzz CC=clang,config=sanitize)
# Not those with the layer under malloc(), which is the sanitizers' own.
SANITIZED_DAEMON := $(patsubst %,tests/python/test_lcm_%.py,cameras faults idle lift live log moving output people service start stream strides tracks)
RACED_DAEMON := $(patsubst %,tests/python/test_lcm_%.py,cameras log service) # slower by ten
sanitizers: setup lib ## C tests, the daemon and fuzzing under asan and ubsan, then make tsan (RUNS= SEED=)
	@LIMIT=1200 $(MAKE) --no-print-directory $(JOBS) $(SANITIZED) tools unit fuzz-run
	@$(call daemon_tests,$(if $(call has,clang),fuzz,sanitize),$(SANITIZED_DAEMON))
	@$(MAKE) --no-print-directory $(JOBS) tsan

tsan: setup lib ## C tests of threads, and the daemon, under the thread sanitizer
	@LIMIT=1200 $(MAKE) --no-print-directory config=thread tools unit-threads
	@$(call daemon_tests,thread,$(RACED_DAEMON))

# With config=fuzz, which needs clang, libFuzzer drives the targets, else standalone.c.
FUZZ := $(patsubst tests/fuzz/%.c,$(B)/fuzz/%,$(sort $(wildcard tests/fuzz/fuzz_*.c)))
FUZZ_ENGINE := $(if $(filter fuzz,$(config)),,tests/fuzz/standalone.c)
$(B)/fuzz/%: tests/fuzz/%.c $(FUZZ_ENGINE) $(OBJ) $(B)/libtrackd.a $(B)/libgaitmsg.a Makefile $(MADE) | $(B)/fuzz/
	$(call log,CC   $<)$(WITH_TOOLS) $(FUZZ_ENGINE) $(if $(FUZZ_ENGINE),,-fsanitize=fuzzer)

fuzz-run: $(FUZZ)
	@for f in $(FUZZ); do \
	    found=build/fuzz/found/$${f##*/fuzz_} && mkdir -p $$found && \
	    $$f -runs=$(RUNS) -seed=$(SEED) -max_len=4096 -timeout=60 -verbosity=0 -artifact_prefix=build/fuzz/ \
	        $$found tests/fuzz/corpus/$${f##*/fuzz_} || { echo "fuzz: $${f##*/} failed with RUNS=$(RUNS) SEED=$(SEED)" >&2; exit 1; }; \
	done

# With libFuzzer where there is clang.
RUNS ?= 2000
SEED ?= $(shell date +%s)
fuzz: ## damaged models, snapshots, frames, messages, files ... under the sanitizers (RUNS=2000 SEED=, else a fresh one)
	@$(MAKE) --no-print-directory $(JOBS) $(SANITIZED) fuzz-run

fuzz-long: setup ## 10^6 executions of each target (ARGS='--runs N --record')
	@$(MAKE) --no-print-directory config=fuzz CC=clang fuzz-targets
	@$(PY) tests/bench/fuzz_long.py $(ARGS)
fuzz-targets: $(FUZZ)

golden-check: ## tracker and lifter have their pinned digests at -O0, -O2 and -O3, with every compiler found
	@tests/check/golden.sh

# ---- work ----------------------------------------------------------------------------------------------------
pass = $(foreach v,VIDEO CAMERA INIT BACKGROUND HEIGHT START STOP,$(if $($(v)),--$(shell echo $(v) | tr A-Z a-z) '$($(v))'))

demo: ## clip -> LCM -> gait-trackd -> report (VIDEO CAMERA INIT BACKGROUND HEIGHT START STOP)
	@$(MAKE) --no-print-directory --silent $(JOBS) setup lib tools
	@$(VENV)/bin/gait demo $(pass) $(ARGS)

MOCAP ?= ../shared/data/mocap/cmu_walk
# People whose recordings may be shipped and show the whole body.
MORE = $(MOCAP)/../more
WALKING := btk/b2 gaitalytics/g1 bvhtoolbox opensim/p2 opensim/p4 mcgill cmu_more/c12 cmu_more/c46
RUNNING := run_cmu run_rbds
LEARN_CLASSES = $(VENV)/bin/gait learn --subjects folder --segments none --joints anatomical
# Credits of these people, besides CMU's.
CREDIT_RUNS = --credit 'R. Fukuchi, C. Fukuchi and M. Duarte 2017, figshare 4543435, CC BY 4.0; 6 of 30 s of each run' \
    --credit 'Convolutional-Sequence-to-Sequence-Model-for-Human-Dynamics (copies of recordings of CMU), MIT'
CREDIT_WALKS = --credit 'BTKData, Biomechanical ToolKit, BSD-3-Clause' --credit 'python-gaitalytics, DART Lab, MIT' \
    --credit 'bvh-toolbox, O. Haag, MIT' --credit 'OpenSim, Apache-2.0' --credit 'OpenSim JAM, C. Smith, Apache-2.0' \
    --credit 'biomechZoo, McGill motion lab, MIT'
model: setup lib ## learn the shipped models from MOCAP= *
	$(VENV)/bin/gait learn $(MOCAP) -o python/gait/data/walk.gait $(ARGS)
	$(VENV)/bin/gait learn $(MOCAP) --prior paper --segments none -o python/gait/data/paper.gait $(ARGS)
	@mkdir -p build
	$(LEARN_CLASSES) $(addprefix $(MORE)/,$(RUNNING)) --activity run $(CREDIT_RUNS) \
	    -o build/run.gait $(ARGS)
	$(LEARN_CLASSES) $(MOCAP) $(addprefix $(MORE)/,$(WALKING)) --generic-lengths cmu_more/c46 \
	    $(CREDIT_WALKS) \
	    --class stand --class backwards --class run=build/run.gait -o python/gait/data/classes.gait $(ARGS)

PAPER_MOCAP ?= $(MOCAP) ../shared/data/mocap/cmu_misc
PAPER_CLIP ?= $(wildcard ../shared/data/video/outdoor)
paper: setup lib ## every figure of both papers, published, literal and ours: build/paper/paper.html (PAPER_MOCAP=, PAPER_CLIP=; ARGS=--record) *
	@for each in $(PAPER_MOCAP); do test -e $$each || { echo "paper: no motion capture in $$each: give folders with" \
	    'PAPER_MOCAP="..."; a clip is the folder PAPER_CLIP, or one is rendered' >&2; exit 1; }; done
	@mkdir -p build/paper
ifneq ($(PAPER_CLIP),)
	@$(PY) tests/bench/paper_clicks.py $(PAPER_CLIP)/reference2d.json build/paper/clicks.json
endif
	$(VENV)/bin/gait paper --mocap $(PAPER_MOCAP) $(if $(PAPER_CLIP),--video $(PAPER_CLIP)/demo.mp4 --camera \
	    $(PAPER_CLIP)/Calib_demo.toml --init $(PAPER_CLIP)/init.json --background $(PAPER_CLIP)/background_median.png \
	    --corrections build/paper/clicks.json) -o build/paper/paper.html --json $(filter-out --record,$(ARGS)) \
	    > build/paper/paper.json
	@$(PY) tests/bench/paper_page.py build/paper/paper.json $(filter --record,$(ARGS))

# The bench calls internal functions, and the linker puts its clocks round those that __wrap_ names.
BENCH_ISA := $(foreach isa,$(KERNEL_ISAS),$(B)/bench/bench_limit_kernel.$(isa).o)
BENCH_SRC := tests/bench/step.c $(filter-out %_kernel.c,$(sort $(wildcard tests/bench/bench_*.c)))
BENCH_OBJ := $(BENCH_SRC:tests/bench/%.c=$(B)/bench/%.o) $(BENCH_ISA)
BENCH_PARTS := $(patsubst %,$(B)/tools/trackd/%.c.o,common options)
BENCH_WRAP := $(shell sed -n 's/^WRAP.[^,]*, \([a-z_]*\),.*/-Wl,--wrap=\1/p' tests/bench/bench_stages.c)
BENCH_CC = $(CC) -std=c11 -D_DEFAULT_SOURCE -D_POSIX_C_SOURCE=200809L $(COMMON) $(CWARN) -Ilibgait/include -iquote libgait/src -Itools $(CFLAGS)
define bench_isa_rule
$(B)/bench/%_kernel.$(1).o: tests/bench/%_kernel.c Makefile $(MADE) | $(B)/bench/
	$$(call log,CC   $$< ($(1)))$$(BENCH_CC) -DKERNEL_ISA=$(1) $(FAST_FLAGS) $(FLAGS_$(1)) -c $$< -o $$@
endef
$(foreach isa,$(KERNEL_ISAS),$(eval $(call bench_isa_rule,$(isa))))
$(B)/bench/%.o: tests/bench/%.c Makefile $(MADE) | $(B)/bench/
	$(call log,CC   $<)$(BENCH_CC) -c $< -o $@
$(B)/bench/step: $(BENCH_OBJ) $(BENCH_PARTS) $(OBJ)
	$(call log,LD   $@)$(CC) $(OPT) $(BENCH_WRAP) $(LDFLAGS) -o $@ $^ -lm -pthread

$(B)/bench/lift: $(B)/bench/lift.o $(BENCH_PARTS) $(OBJ)
	$(call log,LD   $@)$(CC) $(OPT) $(LDFLAGS) -o $@ $^ -lm -pthread

CPU_NAME = $(shell sed -n 's/^model name[^:]*: *//p' /proc/cpuinfo 2>/dev/null | head -n 1 | tr 'A-Z ' 'a-z-' | tr -cd 'a-z0-9-')
BENCH_CSV = $(if $(filter --record,$(ARGS)),tests/bench/results,build/bench)/$(or $(CPU_NAME),$(MACHINE)).csv
BENCH_PAGE = $(if $(filter --record,$(ARGS)),--page tests/bench/results/$(1).md)
BENCH_RUN = $(PY) tests/bench/bench.py --cc '$(CC)'
bench: $(B)/bench/step | $(READY) ## speed by particles, threads, instruction set and stage; detector (ARGS='-s 40 --runs 7'; --record)
	@$(BENCH_RUN) $(call BENCH_PAGE,bench) --csv $(BENCH_CSV) $< $(filter-out --record,$(ARGS))
	@$(PY) tests/bench/detector_speed.py $(filter --record,$(ARGS))

# For a computer without Python: one program, which is copied there with a model.
bench-board: $(B)/bench/step-static ## the bench as one static program, for a board (CC=aarch64-linux-gnu-gcc)
	@echo 'copy $< and a model to the board, and run there: ./step-static -m walk.gait -n 2000,10000 -t 1 -s 20'

$(B)/bench/step-static: $(BENCH_OBJ) $(BENCH_PARTS) $(OBJ)
	$(call log,LD   $@)$(CC) $(OPT) $(BENCH_WRAP) $(LDFLAGS) -static -o $@ $^ -lm -pthread

# Of a particle: what 1,000 more take in three steps.
QEMU ?= qemu-$(CPU)
bench-instructions: $(B)/bench/instructions build/bench/instructions_plugin.so | $(READY) ## instructions of a particle under QEMU (CC=aarch64-linux-gnu-gcc; --record)
	@command -v $(QEMU) >/dev/null || { echo 'bench-instructions: no $(QEMU): install qemu-user' >&2; exit 1; }
	@$(PY) tests/bench/instructions.py $(MACHINE) '$(QEMU)' build/bench/instructions_plugin.so $< --cc '$(CC)' \
	    --flags='$(strip $(OPT) $(CFLAGS))' $(ARGS)

$(B)/bench/instructions: $(B)/bench/instructions.o $(B)/bench/bench_scene.o $(B)/tools/trackd/common.c.o $(OBJ)
	$(call log,LD   $@)$(CC) $(OPT) $(LDFLAGS) -static -o $@ $^ -lm -pthread

build/bench/instructions_plugin.so: tests/bench/instructions_plugin.c | build/bench/
	$(call log,CC   $<)cc -std=c11 -O2 -shared -fPIC -o $@ $<

$(B)/bench/size: $(B)/bench/size.o $(OBJ)
	$(call log,LD   $@)$(CC) $(OPT) $(LDFLAGS) -o $@ $^ -lm -pthread

size: $(B)/bench/size lib ## bytes of the default tracker, and of libgait.so's code and constants, by part
	@$< python/gait/data/walk.gait
	@for folder in $(sort $(notdir $(patsubst %/,%,$(SRC_DIRS)))); do \
	    size $(B)/src/$$folder/*.o | awk -v part=$$folder 'NR > 1 { n += $$1 } END { printf "libgait.so: %-40s %9d\n", part, n }'; done
	@tests/check/size.sh $(B)/libgait.so 409600

bench-lift: $(B)/bench/lift | $(READY) ## time lifting a frame, a segment, by instruction set (ARGS='-m MODEL.gait'; --record)
	@$(BENCH_RUN) --target bench-lift --title 'Speed of lifting' $(call BENCH_PAGE,bench_lift) $< $(filter-out --record,$(ARGS))

bench-peers: setup lib ## the tracker beside BlazePose, MediaPipe and PARSEC's bodytrack (ARGS='--mediapipe PYTHON'; --record) *
	@$(PY) tests/bench/peers.py $(ARGS)

eval: setup lib ## errors on the clips, compared with their targets (gait parameters: eval-gait) *
	@$(PY) tests/bench/eval.py $(ARGS)

# Other packages to compare with, in an environment of their own; without a network they are left out.
PEERS := build/peers/.ready
$(PEERS): tests/bench/lock-peers.txt | $(READY)
	@$(PY) -m venv --clear $(@D) && \
	    $(@D)/bin/pip install --quiet --disable-pip-version-check --require-hashes -r $< && touch $@ || \
	    { rm -rf $(@D); echo 'eval-learn: other packages cannot be installed and are left out' >&2; }

eval-learn: setup lib $(PEERS) ## learning compared with other packages: tests/bench/results/learn.md *
	@$(PY) tests/bench/eval_learn.py $(MOCAP) $(ARGS)

eval-real: setup lib ## tracks of films of real people, compared with joints checked by hand (ARGS='--arms auto --record')
	@$(PY) tests/bench/eval_real.py $(ARGS)

eval-paper: setup lib ## paper mode at its best, and the gain of each addition: paper_mode.md, paper_ladder.md *
	@$(PY) tests/bench/paper_ladder.py $(ARGS)

eval-camera: setup lib ## cameras estimated from walks, and tracks with them: tests/bench/results/camera_walk.md *
	@$(PY) tests/bench/camera_walk.py $(ARGS)

eval-moving: setup lib ## tracks from moving cameras, compared with a static one: tests/bench/results/moving.md
	@$(PY) tests/bench/eval_moving.py $(ARGS)

eval-people: setup lib ## several people in one clip, compared with each alone: tests/bench/results/people.md
	@$(PY) tests/bench/eval_people.py $(ARGS)

eval-cameras: setup lib ## tracks with one and with two cameras: tests/bench/results/cameras.md
	@$(PY) tests/bench/eval_cameras.py $(ARGS)

eval-body: setup lib ## tracks of people with measured limbs: tests/bench/results/body.md
	@$(PY) tests/bench/eval_body.py $(ARGS)

detector-profile: setup lib ## learn the differences between the detector's joints and the model's, on rendered walks (or CLIPS=) *
	@$(PY) tests/bench/detector_profile.py $(CLIPS)

mutants: setup ## change each equation of both papers once: a test of its meaning must fail
	@$(PY) tests/bench/mutants.py $(ARGS)

eval-classes: setup lib ## people who stop, stand, turn, run or walk backwards: tests/bench/results/eval_classes.md *
	@$(PY) tests/bench/eval_classes.py $(ARGS)

eval-gait: setup lib ## gait analysis: footfalls, parameters, angles, their intervals: eval_gait.md *
	@$(PY) tests/bench/eval_gait.py $(ARGS)

eval-lift: setup lib ## lifting of held-out motion, clips and a real motion: tests/bench/results/lift.md *
	@$(PY) tests/bench/eval_lift.py $(ARGS)

eval-studio: setup lib ## corrections by hand, suggested and random, and the time each takes: tests/bench/results/studio.md *
	@$(PY) tests/bench/studio_corrections.py

soak: setup lib tools ## the daemon for 10^6 frames: memory, files, CPU time per frame (ARGS='--frames 108000 --rate 30': an hour)
	@$(PY) tests/bench/soak.py $(ARGS)

kills: setup lib tools ## writers and the daemon killed at random moments: kills.md, daemon_kills.md (ARGS=--record)
	@$(PY) tests/bench/kills.py $(ARGS)
	@$(PY) tests/bench/daemon_kills.py $(ARGS)

# ---- packages ------------------------------------------------------------------------------------------------
# The wheel runs on systems with glibc 2.28: thread functions are those of the oldest glibc for the CPU.
OLDEST_x86_64  := GLIBC_2.2.5
OLDEST_aarch64 := GLIBC_2.17
WHEEL := libgait-$(VERSION)-py3-none-manylinux_2_28_$(CPU).whl
wheel: build/lcm/.stamp ## Python package with the library inside, in build/wheel (CC=aarch64-linux-gnu-gcc for that CPU)
	@command -v cmake >/dev/null || { echo 'wheel: no cmake: install it' >&2; exit 1; }
	@$(VENV)/bin/pip wheel --quiet --disable-pip-version-check --no-deps --no-build-isolation -w build/wheel ./python \
	    $(patsubst %,--config-settings %,wheel.tags=$(WHEEL:libgait-$(VERSION)-%.whl=%) build-dir=$(abspath build/cmake-$(CPU)) \
	        cmake.define.CMAKE_C_COMPILER=$(CC) cmake.define.CMAKE_CXX_COMPILER=$(CXX) cmake.define.GAIT_EIGEN=$(abspath $(EIGEN)) \
	        $(addprefix cmake.define.GAIT_OLDEST_GLIBC=,$(OLDEST_$(CPU))) \
	        $(if $(FOREIGN),cmake.define.CMAKE_SYSTEM_NAME=Linux cmake.define.CMAKE_SYSTEM_PROCESSOR=$(CPU)))
	@$(VENV)/bin/auditwheel show build/wheel/$(WHEEL) | grep -E '"manylinux_2_(5|12|17|2[4678])_$(CPU)"' >/dev/null || \
	    { echo 'wheel: needs a newer glibc than 2.28: see auditwheel show build/wheel/$(WHEEL)' >&2; exit 1; }
	@echo build/wheel/$(WHEEL)

reproducible: sdist lib ## two builds of the wheel, and two models learnt from MOCAP=, have the same bytes *
	@tests/check/reproducible.sh build/wheel/libgait-$(VERSION).tar.gz $(PY) $(wildcard $(MOCAP))

sdist: build/lcm/.stamp ## source package that builds without a network, in build/wheel
	@rm -rf build/eigen3 && mkdir -p build/eigen3 && cp -r $(EIGEN)/Eigen build/eigen3
	@cd python && ../$(PY) -c 'from scikit_build_core.build import build_sdist; build_sdist("../build/wheel")' >/dev/null
	@echo build/wheel/libgait-$(VERSION).tar.gz

wheel-check: wheel sdist lib ## install both packages in fresh environments without a compiler (downloads dependencies)
	@GAIT_WHEEL=$(abspath build/wheel/$(WHEEL)) GAIT_SDIST=$(abspath build/wheel/libgait-$(VERSION).tar.gz) \
	    $(PY) -m pytest -q -c python/pyproject.toml --rootdir . tests/python/test_wheel.py $(ARGS)

# ---- documentation -------------------------------------------------------------------------------------------
DOCS_READY := $(VENV)/.docs
$(DOCS_READY): python/lock-docs.txt | $(READY)
	$(PIP_INSTALL) --require-hashes -r python/lock-docs.txt
	@touch $@

docs: setup lib tools $(DOCS_READY) ## these pages and the reference as a site, in build/docs
	@NO_MKDOCS_2_WARNING=1 $(VENV)/bin/mkdocs build --strict --clean -f libgait/doc/site/mkdocs.yml
	@echo build/docs/index.html

screenshots: setup lib ## the figures of the pages and the tutorial's pictures, from a simulated walk
	@$(VENV)/bin/python libgait/doc/site/figures.py
	@$(VENV)/bin/python libgait/doc/site/screenshots.py

# ---- style ---------------------------------------------------------------------------------------------------
C_FILES := $(sort $(wildcard libgait/doc/*.c libgait/src/*/*.[ch] libgait/src/*/*.cpp tests/unit/*.[ch] tests/bench/*.[ch] tests/fuzz/*.[ch] tests/python/*.c \
           tools/trackd/*.[ch]))
SBOM := build/sbom
sbom: setup $(PACKAGING)/.ready ## components with versions, licences and known hashes (CycloneDX): build/sbom/libgait.cdx.json
	@mkdir -p $(SBOM)
	@$(PACKAGING)/bin/cyclonedx-py environment $(VENV)/bin/python --pyproject python/pyproject.toml --mc-type library \
	    --output-reproducible --output-file $(SBOM)/packages.json 2>$(SBOM)/log || { cat $(SBOM)/log >&2; exit 1; }
	@$(PY) tools/sbom.py $(SBOM)/packages.json -o $(SBOM)/libgait.cdx.json

lint: export PATH := $(abspath $(VENV)/bin):$(PATH)
lint: setup ## clang-format, ruff, mypy; clang-tidy where it is installed
	@clang-format --dry-run -Werror $(C_FILES)
	@ruff check --quiet --config python/pyproject.toml python tests
	@ruff format --quiet --check --config python/pyproject.toml python tests
	@mypy --no-error-summary --config-file python/pyproject.toml python/gait
	@if command -v clang-tidy >/dev/null; then \
	    clang-tidy --quiet $(filter libgait/src/%.c,$(C_FILES)) -- -std=c11 -Ilibgait/include -iquote libgait/src; \
	else echo 'lint: no clang-tidy, skipped' >&2; fi

format: setup ## format all code
	@$(VENV)/bin/clang-format -i $(C_FILES)
	@$(VENV)/bin/ruff format --config python/pyproject.toml python tests

# ---- installation --------------------------------------------------------------------------------------------
install: lib ## the library and, after `make tools`, the daemon as a service (DESTDIR= PREFIX= LIBDIR= INCLUDEDIR=)
	@for d in '$(PREFIX)' '$(LIBDIR)' '$(INCLUDEDIR)'; do case "$$d" in /*) ;; *) echo "install: '$$d' does not begin with /:" \
	    'give PREFIX, LIBDIR and INCLUDEDIR from the root' >&2; exit 1;; esac; done
	install -d '$(DESTDIR)$(LIBDIR)/pkgconfig' '$(DESTDIR)$(LIBDIR)/cmake/gait' '$(DESTDIR)$(INCLUDEDIR)' \
	    '$(DESTDIR)$(PREFIX)/share/doc/libgait'
	install -m 755 $(B)/libgait.so.$(ABI) '$(DESTDIR)$(LIBDIR)/'
	ln -sf libgait.so.$(ABI) '$(DESTDIR)$(LIBDIR)/libgait.so'
	install -m 644 $(B)/libgait.a '$(DESTDIR)$(LIBDIR)/'
	install -m 644 $(HEADERS) '$(DESTDIR)$(INCLUDEDIR)/'
	install -m 644 LICENSE README.md '$(DESTDIR)$(PREFIX)/share/doc/libgait/'
	sed 's|](../../|](|g' libgait/doc/notices.md > '$(DESTDIR)$(PREFIX)/share/doc/libgait/notices.md'
	for f in pkgconfig/gait.pc cmake/gait/gaitConfig.cmake cmake/gait/gaitConfigVersion.cmake; do \
	    sed -e 's|@PREFIX@|$(PREFIX)|; s|@LIBDIR@|$(LIBDIR)|; s|@INCLUDEDIR@|$(INCLUDEDIR)|; s|@VERSION@|$(VERSION)|' \
	        -e "s|@INCLUDES@|$$(realpath -ms --relative-to='$(LIBDIR)/cmake/gait' '$(INCLUDEDIR)')|; s|@ABI@|$(ABI)|" \
	        libgait/cmake/$${f##*/}.in > '$(DESTDIR)$(LIBDIR)'/$$f || exit 1; done

	@if [ -x $(BIN)/gait-trackd ]; then $(MAKE) --no-print-directory install-daemon; \
	else echo 'install: without the daemon; build it by `make tools` first'; fi

# Pages of the manual, from --help: the daemon for another CPU has the page of the one built for this machine.
MANUAL := build/man/.stamp
PAGED := $(if $(FOREIGN),$(wildcard build/bin/gait-trackd),$(BIN)/gait-trackd)
$(MANUAL): tools/man.py $(wildcard python/gait/cli/*.py) $(PAGED) | $(READY) build/man/
	$(PY) $< $(@D) $(VERSION) $(VENV)/bin/gait $(PAGED)
	@touch $@

# Its LCM, which no Debian package has, lies beside it in lib/gait, its licence with the notices.
install-daemon: tools $(MANUAL)
	install -d '$(DESTDIR)$(PREFIX)/bin' '$(DESTDIR)$(PREFIX)/lib/gait' '$(DESTDIR)$(PREFIX)/lib/systemd/system' \
	    '$(DESTDIR)$(PREFIX)/share/man/man1' '$(DESTDIR)$(PREFIX)/share/gait/lcm_types' \
	    '$(DESTDIR)$(PREFIX)/share/doc/libgait'
	install -m 755 $(BIN)/gait-trackd '$(DESTDIR)$(PREFIX)/bin/'
	install -m 755 $(LCM)/lib/liblcm.so.1 '$(DESTDIR)$(PREFIX)/lib/gait/'
	install -m 644 $(or $(firstword $(wildcard $(SITE)/lcm-*.dist-info/licenses/COPYING)), \
	    $(error install-daemon: no licence of lcm in $(SITE); remove $(READY), then `make setup`)) \
	    '$(DESTDIR)$(PREFIX)/share/doc/libgait/lcm-COPYING'
	install -m 644 $(LCM_TYPES) '$(DESTDIR)$(PREFIX)/share/gait/lcm_types/'
	install -m 644 $(addprefix python/gait/data/,walk.gait paper.gait classes.gait) '$(DESTDIR)$(PREFIX)/share/gait/'
	sed 's|/usr/local|$(PREFIX)|' tools/trackd/trackd.toml > '$(DESTDIR)$(PREFIX)/share/gait/trackd.toml'
	sed 's|@PREFIX@|$(PREFIX)|' tools/trackd/gait-trackd.service.in \
	    > '$(DESTDIR)$(PREFIX)/lib/systemd/system/gait-trackd.service'
	install -m 644 build/man/*.1 '$(DESTDIR)$(PREFIX)/share/man/man1/'

uninstall: ## remove what install installed
	cd '$(DESTDIR)$(LIBDIR)' && rm -rf libgait.so.$(ABI) libgait.so libgait.a pkgconfig/gait.pc cmake/gait
	cd '$(DESTDIR)$(INCLUDEDIR)' && rm -f $(notdir $(HEADERS))
	rm -rf '$(DESTDIR)$(PREFIX)/share/doc/libgait'
	test ! -d '$(DESTDIR)$(PREFIX)/share/gait' || { cd '$(DESTDIR)$(PREFIX)' && rm -rf bin/gait-trackd lib/gait share/gait \
	    lib/systemd/system/gait-trackd.service share/man/man1/gait.1 share/man/man1/gait-*.1; }

clean: ## remove build/ (not .venv)
	rm -rf build

-include $(wildcard $(B)/src/*/*.d $(B)/unit/*.d $(B)/fuzz/*.d $(B)/bench/*.d $(B)/tools/trackd/*.d)
