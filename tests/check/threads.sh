#!/bin/sh
# threads.sh OBJECT...: only the pool uses threads.
names=$(nm -A -u "$@") || exit 1
found=$(echo "$names" | grep -vE '(^|/)pool\.c\.o:' | grep -E ' (pthread_|sem_|thrd_|mtx_|cnd_|sig|__tls_get_addr)')
[ -z "$found" ] || { printf 'refers to threads:\n%s\n' "$found"; exit 1; }
