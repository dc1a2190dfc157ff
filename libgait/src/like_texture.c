/* Brightness constancy along each particle's own history (Ormoneit et al. 2000, eqs. 10-13; spec R11-R20). */
#include "fmath.h"
#include "like.h"

enum { FEW = 8 }; /* surface points seen in both frames below which a limb counts as occluded (R19, R20) */

/* Share of the about LIKE_SAMPLES / 2 points facing the camera that both frames show. */
static float visible_share(int32_t both)
{
    return f_min((float)both / (0.4f * (float)LIKE_SAMPLES), 1.0f);
}

/* Mixture of "visible and constant" and "occluded" for one limb (eq. 12), as a log. */
static float mixture(float q, float log_visible, float log_occluded)
{
    float const d = log_visible - log_occluded;
    /* log(q e^v + (1 - q) e^o) with e^o taken out; beyond 30 nats more does not matter. */
    return log_occluded + m_log(q * m_exp(f_clamp(d, -30.0f, 30.0f)) + (1.0f - q));
}

/* Robust, contrast-normalised form: mean Student-t cost. */
static float limb_robust(const like_body *b, int32_t l)
{
    float const log_occluded = -1.6f; /* as bad as a typical mismatch */
    int32_t cost;
    int32_t const both =
        like_compare(b->setup, b->seen + l * LIKE_SAMPLES, b->ancestor + l * LIKE_SAMPLES, &cost);
    if (both < FEW)
        return log_occluded;
    float const mean = (float)cost / (float)(both * LIKE_COST_ONE);
    return mixture(b->outline->facing[l][b->lane] * visible_share(both), -mean, log_occluded);
}

static const float PAPER_OCCLUDED = -6.3200f; /* log 0.0018 per grey level (R18) */

/* Literal form: mean squared grey-level difference, normal density, sigma growing with the viewing angle. */
static float limb_paper(const like_body *b, int32_t l)
{
    float const image_var = 9.0f, model_var = 64.0f; /* grey levels squared (R14, R17) */
    const int8_t *const now = b->seen + l * LIKE_SAMPLES, *const then = b->ancestor + l * LIKE_SAMPLES;
    int32_t both = 0, sum = 0;
    for (int32_t i = 0; i < LIKE_SAMPLES; i++) {
        int32_t const use = now[i] != TEXTURE_HIDDEN && then[i] != TEXTURE_HIDDEN, d = now[i] - then[i];
        both += use;
        sum += use * d * d;
    }
    if (both < FEW)
        return PAPER_OCCLUDED;
    float const facing = b->outline->facing[l][b->lane];
    float const tan2 = f_min((1.0f - facing * facing) / f_max(facing * facing, 1e-3f), 9.0f);
    float const var = 2.0f * image_var + model_var * (1.0f + tan2);
    float const log_visible = -0.5f * m_log(TWO_PI_F * var) - (float)sum / (2.0f * var * (float)both);
    return mixture(facing * visible_share(both), log_visible, PAPER_OCCLUDED);
}

static float log_likelihood(const like_body *b)
{
    float sum = 0.0f;
    if (!b->ancestor)
        return 0.0f;
    for (int32_t l = 0; l < b->setup->limbs; l++)
        sum += b->setup->paper ? limb_paper(b, l) : limb_robust(b, l);
    return sum;
}

/* With nobody there every limb is as good as occluded.  Only the paper's mode asks: its other evidence is
 * none, while a motionless background predicts itself too well to speak against silhouette and edges. */
static float support(const like_body *b)
{
    if (!b->setup->paper || !b->ancestor)
        return 0.0f;
    return log_likelihood(b) - (float)b->setup->limbs * PAPER_OCCLUDED;
}

const like_term like_texture = {"texture", GAIT_TERM_TEXTURE, log_likelihood, support};
