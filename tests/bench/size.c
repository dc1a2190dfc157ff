/* size.c - memory of the default tracker by part: size MODEL.gait.  Parts lie one after the other; each ends where the next
 * begins. */
#include "tracker/tracker_state.h"

#include <stdio.h>
#include <stdlib.h>

typedef struct part {
    const char *name;
    const void *begin;
} part;

static void *read_file(const char *path, size_t *bytes)
{
    FILE *const f = fopen(path, "rb");
    void *const data = aligned_alloc(GAIT_ALIGN, 1 << 22);
    if (!f || !data)
        exit(1);
    *bytes = fread(data, 1, 1 << 22, f);
    fclose(f);
    return data;
}

int main(int argc, char **argv)
{
    gait_model *m = NULL;
    gait_tracker *t = NULL;
    gait_tracker_config c;
    size_t blob_bytes = 0, bytes = 0;
    if (argc != 2)
        return 2;
    void *const data = read_file(argv[1], &blob_bytes);
    if (gait_model_bytes(data, blob_bytes, &bytes, NULL) != GAIT_OK ||
        gait_model_init(aligned_alloc(GAIT_ALIGN, bytes + GAIT_ALIGN - bytes % GAIT_ALIGN), bytes, data,
                        blob_bytes, &m, NULL) != GAIT_OK)
        return 1;
    gait_tracker_default(&c, GAIT_MODE_DEFAULT);
    c.camera[0] = (gait_camera){640, 480, 600, 600, 320, 240, {1, 0, 0, 0, 0, -1, 0, 1, 0}, {0, 1, 5}, {0}};
    gait_tracker_bytes(m, &c, &bytes, NULL);
    void *const memory = aligned_alloc(GAIT_ALIGN, bytes + GAIT_ALIGN - bytes % GAIT_ALIGN);
    if (gait_tracker_init(memory, bytes, m, &c, &t, NULL) != GAIT_OK)
        return 1;
    const part parts[] = {
        {"tracker, configuration", memory},
        {"state: core and weights", t->core},
        {"state: surface samples of the particles", t->texture},
        {"state: templates", t->template[0][0]},
        {"state: generations of particles", t->history.record},
        {"features of the image", t->camera[0].features.edge},
        {"background plate of the region", t->camera[0].plate.channel[0]},
        {"likelihood setup", t->like},
        {"log-likelihoods", t->loglik_raw},
        {"rules and mirrors of the classes", t->layouts},
        {"dominant particles, surface of the estimate", t->dominant},
        {"task, joints, rows, image planes (shared)", t->work},
        {"", (const char *)memory + bytes},
    };
    enum { PARTS = sizeof parts / sizeof *parts - 1 };
    for (int i = 0; i < PARTS; i++)
        printf("%-52s %9td\n", parts[i].name,
               (const char *)parts[i + 1].begin - (const char *)parts[i].begin);
    printf("%-52s %9zu bytes for %d particles, %d while acquiring, a lag of %d frames\n", "tracker", bytes,
           c.particles, t->capacity, c.lag);
    return 0;
}
