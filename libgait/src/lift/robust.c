#include "lift/robust.h"

#include "base/fmath.h"

#include <string.h>

enum { ROWS_MOST = (2 * GAIT_MAX_MARKERS + CHOLESKY_FLOATS - 1) / CHOLESKY_FLOATS * CHOLESKY_FLOATS };

static const double FAR = 4.0;    /* deviations; fewer than one right point in a thousand is as far */
static const double BEYOND = 3.0; /* times the median of the frame's points */

/* Variances of white rows t->W under a belief, over those of their noise. */
static void predict(const lift_table *t, const segment_posterior *b, int32_t rows, double *variance)
{
    int32_t const width = cholesky_padded_float(rows);
    memset(variance, 0, (size_t)width * sizeof *variance);
    for (int32_t i = 0; i < t->ld; i++)
        for (int32_t r = 0; r < width; r++)
            t->V[i * width + r] = i < t->n && r < rows ? (float)t->W[r * t->ld + i] : 0.0f;
    t->run->cholesky_forward_float(b->U, t->n, t->ld, t->V, width);
    t->run->lift_squares(variance, width, t->V, (size_t)width, t->n);
}

/* The largest of the points' squares, two rows each. */
static double largest(const double *square, int32_t rows)
{
    double most = 0.0;
    for (int32_t r = 0; r < rows; r += 2)
        most = square[r] + square[r + 1] > most ? square[r] + square[r + 1] : most;
    return most;
}

/* Squares of the rows become those of the points, which come first. */
static void join(int32_t rows, const double *variance, double *square)
{
    for (int32_t r = 0; r < rows; r += 2)
        square[r / 2] = square[r] / (1.0 + variance[r]) + square[r + 1] / (1.0 + variance[r + 1]);
}

int32_t lift_robust_weights(const lift_table *t, const segment_posterior *b, double at, const lift_seen *seen, bool known,
                   double *place, double *sd)
{
    double square[2 * GAIT_MAX_MARKERS], sorted[GAIT_MAX_MARKERS], variance[ROWS_MOST] = {0.0};
    segment_posterior unchanged = *b;
    lift_residuals const said = {.place = place, .square = square};
    int32_t const rows = lift_rows(t, &unchanged, at, seen, NULL, 0.0, &said);
    memcpy(sd, seen->sd, (size_t)t->prior.markers * sizeof *sd);
    if (largest(square, rows) <= FAR * FAR)
        return 0;
    if (!known)
        predict(t, b, rows, variance);
    join(rows, variance, square);
    memcpy(sorted, square, (size_t)(rows / 2) * sizeof *sorted);
    double const usual = BEYOND * BEYOND * m_median(sorted, rows / 2),
                 limit = usual > FAR * FAR ? usual : FAR * FAR;
    int32_t doubted = 0;
    for (int32_t j = 0, k = 0; j < t->prior.markers; j++) {
        if (!lift_seen_at(seen, j))
            continue;
        double const far = square[k++] / limit;
        doubted += far > 1.0;
        sd[j] *= far > 1.0 ? far : 1.0;
    }
    return doubted;
}
