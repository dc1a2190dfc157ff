#include "raster/outline.h"

void limb_geometry_init(const gait_model *m, float girth, limb_geometry *out)
{
    for (int32_t l = 0; l < m->limbs; l++) {
        const float *const s = m->limb_shape + l * LIMB_SHAPE;
        limb_geometry g = {.start = {s[0], s[1], s[2]},
                           .end = {s[3], s[4], s[5]},
                           .a0 = girth * s[6],
                           .b0 = girth * s[7],
                           .a1 = girth * s[8],
                           .b1 = girth * s[9],
                           .frame = m->limb_info[l * LIMB_INFO],
                           .shape = m->limb_info[l * LIMB_INFO + 1]};
        float const ax = g.end[0] - g.start[0], ay = g.end[1] - g.start[1], az = g.end[2] - g.start[2];
        float const inv = 1.0f / __builtin_sqrtf(ax * ax + ay * ay + az * az);
        float const d[3] = {ax * inv, ay * inv, az * inv};
        /* The frame's y axis, made orthogonal to the limb; for a limb along y, the x axis. */
        float const c = d[1];
        float e[3] = {-c * d[0], 1.0f - c * c, -c * d[2]};
        if (c * c > 0.98f) {
            e[0] = 1.0f - d[0] * d[0];
            e[1] = -d[0] * d[1];
            e[2] = -d[0] * d[2];
        }
        float const norm = 1.0f / __builtin_sqrtf(e[0] * e[0] + e[1] * e[1] + e[2] * e[2]);
        for (int32_t k = 0; k < 3; k++)
            g.lateral[k] = e[k] * norm;
        g.sagittal[0] = g.lateral[1] * d[2] - g.lateral[2] * d[1];
        g.sagittal[1] = g.lateral[2] * d[0] - g.lateral[0] * d[2];
        g.sagittal[2] = g.lateral[0] * d[1] - g.lateral[1] * d[0];
        out[l] = g;
    }
}
