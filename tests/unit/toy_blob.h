/* toy_blob.h - write a model file's container section by section, for tests; it knows nothing about their contents.
 *
 *   toy_file f = toy_begin(buf, 2);                   clears buf, TOY_BYTES long, for two sections
 *   toy_section(&f, "ABCD", 3, 2, 5, 7, 1, floats);   f32 [5][7]
 *   toy_section(&f, "EFGH", 2, 1, 9, 1, 1, ints);     i32 [9]
 *   size_t bytes = toy_finish(&f);                    header and checksum
 *   toy_seal(buf, bytes);                             the checksum again, after changing bytes */
#ifndef TOY_BLOB_H
#define TOY_BLOB_H
#include "gait.h"

#include <stdlib.h>
#include <string.h>

enum { TOY_BYTES = 32768 };

typedef struct toy_file {
    unsigned char *at;
    size_t used;
    uint32_t sections, announced; /* sections written so far; in total */
} toy_file;

static inline void toy_put(unsigned char *p, uint64_t v, int bytes)
{
    for (int i = 0; i < bytes; i++)
        p[i] = (unsigned char)(v >> (8 * i));
}

/* Bit by bit: independent of the library's own. */
static inline uint32_t toy_crc(const unsigned char *p, size_t n)
{
    uint32_t crc = 0xffffffffu;
    for (size_t i = 0; i < n; i++) {
        crc ^= p[i];
        for (int b = 0; b < 8; b++)
            crc = (crc >> 1) ^ (0xedb88320u & (0u - (crc & 1u)));
    }
    return ~crc;
}

/* Correct the checksum of a blob after its bytes were changed. */
static inline void toy_seal(unsigned char *b, size_t bytes)
{
    toy_put(b + 20, 0, 4);
    toy_put(b + 20, toy_crc(b, bytes), 4);
}

/* Begin a blob of so many sections in buf, whose first TOY_BYTES are cleared. */
static inline toy_file toy_begin(unsigned char *buf, uint32_t sections)
{
    memset(buf, 0, TOY_BYTES);
    return (toy_file){.at = buf, .used = (64 + 48 * (size_t)sections + 63) / 64 * 64, .announced = sections};
}

/* Write the header; returns the size of the blob. */
static inline size_t toy_finish(toy_file *f)
{
    if (f->sections != f->announced)
        abort();
    memcpy(f->at, "GAITMDL\n", 8);
    toy_put(f->at + 8, 1, 2);
    toy_put(f->at + 12, 64, 4);
    toy_put(f->at + 16, f->sections, 4);
    toy_put(f->at + 24, f->used, 8);
    toy_seal(f->at, f->used);
    return f->used;
}

/* Append a section of four dimensions: type 1 = u8, 2 = i32, 3 = f32; unused ones 1. */
static inline void toy_section4(toy_file *f, const char *tag, uint32_t type, uint32_t rank,
                                const uint32_t d[4], const void *data)
{
    const uint32_t field[] = {type, rank, d[0], d[1], d[2], d[3], 0};
    size_t const bytes = (type == 1 ? 1u : 4u) * (size_t)d[0] * d[1] * d[2] * d[3];
    unsigned char *const e = f->at + 64 + 48 * (size_t)f->sections++;
    memcpy(e, tag, 4);
    for (int i = 0; i < 7; i++)
        toy_put(e + 4 + 4 * i, field[i], 4);
    toy_put(e + 32, f->used, 8);
    toy_put(e + 40, bytes, 8);
    if (f->used + bytes + 63 > TOY_BYTES || f->sections > f->announced)
        abort();
    memcpy(f->at + f->used, data, bytes);
    f->used = (f->used + bytes + 63) & ~(size_t)63;
}

/* The same with up to three dimensions. */
static inline void toy_section(toy_file *f, const char *tag, uint32_t type, uint32_t rank, uint32_t d0,
                               uint32_t d1, uint32_t d2, const void *data)
{
    const uint32_t d[4] = {d0, d1, d2, 1};
    toy_section4(f, tag, type, rank, d, data);
}
#endif
