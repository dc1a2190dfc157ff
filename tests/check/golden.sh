#!/bin/sh
# The digests of the tracker (test_determinism, every film), the lifter and the starts are those pinned in
# these tests at every optimisation level, with every compiler found and for every instruction set of the CPU, here
# and on an emulated aarch64, where the tests of the kernels run as well.  What is missing is skipped and listed
# at the end.
if [ $# -gt 0 ]; then
    sed -n '2,/^[^#]/s/^# //p' "$0"
    echo 'usage: make golden-check (some minutes; CC= for another first compiler)'
    [ "$*" = --help ]
    exit
fi
cd "$(dirname "$0")/../.." || exit 1
release=$(sed -n 's/^OPT_release *:= *//p' Makefile)
kernels=$(echo tests/unit/test_*kernel*.c tests/unit/test_fmath.c | sed 's|tests/unit/||g; s|\.c||g')
failed=0 runs=0 skipped=''
fail() {
    failed=$((failed + 1)); echo "golden: $*" >&2
}
skip() { # WHAT WHY: once
    case $skipped in *": $1 ("*) return ;; esac
    skipped="$skipped
golden: SKIPPED, not compared: $1 ($2)"
}
make_tests() { # CC BUILD_FOLDER OPT TEST...
    cc=$1 folder=$2 opt=$3; shift 3
    ${MAKE:-make} -s -j"$(getconf _NPROCESSORS_ONLN)" B="$folder" OPT="$opt" CC="$cc" \
        $(printf "$folder/unit/%s " "$@") >/dev/null || exit 1
}
# A line for each of the five instruction sets and each film: four of the tracker, one of the others.
compare() { # CC BUILD_FOLDER OPT [RUNNER]
    for part in determinism:20 lift_stream:5 start:5 start_boxes:5 start_hypotheses:5 classes:5; do
        test=test_${part%:*}
        make_tests "$1" "$2" "$3" $test
        output=$($4 "$2/unit/$test" digest)
        code=$?
        lines=$(echo "$output" | grep -cE '^(digest [0-9a-f]{16} [0-9a-f]{16} |skipped )[a-z0-9_-]+$')
        runs=$((runs + 1))
        [ $code -eq 0 ] && [ "$lines" -eq "${part#*:}" ] ||
            fail "$test $1 ${2##*[-/]}: ended with $code, printed $lines of ${part#*:} lines"
        while read -r kind have want name; do
            case $kind in
            skipped) [ -n "$4" ] || skip "instruction set $have" "this CPU has none" ;;
            digest)
                echo "golden: ${part%:*} $1 ${2##*[-/]} $name: $have"
                runs=$((runs + 1))
                [ "$have" = "$want" ] || fail "$name: wanted $want" ;;
            esac
        done <<END
$output
END
    done
}
here() { # PROGRAM...: all are found
    for program; do command -v "$program" >/dev/null || return 1; done
}
# The release build, which is that of -O3, is the one that other targets have made, where its compiler made it.
version() { "$1" --version | sed 's/^[a-z-]* //; q'; } # without the name by which it was called
own=${CC:-cc}
compare "$own" build/release "$release"
for cc in gcc clang; do
    cxx=$(echo $cc | sed 's/gcc/g++/; s/clang/clang++/')
    here $cc "$cxx" || { skip "$cc and $cxx" "Debian: $(echo $cc | sed 's/gcc/g++/')"; continue; }
    for level in 0 2; do
        compare "$cc" "build/golden/$cc-O$level" "-O$level"
    done
    [ "$(version "$cc")" = "$(version "$own")" ] || compare "$cc" "build/golden/$cc-release" "$release"
done
# Another instruction set, under emulation, in the folder of `make lib CC=$arm-gcc`.
arm=aarch64-linux-gnu
if here $arm-gcc $arm-g++ qemu-aarch64; then
    LDFLAGS=-static && export LDFLAGS
    compare $arm-gcc build/$arm-release "$release" qemu-aarch64
    make_tests $arm-gcc build/$arm-release "$release" $kernels
    for test in $kernels; do
        runs=$((runs + 1))
        output=$(qemu-aarch64 "build/$arm-release/unit/$test") || fail "$test on an emulated $arm"
        echo "golden: $arm $output"
    done
else
    skip "$arm-gcc, $arm-g++ and qemu-aarch64" "Debian: g++-$arm qemu-user"
fi
[ -z "$skipped" ] || echo "${skipped#?}"
echo "golden: $((runs - failed)) passed, $failed failed"
[ "$failed" -eq 0 ] && [ "$runs" -gt 2 ]
