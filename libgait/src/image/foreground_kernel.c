/* Foreground probability of the grid's cells against the empty scene. */
#include "image/features.h"
#include "base/dispatch.h"
#include <string.h>

/* Exposure of the frame against the plate in 1/256, half to double, over pixels that changed little. */
static int32_t exposure_gain(const view_planes *im, const view_planes *plate)
{
    int64_t frame = 0, scene = 0, count = 0;
    for (int32_t c = 0; c < im->channels; c++)
        for (int32_t y = 0; y < VIEW_SIZE; y++) {
            const uint8_t *const a = im->channel[c] + y * VIEW_SIZE, *const b =
                                                                         plate->channel[c] + y * VIEW_SIZE;
            uint16_t sum_a = 0, sum_b = 0, calm = 0; /* of one row: 256 x 255 fits */
            for (int32_t i = 0; i < VIEW_SIZE; i++) {
                uint16_t const take = (uint16_t)(a[i] - b[i] + 31) < 63 ? 0xffff : 0;
                sum_a = (uint16_t)(sum_a + (a[i] & take));
                sum_b = (uint16_t)(sum_b + (b[i] & take));
                calm = (uint16_t)(calm + (take & 1));
            }
            frame += sum_a;
            scene += sum_b;
            count += calm;
        }
    /* Too few or too dark pixels say nothing of the exposure. */
    if (count < VIEW_PIXELS / 16 || scene < 8 * count)
        return 256;
    return i_clamp((int32_t)(frame * 256 / scene), 128, 512);
}

/* Of two numbers below 2^31: exact, because the quotient of two such integers that is not one is further from
 * the next than a double is long. */
static int32_t quotient(int32_t a, int32_t b)
{
    return (int32_t)((double)a / (double)b);
}

typedef struct cells { /* one row of the grid, over the channels */
    int32_t total[GRID_SIZE], across[GRID_SIZE], scene2[GRID_SIZE]; /* |I - B|^2, <I, B>, <B, B> */
} cells;

KERNEL_ROW void cells_add(cells *restrict s, const uint8_t *restrict a, const uint8_t *restrict b,
                          int32_t gain)
{
    for (int32_t x = 0; x < GRID_SIZE; x++) {
        int32_t const i = 2 * x, j = i + VIEW_SIZE;
        int32_t const frame = (a[i] + a[i + 1] + a[j] + a[j + 1]) >> 2;
        int32_t const scene = (b[i] + b[i + 1] + b[j] + b[j + 1]) * gain >> 10;
        int32_t const d = frame - scene;
        s->total[x] += d * d;
        s->across[x] += frame * scene;
        s->scene2[x] += scene * scene;
    }
}

/* What a shadow explains, the plate's colour at 2/5 .. 1 of its brightness, counts a SHADOW_SHARE-th. */
static int32_t without_shadow(int32_t total, int32_t across, int32_t scene2)
{
    enum { SHADOW_SHARE = 6 };
    int32_t const ratio = quotient(256 * across, i_max(scene2, 1)); /* brightness against the plate, 1/256 */
    int32_t const dark = ratio >= 102 && ratio < 256 ? 256 - ratio : 0;
    /* |I - B|^2 = |I - r B|^2 + (1 - r)^2 |B|^2: colour and shade */
    int32_t const shade = i_min((dark * dark / 256) * (scene2 / 16) / 16, total);
    return total - shade + shade / SHADOW_SHARE;
}

/* Probabilities of a row, FG_ONE = 1, from the evidence that each cell of 2 x 2 pixels changed: grey levels
 * squared over three channels. */
KERNEL_ROW void probability_row(cells *restrict s, int32_t channels, uint8_t *restrict p)
{
    int32_t const half = 3 * 9 * 9; /* squared difference at which a cell is as likely foreground as not */
    if (channels == 1)
        for (int32_t x = 0; x < GRID_SIZE; x++)
            s->total[x] *= 3;
    else
        for (int32_t x = 0; x < GRID_SIZE; x++)
            s->total[x] = without_shadow(s->total[x], s->across[x], s->scene2[x]);
    for (int32_t x = 0; x < GRID_SIZE; x++) {
        int32_t const d = s->total[x];
        p[x] = (uint8_t)quotient(FG_ONE * d + (d + half) / 2, d + half);
    }
}

/* Bit k of 64 bytes. */
static uint64_t bits_of(const uint8_t *p, int32_t k)
{
    uint64_t out = 0;
    for (int32_t i = 0; i < 8; i++) {
        uint64_t v;
        memcpy(&v, p + 8 * i, sizeof v);
        v = v >> k & UINT64_C(0x0101010101010101);
        out |= (v * UINT64_C(0x0102040810204080) >> 56) << (8 * i);
    }
    return out;
}

void KERNEL(features_foreground)(features *f, const view_planes *im, const view_planes *plate)
{
    int32_t const gain = exposure_gain(im, plate);
    f->fg_total = 0;
    for (int32_t y = 0; y < GRID_SIZE; y++) {
        cells row = {.total = {0}};
        uint8_t p[GRID_SIZE];
        for (int32_t c = 0; c < im->channels; c++)
            cells_add(&row, im->channel[c] + 2 * y * VIEW_SIZE, plate->channel[c] + 2 * y * VIEW_SIZE, gain);
        probability_row(&row, im->channels, p);
        for (int32_t w = 0; w < GRID_WORDS; w++)
            for (int32_t k = 0; k < FG_PLANES; k++) {
                uint64_t const bits = bits_of(p + 64 * w, k) & f->inside[y][w];
                f->fg[k][y][w] = bits;
                f->fg_total += grid_popcount(bits) << k;
            }
    }
}
