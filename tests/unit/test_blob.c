/* The container against damage: whatever the bytes, nothing outside the blob is read. */
#include "model/blob.h"

#include "base/hash.h"
#include "model/kinematics.h"
#include "toy_model.h"

#include "check.h"

enum { ENTRY = 48, TABLE = 64 };

static _Alignas(GAIT_ALIGN) unsigned char good[TOY_BYTES];
static size_t good_bytes;

/* toy_seal at the speed of the library's own CRC, which test_hash.c checks. */
static void seal(unsigned char *b, size_t bytes)
{
    toy_put(b + 20, 0, 4);
    toy_put(b + 20, hash_crc32(0, b, bytes), 4);
}

static uint32_t get32(const unsigned char *p)
{
    return (uint32_t)p[0] | (uint32_t)p[1] << 8 | (uint32_t)p[2] << 16 | (uint32_t)p[3] << 24;
}

/* Open a model; one that is accepted must also be usable. */
static gait_result open_and_use(const unsigned char *b, size_t bytes)
{
    gait_model m;
    gait_result const s = model_open(b, bytes, &m, NULL);
    if (s == GAIT_OK) {
        gait_state const state = {.phase = 0.3f, .stature = 1.7f, .coef = {3.0f, -3.0f}};
        gait_pose pose;
        CHECK(model_pose_state(&m, &state, &pose) == GAIT_OK);
        CHECK(f_finite(pose.joint[0], sizeof pose.joint / sizeof(float)));
    }
    return s;
}

/* End of the last section; only padding follows. */
static size_t payload_end(const unsigned char *b)
{
    const unsigned char *const last = b + TABLE + ENTRY * (TOY_SECTIONS - 1);
    return get32(last + 32) + get32(last + 40);
}

static void test_truncated(void)
{
    int accepted = 0;
    size_t const end = payload_end(good);
    for (size_t n = 0; n < good_bytes; n++) {
        void *exact; /* a block of exactly its size, so that a sanitizer notices an overrun */
        if (posix_memalign(&exact, GAIT_ALIGN, n + 1))
            abort();
        unsigned char *const at = exact;
        memcpy(at, good, n);
        accepted += open_and_use(at, n) == GAIT_OK;
        if (n >= TABLE && n < end) { /* now with a header that states the shorter length */
            toy_put(at + 24, n, 8);
            seal(at, n);
            accepted += open_and_use(at, n) == GAIT_OK;
        }
        free(exact);
    }
    CHECK(accepted == 0);
}

/* Where a repaired flip is not an error: minor version, the CRC itself, the tags of META and PROP, which may be absent. */
static bool free_byte(size_t i)
{
    bool const tag = i >= TABLE && (i - TABLE) % ENTRY < 4;
    const unsigned char *const name = good + i - (tag ? (i - TABLE) % ENTRY : 0);
    bool const optional = tag && (memcmp(name, "META", 4) == 0 || memcmp(name, "PROP", 4) == 0);
    return (i >= 10 && i < 12) || (i >= 20 && i < 24) || optional;
}

static void test_flipped(void)
{
    static _Alignas(GAIT_ALIGN) unsigned char b[TOY_BYTES];
    static const unsigned char mask[] = {0xff, 0x01, 0x80};
    size_t const table_end = TABLE + ENTRY * TOY_SECTIONS;
    int silent = 0, tolerated = 0;
    memcpy(b, good, sizeof b);
    for (size_t i = 0; i < good_bytes; i++) {
        b[i] ^= mask[i % 3];
        silent += open_and_use(b, good_bytes) == GAIT_OK;
        seal(b, good_bytes);
        gait_result const s = open_and_use(b, good_bytes);
        tolerated += s == GAIT_OK && i < table_end && !free_byte(i);
        b[i] = good[i];
        memcpy(b + 20, good + 20, 4);
    }
    CHECK(silent == 0);
    CHECK(tolerated == 0);
    CHECK(memcmp(b, good, good_bytes) == 0);
}

