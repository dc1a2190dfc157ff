#include "lift/lifter.h"

#include "image/camera.h"
#include "base/cpu.h"

#define KNOWN_STATURE_SD  0.04 /* metres, of a given stature: shoes, posture, marker positions */
#define FURTHEST          1e6  /* pixels or metres; points further off count as not observed */
#define PEOPLE_STATURE_SD 0.09 /* metres, among people */

/* x is in [low, high]; NaN is not. */
static bool within(double x, double low, double high)
{
    return x >= low && x <= high;
}

static bool orthonormal(const double axis[2][3])
{
    double product[3] = {0.0};
    for (int32_t i = 0; i < 3; i++) {
        product[0] += axis[0][i] * axis[0][i];
        product[1] += axis[1][i] * axis[1][i];
        product[2] += axis[0][i] * axis[1][i];
    }
    return within(product[0], 1 - 1e-9, 1 + 1e-9) && within(product[1], 1 - 1e-9, 1 + 1e-9) &&
           within(product[2], -1e-9, 1e-9);
}

/* Along each axis: further away, single precision cannot resolve the ray of a pixel. */
static bool near(const float t[3])
{
    return within((double)t[0], -1e4, 1e4) && within((double)t[1], -1e4, 1e4) &&
           within((double)t[2], -1e4, 1e4);
}

gait_result lifter_check_config(const gait_lift_config *c, gait_error *err)
{
    bool place = true;
    if (c->struct_size != sizeof *c)
        return base_fail(err, GAIT_ERR_STRUCT, -1, "lift config: call gait_lift_default() first");
    for (int32_t i = 0; i < 3; i++)
        place = place && within(c->place[i], -1e6, 1e6) && within(c->place_sd[i], 0.0, 1e6);
    const char *const bad =
        c->projection != GAIT_LIFT_PERSPECTIVE && c->projection != GAIT_LIFT_ORTHOGRAPHIC
            ? "projection is none of GAIT_LIFT_*"
        : !within(c->stature, 0.0, 10.0) ? "stature is not in [0, 10] metres"
        : c->stature_sd != -1.0 && !within(c->stature_sd, 0.0, 1.0)
            ? "stature_sd is neither -1 nor in [0, 1] metres"
        : !within(c->sd, 1e-9, 1e9)                             ? "sd is not in [1e-9, 1e9]"
        : c->residual != -1.0 && !within(c->residual, 0.0, 1e4) ? "residual is neither -1 nor in [0, 10000]"
        : !place                                                ? "place or place_sd is out of range"
        : !within(c->heading, -100.0, 100.0)                    ? "heading is not in [-100, 100] radians"
        : c->heading_sd != -1.0 && !within(c->heading_sd, 0.0, 10.0)
            ? "heading_sd is neither -1 nor in [0, 10] radians"
        : !within(c->turn_sd, 1e-6, 10.0)                  ? "turn_sd is not in [1e-6, 10] radians"
        : !within(c->tolerance, 0.0, 1.0)                  ? "tolerance is not in [0, 1]"
        : c->max_iterations < 1 || c->max_iterations > 100 ? "max_iterations is not in [1, 100]"
        : c->lag < -1 || c->lag > 64                       ? "lag is not in [-1, 64]"
        : !within(c->max_rate, 1.0, 1000.0)                ? "max_rate is not in [1, 1000] Hz"
        : !within(c->max_gap, 1e-3, 60.0)                  ? "max_gap is not in [0.001, 60] seconds"
        : !within(c->fit_threshold, 0.0, 1e9)              ? "fit_threshold is not in [0, 1e9]"
        : !cpu_mask_valid(c->cpu_mask)                     ? "cpu_mask is not ~0u or a set of GAIT_CPU_*"
        : c->projection == GAIT_LIFT_ORTHOGRAPHIC && !orthonormal(c->axis)
            ? "axis is not two unit vectors at right angles"
        : c->projection == GAIT_LIFT_PERSPECTIVE && !camera_valid(&c->camera)
            ? "camera is not valid: size, focal lengths and a rotation R are needed"
        : c->projection == GAIT_LIFT_PERSPECTIVE && !near(c->camera.t)
            ? "camera is not within 10 km: t is in metres"
            : NULL;
    return bad ? base_fail(err, GAIT_ERR_ARG, -1, "lift config: %s", bad) : GAIT_OK;
}

gait_lift *lifter_layout(arena *a, const segment_prior *prior, const gait_lift_config *cfg,
                         const kernels *run)
{
    gait_lift l = {.table = {.prior = *prior, .cfg = *cfg}};
    lift_table *const t = &l.table;
    size_t const points = (size_t)prior->frames * (size_t)prior->markers;
    if (prior->headings != 0 && cfg->heading_sd < 0.0)
        t->cfg.heading_sd = 0.0; /* the turned copies are the prior's own headings */
    if (cfg->stature_sd < 0.0)
        t->cfg.stature_sd = cfg->stature > 0.0 ? KNOWN_STATURE_SD : PEOPLE_STATURE_SD;
    l.any_heading = t->cfg.heading_sd < 0.0;
    gait_lift *const self = TAKE(a, gait_lift, 1);
    lift_table_layout(a, t);
    lift_search_layout(a, t, &l.search);
    segment_posterior_layout(a, t, &l.posterior);
    segment_posterior_layout(a, t, &l.spare);
    l.at = TAKE(a, double, (size_t)prior->frames);
    l.uv = TAKE(a, double, points * 2);
    l.sd = TAKE(a, double, points);
    l.robust = (lift_robust){.sd = l.sd,
                             .inlier_sd = TAKE(a, double, points),
                             .position = TAKE(a, double, (size_t)prior->markers * 3)};
    if (cfg->projection == GAIT_LIFT_ORTHOGRAPHIC && t->turn < 0)
        lift_gain_layout(a, t, &l.gain);
    if (cfg->lag >= 0)
        lift_stream_layout(a, t, &l.stream);
    if (!self || a->overflow)
        return NULL;
    projection_init(&t->projection, cfg);
    t->run = run;
    lift_table_fill(t);
    *self = l;
    return self;
}

gait_result lifter_no_prior(gait_error *err)
{
    return base_fail(err, GAIT_ERR_ARG, -1,
                     "the model holds no segment prior: learn it with gait learn ... --segments learnt");
}

gait_result lifter_check(const gait_model *m, const gait_lift_config *cfg, gait_error *err)
{
    return m->segments.markers ? lifter_check_config(cfg, err) : lifter_no_prior(err);
}

void lifter_take(const gait_lift *l, size_t points, const double *uv, const double *sd, double *to_uv,
                 double *to_sd)
{
    const lift_table *const t = &l->table;
    for (size_t i = 0; i < points; i++) {
        double const u = uv[2 * i], v = uv[2 * i + 1];
        bool const none = t->projection.perspective && u == v &&
                          (u == 0.0 || u == -1.0); /* detectors' sign of "not seen" */
        bool const there = fabs(u) <= FURTHEST && fabs(v) <= FURTHEST && !none;
        to_sd[i] = there ? (sd ? sd[i] : t->cfg.sd) : -1.0;
        to_uv[2 * i] = to_uv[2 * i + 1] = 0.0;
        if (to_sd[i] > 0.0 && to_sd[i] <= DBL_MAX)
            projection_ideal(&t->projection, uv + 2 * i, to_uv + 2 * i);
    }
}
