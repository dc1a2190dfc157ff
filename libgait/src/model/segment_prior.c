#include "model/segment_prior.h"

#include "gait_lift.h"
#include "model/sections.h"

enum { COUNTS = 8, RATES = 8 };

#define LEAST_FPS 1.0f /* frames per second, so that times and the memory for them stay in range */
#define MOST_FPS  1000.0f
#define TALLEST   10.0f /* metres */

static void read_counts(sections *s, segment_prior *p)
{
    p->name = sections_names(s, "SGNM", GAIT_MAX_MARKERS, &p->markers);
    const int32_t *const n = sections_take(s, "SGIN", BLOB_I32, 1, (uint32_t[4]){COUNTS});
    if (!n)
        return;
    p->frames = n[0];
    p->hop = n[1];
    p->headings = n[2];
    p->components = n[3];
    p->modes = n[4];
    sections_require(s, n[0] > 0 && n[1] > 0 && n[1] <= n[0] && n[3] > 0 && n[4] > 0, "SGIN",
                     "holds impossible counts");
    sections_require(s, n[2] == 0 || n[2] == 2 || n[2] == 8, "SGIN", "headings are not 0, 2 or 8");
    if (n[0] > GAIT_MAX_SEGMENT_FRAMES || n[3] > GAIT_MAX_MIXTURE || n[4] > GAIT_MAX_MODES)
        sections_refuse(s, GAIT_ERR_LIMIT, "SGIN",
                        "has more frames, components or modes than this build can hold");
}

static void read_rates(sections *s, segment_prior *p)
{
    const float *const r = sections_floats(s, "SGRT", 1, (uint32_t[4]){RATES});
    if (!r)
        return;
    p->fps = r[0];
    p->gamma = r[1];
    p->stature = r[2];
    sections_require(s,
                     r[0] >= LEAST_FPS && r[0] <= MOST_FPS && r[1] > 0.0f && r[2] > 0.0f && r[2] <= TALLEST,
                     "SGRT", "holds a rate, factor or stature out of range");
}

static void read_weights(sections *s, segment_prior *p)
{
    p->weight = sections_floats(s, "SGWT", 1, (uint32_t[4]){(uint32_t)p->components});
    double sum = 0.0;
    for (int32_t i = 0; s->status == GAIT_OK && i < p->components; i++) {
        sections_require(s, p->weight[i] > 0.0f, "SGWT", "holds a weight that is not positive");
        sum += (double)p->weight[i];
    }
    sections_require(s, fabs(sum - 1.0) <= 1e-3, "SGWT", "weights do not sum to 1");
}

static void read_shapes(sections *s, segment_prior *p)
{
    uint32_t const K = (uint32_t)p->components, k = (uint32_t)p->modes, F = (uint32_t)p->frames;
    uint32_t const J = (uint32_t)p->markers;
    p->mean = sections_floats(s, "SGMN", 4, (uint32_t[4]){K, F, J, 3});
    p->mode = sections_floats(s, "SGMD", 4, (uint32_t[4]){K, k, F, 3 * J});
    p->sd = sections_floats(s, "SGSD", 2, (uint32_t[4]){K, k});
    p->residual = sections_floats(s, "SGPS", 2, (uint32_t[4]){K, J});
    for (uint32_t i = 0; s->status == GAIT_OK && i < K * k; i++)
        sections_require(s, p->sd[i] >= 0.0f, "SGSD", "has a negative standard deviation");
    for (uint32_t i = 0; s->status == GAIT_OK && i < K * J; i++)
        sections_require(s, p->residual[i] > 0.0f, "SGPS", "has a variance that is not positive");
}

gait_result segment_open(const blob *b, segment_prior *p, gait_error *err)
{
    sections s = {.b = *b, .what = "segment prior", .err = err};
    segment_prior t = {0};
    read_counts(&s, &t);
    read_rates(&s, &t);
    read_weights(&s, &t);
    read_shapes(&s, &t);
    if (s.status == GAIT_OK)
        *p = t;
    return s.status;
}
