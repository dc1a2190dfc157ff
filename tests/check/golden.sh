#!/bin/sh
# The digests of the tracker (test_determinism) and of the lifter (test_lift_stream) are the same at every
# optimisation level, with every compiler found and for every instruction set of the CPU, here and on an emulated
# aarch64.
cd "$(dirname "$0")/../.." || exit 1
release=$(sed -n 's/^OPT_release *:= *//p' Makefile)
want_determinism='' want_lift_stream='' failed=0 runs=0
compare() { # CC FOLDER OPT [RUNNER]
    for part in determinism lift_stream; do
        test=build/golden/$2/unit/test_$part
        ${MAKE:-make} -s -j"$(getconf _NPROCESSORS_ONLN)" B="build/golden/$2" OPT="$3" CC="$1" "$test" >/dev/null || exit 1
        lines=$($4 "$test" digest | sed -n 's/^digest //p')
        [ -n "$lines" ] || { echo "golden: $test printed no digest" >&2; exit 1; }
        while read -r have isa; do
            echo "golden: $part $1 $3 $isa: $have"
            eval "want_$part=\${want_$part:-$have} want=\$want_$part" runs=$((runs + 1))
            [ "$have" = "$want" ] || failed=$((failed + 1))
        done <<END
$lines
END
    done
}
for cc in gcc clang; do
    command -v "$cc" >/dev/null && command -v "$(echo $cc | sed 's/gcc/g++/; s/clang/clang++/')" >/dev/null ||
        { echo "golden: no $cc with C++, skipped"; continue; }
    for level in 0 2 3; do
        compare "$cc" "$cc-O$level" "-O$level"
    done
    compare "$cc" "$cc-release" "$release"
done
# Another instruction set, under emulation.
arm=aarch64-linux-gnu
if command -v $arm-gcc >/dev/null && command -v $arm-g++ >/dev/null && command -v qemu-aarch64 >/dev/null; then
    LDFLAGS=-static && export LDFLAGS
    compare $arm-gcc $arm "$release" qemu-aarch64
else
    echo "golden: no $arm-gcc, $arm-g++ or qemu-aarch64, skipped (Debian: gcc-$arm g++-$arm qemu-user)"
fi
echo "golden: $((runs - failed)) passed, $failed failed"
[ "$failed" -eq 0 ] && [ "$runs" -gt 1 ]
