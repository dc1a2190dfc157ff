#include "lift/table.h"

#include "base/fmath.h"

#include <string.h>

void lift_table_layout(arena *a, lift_table *t)
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

/* Index of a marker, -1: the prior does not know it. */
static int32_t marker_named(const segment_prior *p, const char *name)
{
    for (int32_t j = 0; j < p->markers; j++)
        if (strcmp(p->name[j], name) == 0)
            return j;
    return -1;
}

/* Those that are reported first. */
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

void lift_table_fill(lift_table *t)
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

void segment_posterior_layout(arena *a, const lift_table *t, segment_posterior *b)
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
    return (lift_moment){.f = f, .next = i_min(f + 1, last), .part = x - f};
}

static lift_axes axes_at(const lift_table *t, double heading, const double place[3])
{
    lift_axes f = {.z = t->stature, .place = {place[0], place[1], place[2]}};
    m_sincos64(heading, &f.s, &f.c);
    f.s *= t->stature;
    f.c *= t->stature;
    return f;
}

lift_axes lift_axes_prior(const lift_table *t, const segment_posterior *b)
{
    return axes_at(t, b->heading, b->place);
}

lift_axes lift_axes_now(const lift_table *t, const segment_posterior *b)
{
    double place[3];
    for (int32_t i = 0; i < 3; i++)
        place[i] = b->place[i] + t->cfg.place_sd[i] * b->theta[t->prior.modes + i];
    return axes_at(t, lift_heading(t, b), place);
}
