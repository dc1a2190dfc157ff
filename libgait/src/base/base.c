#include "base/base.h"

#include <stdarg.h>
#include <stdio.h>

gait_result base_fail(gait_error *err, gait_result s, int index, const char *fmt, ...)
{
    if (!err)
        return s;
    err->result = s;
    err->index = index;
    va_list args;
    va_start(args, fmt);
    if (vsnprintf(err->text, sizeof err->text, fmt, args) < 0)
        err->text[0] = '\0';
    va_end(args);
    return s;
}

gait_result base_null(gait_error *err, const char *function)
{
    return base_fail(err, GAIT_ERR_ARG, -1, "%s: null pointer", function);
}
