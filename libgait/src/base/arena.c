#include "base/arena.h"

/* Under AddressSanitizer every block is followed by bytes that must not be touched.  gcc and clang announce it
 * in different ways. */
#if defined(__has_feature)
#if __has_feature(address_sanitizer)
#define ARENA_RED_ZONES
#endif
#endif
#if defined(__SANITIZE_ADDRESS__)
#define ARENA_RED_ZONES
#endif
#if defined(ARENA_RED_ZONES)
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

gait_result arena_place(arena *a, void *mem, size_t bytes, gait_error *err)
{
    size_t const need = a->used;
    if ((uintptr_t)mem % GAIT_ALIGN != 0)
        return base_fail(err, GAIT_ERR_MEMORY, -1, "memory not aligned to %d bytes", GAIT_ALIGN);
    if (bytes < need)
        return base_fail(err, GAIT_ERR_MEMORY, -1, "need %zu bytes, got %zu", need, bytes);
    *a = (arena){.base = mem, .cap = bytes};
    return GAIT_OK;
}
