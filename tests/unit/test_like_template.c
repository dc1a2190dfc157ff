/* Running appearance: how fast it learns, what it leaves unchanged, and its likelihood for a body. */
#include "likelihood/template.h"
#include "toy_body.h"

#include "check.h"

enum { LIMBS = 2, SAMPLES = LIMBS * LIKE_SAMPLES };

static int16_t template[SAMPLES];
static int8_t ring[LIMBS * LIKE_RING];
static like_patch patch[LIMBS];

static void hide_all(void)
{
    for (int l = 0; l < LIMBS; l++)
        memset(patch[l].value, TEXTURE_HIDDEN, LIKE_HALF);
}

static void test_update(void)
{
    template_clear(template, LIMBS);
    for (int i = 0; i < SAMPLES; i++)
        CHECK(template[i] == TEMPLATE_EMPTY);
    hide_all();
    patch[0].value[3] = 50;
    patch[1].turn = 2;
    patch[1].value[4] = -127; /* point 8 of the second limb */
    template_update(template, LIMBS, patch);
    CHECK(template[3] == 50 * TEMPLATE_ONE && template[40] == -127 * TEMPLATE_ONE); /* at once */
    CHECK(template[0] == TEMPLATE_EMPTY && template[63] == TEMPLATE_EMPTY);
    patch[0].value[3] = 0;
    patch[1].value[4] = TEXTURE_HIDDEN;
    double want = 50.0;
    for (int n = 1; n <= 60; n++) {
        template_update(template, LIMBS, patch);
        want *= 0.9;
        CHECK_NEAR(template[3] / (double)TEMPLATE_ONE, want, 0.16); /* 10 / 64: where integers stop */
        CHECK(template[40] == -127 * TEMPLATE_ONE);                 /* hidden: kept */
    }
    patch[0].value[3] = 127; /* from end to end without overflow, and to the top */
    for (int n = 0; n < 200; n++)
        template_update(template, LIMBS, patch);
    CHECK_NEAR(template[3] / (double)TEMPLATE_ONE, 127.0, 0.16);
    patch[0].value[3] = -127;
    template_update(template, LIMBS, patch);
    CHECK_NEAR(template[3] / (double)TEMPLATE_ONE, 127.0 - 25.4, 0.16);
    patch[1].value[4] = 0;
    template_update(template, 1, patch); /* one limb only */
    CHECK(template[40] == -127 * TEMPLATE_ONE);
}

/* Each half of a limb updates the points that it shows, and then finds them again. */
static void test_turns(void)
{
    toy_body *const v = toy_body_new(0, GAIT_MODE_DEFAULT);
    v->setup.limbs = LIMBS;
    for (int turn = 0; turn < LIKE_DIRECTIONS; turn++) {
        template_clear(template, LIMBS);
        for (int l = 0; l < LIMBS; l++) {
            patch[l].turn = (uint8_t)((turn + 5 * l) % LIKE_DIRECTIONS);
            for (int i = 0; i < LIKE_HALF; i++)
                patch[l].value[i] = (int8_t)(5 * i - 40 + l);
        }
        template_update(template, LIMBS, patch);
        for (int l = 0; l < LIMBS; l++)
            for (int i = 0; i < LIKE_SAMPLES; i++) {
                int const at = (i - 2 * patch[l].turn + LIKE_SAMPLES) % LIKE_SAMPLES;
                int const want = at < LIKE_HALF ? (5 * at - 40 + l) * TEMPLATE_ONE : TEMPLATE_EMPTY;
                CHECK(template[l * LIKE_SAMPLES + i] == want);
            }
        template_ring(template, LIMBS, ring);
        like_body const b = {.setup = &v->setup, .samples = patch, .known = ring};
        CHECK(like_template.log_likelihood(&b) == 0.0f);
        patch[0].turn = (uint8_t)((patch[0].turn + 1) % LIKE_DIRECTIONS);
        CHECK(like_template.log_likelihood(&b) == -1.5f); /* two points less */
    }
}

/* Mean Student-t cost over all samples known and patch, at least 32 of them; else as bad as a typical mismatch. */
static void test_term(void)
{
    toy_body *const v = toy_body_new(0, GAIT_MODE_DEFAULT);
    like_body b = {.setup = &v->setup, .samples = patch};
    v->setup.limbs = LIMBS;
    CHECK(like_template.log_likelihood(&b) == 0.0f); /* no template at all */
    b.known = ring;
    template_clear(template, LIMBS);
    patch[0].turn = patch[1].turn = 0;
    memset(patch[0].value, 10, LIKE_HALF);
    memset(patch[1].value, 10, LIKE_HALF);
    template_ring(template, LIMBS, ring);
    CHECK(like_template.log_likelihood(&b) == -1.5f);
    for (int i = 0; i < SAMPLES; i++)
        template[i] = (int16_t)(i == 0 ? TEMPLATE_EMPTY : 10 * TEMPLATE_ONE);
    template_ring(template, LIMBS, ring);
    CHECK(like_template.log_likelihood(&b) == -1.5f); /* 31 */
    template[0] = 10 * TEMPLATE_ONE;
    template_ring(template, LIMBS, ring);
    CHECK(like_template.log_likelihood(&b) == 0.0f);
    double want = 0.0;
    for (int l = 0; l < LIMBS; l++)
        for (int i = 0; i < LIKE_HALF; i++) {
            int const d = l * LIKE_HALF + i - 15;
            patch[l].value[i] = (int8_t)(10 + d);
            want += 2.5 * log(1.0 + d * d / 1024.0) / (LIMBS * LIKE_HALF);
        }
    CHECK_NEAR(like_template.log_likelihood(&b), -want, 0.01);
    patch[1].value[15] = 127;
    template[47] = -127 * TEMPLATE_ONE; /* the largest difference there is */
    template_ring(template, LIMBS, ring);
    CHECK(like_template.log_likelihood(&b) < (float)-want);
    patch[1].value[15] = TEXTURE_HIDDEN; /* 31 again */
    CHECK(like_template.log_likelihood(&b) == -1.5f);
    CHECK(like_template.flag == GAIT_TERM_TEMPLATE && !like_template.support);
}

int main(void)
{
    test_update();
    test_turns();
    test_term();
    return CHECK_DONE();
}
