#include "snapshot.h"
#include "hash.h"
#include <string.h>

typedef struct snapshot_header {
    char magic[8];
    uint32_t abi, version;
    uint64_t bytes;         /* of the whole snapshot */
    uint64_t model, config; /* digests: a snapshot fits only a tracker made alike */
    uint64_t body;          /* hash of the state that follows */
} snapshot_header;

static const char MAGIC[8] = {'G', 'A', 'I', 'T', 'S', 'N', 'P', '\n'};

static size_t state_bytes(const gait_tracker *t)
{
    return (size_t)(t->state_end - (unsigned char *)t->core);
}

/* The configuration without pointers: where threads come from and how many pieces they get does not matter. */
static uint64_t config_digest(const gait_tracker *t)
{
    gait_tracker_config c = t->cfg;
    memset(&c.exec, 0, sizeof c.exec);
    c.tasks = 0;
    return hash_fnv1a(HASH_INIT, &c, sizeof c);
}

size_t snapshot_bytes(const gait_tracker *t)
{
    return sizeof(snapshot_header) + state_bytes(t);
}

void snapshot_save(const gait_tracker *t, void *mem)
{
    snapshot_header h = {.abi = GAIT_ABI,
                         .version = GAIT_VERSION,
                         .bytes = snapshot_bytes(t),
                         .model = t->model->digest,
                         .config = config_digest(t),
                         .body = snapshot_digest(t)};
    memcpy(h.magic, MAGIC, sizeof MAGIC);
    memcpy(mem, &h, sizeof h);
    memcpy((unsigned char *)mem + sizeof h, t->core, state_bytes(t));
}

/* Indices inside the state that later code trusts. */
static bool state_plausible(const gait_tracker *t)
{
    for (int32_t i = 0; i < t->filter.n; i++)
        if (t->filter.parent[i] < 0 || t->filter.parent[i] >= t->filter.n)
            return false;
    return t->core->current == 0 || t->core->current == 1;
}

gait_status snapshot_restore(gait_tracker *t, const void *mem, size_t bytes, gait_error *err)
{
    const unsigned char *const body = (const unsigned char *)mem + sizeof(snapshot_header);
    snapshot_header h;
    if (bytes < sizeof h)
        return base_fail(err, GAIT_ERR_CORRUPT, -1, "snapshot of %zu bytes is shorter than its header",
                         bytes);
    memcpy(&h, mem, sizeof h);
    if (memcmp(h.magic, MAGIC, sizeof MAGIC) != 0)
        return base_fail(err, GAIT_ERR_MAGIC, -1, "not a tracker snapshot");
    if (h.abi != GAIT_ABI || h.version != GAIT_VERSION)
        return base_fail(err, GAIT_ERR_VERSION, -1, "snapshot of library version %u, this is %u", h.version,
                         (unsigned)GAIT_VERSION);
    if (h.model != t->model->digest || h.config != config_digest(t))
        return base_fail(err, GAIT_ERR_VERSION, -1,
                         "snapshot of a tracker with another model or configuration");
    if (h.bytes != bytes || bytes != snapshot_bytes(t) ||
        h.body != hash_fnv1a(HASH_INIT, body, state_bytes(t)))
        return base_fail(err, GAIT_ERR_CORRUPT, -1, "snapshot is damaged: length or checksum do not match");
    memcpy(t->core, body, state_bytes(t));
    for (int32_t c = 0; c < t->cfg.cameras; c++)
        t->camera[c].plate_stale = true;
    if (!state_plausible(t)) {
        tracker_clear(t);
        return base_fail(err, GAIT_ERR_CORRUPT, -1,
                         "snapshot holds an index out of range; start the tracker again");
    }
    return GAIT_OK;
}

uint64_t snapshot_digest(const gait_tracker *t)
{
    return hash_fnv1a(HASH_INIT, t->core, state_bytes(t));
}
