/* hash.h - FNV-1a for digests, CRC-32 for files. */
#ifndef GAIT_BASE_HASH_H
#define GAIT_BASE_HASH_H
#include "base/base.h"

#define HASH_INIT UINT64_C(0xcbf29ce484222325)

/* FNV-1a, 64 bits: continue h (HASH_INIT at first) over n bytes. */
uint64_t hash_fnv1a(uint64_t h, const void *p, size_t n);

/* Digest of n bytes, a multiple of 32, in words of 8 bytes: for large states. */
uint64_t hash_state(const void *p, size_t n);

/* CRC-32 with zlib's polynomial and convention: crc is 0 at first, then the last result. */
uint32_t hash_crc32(uint32_t crc, const void *p, size_t n);
#endif
