#include "lift_read.h"

#include "lift.h"

#include <string.h>

/* What moves a marker by one deviation of each unknown, turned by P: columns 3 r to 3 r + 2 of t->Z. */
static void put_columns(const lift_table *t, const lift_belief *b, const lift_axes *axes,
                        const lift_marker *m, const double own[3], double P[3][3], int32_t r, size_t width)
{
    int32_t const k = t->prior.modes;
    double *const z = t->Z + 3 * r;
    double const away[2] = {own[0] - axes->place[0], own[1] - axes->place[1]};
    double turned[3][3], grown[3][3];
    for (int32_t a = 0; a < 3; a++) {
        turned[a][0] = P[a][0] * axes->c + P[a][1] * axes->s;
        turned[a][1] = P[a][1] * axes->c - P[a][0] * axes->s;
        turned[a][2] = P[a][2] * axes->z;
        for (int32_t i = 0; i < 3; i++)
            grown[a][i] = m->grown * turned[a][i];
    }
    t->run->lift_columns(z, width, t->shape, t->lanes, grown); /* the rows past k are written again below */
    for (int32_t a = 0; a < 3; a++) {
        for (int32_t i = 0; i < 3; i++)
            z[(size_t)(k + i) * width + (size_t)a] = P[a][i] * t->cfg.place_sd[i];
        if (t->size >= 0)
            z[(size_t)t->size * width + (size_t)a] =
                t->growth *
                ((turned[a][0] * m->shape[0] + turned[a][1] * m->shape[1]) + turned[a][2] * m->shape[2]);
        if (t->turn >= 0)
            z[(size_t)t->turn * width + (size_t)a] = b->turn_sd * (P[a][1] * away[0] - P[a][0] * away[1]);
    }
}

/* P (3 x 3) = I - K G of marker j, and the mean moved by K times what the rows leave; I where it was not
 * seen. */
static void take_residual(const lift_table *t, const lift_belief *b, const lift_seen *seen, int32_t j,
                          double *mean, double P[3][3])
{
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

static void set_identity(double P[3][3])
{
    for (int32_t i = 0; i < 9; i++)
        P[i / 3][i % 3] = i % 4 == 0;
}

void lift_modes(const lift_table *t, const lift_belief *b, const lift_query *q, double *mean)
{
    lift_axes const axes = lift_axes_now(t, b);
    lift_moment const moment = lift_find_moment(t, q->at);
    size_t const width = (size_t)dense_padded_float(3 * q->count);
    double P[3][3];
    set_identity(P);
    for (int32_t r = 0; r < q->count; r++) {
        lift_marker m;
        double x[3];
        lift_marker_at(t, b, &moment, q->marker[r], &m, x);
        lift_to_world(&axes, x, mean + 3 * r);
        put_columns(t, b, &axes, &m, mean + 3 * r, P, r, width);
    }
}

void lift_read(const lift_table *t, const lift_belief *b, const lift_query *q, double *mean, double *sd)
{
    lift_axes const axes = lift_axes_now(t, b);
    lift_moment const moment = lift_find_moment(t, q->at);
    int32_t const count = 3 * q->count, width = dense_padded_float(count);
    for (int32_t i = 0; sd && count < width && i < t->n; i++)
        memset(t->Z + i * width + count, 0, (size_t)(width - count) * sizeof *t->Z);
    for (int32_t r = 0; r < q->count; r++) {
        lift_marker m;
        double x[3], own[3], P[3][3];
        lift_marker_at(t, b, &moment, q->marker[r], &m, x);
        lift_to_world(&axes, x, own);
        memcpy(mean + 3 * r, own, sizeof own);
        set_identity(P);
        take_residual(t, b, q->seen, q->marker[r], mean + 3 * r, P);
        if (!sd)
            continue;
        for (int32_t a = 0; a < 3; a++)
            sd[3 * r + a] = lift_residual(t, b, q->marker[r]) * P[a][a];
        put_columns(t, b, &axes, &m, own, P, r, (size_t)width);
    }
    if (!sd)
        return;
    t->run->dense_forward_float(b->U, t->n, t->ld, t->Z, width, t->V);
    t->run->lift_squares(sd, count, t->V, (size_t)width, t->n);
    for (int32_t x = 0; x < count; x++)
        sd[x] = sqrt(sd[x]);
}
