/* Curves and kinematics of every instruction set against the scalar ones. */
#include "kernel_check.h"
#include "model/kinematics.h"

#include "base/rng.h"
#include "toy_shifted.h"

#include "check.h"

/* Any phases, scores and angles; now and then a huge one. */
static kin_input random_input(uint32_t round)
{
    static const float extreme[] = {1e30f, -1e30f, 9000.0f, 1e38f};
    kin_input in;
    float *const v = (float *)(void *)&in;
    for (uint32_t i = 0; i < sizeof in / sizeof *v; i++) {
        float x[4];
        rng_normal4(41, 0, 0, i, round, x);
        v[i] = x[1] > 2.5f && round % 2 ? extreme[i % 4] : x[0];
    }
    for (int lane = 0; lane < BLOCK; lane++)
        in.stature[lane] = 1.5f + 0.01f * (float)lane;
    return in;
}

static void test_bits(void)
{
    static kin_channels ch;
    static kin_body body;
    static unsigned char memory[sizeof body + 2 * GUARD];
    for (uint32_t round = 0; round < 60; round++) {
        const gait_model *const m = round % 3 ? toy_model() : toy_shifted();
        kin_input const in = random_input(round);
        int32_t const components = (int32_t)round % (m->components + 1);
        int32_t const proportions = (int32_t)round % (m->proportions + 1);
        memset(&ch, 0xa5, sizeof ch);
        memset(&body, 0xa5, sizeof body);
        isa_scalar()->kin_curves(m, &in, components, &ch);
        isa_scalar()->kin_pose(m, &ch, &in, proportions, &body);
        for (int k = 0; k < isa_count(); k++) {
            guarded g = guard_fill(memory, sizeof ch);
            isa_at(k)->kin_curves(m, &in, components, (kin_channels *)(void *)g.begin);
            CHECK(guard_whole(&g) && memcmp(g.begin, &ch, sizeof ch) == 0);
            g = guard_fill(memory, sizeof body);
            isa_at(k)->kin_pose(m, &ch, &in, proportions, (kin_body *)(void *)g.begin);
            CHECK(guard_whole(&g) && memcmp(g.begin, &body, sizeof body) == 0);
        }
    }
}

/* Models with fewer and more channels than are computed at once: each channel equals the one computed alone. */
static void test_channels(void)
{
    kin_input const in = random_input(0);
    for (int32_t count = 1; count <= TOY_CHANNELS; count++) {
        gait_model m = *toy_model();
        m.channels = count;
        for (int k = 0; k < isa_count(); k++) {
            static kin_channels ch;
            memset(&ch, 0xa5, sizeof ch);
            isa_at(k)->kin_curves(&m, &in, 2, &ch);
            int same = 1;
            for (int lane = 0; lane < BLOCK; lane++)
                for (int32_t i = 0; i < count; i++) {
                    float const coef[2] = {in.coef[0][lane], in.coef[1][lane]};
                    float const one = kin_channel(&m, i, in.phase[lane], in.pace[lane], coef, 2);
                    same &= memcmp(&one, &ch.v[i][lane], sizeof one) == 0;
                }
            CHECK(same);
        }
    }
}

int main(void)
{
    test_channels();
    test_bits();
    return CHECK_DONE();
}
