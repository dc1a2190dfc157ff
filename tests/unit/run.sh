#!/bin/sh
# Run C tests (arguments), as many at a time as there are processors, and add up what they print; a crash, a hang (LIMIT
# seconds) or a silent exit is a failed test.
results=$(mktemp -d) || exit 1
trap 'rm -rf "$results"' EXIT
for test; do
    printf '%s\0%s\0' "$test" "$results/${test##*/}"
done | xargs -0 -n 2 -P "$(getconf _NPROCESSORS_ONLN)" sh -c 'timeout "${LIMIT:-300}" "$0" >"$1.out"; echo $? >"$1.status"'
passed=0 failed=0
for test; do
    out=$(cat "$results/${test##*/}.out")
    status=$(cat "$results/${test##*/}.status")
    [ -n "$out" ] && printf '%s\n' "$out"
    counts=$(printf '%s\n' "$out" | sed -n 's/^.* \([0-9]*\) passed, \([0-9]*\) failed$/\1 \2/p' | tail -n 1)
    p=${counts% *} f=${counts#* }
    if [ -z "$counts" ] || { [ "$status" -ne 0 ] && [ "$f" -eq 0 ]; }; then
        echo "${test##*/}: ended with status $status before it was done" >&2
        f=$((${f:-0} + 1))
    fi
    passed=$((passed + ${p:-0})) failed=$((failed + f))
done
echo "C tests: $passed passed, $failed failed"
[ "$failed" -eq 0 ] && [ "$passed" -gt 0 ]
