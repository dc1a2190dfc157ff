/* toy_segment.h - a segment prior written as a blob, and views of a body drawn from it, for tests. */
#ifndef TOY_SEGMENT_H
#define TOY_SEGMENT_H
#include "gait_lift.h"
#include "toy_blob.h"

#include <math.h>
#include <stdio.h>

enum { TOY_SEGMENT_FRAMES = 6, TOY_HOP = 3, TOY_MARKERS = 9, TOY_MODES = 5, TOY_SEGMENT_SECTIONS = 8 };
#define TOY_FPS     20.0f
#define TOY_STATURE 1.7f
#define TOY_GAMMA   1.5f

enum { TOY_SEGMENT = TOY_SEGMENT_FRAMES * TOY_MARKERS }; /* points of a segment */

/* Uniform in [-1, 1): the same numbers everywhere. */
static inline double toy_random(uint32_t *state)
{
    *state = *state * 1664525u + 1013904223u;
    return (double)(*state >> 8) / 8388608.0 - 1.0;
}

typedef struct toy_segments { /* contents of the blob */
    char name[TOY_MARKERS][32];
    int32_t count[8];
    float rate[8], weight[2], mean[2][TOY_SEGMENT][3], mode[2][TOY_MODES][TOY_SEGMENT][3];
    float sd[2][TOY_MODES], residual[2][TOY_MARKERS];
} toy_segments;

/* Mean of a marker at a moment: a narrow body of height 1 that walks along x while its limbs swing. */
static inline void toy_marker_mean(int component, int frame, int j, float out[3])
{
    float const side = j % 2 ? 0.11f : -0.11f, height = 0.1f * (float)(j + 1);
    float const swing = 0.2f * (0.5f - height) * (float)cos(0.6 * frame + 0.3 * j + component);
    out[0] = 0.03f * (float)frame + (j % 2 ? swing : -swing);
    out[1] = j == 0 ? 0.0f : side * (component ? 1.6f : 1.0f);
    out[2] = height;
}

/* Fill in modes that are smooth in time, of decreasing size, and not orthogonal. */
static inline void toy_segments_fill(toy_segments *s, int components, int headings)
{
    static const char *const names[4] = {"pelvis", "l_hip", "r_hip", "l_shoulder"};
    uint32_t seed = 7;
    memset(s, 0, sizeof *s);
    for (int j = 0; j < TOY_MARKERS; j++)
        snprintf(s->name[j], sizeof s->name[j], j < 4 ? "%s" : "marker %s%d", j < 4 ? names[j] : "", j);
    const int32_t count[8] = {TOY_SEGMENT_FRAMES, TOY_HOP, headings, components, TOY_MODES, 40, 4, 0};
    memcpy(s->count, count, sizeof count);
    s->rate[0] = TOY_FPS;
    s->rate[1] = TOY_GAMMA;
    s->rate[2] = TOY_STATURE;
    for (int c = 0; c < components; c++) {
        s->weight[c] = components == 1 ? 1.0f : c ? 0.3f : 0.7f;
        for (int i = 0; i < TOY_SEGMENT; i++)
            toy_marker_mean(c, i / TOY_MARKERS, i % TOY_MARKERS, s->mean[c][i]);
        for (int k = 0; k < TOY_MODES; k++) {
            double a[TOY_MARKERS][3], b[TOY_MARKERS][3];
            for (int i = 0; i < 3 * TOY_MARKERS; i++) {
                a[i / 3][i % 3] = toy_random(&seed);
                b[i / 3][i % 3] = toy_random(&seed);
            }
            s->sd[c][k] = 0.3f / (float)(k + 1);
            for (int i = 0; i < TOY_SEGMENT; i++)
                for (int x = 0; x < 3; x++)
                    s->mode[c][k][i][x] =
                        0.05f / (float)(k + 1) *
                        (float)(a[i % TOY_MARKERS][x] * cos(0.5 * (double)(i / TOY_MARKERS)) +
                                b[i % TOY_MARKERS][x] * sin(0.5 * (double)(i / TOY_MARKERS)));
        }
        for (int j = 0; j < TOY_MARKERS; j++)
            s->residual[c][j] = 1e-5f * (float)(j + 1);
    }
}

/* Write the prior into buf (TOY_BYTES); returns the size of the blob. */
static inline size_t toy_segments_write(unsigned char *buf, const toy_segments *s)
{
    uint32_t const K = (uint32_t)s->count[3];
    const uint32_t mean[4] = {K, TOY_SEGMENT_FRAMES, TOY_MARKERS, 3};
    const uint32_t mode[4] = {K, TOY_MODES, TOY_SEGMENT_FRAMES, 3 * TOY_MARKERS};
    toy_file f = toy_begin(buf, TOY_SEGMENT_SECTIONS);
    toy_section(&f, "SGNM", 1, 2, TOY_MARKERS, 32, 1, s->name);
    toy_section(&f, "SGIN", 2, 1, 8, 1, 1, s->count);
    toy_section(&f, "SGRT", 3, 1, 8, 1, 1, s->rate);
    toy_section(&f, "SGWT", 3, 1, K, 1, 1, s->weight);
    toy_section4(&f, "SGMN", 3, 4, mean, s->mean);
    toy_section4(&f, "SGMD", 3, 4, mode, s->mode);
    toy_section(&f, "SGSD", 3, 2, K, TOY_MODES, 1, s->sd);
    toy_section(&f, "SGPS", 3, 2, K, TOY_MARKERS, 1, s->residual);
    return toy_finish(&f);
}

/* A body drawn from component c: segment [frames][markers][3] in the world. */
static inline void toy_draw(const toy_segments *s, int c, uint32_t seed, double heading,
                            const double place[3], double (*out)[3])
{
    double alpha[TOY_MODES], turn_c = cos(heading), turn_s = sin(heading);
    for (int k = 0; k < TOY_MODES; k++)
        alpha[k] = 1.5 * toy_random(&seed);
    for (int i = 0; i < TOY_SEGMENT; i++) {
        double x[3];
        for (int a = 0; a < 3; a++) {
            x[a] = (double)s->mean[c][i][a];
            for (int k = 0; k < TOY_MODES; k++)
                x[a] += alpha[k] * (double)s->mode[c][k][i][a];
        }
        out[i][0] = (double)TOY_STATURE * (turn_c * x[0] - turn_s * x[1]) + place[0];
        out[i][1] = (double)TOY_STATURE * (turn_s * x[0] + turn_c * x[1]) + place[1];
        out[i][2] = (double)TOY_STATURE * x[2] + place[2];
    }
}
#endif
