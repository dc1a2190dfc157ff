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

typedef struct box { /* cells that the limbs in front of the camera can meet */
    int32_t left[BLOCK], right[BLOCK], top[BLOCK], end[BLOCK];
} box;

static box box_empty(void)
{
    box b;
    for (int32_t i = 0; i < BLOCK; i++) {
        b.left[i] = b.top[i] = RAST_SIZE;
        b.right[i] = b.end[i] = 0;
    }
    return b;
}

/* What a limb meets, whole bands of rows, grows what the body does. */
static void box_join(box *restrict body, const box *limb, const float *depth, layers_limb *restrict out)
{
    for (int32_t i = 0; i < BLOCK; i++) {
        int32_t const top = i_max(limb->top[i], 0), end = i_min(limb->end[i], RAST_SIZE);
        bool const front = depth[i] > 0.0f, met = front & (top < end);
        out->top[i] = met ? top / LAYERS_ROWS * LAYERS_ROWS : 0;
        out->end[i] = met ? (end + LAYERS_ROWS - 1) / LAYERS_ROWS * LAYERS_ROWS : 0;
        body->top[i] = i_min(body->top[i], met ? out->top[i] : RAST_SIZE);
        body->end[i] = i_max(body->end[i], out->end[i]);
        body->left[i] = i_min(body->left[i], met ? limb->left[i] : RAST_SIZE);
        body->right[i] = i_max(body->right[i], met ? limb->right[i] : 0);
    }
}

static void limb_edges(const outline_lanes *limb, int32_t n, box *restrict body, layers_limb *restrict out)
{
    int32_t px[RAST_MAX_VERTICES][BLOCK], py[RAST_MAX_VERTICES][BLOCK];
    box own = box_empty();
    for (int32_t k = 0; k < n; k++)
        for (int32_t i = 0; i < BLOCK; i++) {
            px[k][i] = to_cell(limb->x[k][i]);
            py[k][i] = to_cell(limb->y[k][i]);
            /* a column more on either side, because edges are rounded */
            own.left[i] = i_min(own.left[i], (px[k][i] >> 8) - 1);
            own.right[i] = i_max(own.right[i], (px[k][i] >> 8) + 2);
            own.top[i] = i_min(own.top[i], rast_row(py[k][i]));
            own.end[i] = i_max(own.end[i], rast_row(py[k][i]));
        }
    for (int32_t k = 0, j = n - 1; k < n; j = k++)
        for (int32_t i = 0; i < BLOCK; i++) {
            rast_edge const e = rast_edge_of(px[j][i], py[j][i], px[k][i], py[k][i]);
            out->at[k][i] = e.at;
            out->slope[k][i] = e.slope;
            out->first[k][i] = e.first;
            out->rows[k][i] = e.last - e.first;
        }
    box_join(body, &own, limb->depth, out);
}

/* Most bodies are no wider than a word; its first column is a multiple of RAST_STEP. */
static void choose_columns(const box *body, layers_block *restrict out)
{
    for (int32_t i = 0; i < BLOCK; i++) {
        int32_t const column = i_clamp(body->left[i], 0, 63) / RAST_STEP * RAST_STEP;
        bool const fits = i_min(body->right[i], RAST_SIZE) - column <= 64;
        out->first[i] = i_min(body->top[i], body->end[i]);
        out->last[i] = body->end[i];
        out->column[i] = fits ? column : 0;
        out->width[i] = fits ? 64 : RAST_SIZE;
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
    box body = box_empty();
    out->count = count;
    for (int32_t l = 0; l < count; l++) {
        out->vertices[l] = outline_vertices(&limbs[l]);
        limb_edges(&outline->limb[l], out->vertices[l], &body, &out->limb[l]);
    }
    choose_columns(&body, out);
    depth_order(outline->limb, count, out);
}

/* ---- masks, lanes are rows ---- */
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
    *begin = crosses ? i_min(*begin, column) : *begin;
    *end = crosses ? i_max(*end, column) : *end;
}

