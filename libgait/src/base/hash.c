#include "base/hash.h"

#include <string.h>

uint64_t hash_fnv1a(uint64_t h, const void *p, size_t n)
{
    const unsigned char *const b = p;
    for (size_t i = 0; i < n; i++)
        h = (h ^ b[i]) * UINT64_C(0x100000001b3);
    return h;
}

uint32_t hash_crc32(uint32_t crc, const void *p, size_t n)
{
    /* One entry per nibble: small enough for a microcontroller's cache. */
    static const uint32_t table[16] = {
        0x00000000u, 0x1db71064u, 0x3b6e20c8u, 0x26d930acu, 0x76dc4190u, 0x6b6b51f4u,
        0x4db26158u, 0x5005713cu, 0xedb88320u, 0xf00f9344u, 0xd6d6a3e8u, 0xcb61b38cu,
        0x9b64c2b0u, 0x86d3d2d4u, 0xa00ae278u, 0xbdbdf21cu,
    };
    const unsigned char *const b = p;
    crc = ~crc;
    for (size_t i = 0; i < n; i++) {
        crc ^= b[i];
        crc = (crc >> 4) ^ table[crc & 15u];
        crc = (crc >> 4) ^ table[crc & 15u];
    }
    return ~crc;
}

uint64_t hash_state(const void *p, size_t n)
{
    enum { CHAINS = 4 }; /* independent, so that multiplications overlap */
    uint64_t const prime = UINT64_C(0x100000001b3);
    uint64_t h[CHAINS], word[CHAINS];
    const unsigned char *const bytes = p;
    for (int i = 0; i < CHAINS; i++)
        h[i] = HASH_INIT + (uint64_t)i;
    for (size_t at = 0; at + sizeof word <= n; at += sizeof word) {
        memcpy(word, bytes + at, sizeof word);
        for (int i = 0; i < CHAINS; i++) {
            h[i] = (h[i] ^ word[i]) * prime;
            h[i] ^= h[i] >> 29;
        }
    }
    return hash_fnv1a(HASH_INIT, h, sizeof h);
}
