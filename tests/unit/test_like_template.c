/* Running appearance: how fast it learns, what it leaves alone, and what it says of a body. */
#include "like_template.h"
#include "toy_look.h"

#include "check.h"

enum { SAMPLES = 2 * LIKE_SAMPLES };

static int16_t template[SAMPLES];
static int8_t seen[SAMPLES];

static void test_update(void)
{
    template_clear(template, 2);
    for (int i = 0; i < SAMPLES; i++)
        CHECK(template[i] == TEMPLATE_EMPTY);
    memset(seen, TEXTURE_HIDDEN, sizeof seen);
    seen[3] = 50;
    seen[40] = -127;
    template_update(template, 2, seen);
    CHECK(template[3] == 50 * TEMPLATE_ONE && template[40] == -127 * TEMPLATE_ONE); /* at once */
    CHECK(template[0] == TEMPLATE_EMPTY && template[63] == TEMPLATE_EMPTY);
    seen[3] = 0;
    seen[40] = TEXTURE_HIDDEN;
    double want = 50.0;
    for (int n = 1; n <= 60; n++) {
        template_update(template, 2, seen);
        want *= 0.9;
        CHECK_NEAR(template[3] / (double)TEMPLATE_ONE, want, 0.16); /* 10 / 64: where integers stop */
        CHECK(template[40] == -127 * TEMPLATE_ONE);                 /* hidden: kept */
    }
    seen[3] = 127; /* from end to end without overflow, and to the top */
    for (int n = 0; n < 200; n++)
        template_update(template, 2, seen);
    CHECK_NEAR(template[3] / (double)TEMPLATE_ONE, 127.0, 0.16);
    seen[3] = -127;
    template_update(template, 2, seen);
    CHECK_NEAR(template[3] / (double)TEMPLATE_ONE, 127.0 - 25.4, 0.16);
    template_update(template, 1, seen); /* one limb only */
    CHECK(template[40] == -127 * TEMPLATE_ONE);
}

/* Mean Student-t cost over all samples known and seen, at least 32 of them; else as bad as a typical mismatch. */
static void test_term(void)
{
    toy_look *const v = toy_look_new(0, GAIT_MODE_DEFAULT);
    like_body b = {.setup = &v->setup, .seen = seen};
    v->setup.limbs = 2;
    CHECK(like_template.log_likelihood(&b) == 0.0f); /* no template at all */
    b.template = template;
    template_clear(template, 2);
    memset(seen, 10, sizeof seen);
    CHECK(like_template.log_likelihood(&b) == -1.5f);
    for (int i = 0; i < SAMPLES; i++) {
        template[i] = (int16_t)(i < 20 || i > 50 ? TEMPLATE_EMPTY : 10 * TEMPLATE_ONE);
        CHECK(i <= 50 || like_template.log_likelihood(&b) == -1.5f); /* 31 */
    }
    template[51] = 10 * TEMPLATE_ONE;
    CHECK(like_template.log_likelihood(&b) == 0.0f);
    seen[51] = TEXTURE_HIDDEN; /* 31 again */
    CHECK(like_template.log_likelihood(&b) == -1.5f);
    double want = 0.0;
    for (int i = 0; i < SAMPLES; i++) {
        int const d = i - 30;
        seen[i] = (int8_t)(i < 4 ? TEXTURE_HIDDEN : 10 + d);
        template[i] = 10 * TEMPLATE_ONE;
        want += i < 4 ? 0.0 : 2.5 * log(1.0 + d * d / 1024.0) / (SAMPLES - 4);
    }
    CHECK_NEAR(like_template.log_likelihood(&b), -want, 0.01);
    seen[63] = 127;
    template[63] = -127 * TEMPLATE_ONE; /* the largest difference there is */
    CHECK(like_template.log_likelihood(&b) < (float)-want);
    CHECK(like_template.flag == GAIT_TERM_TEMPLATE && !like_template.support);
}

int main(void)
{
    test_update();
    test_term();
    return CHECK_DONE();
}
