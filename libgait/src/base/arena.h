/* arena.h - place arrays in caller memory; the same layout code counts the bytes and carves them.
 *
 *   arena a = { .base = NULL };               counting pass: every TAKE gives NULL, a.used is the size needed
 *   arena a = { .base = mem, .cap = bytes };  placing pass; mem aligned to GAIT_ALIGN (arena_place checks it)
 * After the layout function, a.overflow tells that a size overflowed or cap was too small. */
#ifndef GAIT_BASE_ARENA_H
#define GAIT_BASE_ARENA_H
#include "base/base.h"

typedef struct arena {
    unsigned char *base; /* NULL: count only */
    size_t cap, used;    /* bytes */
    int overflow;        /* set for good by the first block that did not fit */
    bool solid;          /* no red zones under ASan: the blocks are handled as one stretch */
} arena;

/* count elements of elem bytes, aligned to GAIT_ALIGN, not cleared.  NULL when counting or on overflow. */
void *arena_take(arena *a, size_t elem, size_t count);

/* After a counting pass, make ready for the placing one in the caller's mem: GAIT_ERR_MEMORY, saying what is needed, if
 * that is too small or not aligned. */
gait_result arena_place(arena *a, void *mem, size_t bytes, gait_error *err);

#define TAKE(a, T, n) ((T *)arena_take((a), sizeof(T), (size_t)(n)))
#endif
