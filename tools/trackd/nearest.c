#include "nearest.h"

#include <string.h>

/* Metres from the camera, along its axis. */
static float depth(const gait_camera *c, const gait_state *s)
{
    return c->R[6] * s->pelvis[0] + c->R[7] * s->pelvis[1] + c->R[8] * s->pelvis[2] + c->t[2];
}

void nearest_draw(const gait_model *model, const gait_camera *camera, nearest_body *bodies, int count,
                  uint8_t *drawing, uint8_t *picture)
{
    size_t const pixels = (size_t)camera->width * (size_t)camera->height;
    memset(picture, 0, pixels);
    for (int i = 1; i < count; i++)
        for (int k = i; k > 0 && depth(camera, &bodies[k - 1].state) < depth(camera, &bodies[k].state); k--) {
            nearest_body const nearer = bodies[k - 1];
            bodies[k - 1] = bodies[k];
            bodies[k] = nearer;
        }
    for (int i = 0; i < count; i++)
        if (gait_render(model, camera, &bodies[i].state, drawing, camera->width, NULL) == GAIT_OK)
            for (size_t p = 0; p < pixels; p++)
                picture[p] = drawing[p] ? (uint8_t)bodies[i].number : picture[p];
}
