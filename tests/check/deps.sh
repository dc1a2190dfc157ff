#!/bin/sh
# deps.sh LIBRARY: it needs libc and libm only, and of those only threads and functions whose result is exact on every
# system.  (Before glibc 2.34 threads were in a separate library.)
libs='libc\.so\.6|libm\.so\.6|libpthread\.so\.0|libc\.musl-.*|ld-linux.*'
text='mem(cpy|set|move|cmp|chr)|str(len|cmp|ncmp|chr|rchr|nlen|spn|cspn)|vsnprintf'
exact='(sqrt|floor|ceil|trunc|rint|nearbyint|fabs|fmod|ldexp|frexp|scalbn)f?'
threads='pthread_(create|join|sigmask|(mutex|cond)_(init|destroy)|mutex_(un)?lock|cond_(wait|signal|broadcast))|sigfillset'
frame='__cxa_finalize|_ITM_(de)?registerTMCloneTable|__gmon_start__|__stack_chk_fail|__assert_fail|__(memcpy|memset|memmove|vsnprintf)_chk'
needed=$(readelf -d "$1") && calls=$(nm -D -u "$1") || exit 1
needed=$(echo "$needed" | sed -n 's/.*(NEEDED).*\[\(.*\)\]/\1/p' | grep -vE "^($libs)\$")
[ -z "$needed" ] || { printf 'depends on:\n%s\n' "$needed"; exit 1; }
calls=$(echo "$calls" | awk '{ sub("@.*", "", $2); print $2 }' | grep -vE "^($text|$exact|$threads|$frame)\$")
[ -z "$calls" ] || { printf 'calls outside the list of this script:\n%s\n' "$calls"; exit 1; }
