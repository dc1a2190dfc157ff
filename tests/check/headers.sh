#!/bin/sh
# headers.sh HEADER...: each compiles alone as every C and C++ since C99 and C++11, without warnings or hidden padding,
# and C++ needs no casts for the enumerations of gait.h.
warn='-Wall -Wextra -Wpedantic -Wpadded -Werror -fsyntax-only'
known() { # STANDARD COMPILER: the standard, or its older name
    if echo | $2 -std="$1" -fsyntax-only -x "$3" - 2>/dev/null; then echo "$1"; else echo "$1" | sed 's/c23/c2x/; s/20$/2a/'; fi
}
c_standards='c99 c11 c17 c23'
cxx_standards='c++11 c++14 c++17 c++20'
for header; do
    for std in $c_standards; do
        ${CC:-cc} -std="$(known $std "${CC:-cc}" c)" $warn -Wstrict-prototypes -x c "$header" || exit 1
    done
    for std in $cxx_standards; do
        ${CXX:-c++} -std="$(known $std "${CXX:-c++}" c++)" $warn -x c++ "$header" || exit 1
        [ "${header##*/}" != gait.h ] || echo "#include \"$header\"
gait_mode mode(const gait_image *i)
{
    gait_tracker_config c;
    gait_tracker_default(&c, GAIT_MODE_PAPER);
    c.terms = GAIT_TERM_TEXTURE | GAIT_TERM_EDGES;
    return i->format == GAIT_GREY8 ? c.mode : GAIT_MODE_DEFAULT;
}" | ${CXX:-c++} -std="$(known $std "${CXX:-c++}" c++)" $warn -I. -Ilibgait/include -x c++ - || exit 1
    done
done
