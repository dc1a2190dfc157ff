#include "lift/segment_posterior.h"

#include "base/fmath.h"

#include <string.h>

COLD void lift_table_layout(arena *a, lift_table *t)
{
    const segment_prior *const p = &t->prior;
    size_t const frames = (size_t)p->components * (size_t)p->frames, points = frames * (size_t)p->markers;
    t->n = p->modes + 3;
    t->size = t->cfg.stature_sd > 0.0 ? t->n++ : -1;
    t->turn = t->cfg.heading_sd == 0.0 ? -1 : t->n++;
    t->ld = cholesky_padded(t->n + 1);
    t->lanes = cholesky_padded(p->modes);
    t->columns = cholesky_padded(p->markers);
    t->width = cholesky_padded_float(3 * t->columns);
    t->row = TAKE(a, float, points * 3 * (size_t)t->lanes);
    t->column = TAKE(a, float, frames * 3 * (size_t)(p->modes * t->columns));
    t->W = TAKE(a, double, 2 * (size_t)p->markers * (size_t)t->ld);
    t->Z = TAKE(a, double, 3 * (size_t)p->markers * (size_t)t->ld);
    t->shape = TAKE(a, double, 3 * CHOLESKY_LANES * (size_t)t->lanes);
    t->V = TAKE(a, float, (size_t)t->ld *(size_t)(t->width + t->ld));
}

/* Index of a marker, -1: it is not in the prior. */
static int32_t marker_named(const segment_prior *p, const char *name)
{
    for (int32_t j = 0; j < p->markers; j++)
        if (strcmp(p->name[j], name) == 0)
            return j;
    return -1;
}

/* Markers that are reported come first. */
static void set_order(lift_table *t)
{
    int32_t count = 0;
    for (uint64_t report = t->cfg.report, pass = 0; pass < 2; pass++, report = ~report) {
        for (int32_t j = 0; j < t->prior.markers; j++)
            if (report >> j & 1)
                t->order[count++] = j;
        t->reported = pass == 0 ? count : t->reported;
    }
}

/* Modes of a frame; numbers past the last mode and the last marker are 0. */
static void set_frame(const lift_table *t, int32_t c, int32_t f, float *row, float *column)
{
    int32_t const J = t->prior.markers, k = t->prior.modes;
    for (int32_t x = 0; x < 3 * J; x++, row += t->lanes)
        for (int32_t i = 0; i < t->lanes; i++)
            row[i] = i < k ? segment_mode(&t->prior, c, i, f)[x] : 0.0f;
    for (int32_t first = 0; first < t->columns; first += CHOLESKY_LANES)
        for (int32_t a = 0; a < 3; a++)
            for (int32_t i = 0; i < k; i++)
                for (int32_t r = first; r < first + CHOLESKY_LANES; r++)
                    *column++ = r < J ? segment_mode(&t->prior, c, i, f)[3 * t->order[r] + a] : 0.0f;
}

COLD void lift_table_fill(lift_table *t)
{
    static const char *const trunk[4] = {"r_hip", "l_hip", "r_shoulder", "l_shoulder"};
    const segment_prior *const p = &t->prior;
    int32_t const J3 = 3 * p->markers;
    t->stature = t->cfg.stature > 0.0 ? t->cfg.stature : (double)p->stature;
    t->growth = t->cfg.stature_sd / t->stature;
    t->gamma = t->cfg.residual < 0.0 ? (double)p->gamma : t->cfg.residual;
    for (int32_t i = 0; i < 4; i++)
        t->trunk[i] = marker_named(p, trunk[i]);
    memset(t->W, 0, 2 * (size_t)p->markers * (size_t)t->ld * sizeof *t->W);
    memset(t->Z, 0, 3 * (size_t)p->markers * (size_t)t->ld * sizeof *t->Z);
    set_order(t);
    float *row = t->row, *column = t->column;
    for (int32_t c = 0; c < p->components; c++)
        for (int32_t f = 0; f < p->frames; f++, row += J3 * t->lanes, column += 3 * p->modes * t->columns)
            set_frame(t, c, f, row, column);
}

COLD void segment_posterior_layout(arena *a, const lift_table *t, segment_posterior *b)
{
    size_t const square = (size_t)t->ld * (size_t)t->ld;
    b->theta = TAKE(a, double, (size_t)t->ld);
    b->A = TAKE(a, double, square);
    b->U = TAKE(a, double, square);
}

