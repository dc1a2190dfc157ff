/* The limbs of a block of bodies as edges in the grid, one lane a body; then one body's edges as masks, one lane a
 * row, each limb without what stands before it. */
#include "kernels.h"
#include "layers.h"

#include <string.h>

/* ---- edges, lanes are bodies ---- */

/* Working pixels to grid cells: the centre of cell c is working pixel 2 c + 1/2. */
static int32_t to_cell(float v)
{
    return rast_sub(0.5f * v - 0.25f);
}

static void limb_edges(const float x[][BLOCK], const float y[][BLOCK], int32_t n, layers_limb *restrict out)
{
    int32_t px[RAST_MAX_VERTICES][BLOCK], py[RAST_MAX_VERTICES][BLOCK], low[BLOCK], high[BLOCK];
    for (int32_t i = 0; i < BLOCK; i++) {
        low[i] = RAST_SIZE;
        high[i] = 0;
    }
    for (int32_t k = 0; k < n; k++)
        for (int32_t i = 0; i < BLOCK; i++) {
            px[k][i] = to_cell(x[k][i]);
            py[k][i] = to_cell(y[k][i]);
            low[i] = i_min(low[i], rast_row(py[k][i]));
            high[i] = i_max(high[i], rast_row(py[k][i]));
        }
    for (int32_t k = 0, j = n - 1; k < n; j = k++)
        for (int32_t i = 0; i < BLOCK; i++) {
            rast_edge const e = rast_edge_of(px[j][i], py[j][i], px[k][i], py[k][i]);
            out->at[k][i] = e.at;
            out->slope[k][i] = e.slope;
            out->first[k][i] = e.first;
            out->rows[k][i] = e.last - e.first;
        }
    for (int32_t i = 0; i < BLOCK; i++) {
        int32_t const top = i_max(low[i], 0), end = i_min(high[i], RAST_SIZE);
        out->top[i] = top < end ? top / LAYERS_ROWS * LAYERS_ROWS : 0;
        out->end[i] = top < end ? (end + LAYERS_ROWS - 1) / LAYERS_ROWS * LAYERS_ROWS : 0;
    }
}

/* Each limb's place from near to far, by counting those before it. */
static void depth_order(const float depth[][BLOCK], int32_t count, layers_block *restrict out)
{
    float key[MODEL_MAX_LIMBS][BLOCK];
    memset(out->drawn, 0, sizeof out->drawn);
    for (int32_t l = 0; l < count; l++)
        for (int32_t i = 0; i < BLOCK; i++) {
            int32_t const front = depth[l][i] > 0.0f;
            key[l][i] = front ? f_min(depth[l][i], FLT_MAX) : INFINITY;
            out->drawn[i] += front;
        }
    for (int32_t l = 0; l < count; l++) {
        int32_t before[BLOCK] = {0};
        for (int32_t m = 0; m < l; m++)
            for (int32_t i = 0; i < BLOCK; i++)
                before[i] += key[m][i] <= key[l][i];
        for (int32_t m = l + 1; m < count; m++)
            for (int32_t i = 0; i < BLOCK; i++)
                before[i] += key[m][i] < key[l][i];
        for (int32_t i = 0; i < BLOCK; i++)
            out->order[i][before[i]] = (uint8_t)l;
    }
}

void KERNEL(layers_prepare)(const outline_block *outline, const limb_geometry *limbs, int32_t count,
                            layers_block *restrict out)
{
    out->count = count;
    for (int32_t l = 0; l < count; l++) {
        out->vertices[l] = outline_vertices(&limbs[l]);
        limb_edges(outline->x[l], outline->y[l], out->vertices[l], &out->limb[l]);
    }
    depth_order(outline->depth, count, out);
}

/* ---- masks, lanes are the words of a band's rows ---- */
enum { BAND = LAYERS_ROWS * RAST_WORDS };

/* Where a limb of n edges begins and ends in the row of each word; begin >= end: it is not there. */
static inline void band_spans(const layers_limb *limb, int32_t n, int32_t lane, int32_t top,
                              int32_t begin[BAND], int32_t end[BAND])
{
    for (int32_t i = 0; i < BAND; i++) {
        begin[i] = RAST_SIZE;
        end[i] = 0;
    }
    for (int32_t k = 0; k < n; k++) {
        uint32_t const at = limb->at[k][lane], slope = limb->slope[k][lane];
        uint32_t const below = (uint32_t)(top - limb->first[k][lane]), rows = (uint32_t)limb->rows[k][lane];
        for (int32_t i = 0; i < BAND; i++) {
            int32_t const row = i / RAST_WORDS, column = rast_column(at, slope, top + row);
            bool const crosses = below + (uint32_t)row < rows;
            begin[i] = i_min(begin[i], crosses ? column : RAST_SIZE);
            end[i] = i_max(end[i], crosses ? column : 0);
        }
    }
}

/* Draw a limb behind `whole`, and add it there. */
static void draw_limb(const layers_limb *limb, int32_t n, int32_t lane, rast_mask *restrict whole,
                      rast_mask *restrict out)
{
    out->first = limb->top[lane];
    out->last = limb->end[lane];
    for (int32_t y = out->first; y < out->last; y += LAYERS_ROWS) {
        uint64_t *const body = (uint64_t *)whole->row + y * RAST_WORDS;
        uint64_t *const seen = (uint64_t *)out->row + y * RAST_WORDS;
        int32_t begin[BAND], end[BAND];
        band_spans(limb, n, lane, y, begin, end);
        for (int32_t i = 0; i < BAND; i++) {
            int32_t const base = i % RAST_WORDS * 64;
            uint64_t const mine = rast_bits(i_clamp(begin[i] - base, 0, 64), i_clamp(end[i] - base, 0, 64));
            uint64_t const nearer = body[i];
            body[i] = nearer | mine;
            seen[i] = mine & ~nearer;
        }
    }
}

void KERNEL(layers_draw)(const layers_block *block, int32_t lane, layers *restrict out)
{
    rast_mask *const whole = &out->whole;
    memset(whole->row, 0, sizeof whole->row);
    whole->first = RAST_SIZE;
    whole->last = 0;
    for (int32_t l = 0; l < block->count; l++)
        out->visible[l].first = out->visible[l].last = 0;
    for (int32_t k = 0; k < block->drawn[lane]; k++) {
        int32_t const l = block->order[lane][k];
        rast_mask *const mask = &out->visible[l];
        draw_limb(&block->limb[l], block->vertices[l], lane, whole, mask);
        if (mask->first < mask->last) {
            whole->first = i_min(whole->first, mask->first);
            whole->last = i_max(whole->last, mask->last);
        }
    }
    if (whole->first > whole->last)
        whole->first = whole->last = 0;
}
