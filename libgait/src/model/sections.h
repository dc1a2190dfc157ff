/* sections.h - read the sections of a blob one by one; the first fault sticks and names its section. */
#ifndef GAIT_MODEL_SECTIONS_H
#define GAIT_MODEL_SECTIONS_H
#include "model/blob.h"

#define SECTION_ANY UINT32_MAX /* a dimension that may be anything */

enum { SECTION_NAME = 32 }; /* bytes of a name, padded with NUL */

typedef struct sections {
    blob b;
    const char *what; /* what is read, for errors: "model" */
    gait_error *err;
    gait_result status; /* of the first failure; later calls do nothing */
} sections;

/* Fail with `fault` about a section, unless something failed before. */
void sections_refuse(sections *s, gait_result status, const char *tag, const char *fault);
void sections_require(sections *s, bool ok, const char *tag, const char *fault); /* else GAIT_ERR_CORRUPT */

/* Elements of a section of this type, rank and shape; SECTION_ANY in dims is filled.  NULL after a failure. */
const void *sections_take(sections *s, const char *tag, uint32_t dtype, uint32_t rank, uint32_t dims[4]);
/* The same for floats, all finite and below 1e4: no length, angle or rate of a body comes near it. */
const float *sections_floats(sections *s, const char *tag, uint32_t rank, uint32_t dims[4]);
/* [1, most] names: none empty, NUL-terminated, all different. */
const char (*sections_names(sections *s, const char *tag, uint32_t most, int32_t *count))[SECTION_NAME];
#endif
