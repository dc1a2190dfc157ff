#!/bin/sh
# Run every check on the build in $B; prints what each finds and a count.
passed=0 failed=0
check() {
    name=$1; shift
    if found=$("$@" 2>&1); then
        passed=$((passed + 1))
    else
        failed=$((failed + 1)); printf 'check %s failed: %s\n' "$name" "$found" >&2
    fi
}
cd "$(dirname "$0")/../.." || exit 1
here=tests/check
check no_heap     $here/no_heap.sh "$B"/src/*.o "$B/libgait.so"
check deps        $here/deps.sh "$B/libgait.so"
check size        $here/size.sh "$B/libgait.so" 400000
check symbols     python3 $here/symbols.py libgait/include/*.h "$B/libgait.so" "$B/libgait.a"
check threads     $here/threads.sh "$B"/src/*.o
check static_init $here/static_init.sh "$B/libgait.so" "$B"/src/*.o
check headers     $here/headers.sh libgait/include/*.h
check layers      python3 $here/layers.py libgait/LAYERS libgait/src
check py_layers   python3 $here/py_layers.py python/LAYERS python/gait
check stack       python3 $here/stack.py 16384 "$B"/src/*.su
if ls "$B"/src/*.ci >/dev/null 2>&1; then
    check calls   python3 $here/calls.py 49152 "$B"/src/*.ci
else
    echo 'check calls: needs the call graphs of gcc, skipped'
fi
check hygiene     python3 $here/hygiene.py .
echo "checks: $passed passed, $failed failed"
[ "$failed" -eq 0 ]
