/* standalone.c - run a fuzz target on damaged copies of its seed: standalone MODEL.gait [COUNT [SEED]]. */
#include "fuzz.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { CAP = 1 << 22, WIDTH = 96, HEIGHT = 64 };

/* xorshift64*: the same damage on every machine. */
static uint64_t draw(uint64_t *s)
{
    *s ^= *s >> 12;
    *s ^= *s << 25;
    *s ^= *s >> 27;
    return *s * UINT64_C(0x2545f4914f6cdd1d);
}

static void write32(uint8_t *at, uint32_t v)
{
    memcpy(at, &v, sizeof v);
}

/* One fault: a flipped bit, a random byte, a nasty word, or a shorter file. */
static size_t damage(uint8_t *data, size_t size, uint64_t *s)
{
    static const uint32_t nasty[] = {0,          1,          0x7fffffff, 0x80000000, 0xffffffff, 0x7f800000,
                                     0xff800000, 0x7fc00000, 0x7f7fffff, 0x00000001, 64,         0x10000};
    /* Headers and tables are small: half of the faults go to the first 2 kB. */
    size_t const reach = draw(s) % 2 && size > 2048 ? 2048 : size, at = (size_t)(draw(s) % reach);
    switch (draw(s) % 8) {
    case 0:
    case 1:
        data[at] = (uint8_t)(data[at] ^ 1u << draw(s) % 8);
        return size;
    case 2:
        data[at] = (uint8_t)draw(s);
        return size;
    case 7:
        return draw(s) % 8 ? size : at;
    default:
        if ((at & ~(size_t)3) + 4 <= size)
            write32(data + (at & ~(size_t)3), nasty[draw(s) % (sizeof nasty / sizeof *nasty)]);
        return size;
    }
}

uint8_t *fuzz_aligned(const uint8_t *data, size_t size, void **memory)
{
    size_t const padded = (size + GAIT_ALIGN - 1) / GAIT_ALIGN * GAIT_ALIGN;
    uint8_t *const at = aligned_alloc(GAIT_ALIGN, padded ? padded : GAIT_ALIGN);
    if (!at)
        abort();
    memcpy(at, data, size);
    *memory = at;
    return at;
}

gait_tracker *fuzz_tracker(const gait_model *model, void **memory)
{
    gait_tracker_config cfg;
    gait_tracker *t = NULL;
    size_t bytes = 0;
    gait_tracker_default(&cfg, GAIT_MODE_DEFAULT);
    cfg.particles = 32;
    cfg.camera[0] =
        (gait_camera){WIDTH, HEIGHT, 100, 100, 48, 32, {1, 0, 0, 0, 0, -1, 0, 1, 0}, {0, 1, 5}, {0}};
    if (gait_tracker_bytes(model, &cfg, &bytes, NULL) != GAIT_OK)
        return NULL;
    *memory = aligned_alloc(GAIT_ALIGN, (bytes + GAIT_ALIGN - 1) / GAIT_ALIGN * GAIT_ALIGN);
    if (!*memory)
        abort();
    gait_tracker_init(*memory, bytes, model, &cfg, &t, NULL);
    return t;
}

void fuzz_steps(gait_tracker *t, const gait_state *mean, const gait_state *sd, int64_t utime, int frames)
{
    static uint8_t pixels[2][WIDTH * HEIGHT];
    gait_estimate out;
    for (int i = 0; i < WIDTH * HEIGHT; i++) {
        pixels[0][i] = (uint8_t)(i * 37 % 200);
        pixels[1][i] = i % WIDTH > 40 && i % WIDTH < 56 ? 250 : pixels[0][i];
    }
    gait_image const plate = {pixels[0], WIDTH, HEIGHT, WIDTH, GAIT_GREY8};
    gait_tracker_set_background(t, 0, &plate, NULL);
    if (mean && gait_tracker_start(t, mean, sd, utime, NULL) != GAIT_OK)
        return;
    for (int f = 0; f < frames; f++) {
        gait_frame const frame = {.utime = utime + f * 33333,
                                  .image = {{pixels[1], WIDTH, HEIGHT, WIDTH, GAIT_GREY8}}};
        if (gait_tracker_step(t, &frame, &out, NULL) != GAIT_OK)
            return;
    }
}

int main(int argc, char **argv)
{
    static uint8_t blob[CAP], seed[CAP], work[CAP];
    long const count = argc > 2 ? strtol(argv[2], NULL, 10) : 500;
    uint64_t state = argc > 3 ? strtoull(argv[3], NULL, 10) * 2 + 1 : 1;
    FILE *const f = argc > 1 ? fopen(argv[1], "rb") : NULL;
    size_t const blob_size = f ? fread(blob, 1, CAP, f) : 0;
    size_t size = 0;
    if (!blob_size) {
        fprintf(stderr, "usage: %s MODEL.gait [COUNT [SEED]]\n", argv[0]);
        return 2;
    }
    fclose(f);
    fuzz_seed(blob, blob_size, seed, CAP, &size);
    for (long i = 0; i < count; i++) {
        size_t left = size;
        memcpy(work, seed, size);
        for (uint64_t k = draw(&state) % 4 + (i > 0); k && left; k--)
            left = damage(work, left, &state);
        LLVMFuzzerTestOneInput(work, left);
    }
    const char *const name = strrchr(argv[0], '/');
    printf("%-28s %6ld passed, 0 failed\n", name ? name + 1 : argv[0], count);
    return 0;
}
