# Compiler flags of the library.  The Makefile includes this file and CMakeLists.txt reads it line by line, so it has
# only comments and lines `NAME := WORDS`.

# Same bits everywhere: baseline instruction set, no fused multiply-add, no -ffast-math, Eigen not vectorised.
# Ignoring errno and traps changes no value (make golden-check) and lets loops over lanes become vector code.
RELEASE_FLAGS := -O3 -DNDEBUG -fno-math-errno -fno-trapping-math
CODE_FLAGS    := -ffp-contract=off -fPIC -fvisibility=hidden -fno-asynchronous-unwind-tables
CXX_FLAGS     := -fno-exceptions -fno-rtti -fno-threadsafe-statics -fvisibility-inlines-hidden -DEIGEN_DONT_VECTORIZE -DEIGEN_NO_MALLOC -DEIGEN_NO_IO

# Release builds use -O3 only for the sources a step or a live lift spends its time in.  What else runs for every
# particle or row of numbers is compiled at -O2 (a third smaller, 2 % of a step), with vector code where it has loops
# over lanes, and the rest at -Os (a fifth smaller again, no slower).  Kernels not listed here have loops over lanes.
O3_SOURCES     := outline_kernel.c silhouette_kernel.c
VECTOR_SOURCES := fmath.c cholesky_kernel.c lift_kernel.c
O2_SOURCES     := segment_posterior.c kinematics.c rejuvenation.c pf.c particles.c likelihood_step.c linalg.cpp
GCC_TIGHT      := -fno-align-functions -fno-align-loops -fno-align-jumps -fno-align-labels
# At -Os invariants stay in their loops on the way to machine code: 1 kB less.
GCC_LEAST      := -fno-tree-loop-im
GCC_VECTOR     := -ftree-vectorize -fvect-cost-model=dynamic
CLANG_VECTOR   := -ftree-vectorize
# Kernels that no list names go without vector code for the last few elements of a row, without a search for
# redundancies across branches and along dominators, and without copies of code for a jump whose outcome is known or of
# a small function for each of its callers: 10 kB less, and a step takes 2 % less time.
GCC_LESS       := -fno-tree-pre -fno-tree-dominator-opts -fno-thread-jumps -fno-inline-small-functions --param=vect-epilogues-nomask=0
# Nor, where a register holds eight numbers or more, with what gcc knows of one block's values in the next: 3 kB less.
GCC_LESS_avx2   := -fno-gcse
GCC_LESS_avx512 := -fno-gcse
# Loops over sixteen elements are unrolled where 400 KiB do not matter: a sixth fewer instructions of a particle.
GCC_AARCH64    := -fpeel-loops
# At -O3 gcc would unroll every loop over 16 lanes besides vectorising it: half as large again, no faster.
GCC_KERNEL     := --param=max-completely-peel-times=8

# Kernels are compiled once per instruction set; the results of `scalar` define those of the others.  It runs only
# where a mask allows no other, so that release builds compile it at -Os, but for the kernels that gain most.
O2_SCALAR_SOURCES := surface_kernel.c silhouette_kernel.c
X86_ISAS     := sse4 avx2 avx512
# Those whose kernels an instruction set takes from the set before (KERNELS_AVX, KERNELS_FRAME in dispatch.h).
SHARED_sse4   := kinematics_kernel.c texture_kernel.c sides_kernel.c cholesky_kernel.c lift_kernel.c dynamics_kernel.c view_kernel.c features_kernel.c estimate_kernel.c track_loss_kernel.c
SHARED_avx512 := view_kernel.c features_kernel.c estimate_kernel.c track_loss_kernel.c
FLAGS_scalar := -DKERNEL_SCALAR -fno-tree-vectorize -fno-tree-slp-vectorize
FLAGS_base   :=
FLAGS_sse4   := -mssse3 -msse4.1 -mpopcnt
FLAGS_avx2   := -mavx2 -mpopcnt -mbmi -mbmi2
FLAGS_avx512 := -mavx2 -mpopcnt -mbmi -mbmi2 -mavx512f -mavx512bw -mavx512dq -mavx512vl -mavx512vbmi -mavx512vpopcntdq -mavx512bitalg -mprefer-vector-width=512
