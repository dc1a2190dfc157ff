#include "arena.h"

/* Under AddressSanitizer every block is followed by bytes that must not be touched. */
#if defined(__SANITIZE_ADDRESS__)
#include <sanitizer/asan_interface.h>
enum { RED_ZONE = GAIT_ALIGN };
#else
enum { RED_ZONE = 0 };
#define ASAN_UNPOISON_MEMORY_REGION(p, n) ((void)0)
#define ASAN_POISON_MEMORY_REGION(p, n)   ((void)0)
#endif

void *arena_take(arena *a, size_t elem, size_t count)
{
    size_t const align = GAIT_ALIGN - 1, zone = a->solid ? 0 : RED_ZONE;
    if (a->overflow || (elem && count > (SIZE_MAX - align - zone) / elem)) {
        a->overflow = 1;
        return NULL;
    }
    size_t const bytes = elem * count, padded = ((bytes + align) & ~align) + zone;
    if (padded > SIZE_MAX - a->used || (a->base && a->used + padded > a->cap)) {
        a->overflow = 1;
        return NULL;
    }
    unsigned char *const block = a->base ? a->base + a->used : NULL;
    a->used += padded;
    if (block) {
        ASAN_UNPOISON_MEMORY_REGION(block, padded);
        if (!a->solid)
            ASAN_POISON_MEMORY_REGION(block + bytes, padded - bytes);
    }
    return block;
}