double lift_heading(const lift_table *t, const segment_posterior *b)
{
    return t->turn < 0 ? b->heading : b->centre + b->turn_sd * b->theta[t->turn];
}

lift_moment lift_find_moment(const lift_table *t, double at)
{
    int32_t const last = t->prior.frames - 1;
    double const x = at > 0.0 ? (at < last ? at : last) : 0.0;
    int32_t const f = (int32_t)x;
    return (lift_moment){.f = f, .next = i_min(f + 1, last), .share = x - f};
}

static lift_axes axes_at(const lift_table *t, double heading, const double place[3])
{
    lift_axes f = {.z = t->stature, .place = {place[0], place[1], place[2]}};
    m_sincos64(heading, &f.s, &f.c);
    f.s *= t->stature;
    f.c *= t->stature;
    return f;
}

COLD lift_axes lift_axes_prior(const lift_table *t, const segment_posterior *b)
{
    return axes_at(t, b->heading, b->place);
}

/* Axes at the present theta. */
static lift_axes axes_now(const lift_table *t, const segment_posterior *b)
{
    double place[3];
    for (int32_t i = 0; i < 3; i++)
        place[i] = b->place[i] + t->cfg.place_sd[i] * b->theta[t->prior.modes + i];
    return axes_at(t, lift_heading(t, b), place);
}

void lift_clear(const lift_table *t, segment_posterior *b)
{
    memset(b->A, 0, (size_t)t->ld * (size_t)t->ld * sizeof *b->A);
    for (int32_t i = 0; i < t->ld; i++)
        b->A[i * (t->ld + 1)] = i != t->n;
    b->observed = 0;
    b->log_noise = b->chi2 = 0.0;
}

typedef struct lift_marker { /* linearised about theta, statures */
    double base[3];          /* without modes and growth */
    double shape[3];         /* grows with the stature */
    double grown;            /* factor of the modes */
} lift_marker;

/* Marker j, which the modes displace by `moved`: its parts in r, its position in the body in x. */
static void displaced_marker(const lift_table *t, const segment_posterior *b, const lift_moment *m, int32_t j,
                             const double moved[3], lift_marker *r, double x[3])
{
    const segment_prior *const p = &t->prior;
    bool const whole = t->projection.perspective;
    double const growth = t->size < 0 ? 0.0 : t->growth * b->theta[t->size], w1 = m->share, w0 = 1.0 - w1;
    const float *const m0 = segment_mean(p, b->component, m->f) + 3 * j;
    const float *const m1 = segment_mean(p, b->component, m->next) + 3 * j;
    r->grown = whole ? 1.0 + growth : 1.0;
    for (int32_t i = 0; i < 3; i++) {
        double const mean = w0 * (double)m0[i] + w1 * (double)m1[i];
        r->shape[i] = whole ? mean + moved[i] : mean;
        x[i] = mean + moved[i] + growth * r->shape[i];
        r->base[i] = mean - (r->grown - 1.0) * moved[i];
    }
}

/* Marker j at the present theta: its modes in t->shape, its position in the body in x. */
static void marker_at(const lift_table *t, const segment_posterior *b, const lift_moment *m, int32_t j,
                      lift_marker *r, double x[3])
{
    const segment_prior *const p = &t->prior;
    size_t const J = (size_t)p->markers, first = (size_t)b->component * (size_t)p->frames;
    const float *const s0 = t->row + ((first + (size_t)m->f) * J + (size_t)j) * 3 * (size_t)t->lanes;
    const float *const s1 = t->row + ((first + (size_t)m->next) * J + (size_t)j) * 3 * (size_t)t->lanes;
    double moved[3];
    t->run->lift_shape(t->shape, s0, s1, 1.0 - m->share, m->share, t->lanes, b->theta, p->modes, moved);
    displaced_marker(t, b, m, j, moved, r, x);
}

