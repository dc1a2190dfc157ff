#!/bin/sh
# Run C tests (arguments) and add up what they print; a crash, a hang (LIMIT seconds) or a silent exit is a failed test.
passed=0 failed=0
for test; do
    out=$(timeout "${LIMIT:-300}" "$test")
    status=$?
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
