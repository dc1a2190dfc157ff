#include "workers.h"

#include <stdlib.h>

bool workers_start(workers *w, int32_t threads, message *why)
{
    gait_error err = {.text = ""};
    *w = (workers){0};
    if (gait_pool_bytes(threads, &w->bytes, &err) != GAIT_OK)
        return message_set(why, "--threads %d: %s", (int)threads, err.text);
    w->memory = aligned_alloc(GAIT_ALIGN, (w->bytes + GAIT_ALIGN - 1) / GAIT_ALIGN * GAIT_ALIGN);
    if (!w->memory)
        return message_set(why, "not enough memory for %d threads", (int)threads);
    if (gait_pool_init(w->memory, w->bytes, threads, &w->pool, &err) == GAIT_OK)
        return true;
    workers_stop(w);
    return message_set(why, "--threads %d: %s", (int)threads, err.text);
}

void workers_stop(workers *w)
{
    gait_pool_stop(w->pool);
    free(w->memory);
    *w = (workers){0};
}
