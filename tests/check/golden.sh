#!/bin/sh
# The digests that test_tracker prints are the same at every optimisation level and with every compiler found.
cd "$(dirname "$0")/../.." || exit 1
want='' failed=0 runs=0
for compiler in gcc:g++ clang:clang++; do
    cc=${compiler%:*} cxx=${compiler#*:}
    command -v "$cc" >/dev/null && command -v "$cxx" >/dev/null || { echo "golden: no $cc, skipped"; continue; }
    for level in O0 O2 O3; do
        config=det-$cc-$level test=build/det-$cc-$level/unit/test_tracker
        ${MAKE:-make} -s config="$config" OPT="-$level" CC="$cc" CXX="$cxx" "$test" >/dev/null || exit 1
        have=$("$test" | sed -n 's/^digest //p')
        [ -n "$have" ] || { echo "golden: $test printed no digest" >&2; exit 1; }
        echo "golden: $cc -$level" $have
        want=${want:-$have} runs=$((runs + 1))
        [ "$have" = "$want" ] || failed=$((failed + 1))
    done
done
echo "golden: $((runs - failed)) passed, $failed failed"
[ "$failed" -eq 0 ] && [ "$runs" -gt 1 ]