/* The limb's bits in a word that begins at column `base` go behind those of the body. */
static inline void cover(int32_t begin, int32_t end, int32_t base, uint64_t *restrict whole,
                         uint64_t *restrict seen)
{
    uint64_t const mine = rast_bits(i_max(begin - base, 0), i_min(end - base, 64)), nearer = *whole;
    *whole = nearer | mine;
    *seen = mine & ~nearer;
}

/* Rows [first, last), whole bands, of which the compiler sees that they need no remainder. */
KERNEL_ROW void draw_cone(const layers_limb *limb, int32_t lane, int32_t base, uint64_t *restrict whole,
                          uint64_t *restrict seen)
{
    int32_t const first = limb->top[lane], last = limb->end[lane];
    edge const a = edge_of(limb, 0, lane), b = edge_of(limb, 1, lane);
    edge const c = edge_of(limb, 2, lane), d = edge_of(limb, 3, lane);
    for (int32_t band = first; band < last; band += LAYERS_ROWS)
        KERNEL_LANES
    for (int32_t i = 0; i < LAYERS_ROWS; i++) {
        int32_t begin = RAST_SIZE, end = 0;
        stretch(a, band + i, &begin, &end);
        stretch(b, band + i, &begin, &end);
        stretch(c, band + i, &begin, &end);
        stretch(d, band + i, &begin, &end);
        cover(begin, end, base, whole + band + i, seen + band + i);
    }
}

KERNEL_ROW void draw_ellipsoid(const layers_limb *limb, int32_t lane, int32_t base, uint64_t *restrict whole,
                               uint64_t *restrict seen)
{
    int32_t const first = limb->top[lane], last = limb->end[lane];
    edge const a = edge_of(limb, 0, lane), b = edge_of(limb, 1, lane);
    edge const c = edge_of(limb, 2, lane), d = edge_of(limb, 3, lane);
    edge const e = edge_of(limb, 4, lane), f = edge_of(limb, 5, lane);
    edge const g = edge_of(limb, 6, lane), h = edge_of(limb, 7, lane);
    for (int32_t band = first; band < last; band += LAYERS_ROWS)
        KERNEL_LANES
    for (int32_t i = 0; i < LAYERS_ROWS; i++) {
        int32_t begin = RAST_SIZE, end = 0;
        stretch(a, band + i, &begin, &end);
        stretch(b, band + i, &begin, &end);
        stretch(c, band + i, &begin, &end);
        stretch(d, band + i, &begin, &end);
        stretch(e, band + i, &begin, &end);
        stretch(f, band + i, &begin, &end);
        stretch(g, band + i, &begin, &end);
        stretch(h, band + i, &begin, &end);
        cover(begin, end, base, whole + band + i, seen + band + i);
    }
}

/* One word of every row. */
static void draw_word(const layers_block *block, int32_t lane, int32_t word, layers *restrict out)
{
    int32_t const base = out->whole.column + 64 * word;
    uint64_t *const whole = out->whole.word[word];
    memset(whole + out->whole.first, 0, (size_t)(out->whole.last - out->whole.first) * sizeof *whole);
    for (int32_t k = 0; k < block->drawn[lane]; k++) {
        int32_t const l = block->order[lane][k];
        if (block->vertices[l] == 4)
            draw_cone(&block->limb[l], lane, base, whole, out->visible[l].word[word]);
        else
            draw_ellipsoid(&block->limb[l], lane, base, whole, out->visible[l].word[word]);
    }
}

void KERNEL(layers_draw)(const layers_block *block, int32_t lane, layers *restrict out)
{
    int32_t const column = block->column[lane], width = block->width[lane];
    out->whole.first = block->first[lane];
    out->whole.last = block->last[lane];
    out->whole.column = column;
    out->whole.width = width;
    for (int32_t l = 0; l < block->count; l++) {
        out->visible[l].first = block->limb[l].top[lane];
        out->visible[l].last = block->limb[l].end[lane];
        out->visible[l].column = column;
        out->visible[l].width = width;
    }
    for (int32_t word = 0; 64 * word < width; word++)
        draw_word(block, lane, word, out);
}
