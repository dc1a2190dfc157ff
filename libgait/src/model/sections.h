/* sections.h - reads the sections of a blob one by one. Only the first fault is kept; it names its section. */
#ifndef GAIT_MODEL_SECTIONS_H
#define GAIT_MODEL_SECTIONS_H
#include "model/blob.h"

#define SECTION_ANY UINT32_MAX /* a dimension of any size */

enum { SECTION_NAME = 32 }; /* bytes of a name, padded with NUL */

typedef struct sections {
    blob b;
    const char *what; /* name of the object for errors: "model" */
    gait_error *err;
    gait_result status; /* result of the first failure; later calls do nothing */
} sections;

/* Fail with `fault` about a section, unless a failure came before. */
void sections_refuse(sections *s, gait_result status, const char *tag, const char *fault);
void sections_require(sections *s, bool ok, const char *tag, const char *fault); /* else GAIT_ERR_CORRUPT */

/* Elements of a section of this type, rank and shape; SECTION_ANY in dims is replaced by the size. NULL
 * after a failure. */
const void *sections_take(sections *s, const char *tag, uint32_t dtype, uint32_t rank, uint32_t dims[4]);
/* The same for floats, which must be finite and below 1e4: lengths, angles and rates of a body are far
 * smaller. */
const float *sections_floats(sections *s, const char *tag, uint32_t rank, uint32_t dims[4]);
/* 1 to `most` names: not empty, NUL-terminated, all different. */
const char (*sections_names(sections *s, const char *tag, uint32_t most, int32_t *count))[SECTION_NAME];
#endif