/* The white row g . X = y of a marker as a row of the unknowns, with y last. */
static void put_row(const lift_table *t, const segment_posterior *b, const lift_axes *f, const lift_marker *m,
                    const double spin[2], const double g[3], double y, double *w)
{
    int32_t const k = t->prior.modes;
    const double q[3] = {f->c * g[0] + f->s * g[1], f->c * g[1] - f->s * g[0], f->z * g[2]};
    const double grown[3] = {m->grown * q[0], m->grown * q[1], m->grown * q[2]};
    double base[3];
    lift_to_world(f, m->base, base);
    t->run->lift_row(w, t->shape, t->lanes, grown); /* the lanes past k are written again below */
    for (int32_t i = 0; i < 3; i++)
        w[k + i] = g[i] * t->cfg.place_sd[i];
    double rest = y - ((g[0] * base[0] + g[1] * base[1]) + g[2] * base[2]);
    if (t->size >= 0)
        w[t->size] = t->growth * ((q[0] * m->shape[0] + q[1] * m->shape[1]) + q[2] * m->shape[2]);
    if (t->turn >= 0) {
        double const turn = g[0] * spin[0] + g[1] * spin[1];
        w[t->turn] = b->turn_sd * turn;
        rest -= turn * (b->centre - b->heading);
    }
    w[t->n] = rest;
}

typedef struct adding { /* common to all markers of a frame */
    lift_axes prior, now;
    double depth;
} adding;

/* Two white rows of marker j and their squared residuals; returns the root of the determinant of their noise. */
static double add_marker(const lift_table *t, segment_posterior *b, const adding *a, const double *ideal,
                         double sd, int32_t j, const lift_marker *m, const double *about, double *w,
                         double square[2])
{
    projection_rows r;
    double spin[2] = {-(about[1] - a->now.place[1]), about[0] - a->now.place[0]};
    if (a->depth > 0.0) {
        projection_rows_ray(&t->projection, ideal, a->depth, &r);
        spin[0] = spin[1] = 0.0; /* positions are not known yet */
    } else {
        projection_rows_near(&t->projection, ideal, about, &r);
    }
    double const det = projection_whiten(&r, sd, lift_residual(t, b, j));
    for (int32_t i = 0; i < 2; i++) {
        double const off = r.y[i] - ((r.g[i][0] * about[0] + r.g[i][1] * about[1]) + r.g[i][2] * about[2]);
        square[i] = off * off;
        b->chi2 += square[i];
        put_row(t, b, &a->prior, m, spin, r.g[i], r.y[i], w + (size_t)i * (size_t)t->ld);
    }
    return det;
}

int32_t lift_rows(const lift_table *t, segment_posterior *b, double at, const lift_observations *observed,
                  const double *guess, double depth, const lift_residuals *residuals)
{
    lift_moment const m = lift_find_moment(t, at);
    adding const a = {.prior = lift_axes_prior(t, b), .now = axes_now(t, b), .depth = depth};
    double det = 1.0; /* product of many factors, to take one logarithm */
    int32_t rows = 0;
    for (int32_t j = 0; j < t->prior.markers; j++) {
        lift_marker r;
        double x[3], own[3], square[2];
        if (!lift_observed_at(observed, j))
            continue;
        marker_at(t, b, &m, j, &r, x);
        lift_to_world(&a.now, x, own);
        det *= add_marker(t, b, &a, observed->uv + 2 * j, observed->sd[j], j, &r, guess ? guess + 3 * j : own,
                          t->W + (size_t)rows * (size_t)t->ld, square);
        if (residuals) {
            memcpy(residuals->position + 3 * j, own, sizeof own);
            memcpy(residuals->square + rows, square, sizeof square);
        }
        rows += 2;
        if (!(det > 1e-100 && det < 1e100)) {
            b->log_noise += 2.0 * m_log64(det);
            det = 1.0;
        }
    }
    b->log_noise += 2.0 * m_log64(det);
    b->observed += rows;
    return rows;
}

void lift_add(const lift_table *t, segment_posterior *b, double at, const lift_observations *observed,
              const double *guess, double depth)
{
    int32_t const rows = lift_rows(t, b, at, observed, guess, depth, NULL);
    t->run->cholesky_rank(b->A, t->ld, t->W, rows);
}

bool lift_solve(const lift_table *t, segment_posterior *b)
{
    if (!t->run->cholesky_factor(b->A, b->U, t->n, t->ld))
        return false;
    cholesky_solve(b->U, t->n, t->ld, b->theta);
    bool ok = true;
    for (int32_t i = 0; i < t->n; i++)
        ok &= fabs(b->theta[i]) <= DBL_MAX;
    return ok;
}

COLD double lift_evidence(const lift_table *t, const segment_posterior *b)
{
    double const log_two_pi = 1.83787706640934548356, left = b->U[t->n * (t->ld + 1)];
    return -0.5 * (log_two_pi * b->observed + b->log_noise + left) - cholesky_log_det(b->U, t->n, t->ld);
}

