/* toy_lift.h - a lifter for the toy prior, and its views of a body. */
#ifndef TOY_LIFT_H
#define TOY_LIFT_H
#include "toy_segment.h"

#include "check.h"

enum { TOY_LIFT_BYTES = 1 << 20 };

static _Alignas(GAIT_ALIGN) unsigned char toy_lift_blob[TOY_BYTES], toy_lift_memory[TOY_LIFT_BYTES];
static toy_segments toy_lift_prior;
static gait_model *toy_lift_model;

/* Load toy_lift_prior as a model. */
static inline void toy_lift_load(void)
{
    static _Alignas(GAIT_ALIGN) unsigned char memory[1024];
    size_t const bytes = toy_segments_write(toy_lift_blob, &toy_lift_prior);
    CHECK(gait_model_init(memory, sizeof memory, toy_lift_blob, bytes, &toy_lift_model, NULL) == GAIT_OK);
}

static inline void toy_lift_learn(int components, int headings)
{
    toy_segments_fill(&toy_lift_prior, components, headings);
    toy_lift_load();
}

/* A camera 5 m in front, which looks along +y. */
static inline gait_lift_config toy_lift_config(int projection)
{
    gait_lift_config c;
    gait_lift_default(&c);
    c.projection = (gait_projection)projection;
    c.stature_sd = 0.0; /* set by the tests that need it */
    c.camera = (gait_camera){.width = 640,
                             .height = 480,
                             .fx = 500,
                             .fy = 500,
                             .cx = 320,
                             .cy = 240,
                             .R = {1, 0, 0, 0, 0, -1, 0, 1, 0},
                             .t = {0, 0.9f, 5}};
    return c;
}

static inline gait_lift *toy_lift_open(const gait_lift_config *c)
{
    gait_lift *l = NULL;
    gait_error err = {0};
    gait_result const s =
        gait_lift_init(toy_lift_memory, sizeof toy_lift_memory, toy_lift_model, c, &l, &err);
    if (s != GAIT_OK)
        fprintf(stderr, "gait_lift_init: %s\n", err.text);
    CHECK(s == GAIT_OK);
    return l;
}

/* Project `count` points into that camera, or onto x and z, with noise of `sd`. */
static inline void toy_lift_see(const gait_lift_config *c, const double (*X)[3], int count, double sd,
                                uint32_t seed, double *uv)
{
    for (int i = 0; i < count; i++) {
        double const depth = X[i][1] + (double)c->camera.t[2];
        bool const pinhole = c->projection == GAIT_LIFT_PERSPECTIVE;
        for (int a = 0; a < 2; a++) { /* the sum of 12 uniform numbers is nearly normal */
            double noise = 0.0;
            for (int k = 0; k < 12; k++)
                noise += 0.5 * toy_random(&seed);
            double const x = a == 0 ? X[i][0] : -X[i][2] + (double)c->camera.t[1];
            double const seen = pinhole ? 500.0 * x / depth + (a == 0 ? 320.0 : 240.0) : X[i][a == 0 ? 0 : 2];
            uv[2 * i + a] = seen + sd * noise;
        }
    }
}

static inline double toy_distance(const double *a, const double *b)
{
    return sqrt((a[0] - b[0]) * (a[0] - b[0]) + (a[1] - b[1]) * (a[1] - b[1]) +
                (a[2] - b[2]) * (a[2] - b[2]));
}
#endif
