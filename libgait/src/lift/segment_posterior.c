#include "lift/segment_posterior.h"

#include "base/fmath.h"

#include <string.h>

void lift_clear(const lift_table *t, segment_posterior *b)
{
    memset(b->A, 0, (size_t)t->ld * (size_t)t->ld * sizeof *b->A);
    for (int32_t i = 0; i < t->ld; i++)
        b->A[i * (t->ld + 1)] = i != t->n;
    b->observed = 0;
    b->log_noise = b->miss = 0.0;
}

void lift_marker_moved(const lift_table *t, const segment_posterior *b, const lift_moment *m, int32_t j,
                       const double moved[3], lift_marker *r, double x[3])
{
    const segment_prior *const p = &t->prior;
    bool const whole = t->projection.perspective;
    double const growth = t->size < 0 ? 0.0 : t->growth * b->theta[t->size], w1 = m->part, w0 = 1.0 - w1;
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

void lift_marker_at(const lift_table *t, const segment_posterior *b, const lift_moment *m, int32_t j,
                    lift_marker *r, double x[3])
{
    const segment_prior *const p = &t->prior;
    size_t const J = (size_t)p->markers, first = (size_t)b->component * (size_t)p->frames;
    const float *const s0 = t->row + ((first + (size_t)m->f) * J + (size_t)j) * 3 * (size_t)t->lanes;
    const float *const s1 = t->row + ((first + (size_t)m->next) * J + (size_t)j) * 3 * (size_t)t->lanes;
    double moved[3];
    t->run->lift_shape(t->shape, s0, s1, 1.0 - m->part, m->part, t->lanes, b->theta, p->modes, moved);
    lift_marker_moved(t, b, m, j, moved, r, x);
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

typedef struct adding { /* what is the same for all markers of a frame */
    lift_axes prior, now;
    double depth;
} adding;

/* Two white rows of marker j and their squared residuals; returns the root of the determinant of their noise. */
static double add_marker(const lift_table *t, segment_posterior *b, const adding *a, const double *ideal, double sd,
                         int32_t j, const lift_marker *m, const double *about, double *w, double square[2])
{
    projection_rows r;
    double spin[2] = {-(about[1] - a->now.place[1]), about[0] - a->now.place[0]};
    if (a->depth > 0.0) {
        projection_rows_ray(&t->projection, ideal, a->depth, &r);
        spin[0] = spin[1] = 0.0; /* what is turned is not known yet */
    } else {
        projection_rows_near(&t->projection, ideal, about, &r);
    }
    double const det = projection_whiten(&r, sd, lift_residual(t, b, j));
    for (int32_t i = 0; i < 2; i++) {
        double const miss = r.y[i] - ((r.g[i][0] * about[0] + r.g[i][1] * about[1]) + r.g[i][2] * about[2]);
        square[i] = miss * miss;
        b->miss += square[i];
        put_row(t, b, &a->prior, m, spin, r.g[i], r.y[i], w + (size_t)i * (size_t)t->ld);
    }
    return det;
}

int32_t lift_rows(const lift_table *t, segment_posterior *b, double at, const lift_seen *seen, const double *guess,
                  double depth, const lift_residuals *said)
{
    lift_moment const m = lift_find_moment(t, at);
    adding const a = {.prior = lift_axes_prior(t, b), .now = lift_axes_now(t, b), .depth = depth};
    double det = 1.0; /* a log for many is as good as one for each */
    int32_t rows = 0;
    for (int32_t j = 0; j < t->prior.markers; j++) {
        lift_marker r;
        double x[3], own[3], square[2];
        if (!lift_seen_at(seen, j))
            continue;
        lift_marker_at(t, b, &m, j, &r, x);
        lift_to_world(&a.now, x, own);
        det *= add_marker(t, b, &a, seen->uv + 2 * j, seen->sd[j], j, &r, guess ? guess + 3 * j : own,
                          t->W + (size_t)rows * (size_t)t->ld, square);
        if (said) {
            memcpy(said->place + 3 * j, own, sizeof own);
            memcpy(said->square + rows, square, sizeof square);
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

void lift_add(const lift_table *t, segment_posterior *b, double at, const lift_seen *seen, const double *guess,
              double depth)
{
    int32_t const rows = lift_rows(t, b, at, seen, guess, depth, NULL);
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

double lift_evidence(const lift_table *t, const segment_posterior *b)
{
    double const log_two_pi = 1.83787706640934548356, left = b->U[t->n * (t->ld + 1)];
    return -0.5 * (log_two_pi * b->observed + b->log_noise + left) - cholesky_log_det(b->U, t->n, t->ld);
}
