#!/bin/sh
# size.sh LIBRARY BYTES: gcc's release build for x86-64, stripped, is no larger; others are not judged.
case $1 in */release/*) ;; *) exit 0 ;; esac
readelf -h "$1" | grep -q 'Machine:.*X86-64' || exit 0
readelf -p .comment "$1" | grep -q clang && exit 0
small=$(mktemp) || exit 1
trap 'rm -f "$small"' EXIT
strip -o "$small" "$1" || exit 1
bytes=$(wc -c <"$small")
[ "$bytes" -le "$2" ] || { echo "$1 has $bytes bytes when stripped, more than $2"; exit 1; }
