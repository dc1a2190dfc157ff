/* byte_reader.h - walk through an encoded LCM message where it lies; every length is checked. */
#ifndef TRACKD_BYTE_READER_H
#define TRACKD_BYTE_READER_H
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

typedef struct byte_reader {
    const uint8_t *at;
    size_t left;
    bool ok; /* false: a read went beyond the end */
} byte_reader;

/* `count` bytes of the message, or NULL beyond its end. */
static inline const uint8_t *bytes_take(byte_reader *r, int64_t count)
{
    const uint8_t *const at = r->at;
    if (!r->ok || count < 0 || (uint64_t)count > r->left) {
        r->ok = false;
        return NULL;
    }
    r->at += count;
    r->left -= (size_t)count;
    return at;
}

/* Big-endian, as LCM writes integers. */
static inline int64_t bytes_int(byte_reader *r, int bytes)
{
    const uint8_t *const at = bytes_take(r, bytes);
    uint64_t value = 0;
    for (int i = 0; at && i < bytes; i++)
        value = value << 8 | at[i];
    return bytes == 4 ? (int32_t)(uint32_t)value : (int64_t)value;
}

static inline int32_t bytes_int32(byte_reader *r)
{
    return (int32_t)bytes_int(r, 4);
}

static inline float bytes_float(byte_reader *r)
{
    uint32_t const bits = (uint32_t)bytes_int32(r);
    float value;
    memcpy(&value, &bits, sizeof value);
    return value;
}

/* A NUL-terminated text; NULL beyond the end or without a NUL. */
static inline const char *bytes_text(byte_reader *r)
{
    int32_t const length = bytes_int32(r);
    const uint8_t *const at = bytes_take(r, length);
    if (at && (length < 1 || at[length - 1] != '\0'))
        r->ok = false;
    return r->ok ? (const char *)at : NULL;
}
#endif