/* Swap the tags of every two sections: an error unless they have the same type and shape. */
static void test_swapped(void)
{
    static _Alignas(GAIT_ALIGN) unsigned char b[TOY_BYTES];
    for (size_t i = 0; i < TOY_SECTIONS; i++)
        for (size_t j = 0; j < i; j++) {
            unsigned char *const p = b + TABLE + ENTRY * i, *const q = b + TABLE + ENTRY * j;
            memcpy(b, good, sizeof b);
            memcpy(p, good + (q - b), 4);
            memcpy(q, good + (p - b), 4);
            seal(b, good_bytes);
            bool const alike = memcmp(p + 4, q + 4, 28) == 0;
            CHECK((open_and_use(b, good_bytes) != GAIT_OK) || alike);
            memcpy(b, good, sizeof b);
            memcpy(p, good + (q - b), ENTRY); /* whole rows: the order of the table does not matter */
            memcpy(q, good + (p - b), ENTRY);
            seal(b, good_bytes);
            CHECK(open_and_use(b, good_bytes) == GAIT_OK);
        }
}

/* One field of n bytes changed, checksum repaired. */
typedef struct patch {
    const char *what;
    size_t at;
    int bytes;
    uint64_t value;
    gait_result want;
} patch;

static void test_fields(void)
{
    static _Alignas(GAIT_ALIGN) unsigned char b[TOY_BYTES];
    size_t const e = TABLE + 2 * ENTRY; /* CURV: f32, rank 3 */
    patch const patches[] = {
        {"magic", 0, 1, 'X', GAIT_ERR_MAGIC},
        {"major", 8, 2, 2, GAIT_ERR_VERSION},
        {"major 0", 8, 2, 0, GAIT_ERR_VERSION},
        {"newer minor", 10, 2, 7, GAIT_OK},
        {"header bytes", 12, 4, 128, GAIT_ERR_CORRUPT},
        {"no sections", 16, 4, 0, GAIT_ERR_CORRUPT},
        {"more sections than fit", 16, 4, 65535, GAIT_ERR_CORRUPT},
        {"sections wrap", 16, 4, 0xffffffff, GAIT_ERR_CORRUPT},
        {"total", 24, 8, good_bytes + 1, GAIT_ERR_CORRUPT},
        {"total wraps", 24, 8, UINT64_MAX, GAIT_ERR_CORRUPT},
        {"reserved", 40, 1, 1, GAIT_ERR_CORRUPT},
        {"type 0", e + 4, 4, 0, GAIT_ERR_CORRUPT},
        {"type 4", e + 4, 4, 4, GAIT_ERR_CORRUPT},
        {"other type", e + 4, 4, 2, GAIT_ERR_CORRUPT},
        {"rank 0", e + 8, 4, 0, GAIT_ERR_CORRUPT},
        {"rank 5", e + 8, 4, 5, GAIT_ERR_CORRUPT},
        {"rank 4", e + 8, 4, 4, GAIT_ERR_CORRUPT},
        {"rank 2", e + 8, 4, 2, GAIT_ERR_CORRUPT},
        {"dimension", e + 16, 4, 9, GAIT_ERR_CORRUPT},
        {"huge dimension", e + 16, 4, 0xffffffff, GAIT_ERR_CORRUPT},
        {"zero dimension", e + 16, 4, 0, GAIT_ERR_CORRUPT},
        {"unused dimension", e + 24, 4, 0, GAIT_ERR_CORRUPT},
        {"entry reserved", e + 28, 4, 1, GAIT_ERR_CORRUPT},
        {"offset not aligned", e + 32, 1, 4, GAIT_ERR_CORRUPT},
        {"offset in the table", e + 32, 8, 64, GAIT_ERR_CORRUPT},
        {"offset past the end", e + 32, 8, TOY_BYTES, GAIT_ERR_CORRUPT},
        {"offset wraps", e + 32, 8, UINT64_MAX - 63, GAIT_ERR_CORRUPT},
        {"bytes", e + 40, 8, 4, GAIT_ERR_CORRUPT},
        {"bytes wrap", e + 40, 8, UINT64_MAX, GAIT_ERR_CORRUPT},
    };
    for (size_t i = 0; i < sizeof patches / sizeof *patches; i++) {
        const patch *const p = &patches[i];
        memcpy(b, good, sizeof b);
        toy_put(b + p->at, p->value, p->bytes);
        seal(b, good_bytes);
        gait_result const s = open_and_use(b, good_bytes);
        if (s != p->want)
            fprintf(stderr, "%s: %s\n", p->what, gait_result_name(s));
        CHECK(s == p->want);
    }
    CHECK(open_and_use(good + 1, good_bytes) == GAIT_ERR_MEMORY);
    CHECK(open_and_use(good, good_bytes + 1) == GAIT_ERR_CORRUPT);
}

