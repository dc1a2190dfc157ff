#include "model/sections.h"

#include <string.h>

#define LARGEST_NUMBER 1e4f /* products of such numbers stay finite */

void sections_refuse(sections *s, gait_result status, const char *tag, const char *fault)
{
    if (s->status == GAIT_OK)
        s->status = base_fail(s->err, status, -1, "%s: section %s: %s", s->what, tag, fault);
}

void sections_require(sections *s, bool ok, const char *tag, const char *fault)
{
    if (!ok)
        sections_refuse(s, GAIT_ERR_CORRUPT, tag, fault);
}

const void *sections_take(sections *s, const char *tag, uint32_t dtype, uint32_t rank, uint32_t dims[4])
{
    if (s->status != GAIT_OK)
        return NULL;
    uint32_t got[4] = {0};
    const void *const p = blob_section(&s->b, tag, dtype, rank, got);
    sections_require(s, p != NULL, tag, "missing, or of another type or rank");
    for (uint32_t i = 0; p && i < rank; i++) {
        sections_require(s, dims[i] == SECTION_ANY || dims[i] == got[i], tag,
                         "its shape does not fit the other sections");
        dims[i] = got[i];
    }
    return s->status == GAIT_OK ? p : NULL;
}

const float *sections_floats(sections *s, const char *tag, uint32_t rank, uint32_t dims[4])
{
    const float *const x = sections_take(s, tag, BLOB_F32, rank, dims);
    if (!x)
        return NULL;
    size_t n = 1;
    for (uint32_t i = 0; i < rank; i++)
        n *= dims[i];
    for (size_t i = 0; i < n; i++)
        if (!(fabsf(x[i]) < LARGEST_NUMBER)) {
            sections_refuse(s, GAIT_ERR_CORRUPT, tag, "holds a number that is not finite or absurdly large");
            return NULL;
        }
    return x;
}

const char (*sections_names(sections *s, const char *tag, uint32_t most, int32_t *count)) [SECTION_NAME] {
    uint32_t dims[4] = {SECTION_ANY, SECTION_NAME};
    const char (*const name)[SECTION_NAME] =
        (const char (*)[SECTION_NAME])sections_take(s, tag, BLOB_U8, 2, dims);
    if (!name)
        return NULL;
    sections_require(s, dims[0] > 0, tag, "is empty");
    if (dims[0] > most)
        sections_refuse(s, GAIT_ERR_LIMIT, tag, "has more rows than this build can hold");
    for (uint32_t i = 0; s->status == GAIT_OK && i < dims[0]; i++) {
        sections_require(s, name[i][0] && !name[i][SECTION_NAME - 1], tag,
                         "holds a name that is empty or too long");
        for (uint32_t k = 0; s->status == GAIT_OK && k < i; k++)
            sections_require(s, strcmp(name[i], name[k]) != 0, tag, "holds a name twice");
    }
    *count = (int32_t)dims[0];
    return s->status == GAIT_OK ? name : NULL;
}
