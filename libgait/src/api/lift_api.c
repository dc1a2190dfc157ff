/* lift_api.c - public functions of the lifter: check the arguments, then call down. */
#include "api/check.h"
#include "api/fields.h"
#include "api/kernels.h"
#include "base/cpu.h"
#include "image/camera.h"
#include "model/model.h"
#include "lift/uncertainty.h"
#include "lift/lifter.h"

#include <float.h>
#include <string.h>

#define USUAL(meaning, type, name, array, unit, value, low, high) .name = value,
#define NO_DEFAULT(...)

void gait_lift_fill(gait_lift_config *cfg, size_t cfg_bytes)
{
    static const gait_lift_config USUALLY = {GAIT_LIFT_CONFIG_FIELDS(USUAL, NO_DEFAULT)};
    gait_lift_config full = USUALLY;
    full.struct_size = (uint32_t)(cfg_bytes < sizeof full ? cfg_bytes : sizeof full);
    if (cfg)
        memcpy(cfg, &full, full.struct_size);
}

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

static gait_result check_config(const gait_lift_config *c, gait_error *err)
{
    gait_result const s = fields_check("gait_lift_config", c, "lift config: ", err);
    if (s != GAIT_OK)
        return s;
    bool const perspective = c->projection == GAIT_LIFT_PERSPECTIVE;
    const char *const bad =
        !perspective && c->projection != GAIT_LIFT_ORTHOGRAPHIC ? "projection is none of GAIT_LIFT_*"
        : c->stature_sd < 0.0 && c->stature_sd != -1.0 ? "stature_sd is neither -1 nor in [0, 1] metres"
        : c->residual < 0.0 && c->residual != -1.0     ? "residual is neither -1 nor in [0, 10000]"
        : c->heading_sd < 0.0 && c->heading_sd != -1.0 ? "heading_sd is neither -1 nor in [0, 10] radians"
        : !cpu_mask_valid(c->cpu_mask)                 ? "cpu_mask is not ~0u or a set of GAIT_CPU_*"
        : !perspective && !orthonormal(c->axis)        ? "axis is not two unit vectors at right angles"
        : perspective && !camera_valid(&c->camera)     ? "camera: " CHECK_CAMERA
                                                       : NULL;
    return bad ? base_fail(err, GAIT_ERR_ARG, -1, "lift config: %s", bad) : GAIT_OK;
}

static gait_result need_prior(const gait_model *m, gait_error *err)
{
    if (m->segments.markers)
        return GAIT_OK;
    return base_fail(err, GAIT_ERR_ARG, -1,
                     "the model holds no segment prior: learn it with gait learn ... --segments learnt");
}

/* Check a config, which may come from an older header, and complete it. */
static gait_result open_config(const gait_model *m, const gait_lift_config *given, gait_lift_config *cfg,
                               gait_error *err)
{
    gait_result s = need_prior(m, err);
    if (s == GAIT_OK)
        s = fields_check_size("gait_lift_config", given->struct_size, "gait_lift_default", err);
    if (s != GAIT_OK)
        return s;
    gait_lift_default(cfg);
    memcpy(cfg, given, given->struct_size);
    cfg->struct_size = sizeof *cfg;
    return check_config(cfg, err);
}

gait_result gait_lift_bytes(const gait_model *m, const gait_lift_config *cfg, size_t *bytes, gait_error *err)
{
    gait_lift_config full;
    arena a = {.base = NULL};
    if (!m || !cfg || !bytes)
        return base_null(err, "gait_lift_bytes");
    gait_result const s = open_config(m, cfg, &full, err);
    if (s != GAIT_OK)
        return s;
    (void)lifter_layout(&a, &m->segments, &full, kernels_choose(full.cpu_mask));
    *bytes = a.used;
    return GAIT_OK;
}

gait_result gait_lift_init(void *mem, size_t mem_bytes, const gait_model *m, const gait_lift_config *cfg,
                           gait_lift **out, gait_error *err)
{
    gait_lift_config full;
    arena a = {.base = NULL};
    if (!mem || !m || !cfg || !out)
        return base_null(err, "gait_lift_init");
    gait_result s = open_config(m, cfg, &full, err);
    if (s != GAIT_OK)
        return s;
    const kernels *const run = kernels_choose(full.cpu_mask);
    (void)lifter_layout(&a, &m->segments, &full, run);
    s = arena_place(&a, mem, mem_bytes, err);
    if (s != GAIT_OK)
        return s;
    gait_lift *const self = lifter_layout(&a, &m->segments, &full, run);
    int32_t const frames = m->segments.frames;
    lift_stream_reset(&self->stream);
    for (int32_t f = 0; f < frames; f++)
        self->at[f] = f;
    self->window = (lift_window){.frames = frames, .at = self->at, .uv = self->uv, .sd = self->sd};
    *out = self;
    return GAIT_OK;
}

