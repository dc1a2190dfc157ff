#include "lift_read.h"

#include <string.h>

/* Row i of the modes, -1: the mean, in the axes of the world. */
static void read_row(const lift_table *t, const lift_belief *b, const lift_query *q, const lift_axes *axes,
                     int32_t i, double *row)
{
    const segment_prior *const p = &t->prior;
    lift_moment const m = lift_find_moment(t, q->at);
    double const w1 = m.part, w0 = 1.0 - w1;
    const float *const x0 =
        i < 0 ? segment_mean(p, b->component, m.f) : segment_mode(p, b->component, i, m.f);
    const float *const x1 =
        i < 0 ? segment_mean(p, b->component, m.next) : segment_mode(p, b->component, i, m.next);
    for (int32_t r = 0; r < q->count; r++) {
        int32_t const j = 3 * q->marker[r];
        double const x = w0 * (double)x0[j] + w1 * (double)x1[j];
        double const y = w0 * (double)x0[j + 1] + w1 * (double)x1[j + 1];
        double const z = w0 * (double)x0[j + 2] + w1 * (double)x1[j + 2];
        row[3 * r] = axes->c * x - axes->s * y;
        row[3 * r + 1] = axes->s * x + axes->c * y;
        row[3 * r + 2] = axes->z * z;
    }
}

/* Mean of the markers by modes and stature, and the rows of t->Z that are these. */
static void read_shape(const lift_table *t, const lift_belief *b, const lift_query *q, const lift_axes *axes,
                       double *mean)
{
    double *const size = t->size < 0 ? NULL : t->Z + (size_t)t->size * (size_t)t->width;
    double const growth = size ? t->growth * b->theta[t->size] : 0.0;
    double const scale = t->eye.perspective ? 1.0 + growth : 1.0;
    int32_t const count = 3 * q->count;
    read_row(t, b, q, axes, -1, mean);
    if (size)
        for (int32_t x = 0; x < count; x++)
            size[x] = t->growth * mean[x];
    for (int32_t i = 0; i < t->prior.modes; i++) {
        double *const row = t->Z + (size_t)i * (size_t)t->width;
        read_row(t, b, q, axes, i, row);
        for (int32_t x = 0; x < count; x++) {
            mean[x] += b->theta[i] * row[x];
            row[x] *= scale;
        }
    }
    for (int32_t x = 0; x < count; x++) {
        if (size && t->eye.perspective)
            size[x] = t->growth * mean[x];
        mean[x] += axes->place[x % 3] + (size ? b->theta[t->size] * size[x] : 0.0);
    }
}

void lift_modes(const lift_table *t, const lift_belief *b, const lift_query *q, double *mean)
{
    lift_axes const axes = lift_axes_now(t, b);
    size_t const width = (size_t)t->width;
    int32_t const k = t->prior.modes;
    memset(t->Z + (size_t)k * width, 0, (size_t)(t->n - k) * width * sizeof *t->Z);
    read_shape(t, b, q, &axes, mean);
    for (int32_t r = 0; r < q->count; r++) {
        for (int32_t a = 0; a < 3; a++)
            t->Z[(size_t)(k + a) * width + (size_t)(3 * r + a)] = t->cfg.place_sd[a];
        if (t->turn >= 0) {
            double *const turn = t->Z + (size_t)t->turn * width + 3 * r;
            turn[0] = -b->turn_sd * (mean[3 * r + 1] - axes.place[1]);
            turn[1] = b->turn_sd * (mean[3 * r] - axes.place[0]);
        }
    }
}

/* P (3 x 3) = I - K G of marker j, and the mean moved by K times what the rows leave; I where it was not
 * seen. */
static void take_residual(const lift_table *t, const lift_belief *b, const lift_seen *seen, int32_t j,
                          double *mean, double P[3][3])
{
    for (int32_t i = 0; i < 9; i++)
        P[i / 3][i % 3] = i % 4 == 0;
    if (!seen || !lift_seen_at(seen, j))
        return;
    eye_rows r;
    double K[3][2], left[2];
    eye_rows_near(&t->eye, seen->uv + 2 * j, mean, &r);
    eye_gain(&r, seen->sd[j], lift_residual(t, b, j), K);
    for (int32_t a = 0; a < 2; a++)
        left[a] = r.y[a] - ((r.g[a][0] * mean[0] + r.g[a][1] * mean[1]) + r.g[a][2] * mean[2]);
    for (int32_t i = 0; i < 3; i++) {
        mean[i] += K[i][0] * left[0] + K[i][1] * left[1];
        for (int32_t c = 0; c < 3; c++)
            P[i][c] -= K[i][0] * r.g[0][c] + K[i][1] * r.g[1][c];
    }
}

/* Every row of t->Z: the coordinates of the r-th marker by P. */
static void turn_columns(const lift_table *t, int32_t r, double P[3][3])
{
    for (int32_t i = 0; i < t->n; i++) {
        double *const v = t->Z + (size_t)i * (size_t)t->width + 3 * r;
        const double x[3] = {v[0], v[1], v[2]};
        for (int32_t a = 0; a < 3; a++)
            v[a] = (P[a][0] * x[0] + P[a][1] * x[1]) + P[a][2] * x[2];
    }
}

void lift_read(const lift_table *t, const lift_belief *b, const lift_query *q, double *mean, double *sd)
{
    lift_modes(t, b, q, mean);
    for (int32_t r = 0; r < q->count; r++) {
        double P[3][3];
        take_residual(t, b, q->seen, q->marker[r], mean + 3 * r, P);
        for (int32_t a = 0; sd && a < 3; a++)
            sd[3 * r + a] = lift_residual(t, b, q->marker[r]) * P[a][a];
        if (sd && q->seen && lift_seen_at(q->seen, q->marker[r]))
            turn_columns(t, r, P);
    }
    if (!sd)
        return;
    t->run->dense_forward(b->U, t->n, t->ld, t->Z, t->width, dense_padded(3 * q->count));
    for (int32_t i = 0; i < t->n; i++) {
        const double *const z = t->Z + (size_t)i * (size_t)t->width;
        for (int32_t x = 0; x < 3 * q->count; x++)
            sd[x] += z[x] * z[x];
    }
    for (int32_t x = 0; x < 3 * q->count; x++)
        sd[x] = sqrt(sd[x]);
}
