/* arena.h - places arrays in the caller's memory. The same layout code first counts the bytes and then
 * places the arrays.
 *
 *  arena a = { .base = NULL };               counting pass: TAKE returns NULL, a.used becomes the size needed
 *  arena a = { .base = mem, .cap = bytes };  placing pass: arena_place has checked mem
 *
 * After the layout function, a.overflow is set if a size overflowed or cap was too small. */
#ifndef GAIT_BASE_ARENA_H
#define GAIT_BASE_ARENA_H
#include "base/base.h"

typedef struct arena {
    unsigned char *base; /* NULL: count only */
    size_t cap, used;    /* bytes */
    int overflow;        /* set by the first block that did not fit, and never reset */
    bool solid;          /* no red zones under ASan: the blocks are copied and hashed as one */
} arena;

/* An array of count elements of elem bytes, aligned to GAIT_ALIGN and not cleared. NULL when counting or on
 * overflow. */
void *arena_take(arena *a, size_t elem, size_t count);

/* After a counting pass, start the placing pass in the caller's mem. GAIT_ERR_MEMORY, with the size needed,
 * if mem is too small or not aligned. */
gait_result arena_place(arena *a, void *mem, size_t bytes, gait_error *err);

#define TAKE(a, T, n) ((T *)arena_take((a), sizeof(T), (size_t)(n)))
#endif