/* All four dimensions at their largest: the product must not wrap round to the stored size. */
static void test_product_wraps(void)
{
    static _Alignas(GAIT_ALIGN) unsigned char b[TOY_BYTES];
    toy_file f = toy_begin(b, 1);
    toy_section(&f, "WRAP", 3, 4, 0, 1, 1, "");
    for (int i = 0; i < 4; i++)
        toy_put(b + TABLE + 12 + 4 * i, 0x10000, 4); /* 4 x 2^64 */
    size_t const n = toy_finish(&f);
    blob out;
    CHECK(blob_open(b, n, &out, NULL) == GAIT_ERR_CORRUPT);
}

static void test_overlap_and_gaps(void)
{
    static _Alignas(GAIT_ALIGN) unsigned char b[TOY_BYTES];
    static const float x[20];
    blob out;
    toy_file f = toy_begin(b, 2);
    toy_section(&f, "ONE ", 3, 1, 20, 1, 1, x);
    toy_section(&f, "TWO ", 3, 1, 20, 1, 1, x);
    size_t const n = toy_finish(&f);
    CHECK(blob_open(b, n, &out, NULL) == GAIT_OK);
    uint64_t const first = get32(b + TABLE + 32);
    toy_put(b + TABLE + ENTRY + 32, first + 64, 8); /* TWO begins inside ONE */
    seal(b, n);
    CHECK(blob_open(b, n, &out, NULL) == GAIT_ERR_CORRUPT);
    toy_put(b + TABLE + ENTRY + 32, first, 8); /* both in the same place */
    seal(b, n);
    CHECK(blob_open(b, n, &out, NULL) == GAIT_ERR_CORRUPT);
    toy_put(b + TABLE + ENTRY + 32, first + 128, 8);
    memcpy(b + TABLE + ENTRY, "ONE ", 4); /* a tag twice */
    seal(b, n);
    CHECK(blob_open(b, n, &out, NULL) == GAIT_ERR_CORRUPT);
    memcpy(b + TABLE + ENTRY, "TWO ", 4);
    size_t const gaps[] = {TABLE + 2 * ENTRY, (size_t)first + 80, n - 1}; /* before, between, after */
    for (int i = 0; i < 3; i++) {
        b[gaps[i]] = 1;
        seal(b, n);
        CHECK(blob_open(b, n, &out, NULL) == GAIT_ERR_CORRUPT);
        b[gaps[i]] = 0;
    }
    seal(b, n);
    CHECK(blob_open(b, n, &out, NULL) == GAIT_OK);
}

static void test_lookup(void)
{
    blob b = {0};
    uint32_t dims[4];
    CHECK(blob_open(good, good_bytes, &b, NULL) == GAIT_OK && b.sections == TOY_SECTIONS);
    const float *const curve = blob_section(&b, "CURV", BLOB_F32, 3, dims);
    CHECK(curve && (uintptr_t)curve % GAIT_ALIGN == 0);
    CHECK(dims[0] == 2 && dims[1] == 8 && dims[2] == TOY_CHANNELS && dims[3] == 1);
    CHECK(!blob_section(&b, "CURV", BLOB_I32, 3, dims) && !blob_section(&b, "CURV", BLOB_F32, 2, dims));
    CHECK(!blob_section(&b, "NONE", BLOB_F32, 3, dims));
    CHECK(blob_section(&b, "SCST", BLOB_F32, 2, dims) && dims[0] == 1 && dims[1] == 3);
}

static void test_message(void)
{
    static _Alignas(GAIT_ALIGN) unsigned char b[TOY_BYTES];
    gait_error err = {0};
    blob out = {.bytes = 1};
    memcpy(b, good, sizeof b);
    b[good_bytes - 100] ^= 4;
    CHECK(blob_open(b, good_bytes, &out, &err) == GAIT_ERR_CORRUPT && out.bytes == 1);
    CHECK(err.result == GAIT_ERR_CORRUPT && strstr(err.text, "checksum"));
    toy_put(b + TABLE + 3 * ENTRY + 8, 9, 4);
    seal(b, good_bytes);
    CHECK(blob_open(b, good_bytes, &out, &err) == GAIT_ERR_CORRUPT && err.index == 3);
}

int main(void)
{
    good_bytes = toy_write(good, 8, 1);
    CHECK(open_and_use(good, good_bytes) == GAIT_OK);
    test_truncated();
    test_flipped();
    test_swapped();
    test_fields();
    test_product_wraps();
    test_overlap_and_gaps();
    test_lookup();
    test_message();
    return CHECK_DONE();
}
