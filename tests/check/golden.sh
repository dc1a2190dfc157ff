#!/bin/sh
# The digests of the tracker (test_determinism, both modes) and of the lifter (test_lift_stream) are those pinned in
# these tests at every optimisation level, with every compiler found and for every instruction set of the CPU, here
# and on an emulated aarch64.  What is not there is skipped, and listed at the end.
cd "$(dirname "$0")/../.." || exit 1
release=$(sed -n 's/^OPT_release *:= *//p' Makefile)
failed=0 runs=0 skipped=''
compare() { # CC BUILD_FOLDER OPT [RUNNER]
    for part in determinism lift_stream; do
        test=$2/unit/test_$part
        ${MAKE:-make} -s -j"$(getconf _NPROCESSORS_ONLN)" B="$2" OPT="$3" CC="$1" "$test" >/dev/null || exit 1
        lines=$($4 "$test" digest | sed -n 's/^digest //p')
        [ -n "$lines" ] || { echo "golden: $test printed no digest" >&2; exit 1; }
        while read -r have want name; do
            echo "golden: $part $1 $3 $name: $have"
            runs=$((runs + 1))
            [ "$have" = "$want" ] || { failed=$((failed + 1)); echo "golden: wanted $want" >&2; }
        done <<END
$lines
END
    done
}
skip() { # WHAT DEBIAN_PACKAGES
    skipped="$skipped
golden: SKIPPED, not compared: $1 (Debian: $2)"
}
here() { # PROGRAM...: all are found
    for program; do command -v "$program" >/dev/null || return 1; done
}
for cc in gcc clang; do
    cxx=$(echo $cc | sed 's/gcc/g++/; s/clang/clang++/')
    here $cc "$cxx" || { skip "$cc and $cxx" "$(echo $cc | sed 's/gcc/g++/')"; continue; }
    for level in 0 2 3; do
        compare "$cc" "build/golden/$cc-O$level" "-O$level"
    done
    compare "$cc" "build/golden/$cc-release" "$release"
done
# Another instruction set, under emulation, in the folder of `make lib CC=$arm-gcc`: the tests of the example made it.
arm=aarch64-linux-gnu
if here $arm-gcc $arm-g++ qemu-aarch64; then
    LDFLAGS=-static && export LDFLAGS
    compare $arm-gcc build/$arm-release "$release" qemu-aarch64
else
    skip "$arm-gcc, $arm-g++ and qemu-aarch64" "g++-$arm qemu-user"
fi
[ -z "$skipped" ] || echo "${skipped#?}"
echo "golden: $((runs - failed)) passed, $failed failed"
[ "$failed" -eq 0 ] && [ "$runs" -gt 1 ]
