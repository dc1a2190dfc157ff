#include "likelihood/template.h"

void template_clear(int16_t *template, int32_t limbs)
{
    for (int32_t i = 0; i < limbs * LIKE_SAMPLES; i++)
        template[i] = TEMPLATE_EMPTY;
}

static int16_t approach(int16_t known, int32_t value)
{
    int32_t const slow = 10, now = value * TEMPLATE_ONE; /* frames: the weight of a new sample is a tenth */
    return (int16_t)(known == TEMPLATE_EMPTY ? now : known + (now - known) / slow);
}

void template_update(int16_t *template, int32_t limbs, const like_patch *patch)
{
    for (int32_t l = 0; l < limbs; l++)
        for (int32_t i = 0; i < LIKE_HALF; i++) {
            int16_t *const point = template + l * LIKE_SAMPLES + (2 * patch[l].turn + i) % LIKE_SAMPLES;
            if (patch[l].value[i] != TEXTURE_HIDDEN)
                *point = approach(*point, patch[l].value[i]);
        }
}

void template_ring(const int16_t *template, int32_t limbs, int8_t *ring)
{
    for (int32_t l = 0; l < limbs; l++)
        for (int32_t i = 0; i < LIKE_RING; i++) {
            int16_t const known = template[l * LIKE_SAMPLES + i % LIKE_SAMPLES];
            ring[l * LIKE_RING + i] =
                (int8_t)(known == TEMPLATE_EMPTY ? TEXTURE_HIDDEN : known / TEMPLATE_ONE);
        }
}

/* Mean robust cost over all points that have a template and are visible. */
static float log_likelihood(const like_body *b)
{
    int32_t const enough = 32;
    if (!b->known)
        return 0.0f;
    int64_t const sum = b->setup->run->template_cost(b);
    int32_t const both = (int32_t)(sum / LIKE_COUNT_ONE), cost = (int32_t)(sum % LIKE_COUNT_ONE);
    float const unknown = -1.5f; /* as bad as a typical mismatch */
    return both < enough ? unknown : -(float)cost / (float)(both * LIKE_COST_ONE);
}

const like_term like_template = {GAIT_TERM_TEMPLATE, log_likelihood, NULL};
