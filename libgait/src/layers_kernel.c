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
static void depth_order(const outline_lanes *limb, int32_t count, layers_block *restrict out)
{
    float key[MODEL_MAX_LIMBS][BLOCK];
    memset(out->drawn, 0, sizeof out->drawn);
    for (int32_t l = 0; l < count; l++)
        for (int32_t i = 0; i < BLOCK; i++) {
            int32_t const front = limb[l].depth[i] > 0.0f;
            key[l][i] = front ? f_min(limb[l].depth[i], FLT_MAX) : INFINITY;
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
        limb_edges(outline->limb[l].x, outline->limb[l].y, out->vertices[l], &out->limb[l]);
    }
    depth_order(outline->limb, count, out);
}

/* ---- masks, lanes are rows, or their words where that fills a vector better ---- */
_Static_assert(RAST_WORDS == 2, "a lane has one word of a row or both");
#if defined(__AVX2__)
enum { LANE_WORDS = 1 };
#else
enum { LANE_WORDS = 2 };
#endif
enum { BAND = LAYERS_ROWS * RAST_WORDS / LANE_WORDS }; /* lanes of a band */

typedef struct edge { /* of one body */
    uint32_t at, slope, first, rows;
} edge;

static inline edge edge_of(const layers_limb *limb, int32_t k, int32_t lane)
{
    return (edge){.at = limb->at[k][lane],
                  .slope = limb->slope[k][lane],
                  .first = (uint32_t)limb->first[k][lane],
                  .rows = (uint32_t)limb->rows[k][lane]};
}

/* Stretch the span of row y to an edge that crosses it. */
static inline void stretch(edge e, int32_t y, int32_t *begin, int32_t *end)
{
    int32_t const column = rast_column(e.at, e.slope, y);
    bool const crosses = (uint32_t)y - e.first < e.rows;
    *begin = i_min(*begin, crosses ? column : RAST_SIZE);
    *end = i_max(*end, crosses ? column : 0);
}

/* The limb's bits in one word go behind those of `whole`. */
static inline void cover_word(int32_t word, int32_t begin, int32_t end, uint64_t *restrict whole,
                              uint64_t *restrict seen)
{
    int32_t const base = (word & 1) * 64;
    uint64_t const mine = rast_bits(i_max(begin - base, 0), i_min(end - base, 64));
    uint64_t const nearer = whole[word];
    whole[word] = nearer | mine;
    seen[word] = mine & ~nearer;
}

/* The same in the words of lane i. */
static inline void cover(int32_t i, int32_t begin, int32_t end, uint64_t *restrict whole,
                         uint64_t *restrict seen)
{
    cover_word(i * LANE_WORDS, begin, end, whole, seen);
    if (LANE_WORDS == 2)
        cover_word(i * LANE_WORDS + 1, begin, end, whole, seen);
}

/* Rows from `top` on in whole bands, of which the compiler sees that they need no remainder. */
static void draw_cone(const layers_limb *limb, int32_t lane, int32_t top, int32_t bands,
                      uint64_t *restrict whole, uint64_t *restrict seen)
{
    edge const a = edge_of(limb, 0, lane), b = edge_of(limb, 1, lane);
    edge const c = edge_of(limb, 2, lane), d = edge_of(limb, 3, lane);
    KERNEL_LANES
    for (int32_t i = 0; i < bands * BAND; i++) {
        int32_t const y = top + (i * LANE_WORDS >> 1);
        int32_t begin = RAST_SIZE, end = 0;
        stretch(a, y, &begin, &end);
        stretch(b, y, &begin, &end);
        stretch(c, y, &begin, &end);
        stretch(d, y, &begin, &end);
        cover(i, begin, end, whole, seen);
    }
}

static void draw_ellipsoid(const layers_limb *limb, int32_t lane, int32_t top, int32_t bands,
                           uint64_t *restrict whole, uint64_t *restrict seen)
{
    edge const a = edge_of(limb, 0, lane), b = edge_of(limb, 1, lane);
    edge const c = edge_of(limb, 2, lane), d = edge_of(limb, 3, lane);
    edge const e = edge_of(limb, 4, lane), f = edge_of(limb, 5, lane);
    edge const g = edge_of(limb, 6, lane), h = edge_of(limb, 7, lane);
    KERNEL_LANES
    for (int32_t i = 0; i < bands * BAND; i++) {
        int32_t const y = top + (i * LANE_WORDS >> 1);
        int32_t begin = RAST_SIZE, end = 0;
        stretch(a, y, &begin, &end);
        stretch(b, y, &begin, &end);
        stretch(c, y, &begin, &end);
        stretch(d, y, &begin, &end);
        stretch(e, y, &begin, &end);
        stretch(f, y, &begin, &end);
        stretch(g, y, &begin, &end);
        stretch(h, y, &begin, &end);
        cover(i, begin, end, whole, seen);
    }
}

static void draw_limb(const layers_limb *limb, int32_t vertices, int32_t lane, rast_mask *whole,
                      rast_mask *out)
{
    int32_t const top = limb->top[lane], bands = (limb->end[lane] - top) / LAYERS_ROWS;
    uint64_t *const body = (uint64_t *)whole->row + top * RAST_WORDS;
    uint64_t *const seen = (uint64_t *)out->row + top * RAST_WORDS;
    out->first = top;
    out->last = limb->end[lane];
    if (vertices == 4)
        draw_cone(limb, lane, top, bands, body, seen);
    else
        draw_ellipsoid(limb, lane, top, bands, body, seen);
}

void KERNEL(layers_draw)(const layers_block *block, int32_t lane, layers *restrict out)
{
    rast_mask *const whole = &out->whole;
    int32_t first = RAST_SIZE, last = 0;
    for (int32_t l = 0; l < block->count; l++)
        out->visible[l].first = out->visible[l].last = 0;
    for (int32_t k = 0; k < block->drawn[lane]; k++) {
        const layers_limb *const limb = &block->limb[block->order[lane][k]];
        bool const met = limb->top[lane] < limb->end[lane];
        first = met ? i_min(first, limb->top[lane]) : first;
        last = met ? i_max(last, limb->end[lane]) : last;
    }
    whole->first = i_min(first, last);
    whole->last = last;
    memset(whole->row[whole->first], 0, (size_t)(last - whole->first) * sizeof whole->row[0]);
    for (int32_t k = 0; k < block->drawn[lane]; k++) {
        int32_t const l = block->order[lane][k];
        draw_limb(&block->limb[l], block->vertices[l], lane, whole, &out->visible[l]);
    }
}
