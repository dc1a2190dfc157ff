#include "like_template.h"

void template_clear(int16_t *template, int32_t limbs)
{
    for (int32_t i = 0; i < limbs * LIKE_SAMPLES; i++)
        template[i] = TEMPLATE_EMPTY;
}

void template_update(int16_t *template, int32_t limbs, const int8_t *seen)
{
    int32_t const slow = 10; /* frames (prototype.md: rate 0.1) */
    for (int32_t i = 0; i < limbs * LIKE_SAMPLES; i++) {
        if (seen[i] == TEXTURE_HIDDEN)
            continue;
        int32_t const now = seen[i] * TEMPLATE_ONE;
        template[i] =
            (int16_t)(template[i] == TEMPLATE_EMPTY ? now : template[i] + (now - template[i]) / slow);
    }
}

/* Mean robust cost over all points that the template knows and the body shows. */
static float log_likelihood(const like_body *b)
{
    int32_t const enough = 32, total = b->setup->limbs * LIKE_SAMPLES;
    int32_t both = 0, sum = 0;
    if (!b->template)
        return 0.0f;
    for (int32_t i = 0; i < total; i++) {
        if (b->seen[i] == TEXTURE_HIDDEN || b->template[i] == TEMPLATE_EMPTY)
            continue;
        int32_t const d = b->seen[i] - b->template[i] / TEMPLATE_ONE;
        sum += b->setup->cost[d < 0 ? -d : d];
        both++;
    }
    float const unknown = -1.5f; /* as bad as a typical mismatch */
    return both < enough ? unknown : -(float)sum / (float)(both * LIKE_COST_ONE);
}

const like_term like_template = {"template", GAIT_TERM_TEMPLATE, log_likelihood, NULL};