gait_result gait_lift_get_info(const gait_model *m, gait_lift_info *out, gait_error *err)
{
    if (!m || !out)
        return base_null(err, "gait_lift_get_info");
    const segment_prior *const p = &m->segments;
    gait_result const s = need_prior(m, err);
    if (s != GAIT_OK)
        return s;
    *out = (gait_lift_info){.markers = p->markers,
                            .frames = p->frames,
                            .hop = p->hop,
                            .headings = p->headings,
                            .components = p->components,
                            .modes = p->modes,
                            .fps = p->fps,
                            .stature = p->stature,
                            .digest = m->digest};
    return GAIT_OK;
}

const char *gait_lift_marker_name(const gait_lift *l, int32_t marker)
{
    return l && marker >= 0 && marker < l->table.prior.markers ? l->table.prior.name[marker] : NULL;
}

static size_t points_of(const lift_table *t)
{
    return (size_t)t->prior.frames * (size_t)t->prior.markers;
}

/* The public result of the last fit. */
static void describe_fit(const gait_lift *l, const lift_outcome *found, gait_lift_fit *out)
{
    const lift_table *const t = &l->table;
    const segment_posterior *const b = &l->posterior;
    double const log_10 = 2.30258509299404568402;
    *out = (gait_lift_fit){.log_evidence = lift_evidence(t, b),
                           .log10_volume = -cholesky_log_det(b->U, t->n, t->ld) / log_10,
                           .chi2 = lift_chi2(t, b),
                           .heading = lift_heading(t, b),
                           .share = found->share,
                           .component = b->component,
                           .observed = b->observed,
                           .iterations = found->iterations,
                           .converged = found->converged};
    if (t->turn >= 0) /* the last unknown: its variance is that of the last pivot */
        out->heading_sd = b->turn_sd / b->U[t->turn * (t->ld + 1)];
    for (int32_t i = 0; i < 3; i++)
        out->place[i] = b->place[i] + t->cfg.place_sd[i] * b->theta[t->prior.modes + i];
}

static gait_result out_of_range(const char *function, const char *what, gait_error *err)
{
    return base_fail(err, GAIT_ERR_NUMERIC, -1,
                     "%s: %s out of range; give uv and sd in pixels, stature in metres", function, what);
}

gait_result gait_lift_segment(gait_lift *l, const double *uv, const double *sd, gait_lift_fit *out,
                              gait_error *err)
{
    if (!l || !uv || !out)
        return base_null(err, "gait_lift_segment");
    const lift_table *const t = &l->table;
    lift_outcome found;
    lifter_take(l, points_of(t), uv, sd, l->uv, l->sd);
    memcpy(l->posterior.place, t->cfg.place, sizeof t->cfg.place);
    l->fitted = l->windowed = lift_fit(t, &l->search, &l->window, &l->posterior, &found);
    if (!l->fitted)
        return out_of_range("gait_lift_segment", "an observation is", err);
    describe_fit(l, &found, out);
    return GAIT_OK;
}

gait_result gait_lift_segment_robust(gait_lift *l, const double *uv, const double *sd, double *weighted,
                                     gait_lift_fit *out, gait_error *err)
{
    if (!l || !uv || !weighted || !out)
        return base_null(err, "gait_lift_segment_robust");
    const lift_table *const t = &l->table;
    lift_outcome found;
    int32_t outliers;
    lifter_take(l, points_of(t), uv, sd, l->uv, l->robust.inlier_sd);
    memcpy(l->posterior.place, t->cfg.place, sizeof t->cfg.place);
    l->fitted = l->windowed =
        lift_fit_robust(t, &l->search, &l->window, &l->robust, &l->posterior, &found, &outliers);
    if (!l->fitted)
        return out_of_range("gait_lift_segment_robust", "an observation is", err);
    memcpy(weighted, l->sd, points_of(t) * sizeof *weighted);
    describe_fit(l, &found, out);
    return GAIT_OK;
}

