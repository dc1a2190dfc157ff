#!/bin/sh
# no_heap.sh OBJECT...: none of them refers to an allocator.
symbols='malloc|calloc|realloc|reallocarray|free|cfree|aligned_alloc|posix_memalign|memalign|valloc|pvalloc'
symbols="$symbols|strn?dup|v?asprintf|getline|getdelim|open_memstream|s?brk|mmap(64)?|_Zn[wa][jm].*|_Zd[la]Pv.*"
names=$(nm -A "$@") || exit 1
found=$(echo "$names" | grep -E " ($symbols)(@.*)?\$")
[ -z "$found" ] || { printf 'refers to the heap:\n%s\n' "$found"; exit 1; }
