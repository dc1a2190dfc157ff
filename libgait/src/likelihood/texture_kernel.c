/* Comparison of the limbs' surfaces with those of the ancestor (Ormoneit et al. 2000, eqs. 10-13) and with
 * the template. */
#include "base/fmath.h"
#include "base/dispatch.h"
#include "likelihood/term.h"
#include "base/simd16.h"
#include <string.h>

enum { PLACES = (MODEL_MAX_LIMBS + 3) / 4 * 4 }; /* number of limbs, rounded up to four at a time */

typedef struct rows { /* samples of each limb */
    const int8_t *now[PLACES], *then[PLACES];
} rows;

/* Sums of costs over the points of each limb, plus LIKE_COUNT_ONE for each point that is visible in both. */
#ifdef SIMD16_BYTES
static void compare_all(rows *r, int32_t limbs, const like_costs *cost, int32_t *sum)
{
    for (int32_t l = limbs; l % SIMD16_BYTES != 0;
         l++) { /* fill up the last group; these sums are not read */
        r->now[l] = r->now[0];
        r->then[l] = r->then[0];
    }
    for (int32_t l = 0; l < limbs; l += SIMD16_BYTES)
        bytes_costs(r->now + l, r->then + l, TEXTURE_HIDDEN, cost->low, cost->high, sum + l);
}
#else
static inline int32_t compare(const int8_t *restrict a, const int8_t *restrict b, const int32_t *cost)
{
    uint8_t difference[LIKE_HALF]; /* of two that are visible less than LIKE_COST_NONE */
    int32_t sum = 0;
    for (int32_t i = 0; i < LIKE_HALF; i++) {
        int8_t const x = a[i], y = b[i];
        uint8_t const d = (uint8_t)(x > y ? x - y : y - x);
        bool const hidden = (x == TEXTURE_HIDDEN) | (y == TEXTURE_HIDDEN);
        difference[i] = hidden ? LIKE_COST_NONE : d;
    }
    SIMD16_STORED(difference);
#pragma GCC unroll 16
    for (int32_t i = 0; i < LIKE_HALF; i++)
        sum += cost[difference[i]];
    return sum;
}

static void compare_all(rows *r, int32_t limbs, const like_costs *cost, int32_t *sum)
{
    for (int32_t l = 0; l < limbs; l++)
        sum[l] = compare(r->now[l], r->then[l], cost->one);
}
#endif

/* The ancestor's half may begin at another direction: its samples are copied into an array that is hidden elsewhere,
 * and read from where `now` begins. */
static void compare_limbs(const like_patch *now, const like_patch *then, int32_t limbs,
                          const like_costs *cost, int32_t *sum)
{
    int8_t padded[MODEL_MAX_LIMBS][3 * LIKE_HALF];
    rows r;
    for (int32_t l = 0; l < limbs; l++) {
        memset(padded[l], TEXTURE_HIDDEN, sizeof padded[l]);
        memcpy(padded[l] + LIKE_HALF, then[l].value, LIKE_HALF);
    }
    for (int32_t l = 0; l < limbs; l++) {
        int32_t const ahead = (now[l].turn - then[l].turn + LIKE_AZIMUTHS) & (LIKE_DIRECTIONS - 1);
        r.now[l] = now[l].value;
        r.then[l] = padded[l] + 2 * ahead;
    }
    compare_all(&r, limbs, cost, sum);
}

/* Log of the mixture of "visible and constant" and "occluded" for one limb (eq. 12). */
static inline float mixture(float q, float log_visible, float log_occluded)
{
    float const d = log_visible - log_occluded;
    /* log(q e^v + (1 - q) e^o) with e^o factored out; differences beyond 30 nats do not matter. */
    return log_occluded + m_log(q * m_exp(f_clamp(d, -30.0f, 30.0f)) + (1.0f - q));
}

/* Log-likelihood of a visible limb in the robust, contrast-normalised form: mean Student-t cost. */
static inline float robust(int32_t both, int32_t cost)
{
    return -((float)cost / (float)(i_max(both, 1) * LIKE_COST_ONE));
}

/* In the form of the paper: mean squared grey-level difference, normal density, sigma growing with the viewing
 * angle. */
static inline float literal(const like_setup *s, int32_t both, int32_t squares, float cos_tilt)
{
    float const pixel_var = 9.0f; /* grey levels squared, in either frame */
    float const tan2 = f_min((1.0f - cos_tilt * cos_tilt) / f_max(cos_tilt * cos_tilt, 1e-3f), 9.0f);
    float const var = 2.0f * pixel_var + s->surface_var * (1.0f + s->tilt * tan2);
    return -0.5f * m_log(TWO_PI_F * var) - (float)squares / (2.0f * var * (float)i_max(both, 1));
}

void KERNEL(texture_costs)(const like_body *b, int32_t (*cost)[BLOCK])
{
    int32_t const limbs = b->setup->limbs;
    int32_t sum[PLACES];
    compare_limbs(b->samples, b->ancestor, limbs, b->setup->paper ? &b->setup->square : &b->setup->robust,
                  sum);
    for (int32_t l = 0; l < limbs; l++)
        cost[l][b->lane] = sum[l];
}

void KERNEL(texture_logs)(const like_setup *s, const outline_block *outline, const int32_t (*cost)[BLOCK],
                          float *restrict log)
{
    for (int32_t i = 0; i < BLOCK; i++)
        log[i] = 0.0f;
    float const log_occluded = s->log_occluded;
    for (int32_t l = 0; l < s->limbs; l++) {
        const float *const cos_tilt = outline->limb[l].cos_tilt;
        float visible[BLOCK];
        if (s->paper)
            for (int32_t i = 0; i < BLOCK; i++)
                visible[i] =
                    literal(s, cost[l][i] / LIKE_COUNT_ONE, cost[l][i] % LIKE_COUNT_ONE, cos_tilt[i]);
        else
            for (int32_t i = 0; i < BLOCK; i++)
                visible[i] = robust(cost[l][i] / LIKE_COUNT_ONE, cost[l][i] % LIKE_COUNT_ONE);
        for (int32_t i = 0; i < BLOCK; i++) {
            int32_t const both = cost[l][i] / LIKE_COUNT_ONE;
            float const share = f_min((float)both / s->all, 1.0f);
            float const mixed = mixture(cos_tilt[i] * share, visible[i], log_occluded);
            log[i] += both < s->few ? log_occluded : mixed;
        }
    }
}

int64_t KERNEL(template_cost)(const like_body *b)
{
    int32_t const limbs = b->setup->limbs;
    int32_t sum[PLACES];
    int64_t all = 0;
    rows r;
    for (int32_t l = 0; l < limbs; l++) {
        r.now[l] = b->samples[l].value;
        r.then[l] = b->known + l * LIKE_RING + 2 * (b->samples[l].turn & (LIKE_DIRECTIONS - 1));
    }
    compare_all(&r, limbs, &b->setup->robust, sum);
    for (int32_t l = 0; l < limbs; l++)
        all += sum[l];
    return all;
}
