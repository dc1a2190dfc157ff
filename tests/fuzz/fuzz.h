/* fuzz.h - what the fuzz targets share.  Each is an LLVMFuzzerTestOneInput() that takes its bytes as instructions and
 * aborts where a promise is broken; libFuzzer drives it, or standalone.c, which needs no clang. */
#ifndef FUZZ_H
#define FUZZ_H
#include "gait.h"

#include "../unit/toy_model.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

enum { FUZZ_WIDTH = 48, FUZZ_HEIGHT = 32, FUZZ_MEMORY = 1 << 23 };

/* ---- the input, read from its start; 0 after its end ---- */
typedef struct fuzz_bytes {
    const uint8_t *at;
    size_t left;
} fuzz_bytes;

static inline uint8_t fuzz_take(fuzz_bytes *b)
{
    if (b->left == 0)
        return 0;
    b->left--;
    return *b->at++;
}

static inline uint32_t fuzz_word(fuzz_bytes *b)
{
    uint32_t word = 0;
    for (int i = 0; i < 4; i++)
        word = word << 8 | fuzz_take(b);
    return word;
}

/* A number about as large as the picture, sometimes a special one or any float. */
static inline float fuzz_number(fuzz_bytes *b)
{
    static const float SPECIAL[] = {NAN, INFINITY, -INFINITY, 3e38f, -1e30f, 1e-38f, 0.0f, -1.0f};
    uint8_t const k = fuzz_take(b);
    if (k < 8)
        return SPECIAL[k];
    if (k > 8)
        return (float)k * 0.25f - 4.0f + (float)fuzz_take(b) * 0.01f;
    uint32_t const word = fuzz_word(b);
    float any;
    memcpy(&any, &word, sizeof any);
    return any;
}

/* Whether what is left of an input is one of few, one in `of`, on which time is spent; nothing left is one. */
static inline int fuzz_one_in(const fuzz_bytes *b, unsigned of)
{
    unsigned sum = 0;
    for (size_t i = 0; i < b->left; i++)
        sum += b->at[i];
    return sum % of == 0;
}

/* ---- memory ---- */
/* At least `bytes` bytes, aligned to GAIT_ALIGN; free() them.  NULL: more than FUZZ_MEMORY. */
static inline void *fuzz_memory(size_t bytes)
{
    void *const at =
        bytes > FUZZ_MEMORY ? NULL : aligned_alloc(GAIT_ALIGN, bytes / GAIT_ALIGN * GAIT_ALIGN + GAIT_ALIGN);
    if (!at && bytes <= FUZZ_MEMORY)
        abort();
    return at;
}

/* A copy that ends where the data end, so that an overrun is noticed, aligned to GAIT_ALIGN; free() it. */
static inline uint8_t *fuzz_copy(const uint8_t *data, size_t size)
{
    size_t const padded = (size + GAIT_ALIGN - 1) / GAIT_ALIGN * GAIT_ALIGN;
    uint8_t *const at = aligned_alloc(GAIT_ALIGN, padded ? padded : GAIT_ALIGN);
    if (!at)
        abort();
    memcpy(at, data, size);
    return at;
}

/* Damage the data by the rest of the input: every eight bytes of it replace a word somewhere, or truncate the data there.
 * Returns the new size. */
static inline size_t fuzz_damage(uint8_t *data, size_t size, fuzz_bytes *b)
{
    while (b->left >= 8 && size > 0) {
        uint32_t const what = fuzz_word(b), word = fuzz_word(b);
        size_t const near = size < 2048 ? size : 2048; /* headers and tables */
        size_t const place = (what & 0xffffff) % (what >> 24 & 1 ? near : size);
        if (what >> 28 == 0xf)
            size = place;
        else if (what >> 28 == 0xe)
            data[place] = (uint8_t)word;
        else if (place / 4 * 4 + 4 <= size)
            memcpy(data + place / 4 * 4, &word, 4);
    }
    return size;
}