gait_result gait_lift_expect(gait_lift *l, const double place[3], double heading, double heading_sd,
                             gait_error *err)
{
    if (!l || !place)
        return base_null(err, "gait_lift_expect");
    gait_lift_config cfg = l->table.cfg;
    if (!l->any_heading)
        return base_fail(
            err, GAIT_ERR_STATE, -1,
            "gait_lift_expect: the lifter was made for a known heading; make it with heading_sd -1");
    memcpy(cfg.place, place, sizeof cfg.place);
    cfg.heading = heading;
    cfg.heading_sd = heading_sd;
    gait_result const s = check_config(&cfg, err);
    if (s == GAIT_OK && heading_sd == 0.0)
        return base_fail(err, GAIT_ERR_ARG, -1,
                         "gait_lift_expect: heading_sd is 0; give -1 or a positive one");
    if (s == GAIT_OK)
        l->table.cfg = cfg;
    return s;
}

/* Every marker of frame f of the last segment. */
static void read_frame(const gait_lift *l, const segment_posterior *b, int32_t f, bool residual, double *mean,
                       double *sd)
{
    const lift_table *const t = &l->table;
    size_t const J = (size_t)t->prior.markers, first = (size_t)f * J;
    double x[3 * GAIT_MAX_MARKERS], each[3 * GAIT_MAX_MARKERS];
    lift_observations const observed = {.uv = l->uv + first * 2, .sd = l->sd + first};
    lift_query const q = {.at = f, .count = t->prior.markers, .observed = residual ? &observed : NULL};
    lift_read(t, b, &q, x, sd ? each : NULL);
    for (int32_t r = 0; r < q.count; r++) {
        size_t const to = 3 * (first + (size_t)t->order[r]);
        memcpy(mean + to, x + 3 * r, 3 * sizeof *x);
        if (sd)
            memcpy(sd + to, each + 3 * r, 3 * sizeof *each);
    }
}

static gait_result need_segment(bool there, const char *function, gait_error *err)
{
    return there ? GAIT_OK
                 : base_fail(err, GAIT_ERR_STATE, -1, "%s: no segment yet; call gait_lift_segment() first",
                             function);
}

static bool are_finite(const double *mean, const double *sd, size_t points)
{
    bool ok = true;
    for (size_t i = 0; i < 3 * points; i++)
        ok &= fabs(mean[i]) <= DBL_MAX && fabs(sd[i]) <= DBL_MAX;
    return ok;
}

gait_result gait_lift_positions(gait_lift *l, double *mean, double *sd, gait_error *err)
{
    if (!l || !mean)
        return base_null(err, "gait_lift_positions");
    gait_result const s = need_segment(l->fitted, "gait_lift_positions", err);
    if (s != GAIT_OK)
        return s;
    for (int32_t f = 0; f < l->table.prior.frames; f++)
        read_frame(l, &l->posterior, f, true, mean, sd);
    return are_finite(mean, sd ? sd : mean, points_of(&l->table))
               ? GAIT_OK
               : out_of_range("gait_lift_positions", "the last segment is", err);
}

int32_t gait_lift_unknowns(const gait_lift *l)
{
    return l ? l->table.n : GAIT_ERR_ARG;
}

gait_result gait_lift_posterior(gait_lift *l, double *mean, double *covariance, gait_error *err)
{
    if (!l || !mean)
        return base_null(err, "gait_lift_posterior");
    gait_result const s = need_segment(l->fitted, "gait_lift_posterior", err);
    if (s != GAIT_OK)
        return s;
    memcpy(mean, l->posterior.theta, (size_t)l->table.n * sizeof *mean);
    if (covariance)
        lift_covariance(&l->table, &l->posterior, &l->spare, covariance);
    return GAIT_OK;
}

gait_result gait_lift_scale(gait_lift *l, double *scale, gait_error *err)
{
    if (!l || !scale)
        return base_null(err, "gait_lift_scale");
    gait_result const s = need_segment(l->windowed, "gait_lift_scale", err);
    if (s != GAIT_OK)
        return s;
    double const found = lift_scale(&l->table, &l->posterior, &l->spare);
    if (!(found > 0.0 && found <= DBL_MAX))
        return out_of_range("gait_lift_scale", "the last segment is", err);
    *scale = sqrt(found);
    return GAIT_OK;
}

gait_result gait_lift_least_squares(gait_lift *l, double *mean, gait_error *err)
{
    if (!l || !mean)
        return base_null(err, "gait_lift_least_squares");
    gait_result const s = need_segment(l->windowed, "gait_lift_least_squares", err);
    if (s != GAIT_OK)
        return s;
    lift_least_squares(&l->table, &l->window, &l->posterior, &l->spare);
    segment_posterior alone = l->posterior;
    alone.theta = l->spare.theta;
    for (int32_t f = 0; f < l->table.prior.frames; f++)
        read_frame(l, &alone, f, false, mean, NULL);
    return GAIT_OK;
}

