/* Arrays of particles are replaced in place by their ancestors': ancestors from resampling, arbitrary ones, cycles, and
 * another number of particles before. */
#include "filter/pf.h"
#include "base/rng.h"

#include "check.h"

enum { N = 200, MOST = 250, EACH = 13, PAD = 8 };
enum { SYSTEMATIC, ANY, RINGS, FEWER, MORE, KINDS };

static uint32_t word(uint32_t index)
{
    uint32_t r[4];
    rng_bits(23, 0, 0, index, 0, r);
    return r[0];
}

/* N particles after `before`, most of them descended from few. */
static void draw(pf *p, int32_t before, uint32_t round)
{
    float ll[MOST];
    p->n = before;
    pf_uniform(p);
    for (int32_t i = 0; i < before; i++)
        ll[i] = -14.0f * (float)(word(round * 1000 + (uint32_t)i) >> 8) * 0x1p-24f;
    pf_update(p, ll);
    pf_resize(p, N, word(round));
}

/* Ancestors in any order: shared by many particles or, in rings, one for each. */
static void mix(pf *p, int kind, uint32_t round)
{
    for (uint32_t i = 0; i < N; i++)
        p->parent[i] = (int32_t)(kind == RINGS ? (i * 7 + round) % N : word(round * 1000 + i) % N);
}

int main(void)
{
    static _Alignas(GAIT_ALIGN) unsigned char memory[MOST * 32];
    for (uint32_t round = 0; round < 20 * KINDS; round++) {
        int const kind = (int)(round % KINDS);
        int32_t const before = kind == FEWER ? N / 2 : kind == MORE ? MOST : N;
        unsigned char array[MOST * EACH + PAD], was[sizeof array];
        arena a = {.base = memory, .cap = sizeof memory};
        pf p = pf_layout(&a, MOST);
        CHECK(!a.overflow);
        draw(&p, before, round);
        if (kind == ANY || kind == RINGS)
            mix(&p, kind, round);
        for (size_t k = 0; k < sizeof array; k++)
            array[k] = was[k] = (unsigned char)word((uint32_t)k);
        pf_inherit(&p, before, array, EACH);
        int32_t wrong = 0;
        for (int32_t i = 0; i < N; i++)
            wrong += memcmp(array + i * EACH, was + p.parent[i] * EACH, EACH) != 0;
        CHECK(wrong == 0);
        CHECK(memcmp(array + N * EACH, was + N * EACH, sizeof array - N * EACH) == 0);
    }
    return CHECK_DONE();
}
