#!/bin/sh
# static_init.sh OBJECT...: no constructors, no writable globals (constant tables of pointers are read-only).
found=$(size -A "$@" | awk '
    / :$/ { file = $1 }
    $2 > 0 && $1 !~ /^\.data\.rel\.ro/ && $1 ~ /^\.(data|bss|tdata|tbss|init_array|fini_array|ctors|dtors)(\.|$)/ {
        print file, $1, $2, "bytes" }
    $1 == "COMMON" && $2 > 0 { print file, $1, $2, "bytes" }')
[ -z "$found" ] || { printf 'writable or run at load time:\n%s\n' "$found"; exit 1; }
