#!/bin/sh
# The digest that test_determinism prints is the same at every optimisation level and with every compiler found.
cd "$(dirname "$0")/../.." || exit 1
release=$(sed -n 's/^OPT_release *:= *//p' Makefile)
want='' failed=0 runs=0
compare() { # CC CXX CONFIG OPT [RUNNER]
    test=build/$3/unit/test_determinism
    ${MAKE:-make} -s config="$3" OPT="$4" CC="$1" CXX="$2" "$test" >/dev/null || exit 1
    have=$($5 "$test" digest | sed -n 's/^digest //p')
    [ -n "$have" ] || { echo "golden: $test printed no digest" >&2; exit 1; }
    echo "golden: $1 $4:" $have
    want=${want:-$have} runs=$((runs + 1))
    [ "$have" = "$want" ] || failed=$((failed + 1))
}
for compiler in gcc:g++ clang:clang++; do
    cc=${compiler%:*} cxx=${compiler#*:}
    command -v "$cc" >/dev/null && command -v "$cxx" >/dev/null || { echo "golden: no $cc, skipped"; continue; }
    for level in 0 2 3; do
        compare "$cc" "$cxx" "det-$cc-O$level" "-O$level"
    done
    compare "$cc" "$cxx" "det-$cc-release" "$release"
done
# Another instruction set, under emulation.
arm=aarch64-linux-gnu
if command -v $arm-gcc >/dev/null && command -v $arm-g++ >/dev/null && command -v qemu-aarch64 >/dev/null; then
    LDFLAGS=-static && export LDFLAGS
    compare $arm-gcc $arm-g++ det-$arm "$release" qemu-aarch64
else
    echo "golden: no $arm-gcc, $arm-g++ or qemu-aarch64, skipped"
fi
echo "golden: $((runs - failed)) passed, $failed failed"
[ "$failed" -eq 0 ] && [ "$runs" -gt 1 ]
