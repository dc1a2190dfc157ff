/* fields.h - the tables of the public structs at run time: their rows, and checks of values against them. */
#ifndef GAIT_API_FIELDS_H
#define GAIT_API_FIELDS_H
#include "base/base.h"

/* Check that every number of the struct `of` at `values` is in its range.  what: text before the name in errors, such as
 * "config ". */
gait_result fields_check(const char *of, const void *values, const char *what, gait_error *err);
/* The same for standard deviations of such numbers, which must be in [0, most]. */
gait_result fields_check_sd(const char *of, const void *values, double most, const char *what,
                            gait_error *err);
/* Check that struct_size is that of this library's struct, or of an older, shorter one, which ends with a whole field.
 * filled_by: the function that sets it, for the error. */
gait_result fields_check_size(const char *of, uint64_t struct_size, const char *filled_by, gait_error *err);
#endif