gait_result gait_lift_uncertain(gait_lift *l, int32_t count, double *mode, double *sd, gait_error *err)
{
    if (!l || !mode || !sd)
        return base_null(err, "gait_lift_uncertain");
    if (count < 1 || count > l->table.n)
        return base_fail(err, GAIT_ERR_ARG, -1, "gait_lift_uncertain: count = %d is outside [1, %d]",
                         (int)count, (int)l->table.n);
    gait_result const s = need_segment(l->fitted, "gait_lift_uncertain", err);
    if (s == GAIT_OK)
        lift_uncertain(&l->table, &l->posterior, &l->spare, count, mode, sd);
    return s;
}

gait_result gait_lift_fix(gait_lift *l, const double *sd, gait_error *err)
{
    if (!l || !sd)
        return base_null(err, "gait_lift_fix");
    lift_table *const t = &l->table;
    if (t->projection.perspective || t->turn >= 0)
        return base_fail(err, GAIT_ERR_STATE, -1,
                         "gait_lift_fix: needs an orthographic view and a known heading (heading_sd 0)");
    memcpy(l->posterior.place, t->cfg.place, sizeof l->posterior.place);
    l->windowed = false;
    l->fitted = lift_gain_fix(t, &l->gain, &l->posterior, sd);
    if (!l->fitted)
        return out_of_range("gait_lift_fix", "standard deviations are", err);
    memcpy(l->uv, l->gain.base, points_of(t) * 2 * sizeof *l->uv);
    memcpy(l->sd, sd, points_of(t) * sizeof *l->sd);
    return GAIT_OK;
}

gait_result gait_lift_batch(gait_lift *l, int32_t count, const double *uv, double *mean, gait_error *err)
{
    if (!l || !uv || !mean)
        return base_null(err, "gait_lift_batch");
    if (count < 0)
        return base_fail(err, GAIT_ERR_ARG, -1, "gait_lift_batch: count = %d is negative", (int)count);
    if (!l->gain.ready)
        return base_fail(err, GAIT_ERR_STATE, -1, "gait_lift_batch: no gain yet; call gait_lift_fix() first");
    size_t const points = points_of(&l->table);
    for (size_t i = 0; i < (size_t)count; i++)
        lift_gain_apply(&l->table, &l->gain, uv + i * points * 2, mean + i * points * 3);
    return GAIT_OK;
}

gait_result gait_lift_push(gait_lift *l, int64_t utime, const double *uv, const double *sd, gait_error *err)
{
    if (!l || !uv)
        return base_null(err, "gait_lift_push");
    const lift_table *const t = &l->table;
    if (t->cfg.lag < 0)
        return base_fail(err, GAIT_ERR_STATE, -1,
                         "gait_lift_push: config lag is -1: there is no memory for a stream");
    if (utime < 0 || (l->stream.last >= 0 && utime <= l->stream.last))
        return base_fail(err, GAIT_ERR_STATE, -1,
                         "gait_lift_push: utime %lld is not after %lld; gait_lift_reset() begins anew",
                         (long long)utime, (long long)l->stream.last);
    lift_observations const observed = {.uv = l->stream.new_uv, .sd = l->stream.new_sd};
    lifter_take(l, (size_t)t->prior.markers, uv, sd, l->stream.new_uv, l->stream.new_sd);
    if (!lift_stream_push(t, &l->search, &l->stream, utime, &observed))
        return out_of_range("gait_lift_push", "observations are", err);
    return GAIT_OK;
}

gait_result gait_lift_estimate(gait_lift *l, gait_lift_frame *out, gait_error *err)
{
    if (!l || !out)
        return base_null(err, "gait_lift_estimate");
    if (l->table.cfg.lag < 0 || !lift_stream_estimate(&l->table, &l->stream, out))
        return base_fail(err, GAIT_ERR_STATE, -1,
                         "gait_lift_estimate: no frame of %d frames ago; push more, or lower config lag",
                         (int)l->table.cfg.lag);
    if (!are_finite(out->marker[0], out->sd[0], (size_t)l->table.prior.markers))
        return out_of_range("gait_lift_estimate", "observations are", err);
    return GAIT_OK;
}

void gait_lift_reset(gait_lift *l)
{
    if (l)
        lift_stream_reset(&l->stream);
}

int32_t gait_lift_remove_spikes(int32_t frames, int32_t points, const double *time, const double *uv,
                                double *sd, double *scratch)
{
    return time && uv && sd && scratch ? lift_remove_spikes(frames, points, time, uv, sd, scratch) : 0;
}

int32_t gait_lift_weight_outliers(int32_t points, const double *square, double *sd, double *scratch)
{
    return square && sd && scratch && points > 0 ? lift_weight_points(points, square, sd, scratch) : 0;
}
