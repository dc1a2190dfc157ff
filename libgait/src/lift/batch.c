#include "lift/batch.h"

#include <string.h>

static size_t points_of(const lift_table *t)
{
    return (size_t)t->prior.frames * (size_t)t->prior.markers;
}

void lift_gain_layout(arena *a, const lift_table *t, lift_gain *g)
{
    g->row = TAKE(a, double, points_of(t) * 2 * (size_t)t->ld);
    g->base = TAKE(a, double, points_of(t) * 2);
    g->keep = TAKE(a, double, points_of(t));
    g->theta = TAKE(a, double, (size_t)t->ld);
    g->ready = false;
}

static double dot3(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/* Observations of the prior's mean, and the share of each residual that is due to the marker itself. */
static void set_base(const lift_table *t, lift_gain *g, const segment_posterior *b, const double *sd)
{
    g->axes = lift_axes_prior(t, b);
    for (int32_t f = 0; f < t->prior.frames; f++)
        for (int32_t j = 0; j < t->prior.markers; j++) {
            const float *const m = segment_mean(&t->prior, b->component, f) + 3 * j;
            const double local[3] = {(double)m[0], (double)m[1], (double)m[2]};
            size_t const p = (size_t)f * (size_t)t->prior.markers + (size_t)j;
            double const psi = lift_residual(t, b, j);
            double world[3];
            lift_to_world(&g->axes, local, world);
            for (int32_t i = 0; i < 2; i++)
                g->base[2 * p + (size_t)i] = dot3(t->projection.axis[i], world);
            bool const observed = sd[p] > 0.0 && sd[p] <= DBL_MAX;
            g->keep[p] = observed ? psi / (sd[p] * sd[p] + psi) : -1.0;
        }
}

/* Two rows of the gain: Q w over the noise's standard deviation, for the white rows w of one marker. */
static void set_rows(const lift_table *t, const segment_posterior *b, const double *w, double noise_sd,
                     double *row)
{
    for (int32_t i = 0; i < 2; i++, row += t->ld, w += t->ld) {
        memset(row, 0, (size_t)t->ld * sizeof *row);
        memcpy(row, w, (size_t)t->n * sizeof *row);
        cholesky_forward_vector(b->U, t->n, t->ld, row);
        cholesky_backward(b->U, t->n, t->ld, row);
        for (int32_t k = 0; k < t->n; k++)
            row[k] /= noise_sd;
    }
}

bool lift_gain_fix(const lift_table *t, lift_gain *g, segment_posterior *b, const double *sd)
{
    size_t const J = (size_t)t->prior.markers;
    b->component = 0;
    b->heading = b->centre = t->cfg.heading;
    memset(b->theta, 0, (size_t)t->n * sizeof *b->theta);
    set_base(t, g, b, sd);
    g->ready = false;
    lift_clear(t, b);
    for (int32_t f = 0; f < t->prior.frames; f++) {
        lift_observations const observed = {.uv = g->base + (size_t)f * J * 2, .sd = sd + (size_t)f * J};
        lift_add(t, b, f, &observed, NULL, 0.0);
    }
    if (!lift_solve(t, b))
        return false;
    for (int32_t f = 0; f < t->prior.frames; f++) {
        lift_observations const observed = {.uv = g->base + (size_t)f * J * 2, .sd = sd + (size_t)f * J};
        const double *w = t->W;
        (void)lift_rows(t, b, f, &observed, NULL, 0.0, NULL);
        for (size_t p = (size_t)f * J; p < (size_t)(f + 1) * J; p++) {
            if (g->keep[p] < 0.0)
                continue;
            double const psi = lift_residual(t, b, (int32_t)(p - (size_t)f * J));
            set_rows(t, b, w, sqrt(sd[p] * sd[p] + psi), g->row + p * 2 * (size_t)t->ld);
            w += 2 * t->ld;
        }
    }
    g->ready = true;
    return true;
}

/* theta += rows of one marker times its observation less that of the mean. */
static void add_point(const double *row, int32_t ld, double u, double v, double *theta)
{
    for (int32_t k = 0; k < ld; k++)
        theta[k] = (theta[k] + u * row[k]) + v * row[ld + k];
}

/* Transform x to the world and move it towards the observation by the marker's share of the residual. */
static void place_point(const lift_table *t, const lift_axes *axes, const double *uv, double keep, double *x)
{
    double world[3];
    lift_to_world(axes, x, world);
    double const u = keep > 0.0 ? keep * (uv[0] - dot3(t->projection.axis[0], world)) : 0.0;
    double const v = keep > 0.0 ? keep * (uv[1] - dot3(t->projection.axis[1], world)) : 0.0;
    for (int32_t i = 0; i < 3; i++)
        x[i] = world[i] + (u * t->projection.axis[0][i] + v * t->projection.axis[1][i]);
}

void lift_gain_apply(const lift_table *t, const lift_gain *g, const double *uv, double *mean)
{
    const segment_prior *const p = &t->prior;
    size_t const points = points_of(t);
    int32_t const width = (int32_t)(3 * points);
    memset(g->theta, 0, (size_t)t->ld * sizeof *g->theta);
    for (size_t i = 0; i < points; i++)
        if (g->keep[i] >= 0.0)
            add_point(g->row + i * 2 * (size_t)t->ld, t->ld, uv[2 * i] - g->base[2 * i],
                      uv[2 * i + 1] - g->base[2 * i + 1], g->theta);
    double const grown = t->size < 0 ? 1.0 : 1.0 + t->growth * g->theta[t->size];
    for (int32_t i = 0; i < width; i++)
        mean[i] = grown * (double)p->mean[i];
    t->run->lift_sum(mean, width, p->mode, (size_t)width, g->theta, p->modes);
    lift_axes axes = g->axes;
    for (int32_t i = 0; i < 3; i++)
        axes.place[i] += t->cfg.place_sd[i] * g->theta[p->modes + i];
    for (size_t i = 0; i < points; i++)
        place_point(t, &axes, uv + 2 * i, g->keep[i], mean + 3 * i);
}
