#!/bin/sh
# static_init.sh LIBRARY OBJECT...: no constructors, no writable globals (constant tables of pointers are read-only); and
# none that a compiler's own library brought into the linked one, where only the C runtime has some.
library=$1; shift
sections='\.(data|bss|tdata|tbss|init_array|fini_array|ctors|dtors)'
sizes=$(size -A "$@") && linked=$(readelf -SsW "$library") || exit 1
found=$(echo "$sizes" | awk -v sections="^$sections(\\\\.|\$)" '
    / :$/ { file = $1 }
    $2 > 0 && $1 !~ /^\.data\.rel\.ro/ && $1 ~ sections { print file, $1, $2, "bytes" }
    $1 == "COMMON" && $2 > 0 { print file, $1, $2, "bytes" }'
    echo "$linked" | sed 's/^ *\[ *\([0-9]*\)\]/section \1/' | awk -v file="$library" '
    $1 == "section" { size[$3] = $7 }
    $1 == "section" && $3 ~ /^\.(data|bss|tdata|tbss)$/ { writable[$2] = $3 }
    $4 ~ /^(OBJECT|TLS)$/ && $3 > 0 && $7 in writable && $8 !~ /^(completed(\.[0-9]+)?|__dso_handle)$/ {
        print file, writable[$7], $8, $3, "bytes" }
    END { for (s in size) if (s ~ /^\.(init_array|fini_array|ctors|dtors)$/ && size[s] !~ /^0*[48]$/)
        print file, s, "0x" size[s], "bytes: more than the C runtime has" }')
[ -z "$found" ] || { printf 'writable or run at load time:\n%s\n' "$found"; exit 1; }
