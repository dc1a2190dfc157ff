#include "lift/lifter.h"

#define KNOWN_STATURE_SD  0.04 /* metres, of a given stature: shoes, posture, positions of markers */
#define PEOPLE_STATURE_SD 0.09 /* metres, among people */
#define FURTHEST          1e6  /* pixels or metres; points further away count as not observed */

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
    if (!self)
        return NULL;
    projection_init(&t->projection, cfg);
    t->run = run;
    lift_table_fill(t);
    *self = l;
    return self;
}

void lifter_take(const gait_lift *l, size_t points, const double *uv, const double *sd, double *to_uv,
                 double *to_sd)
{
    const lift_table *const t = &l->table;
    for (size_t i = 0; i < points; i++) {
        double const u = uv[2 * i], v = uv[2 * i + 1];
        bool const none = t->projection.perspective && u == v &&
                          (u == 0.0 || u == -1.0); /* how detectors mark "not observed" */
        bool const there = fabs(u) <= FURTHEST && fabs(v) <= FURTHEST && !none;
        to_sd[i] = there ? (sd ? sd[i] : t->cfg.sd) : -1.0;
        to_uv[2 * i] = to_uv[2 * i + 1] = 0.0;
        if (to_sd[i] > 0.0 && to_sd[i] <= DBL_MAX)
            projection_ideal(&t->projection, uv + 2 * i, to_uv + 2 * i);
    }
}
