#!/bin/sh
# Run every check on the build in $B; prints what each finds, a count and what holds (V=1: the output of each as well).
passed=0 failed=0 proved=''
check() { # NAME WHAT_HOLDS COMMAND...
    name=$1 holds=$2; shift 2
    if found=$("$@" 2>&1); then
        passed=$((passed + 1)) proved="$proved; $holds"
        printf '%s\n' "$found" | grep '^warning: '
        [ -z "$V" ] || printf 'check %s: %s: %s\n' "$name" "$holds" "${found:-ok}"
    else
        failed=$((failed + 1)); printf 'check %s failed: %s\n' "$name" "$found" >&2
    fi
}
cd "$(dirname "$0")/../.." || exit 1
here=tests/check
check no_heap 'no heap' $here/no_heap.sh "$B"/src/*/*.o "$B/libgait.so"
check deps 'needs exact functions of libc and libm alone' $here/deps.sh "$B/libgait.so"
check size '409600 bytes at most' $here/size.sh "$B/libgait.so" 409600
check symbols 'exports what the headers declare' python3 $here/symbols.py libgait/include/*.h "$B/libgait.so" "$B/libgait.a"
check threads 'threads in the pool alone' $here/threads.sh "$B"/src/*/*.o
check static_init 'no writable data, no constructors' $here/static_init.sh "$B/libgait.so" "$B"/src/*/*.o
check headers 'headers compile alone' $here/headers.sh libgait/include/*.h
check layers 'includes and calls go down, in no circle' python3 $here/layers.py libgait/LAYERS libgait/src "$B"/src/*/*.o
check py_layers 'imports go down, in no circle' python3 $here/py_layers.py python/LAYERS python/gait
check stack 'frames of 16384 bytes at most' python3 $here/stack.py 16384 "$B"/src/*/*.su
if ls "$B"/src/*/*.ci >/dev/null 2>&1; then
    check calls "no recursion, paths of 49152 bytes at most without libc's" python3 $here/calls.py 49152 "$B"/src/*/*.o
else
    echo 'check calls: needs the call graphs of gcc, skipped'
fi
check hygiene 'nothing tracked but sources' python3 $here/hygiene.py .
check words "the field's words" python3 $here/words.py .
echo "checks: $passed passed, $failed failed${proved:+: ${proved#; }}"
[ "$failed" -eq 0 ]
