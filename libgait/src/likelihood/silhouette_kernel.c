/* Area and foreground of a body: bits of its rows, of the field of view and of the foreground, counted
 * together. */
#include "image/features.h"
#include "base/dispatch.h"
#include "base/simd16.h"

#if defined(__POPCNT__) || defined(KERNEL_SCALAR)
void KERNEL(silhouette_count)(const features *f, const grid_mask *whole, int32_t *area, int32_t *covered)
{
    int64_t cells = 0, part[FOREGROUND_PLANES] = {0}, sum = 0;
    for (int32_t w = 0; 64 * w < whole->width; w++) {
        const uint64_t (*const words)[GRID_SIZE] =
            (const uint64_t (*)[GRID_SIZE])f->words[(whole->column + 64 * w) / GRID_STEP];
        const uint64_t *const body = whole->word[w], *const inside = words[FOREGROUND_PLANES];
#pragma GCC unroll 4
        for (int32_t y = whole->first; y < whole->last; y++) {
            uint64_t const m = body[y] & inside[y];
            cells += grid_popcount(m);
            for (int32_t k = 0; k < FOREGROUND_PLANES; k++)
                part[k] += grid_popcount(m & words[k][y]);
        }
    }
    for (int32_t k = 0; k < FOREGROUND_PLANES; k++)
        sum += part[k] << k;
    *area = (int32_t)cells * FOREGROUND_ONE;
    *covered = (int32_t)sum;
}
#elif defined(SIMD16_NEON)
/* Two rows at once; the last of an odd number alone. */
static void count_rows(const uint64_t *body, const uint64_t (*words)[GRID_SIZE], int32_t first, int32_t last,
                       int32_t *cells, int32_t *sum)
{
    const uint64_t *const inside = words[FOREGROUND_PLANES];
    uint16x8_t count = vdupq_n_u16(0), part[FOREGROUND_PLANES];
    int32_t y = first;
    for (int32_t k = 0; k < FOREGROUND_PLANES; k++)
        part[k] = count;
    for (; y + 2 <= last; y += 2) {
        uint64x2_t const m = vandq_u64(vld1q_u64(body + y), vld1q_u64(inside + y));
        count = vpadalq_u8(count, vcntq_u8(vreinterpretq_u8_u64(m)));
#pragma GCC unroll 4
        for (int32_t k = 0; k < FOREGROUND_PLANES; k++)
            part[k] =
                vpadalq_u8(part[k], vcntq_u8(vreinterpretq_u8_u64(vandq_u64(m, vld1q_u64(words[k] + y)))));
    }
    *cells += (int32_t)vaddlvq_u16(count);
    for (int32_t k = 0; k < FOREGROUND_PLANES; k++)
        *sum += (int32_t)vaddlvq_u16(part[k]) << k;
    for (; y < last; y++) {
        uint64_t const m = body[y] & inside[y];
        *cells += grid_popcount(m);
        for (int32_t k = 0; k < FOREGROUND_PLANES; k++)
            *sum += grid_popcount(m & words[k][y]) << k;
    }
}

void KERNEL(silhouette_count)(const features *f, const grid_mask *whole, int32_t *area, int32_t *covered)
{
    int32_t cells = 0, sum = 0;
    for (int32_t w = 0; 64 * w < whole->width; w++)
        count_rows(whole->word[w],
                   (const uint64_t (*)[GRID_SIZE])f->words[(whole->column + 64 * w) / GRID_STEP],
                   whole->first, whole->last, &cells, &sum);
    *area = cells * FOREGROUND_ONE;
    *covered = sum;
}
#else /* counts of bytes, which vector code adds and shifts as well as words */
static inline uint64_t count_bytes(uint64_t v)
{
    v = v - ((v >> 1) & UINT64_C(0x5555555555555555));
    v = (v & UINT64_C(0x3333333333333333)) + ((v >> 2) & UINT64_C(0x3333333333333333));
    return (v + (v >> 4)) & UINT64_C(0x0f0f0f0f0f0f0f0f);
}

/* Bytes added in pairs. */
static inline uint64_t pairs(uint64_t bytes)
{
    return (bytes & UINT64_C(0x00ff00ff00ff00ff)) + ((bytes >> 8) & UINT64_C(0x00ff00ff00ff00ff));
}

static inline int32_t sum_quarters(uint64_t v)
{
    return (int32_t)((v & 0xffff) + ((v >> 16) & 0xffff) + ((v >> 32) & 0xffff) + (v >> 48));
}

void KERNEL(silhouette_count)(const features *f, const grid_mask *whole, int32_t *area, int32_t *covered)
{
    *area = *covered = 0;
    for (int32_t w = 0; 64 * w < whole->width; w++) {
        const uint64_t (*const words)[GRID_SIZE] =
            (const uint64_t (*)[GRID_SIZE])f->words[(whole->column + 64 * w) / GRID_STEP];
        const uint64_t *const body = whole->word[w], *const inside = words[FOREGROUND_PLANES];
        uint64_t cells = 0,
                 sum = 0; /* GRID_SIZE rows of twice 8 (FOREGROUND_ONE) in a quarter: less than 2^16 */
        for (int32_t y = whole->first; y < whole->last; y++) {
            uint64_t const m = body[y] & inside[y];
            uint64_t part = 0;
#pragma GCC unroll 4
            for (int32_t k = 0; k < FOREGROUND_PLANES; k++)
                part += count_bytes(m & words[k][y]) << k;
            cells += pairs(count_bytes(m));
            sum += pairs(part);
        }
        *area += sum_quarters(cells) * FOREGROUND_ONE;
        *covered += sum_quarters(sum);
    }
}
#endif
