#!/bin/sh
# headers.sh HEADER...: each compiles alone as C and C++, without warnings or hidden padding.
warn='-Wall -Wextra -Wpedantic -Wpadded -Werror -fsyntax-only'
for header; do
    for std in c99 c11 c17; do
        ${CC:-cc} -std=$std $warn -Wstrict-prototypes -x c "$header" || exit 1
    done
    for std in c++11 c++17; do
        ${CXX:-c++} -std=$std $warn -x c++ "$header" || exit 1
    done
done