double lift_chi2(const lift_table *t, const segment_posterior *b)
{
    double left = b->U[t->n * (t->ld + 1)];
    for (int32_t i = 0; i < t->n; i++)
        left -= b->theta[i] * b->theta[i];
    return left > 0.0 ? left : 0.0;
}

enum { OTHERS = 5 }; /* unknowns other than modes, at most */

typedef struct effects { /* displacement of a marker by one standard deviation of each unknown */
    double M[3][3];      /* of the modes: M times the mode */
    double other[OTHERS][3];
} effects;

/* Effects of the unknowns on a marker, times P (3 x 3). */
static COLD void find_effects(const lift_table *t, const segment_posterior *b, const lift_axes *axes,
                              const lift_marker *m, const double own[3], double P[3][3], effects *out)
{
    int32_t const k = t->prior.modes;
    double const away[2] = {own[0] - axes->place[0], own[1] - axes->place[1]};
    for (int32_t a = 0; a < 3; a++) {
        const double turned[3] = {P[a][0] * axes->c + P[a][1] * axes->s,
                                  P[a][1] * axes->c - P[a][0] * axes->s, P[a][2] * axes->z};
        for (int32_t i = 0; i < 3; i++) {
            out->M[a][i] = m->grown * turned[i];
            out->other[i][a] = P[a][i] * t->cfg.place_sd[i];
        }
        if (t->size >= 0)
            out->other[t->size - k][a] =
                t->growth * ((turned[0] * m->shape[0] + turned[1] * m->shape[1]) + turned[2] * m->shape[2]);
        if (t->turn >= 0)
            out->other[t->turn - k][a] = b->turn_sd * (P[a][1] * away[0] - P[a][0] * away[1]);
    }
}

/* The part of marker j outside the modes: mean += K times the residual of its rows, P (3 x 3) = I - K G.  Nothing
 * changes if it was not observed. */
static void add_residual(const lift_table *t, const segment_posterior *b, const lift_observations *observed,
                         int32_t j, double *mean, double P[3][3])
{
    if (!observed || !lift_observed_at(observed, j))
        return;
    projection_rows r;
    double K[3][2], left[2];
    projection_rows_near(&t->projection, observed->uv + 2 * j, mean, &r);
    projection_gain(&r, observed->sd[j], lift_residual(t, b, j), K);
    for (int32_t a = 0; a < 2; a++)
        left[a] = r.y[a] - ((r.g[a][0] * mean[0] + r.g[a][1] * mean[1]) + r.g[a][2] * mean[2]);
    for (int32_t i = 0; i < 3; i++) {
        mean[i] += K[i][0] * left[0] + K[i][1] * left[1];
        for (int32_t c = 0; c < 3; c++)
            P[i][c] -= K[i][0] * r.g[0][c] + K[i][1] * r.g[1][c];
    }
}

static void set_identity(double P[3][3])
{
    for (int32_t i = 0; i < 9; i++)
        P[i / 3][i % 3] = i % 4 == 0;
}

void lift_positions(const lift_table *t, const segment_posterior *b, double at, const int32_t *marker,
                    int32_t count, double *mean)
{
    lift_axes const axes = axes_now(t, b);
    lift_moment const moment = lift_find_moment(t, at);
    for (int32_t r = 0; r < count; r++) {
        lift_marker m;
        double x[3];
        marker_at(t, b, &moment, marker[r], &m, x);
        lift_to_world(&axes, x, mean + 3 * r);
    }
}

void lift_modes(const lift_table *t, const segment_posterior *b, double at)
{
    lift_axes const axes = axes_now(t, b);
    lift_moment const moment = lift_find_moment(t, at);
    int32_t const k = t->prior.modes;
    double *z = t->Z;
    for (int32_t j = 0; j < t->prior.markers; j++) {
        lift_marker m;
        effects by;
        double x[3], own[3], P[3][3];
        marker_at(t, b, &moment, j, &m, x);
        lift_to_world(&axes, x, own);
        set_identity(P);
        find_effects(t, b, &axes, &m, own, P, &by);
        for (int32_t a = 0; a < 3; a++, z += t->ld) {
            t->run->lift_row(z, t->shape, t->lanes, by.M[a]); /* the lanes past k are written again below */
            for (int32_t i = 0; i < OTHERS; i++)
                if (k + i < t->n)
                    z[k + i] = by.other[i][a];
        }
    }
}

