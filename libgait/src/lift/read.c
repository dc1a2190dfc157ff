#include "lift/read.h"

#include "lift/segment_posterior.h"

#include <string.h>

enum { OTHERS = 5 }; /* unknowns that are no modes, at most */

typedef struct moving { /* what the unknowns of a marker do to it */
    double M[3][3];     /* to its modes */
    double other[OTHERS][3];
} moving;

/* The displacement turned by P. */
static void find_moving(const lift_table *t, const segment_posterior *b, const lift_axes *axes,
                        const lift_marker *m, const double own[3], double P[3][3], moving *out)
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

/* P (3 x 3) = I - K G of marker j, and the mean moved by K times what the rows leave; I where it was not
 * seen. */
static void take_residual(const lift_table *t, const segment_posterior *b, const lift_seen *seen, int32_t j,
                          double *mean, double P[3][3])
{
    if (!seen || !lift_seen_at(seen, j))
        return;
    projection_rows r;
    double K[3][2], left[2];
    projection_rows_near(&t->projection, seen->uv + 2 * j, mean, &r);
    projection_gain(&r, seen->sd[j], lift_residual(t, b, j), K);
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

void lift_places(const lift_table *t, const segment_posterior *b, double at, const int32_t *marker, int32_t count,
                 double *mean)
{
    lift_axes const axes = lift_axes_now(t, b);
    lift_moment const moment = lift_find_moment(t, at);
    for (int32_t r = 0; r < count; r++) {
        lift_marker m;
        double x[3];
        lift_marker_at(t, b, &moment, marker[r], &m, x);
        lift_to_world(&axes, x, mean + 3 * r);
    }
}

void lift_modes(const lift_table *t, const segment_posterior *b, double at)
{
    lift_axes const axes = lift_axes_now(t, b);
    lift_moment const moment = lift_find_moment(t, at);
    int32_t const k = t->prior.modes;
    double *z = t->Z;
    for (int32_t j = 0; j < t->prior.markers; j++) {
        lift_marker m;
        moving by;
        double x[3], own[3], P[3][3];
        lift_marker_at(t, b, &moment, j, &m, x);
        lift_to_world(&axes, x, own);
        set_identity(P);
        find_moving(t, b, &axes, &m, own, P, &by);
        for (int32_t a = 0; a < 3; a++, z += t->ld) {
            t->run->lift_row(z, t->shape, t->lanes, by.M[a]); /* the lanes past k are written again below */
            for (int32_t i = 0; i < OTHERS; i++)
                if (k + i < t->n)
                    z[k + i] = by.other[i][a];
        }
    }
}

typedef struct reading { /* what is the same for all markers that are read */
    lift_axes axes;
    lift_moment moment;
    int32_t columns;   /* as many as are read, padded */
    int32_t width;     /* of a row of t->V: 3 columns, padded */
    double *mean, *sd; /* sd: 3 x columns, variances, may be NULL */
} reading;

/* One marker, `moved` so far by the modes; what moves it goes to column r of each coordinate. */
static void read_marker(const lift_table *t, const segment_posterior *b, const reading *to, const lift_seen *seen,
                        int32_t r, const double moved[3], double M[9][CHOLESKY_LANES])
{
    int32_t const j = t->order[r];
    lift_marker m;
    moving by;
    double x[3], own[3], P[3][3], *const mean = to->mean + 3 * r;
    lift_marker_moved(t, b, &to->moment, j, moved, &m, x);
    lift_to_world(&to->axes, x, own);
    memcpy(mean, own, sizeof own);
    set_identity(P);
    take_residual(t, b, seen, j, mean, P);
    if (!to->sd)
        return;
    find_moving(t, b, &to->axes, &m, own, P, &by);
    for (int32_t a = 0; a < 3; a++) {
        float *const v = t->V + t->prior.modes * to->width + a * to->columns + r;
        to->sd[a * to->columns + r] = lift_residual(t, b, j) * P[a][a];
        for (int32_t i = 0; i < 3; i++)
            M[3 * a + i][r % CHOLESKY_LANES] = by.M[a][i];
        for (int32_t i = 0; i < t->n - t->prior.modes; i++)
            v[i * to->width] = (float)by.other[i][a];
    }
}

/* Markers r to r + 7 of the order, as far as they are asked for. */
static void read_eight(const lift_table *t, const segment_posterior *b, const reading *to, const lift_query *q,
                       int32_t r)
{
    size_t const plane = (size_t)(t->prior.modes * CHOLESKY_LANES),
                 frame = 3 * (size_t)(t->prior.modes * t->columns);
    const float *const s =
        t->column + (size_t)(b->component * t->prior.frames) * frame + 3 * plane * (size_t)(r / CHOLESKY_LANES);
    double moved[3][CHOLESKY_LANES], M[9][CHOLESKY_LANES] = {{0.0}};
    for (size_t a = 0; a < 3; a++)
        t->run->lift_eight(t->shape + a * plane, s + (size_t)to->moment.f * frame + a * plane,
                           s + (size_t)to->moment.next * frame + a * plane, 1.0 - to->moment.part,
                           to->moment.part, b->theta, t->prior.modes, moved[a]);
    for (int32_t i = r; i < r + CHOLESKY_LANES && i < q->count; i++) {
        int32_t const c = i - r;
        read_marker(t, b, to, q->seen, i, (const double[3]){moved[0][c], moved[1][c], moved[2][c]}, M);
    }
    if (to->sd)
        t->run->lift_turn(t->V + r, (size_t)to->width, (size_t)to->columns, t->shape, t->prior.modes, M);
}

void lift_read(const lift_table *t, const segment_posterior *b, const lift_query *q, double *mean, double *sd)
{
    double variance[3 * GAIT_MAX_MARKERS] = {0.0};
    reading to = {.axes = lift_axes_now(t, b),
                  .moment = lift_find_moment(t, q->at),
                  .columns = cholesky_padded(q->count),
                  .mean = mean,
                  .sd = sd ? variance : NULL};
    to.width = cholesky_padded_float(3 * to.columns);
    int32_t const clean = to.width > 3 * to.columns ? 0 : t->prior.modes; /* rows of which all is written */
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