/* ---- settings ---- */
/* Change at most three fields of a struct, which are found by gait_field_at(). */
static inline void fuzz_settings(const char *of, void *at, fuzz_bytes *b)
{
    enum { MOST = 512 };
    static gait_field fields[MOST]; /* the library walks through its tables each time it is asked for one */
    static uint32_t count;
    if (count == 0)
        while (count < MOST && gait_field_at(count, &fields[count]) == GAIT_OK)
            count++;
    for (uint8_t left = fuzz_take(b) % 4; left > 0; left--) {
        uint8_t chosen = fuzz_take(b);
        float const value = fuzz_number(b);
        for (uint32_t i = 0; i < count; i++) {
            gait_field const f = fields[i];
            if (strcmp(f.of, of) != 0 || !f.name[0] || strstr(f.name, "struct_size") || chosen-- > 0)
                continue;
            int32_t const whole = value > -2e9f && value < 2e9f ? (int32_t)value : INT32_MIN;
            double const as_double = (double)value;
            char *const field = (char *)at + f.offset;
            if (strcmp(f.type, "float") == 0)
                memcpy(field, &value, sizeof value);
            else if (strcmp(f.type, "double") == 0)
                memcpy(field, &as_double, sizeof as_double);
            else if (strcmp(f.type, "int32_t") == 0 || strcmp(f.type, "uint32_t") == 0)
                memcpy(field, &whole, sizeof whole);
            break;
        }
    }
}

/* ---- a small tracker ---- */
static inline gait_camera fuzz_camera(void)
{
    return (gait_camera){FUZZ_WIDTH, FUZZ_HEIGHT, 50, 50, 24, 16, {1, 0, 0, 0, 0, -1, 0, 1, 0},
                         {0, 1, 5},  {0}};
}

static inline gait_tracker_config fuzz_config(void)
{
    gait_tracker_config c;
    gait_tracker_default(&c, GAIT_MODE_DEFAULT);
    c.particles = c.acquisition_particles = 16;
    c.camera[0] = fuzz_camera();
    return c;
}

/* A tracker with this config, or NULL if it is rejected; free() the memory. */
static inline gait_tracker *fuzz_tracker(const gait_model *model, const gait_tracker_config *c, void **memory)
{
    gait_tracker *t = NULL;
    size_t bytes = 0;
    *memory = NULL;
    if (gait_tracker_bytes(model, c, &bytes, NULL) == GAIT_OK && (*memory = fuzz_memory(bytes)))
        gait_tracker_init(*memory, bytes, model, c, &t, NULL);
    return t;
}

static inline void fuzz_finite(const float *x, size_t count)
{
    for (size_t i = 0; i < count; i++)
        if (!isfinite(x[i]))
            abort();
}

/* Check an estimate that was returned with GAIT_OK. */
static inline void fuzz_check(const gait_estimate *e)
{
    fuzz_finite(e->pose.joint[0], sizeof e->pose.joint / sizeof(float));
    fuzz_finite(e->joint_sd[0], sizeof e->joint_sd / sizeof(float));
    fuzz_finite(e->mean.pelvis, 3);
    fuzz_finite(&e->ess, 1);
    if (!isfinite(e->log_evidence) || !(e->mean.phase >= 0.0f && e->mean.phase < 1.0f) ||
        e->status < GAIT_TRACK_INIT || e->status > GAIT_TRACK_LOST)
        abort();
}

/* Track some frames of a bright bar, or without pictures, which takes a tenth of the time. */
static inline void fuzz_steps(gait_tracker *t, int64_t utime, int frames, int pictures)
{
    static uint8_t pixels[2][FUZZ_WIDTH * FUZZ_HEIGHT];
    gait_estimate out;
    for (int i = 0; i < FUZZ_WIDTH * FUZZ_HEIGHT; i++) {
        pixels[0][i] = (uint8_t)(i * 37 % 200);
        pixels[1][i] = i % FUZZ_WIDTH > 20 && i % FUZZ_WIDTH < 28 ? 250 : pixels[0][i];
    }
    gait_image const plate = {pixels[0], FUZZ_WIDTH, FUZZ_HEIGHT, FUZZ_WIDTH, GAIT_GREY8};
    if (pictures)
        gait_tracker_set_background(t, 0, &plate, NULL);
    for (int f = 0; f < frames; f++) {
        gait_frame frame = {.utime = utime + f * 33333};
        if (pictures)
            frame.image[0] = (gait_image){pixels[1], FUZZ_WIDTH, FUZZ_HEIGHT, FUZZ_WIDTH, GAIT_GREY8};
        if (gait_tracker_step(t, &frame, &out, NULL) != GAIT_OK)
            return;
        fuzz_check(&out);
    }
}
#endif
