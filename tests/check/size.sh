#!/bin/sh
# size.sh LIBRARY BYTES: gcc's release build for x86-64, stripped, is no larger; others are not judged.
about=$(readelf -h -p .comment "$1") || exit 1
case $1 in */release/*) ;; *) exit 0 ;; esac
echo "$about" | grep -q 'Machine:.*X86-64' || exit 0
echo "$about" | grep -q clang && exit 0
small=$(mktemp) || exit 1
trap 'rm -f "$small"' EXIT
strip -o "$small" "$1" || exit 1
bytes=$(wc -c <"$small")
echo "$1 has $bytes bytes when stripped, at most $2 are wanted"
[ "$bytes" -le "$2" ]