typedef struct reading { /* common to all markers of a query */
    lift_axes axes;
    lift_moment moment;
    int32_t columns;   /* markers, padded */
    int32_t width;     /* of a row of t->V: 3 columns, padded */
    double *mean, *sd; /* sd: 3 x columns, variances, may be NULL */
} reading;

/* One marker, displaced by `moved` by the modes; the effects on it go to column r of each coordinate. */
static void read_marker(const lift_table *t, const segment_posterior *b, const reading *to,
                        const lift_observations *observed, int32_t r, const double moved[3],
                        double M[9][CHOLESKY_LANES])
{
    int32_t const j = t->order[r];
    lift_marker m;
    effects by;
    double x[3], own[3], P[3][3], *const mean = to->mean + 3 * r;
    displaced_marker(t, b, &to->moment, j, moved, &m, x);
    lift_to_world(&to->axes, x, own);
    memcpy(mean, own, sizeof own);
    set_identity(P);
    add_residual(t, b, observed, j, mean, P);
    if (!to->sd)
        return;
    find_effects(t, b, &to->axes, &m, own, P, &by);
    for (int32_t a = 0; a < 3; a++) {
        float *const v = t->V + t->prior.modes * to->width + a * to->columns + r;
        /* of a point observed almost exactly 0 remains, or by rounding a little less; NaN stays NaN */
        to->sd[a * to->columns + r] = P[a][a] < 0.0 ? 0.0 : lift_residual(t, b, j) * P[a][a];
        for (int32_t i = 0; i < 3; i++)
            M[3 * a + i][r % CHOLESKY_LANES] = by.M[a][i];
        for (int32_t i = 0; i < t->n - t->prior.modes; i++)
            v[i * to->width] = (float)by.other[i][a];
    }
}

/* Markers r to r + 7 of the order, as far as they are in the query. */
static void read_eight(const lift_table *t, const segment_posterior *b, const reading *to,
                       const lift_query *q, int32_t r)
{
    size_t const plane = (size_t)(t->prior.modes * CHOLESKY_LANES),
                 frame = 3 * (size_t)(t->prior.modes * t->columns);
    const float *const s = t->column + (size_t)(b->component * t->prior.frames) * frame +
                           3 * plane * (size_t)(r / CHOLESKY_LANES);
    double moved[3][CHOLESKY_LANES], M[9][CHOLESKY_LANES] = {{0.0}};
    for (size_t a = 0; a < 3; a++)
        t->run->lift_eight(t->shape + a * plane, s + (size_t)to->moment.f * frame + a * plane,
                           s + (size_t)to->moment.next * frame + a * plane, 1.0 - to->moment.share,
                           to->moment.share, b->theta, t->prior.modes, moved[a]);
    for (int32_t i = r; i < r + CHOLESKY_LANES && i < q->count; i++) {
        int32_t const c = i - r;
        read_marker(t, b, to, q->observed, i, (const double[3]){moved[0][c], moved[1][c], moved[2][c]}, M);
    }
    if (to->sd)
        t->run->lift_turn(t->V + r, (size_t)to->width, (size_t)to->columns, t->shape, t->prior.modes, M);
}

void lift_read(const lift_table *t, const segment_posterior *b, const lift_query *q, double *mean, double *sd)
{
    double variance[3 * GAIT_MAX_MARKERS] = {0.0};
    reading to = {.axes = axes_now(t, b),
                  .moment = lift_find_moment(t, q->at),
                  .columns = cholesky_padded(q->count),
                  .mean = mean,
                  .sd = sd ? variance : NULL};
    to.width = cholesky_padded_float(3 * to.columns);
    int32_t const clean =
        to.width > 3 * to.columns ? 0 : t->prior.modes; /* rows that are written completely */
    memset(t->V + clean * to.width, 0, (size_t)((t->ld - clean) * to.width) * sizeof *t->V);
    for (int32_t r = 0; r < q->count; r += CHOLESKY_LANES)
        read_eight(t, b, &to, q, r);
    if (!sd)
        return;
    t->run->cholesky_forward_float(b->U, t->n, t->ld, t->V, to.width);
    t->run->lift_squares(variance, 3 * to.columns, t->V, (size_t)to.width, t->n);
    for (int32_t r = 0; r < q->count; r++)
        for (int32_t a = 0; a < 3; a++)
            sd[3 * r + a] = sqrt(variance[a * to.columns + r]);
}
