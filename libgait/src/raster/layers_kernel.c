/* The limbs of a block of bodies as lines in the grid, one lane a body; then the lines of one body as masks,
 * one lane a row, each limb without the cells that nearer limbs hide. */
#include "base/dispatch.h"
#include "base/fmath.h"
#include "base/simd16.h"
#include "raster/layers.h"

#include <string.h>

/* ---- lines, lanes are bodies ---- */

/* Corners are clamped to this many cells from the grid's first, and slopes to SHALLOW: a line that crosses
 * two rows cannot be shallower, and one that crosses a single row is exact there. */
#define FAR_CELLS 512.0f
#define SHALLOW   (2.0f * FAR_CELLS) /* cells in a row */
#define NOWHERE   1e6f               /* column of a line that does not bound anything */

/* Working pixels to grid cells: the centre of cell c is working pixel 2 c + 1/2. */
static inline float to_cell(float v, float far)
{
    return f_clamp(0.5f * v - 0.25f, -far, far);
}

/* First row whose centre is at or below y. */
static inline int32_t row_from(float y)
{
    enum { BELOW = 1024 }; /* makes the number positive before it is rounded down */
    return BELOW - (int32_t)((float)BELOW - y);
}

typedef struct box { /* bounding box, cells */
    int32_t left[BLOCK], right[BLOCK], top[BLOCK], end[BLOCK];
} box;

static box box_empty(void)
{
    box b;
    for (int32_t i = 0; i < BLOCK; i++) {
        b.left[i] = b.top[i] = GRID_SIZE;
        b.right[i] = b.end[i] = 0;
    }
    return b;
}

/* The first where all bits of a mask are set, the second where none is. */
static inline int32_t choose(int32_t mask, int32_t a, int32_t b)
{
    return (a & mask) | (b & ~mask);
}

/* Clip the rows of a limb, and extend the box of the body by them in whole bands of rows. */
static void box_join(box *restrict body, const box *restrict limb, const float *restrict depth,
                     layers_limb *restrict out)
{
    for (int32_t i = 0; i < BLOCK; i++) {
        int32_t const top = i_max(limb->top[i], 0), end = i_min(limb->end[i], GRID_SIZE);
        int32_t const front = -(int32_t)(depth[i] > 0.0f), met = front & -(int32_t)(top < end);
        out->top[i] = top & met;
        out->end[i] = end & met;
        body->top[i] = i_min(body->top[i], choose(met, top & -LAYERS_BAND, GRID_SIZE));
        body->end[i] = i_max(body->end[i], (end + LAYERS_BAND - 1) & -LAYERS_BAND & met);
        body->left[i] = i_min(body->left[i], choose(met, limb->left[i], GRID_SIZE));
        body->right[i] = i_max(body->right[i], limb->right[i] & met);
    }
}

typedef struct corners { /* cells */
    float x[RAST_MAX_VERTICES][BLOCK], y[RAST_MAX_VERTICES][BLOCK];
    int32_t row[RAST_MAX_VERTICES][BLOCK]; /* the first whose centre is at or below the corner */
} corners;

static void corners_of(const outline_lanes *limb, int32_t n, corners *restrict c, box *restrict own)
{
    float const far = f_bound(FAR_CELLS);
    for (int32_t k = 0; k < n; k++)
        for (int32_t i = 0; i < BLOCK; i++) {
            float const x = to_cell(limb->x[k][i], far), y = to_cell(limb->y[k][i], far);
            int32_t const column = row_from(x), row = row_from(y);
            c->x[k][i] = x;
            c->y[k][i] = y;
            c->row[k][i] = row;
            /* one more column on each side, because lines are rounded */
            own->left[i] = i_min(own->left[i], column - 2);
            own->right[i] = i_max(own->right[i], column + 2);
            own->top[i] = i_min(own->top[i], row);
            own->end[i] = i_max(own->end[i], row);
        }
}

/* The lines of a limb by [at, slope][left, right][body]. */
typedef float line_lanes[2][2][BLOCK];

/* The side from corner j to corner k. Going down, it is on the right if the corners are in clockwise order. */
static void side(const corners *c, int32_t j, int32_t k, const int32_t *clockwise, line_lanes *restrict out)
{
    float const nowhere = f_bound(NOWHERE), shallow = f_bound(SHALLOW);
    KERNEL_LANES
    for (int32_t i = 0; i < BLOCK; i++) {
        bool const down = c->y[j][i] < c->y[k][i];
        float const x0 = down ? c->x[j][i] : c->x[k][i], y0 = down ? c->y[j][i] : c->y[k][i];
        float const dx = c->x[k][i] - c->x[j][i], dy = c->y[k][i] - c->y[j][i];
        int32_t const first = i_min(c->row[j][i], c->row[k][i]);
        bool const crosses = c->row[j][i] != c->row[k][i], right = down == clockwise[i];
        float const slope = f_clamp(dx / (crosses ? dy : 1.0f), -nowhere, nowhere);
        float const steep = f_clamp(slope, -shallow, shallow);
        float const at = x0 + slope * ((float)first - y0) - steep * (float)first;
        bool const to_left = crosses & !right, to_right = crosses & right;
        (*out)[0][0][i] = to_left ? at : (*out)[0][0][i];
        (*out)[0][1][i] = to_right ? -at : (*out)[0][1][i];
        (*out)[1][0][i] = to_left ? steep : (*out)[1][0][i];
        (*out)[1][1][i] = to_right ? -steep : (*out)[1][1][i];
    }
}

/* Lines of the sides of a cone. Its ends are parallel: one of them is on the left, the other on the right. Its long
 * sides are almost so. */
enum { ONLY_LONG, END, LONG };

/* Unless both long sides are on the left or both on the right, which is rare, no side of the body has more than one of
 * them. */
static void join_long_sides(line_lanes *restrict line, int32_t *restrict lines)
{
    float const nowhere = f_bound(-NOWHERE);
    for (int32_t i = 0; i < BLOCK; i++)
        lines[i] = 2;
    for (int32_t right = 0; right < 2; right++)
        for (int32_t i = 0; i < BLOCK; i++) {
            float const a = line[LONG][0][right][i], b = line[LONG + 1][0][right][i];
            uint32_t const first = m_less(nowhere, a), both = first & m_less(nowhere, b);
            line[ONLY_LONG][0][right][i] = m_select(both, nowhere, m_select(first, a, b));
            line[ONLY_LONG][1][right][i] = line[LONG][1][right][i] + line[LONG + 1][1][right][i];
            lines[i] |= (int32_t)both & LAYERS_LINES;
        }
}

/* Opposite sides of an octagon are parallel, too. */
static void limb_lines(const outline_lanes *limb, int32_t n, box *restrict body, layers_limb *restrict out)
{
    corners c;
    int32_t clockwise[BLOCK];
    box own = box_empty();
    line_lanes *const line = (line_lanes *)out->line; /* transposed when the columns are known */
    corners_of(limb, n, &c, &own);
    for (int32_t i = 0; i < BLOCK; i++) {
        int32_t const a = n / 4, b = n / 2, d = n / 4 + n / 2;
        clockwise[i] = (c.x[b][i] - c.x[0][i]) * (c.y[d][i] - c.y[a][i]) >
                       (c.y[b][i] - c.y[0][i]) * (c.x[d][i] - c.x[a][i]);
    }
    for (int32_t slot = 0; slot < LAYERS_LINES; slot++)
        for (int32_t right = 0; right < 2; right++)
            for (int32_t i = 0; i < BLOCK; i++) {
                line[slot][0][right][i] = -NOWHERE;
                line[slot][1][right][i] = 0.0f;
            }
    for (int32_t k = 0; k < n; k++)
        side(&c, k, (k + 1) % n, clockwise, &line[n > 4 ? k % LAYERS_LINES : k % 2 ? END : LONG + k / 2]);
    if (n > 4)
        for (int32_t i = 0; i < BLOCK; i++)
            out->lines[i] = LAYERS_LINES;
    else
        join_long_sides(line, out->lines);
    box_join(body, &own, limb->depth, out);
}

/* Make columns relative to the first one of each body, and transpose to body by body. */
static void deal_lines(const int32_t *column, layers_limb *restrict out)
{
    line_lanes line[LAYERS_LINES];
    memcpy(line, out->line, sizeof line);
    for (int32_t slot = 0; slot < LAYERS_LINES; slot++)
        for (int32_t i = 0; i < BLOCK; i++) {
            line[slot][0][0][i] -= (float)column[i];
            line[slot][0][1][i] += (float)column[i];
        }
    simd16_transpose((const float (*)[SIMD16])line, (float (*)[SIMD16])out->line);
}

/* Most bodies are no wider than a word, which begins at a multiple of GRID_STEP. */
static void choose_columns(const box *body, layers_block *restrict out)
{
    for (int32_t i = 0; i < BLOCK; i++) {
        int32_t const column = i_clamp(body->left[i], 0, 63) / GRID_STEP * GRID_STEP;
        bool const fits = i_min(body->right[i], GRID_SIZE) - column <= 64;
        out->first[i] = i_min(body->top[i], body->end[i]);
        out->last[i] = body->end[i];
        out->column[i] = fits ? column : 0;
        out->width[i] = fits ? 64 : GRID_SIZE;
    }
}

/* The depth order by counting, for each limb, the limbs before it. */
static void depth_order(const outline_lanes *limb, int32_t count, layers_block *restrict out)
{
    float key[MODEL_MAX_LIMBS][BLOCK];
    for (int32_t l = 0; l < count; l++)
        for (int32_t i = 0; i < BLOCK; i++) {
            int32_t const front = limb[l].depth[i] > 0.0f;
            key[l][i] = front ? f_min(limb[l].depth[i], FLT_MAX) : INFINITY;
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
        int32_t const n = outline_vertices(&limbs[l]);
        limb_lines(&outline->limb[l], n, &body, &out->limb[l]);
    }
    choose_columns(&body, out);
    for (int32_t l = 0; l < count; l++)
        deal_lines(out->column, &out->limb[l]);
    depth_order(outline->limb, count, out);
}

/* ---- masks, lanes are rows ---- */

#define SLACK (1.0f / 1024.0f) /* cells: allowed for rounding errors of a column */

#ifdef SIMD4
typedef struct side_lines { /* of one side of a polygon, each in all four elements */
    simd4_f at[LAYERS_LINES], slope[LAYERS_LINES];
} side_lines;

static inline side_lines side_of(const float *line, int32_t lines)
{
    side_lines s;
#pragma GCC unroll 4
    for (int32_t k = 0; k < lines; k++) {
        s.at[k] = simd4_all(line[4 * k]);
        s.slope[k] = simd4_all(line[4 * k + 2]);
    }
    return s;
}

static inline simd4_f column_of(const side_lines *s, int32_t lines, simd4_f y)
{
    simd4_f x = s->at[0] + s->slope[0] * y;
#pragma GCC unroll 4
    for (int32_t k = 1; k < lines; k++)
        x = simd4_max(s->at[k] + s->slope[k] * y, x);
    return x;
}

/* The bits of one limb in one word, four rows at once. */
static inline __attribute__((always_inline)) void draw_limb(const float *line, int32_t lines, int32_t top,
                                                            int32_t end, uint64_t *restrict whole,
                                                            uint64_t *restrict visible)
{
    simd4_f const slack = simd4_all(1.0f - SLACK), most = simd4_all(64.0f);
    simd4_f const from = simd4_all((float)top), to = simd4_all((float)end);
    int32_t const first = top & -4;
    side_lines const left = side_of(line, lines), right = side_of(line + 1, lines);
    const uint64_t *const last = whole + end;
    simd4_f y = simd4_all((float)first) + (simd4_f){0.0f, 1.0f, 2.0f, 3.0f};
    memset(visible + (top & -LAYERS_BAND), 0, 4 * sizeof *visible); /* rows before `first` */
    visible += first;
    for (whole += first; whole < last; whole += 4) {
        simd4_f const begin = simd4_min(column_of(&left, lines, y) + slack, most);
        simd4_f const stop = simd4_min(slack - column_of(&right, lines, y), most);
        simd4_cover(begin, simd4_inside(y, from, to, stop), whole, visible);
        y += simd4_all(4.0f);
        visible += 4;
    }
}
#else
/* The first cell of a word whose centre is at or right of a column, except for rounding errors. */
static inline int32_t cell_from(float x)
{
    return i_max((int32_t)f_min(x + (1.0f - SLACK), 64.0f), 0);
}

/* The bits of one limb in one word, SIMD16_ROWS rows at once, each as a left and a right column. Arrays are
 * stored and loaded in pieces of the same size, so that loads do not wait. */
static inline __attribute__((always_inline)) void draw_limb(const float *line, int32_t lines, int32_t top,
                                                            int32_t end, uint64_t *restrict whole,
                                                            uint64_t *restrict visible)
{
    float at[LAYERS_LINES][2 * SIMD16_ROWS], slope[LAYERS_LINES][2 * SIMD16_ROWS], y[2 * SIMD16_ROWS];
    float const from = (float)top, to = (float)end;
    int32_t const first = top / LAYERS_BAND * LAYERS_BAND;
    simd16_repeat(line, 2 * SIMD16_ROWS, at[0]);
    simd16_repeat(line + 2, 2 * SIMD16_ROWS, slope[0]);
    simd16_repeat(line + 4, 2 * SIMD16_ROWS, at[1]);
    simd16_repeat(line + 6, 2 * SIMD16_ROWS, slope[1]);
    if (lines > 2) {
        simd16_repeat(line + 8, 2 * SIMD16_ROWS, at[2]);
        simd16_repeat(line + 10, 2 * SIMD16_ROWS, slope[2]);
        simd16_repeat(line + 12, 2 * SIMD16_ROWS, at[3]);
        simd16_repeat(line + 14, 2 * SIMD16_ROWS, slope[3]);
    }
    for (int32_t i = 0; i < 2 * SIMD16_ROWS; i++)
        y[i] = (float)(first + (i >> 1));
    for (int32_t strip = first; strip < end; strip += SIMD16_ROWS) {
        int32_t span[2 * SIMD16_ROWS];
        for (int32_t i = 0; i < 2 * SIMD16_ROWS; i++) {
            float const sign = (float)(1 - 2 * (i & 1));
            float x = at[0][i] + slope[0][i] * y[i];
            x = f_max(at[1][i] + slope[1][i] * y[i], x);
            x = lines > 2 ? f_max(at[2][i] + slope[2][i] * y[i], x) : x;
            x = lines > 2 ? f_max(at[3][i] + slope[3][i] * y[i], x) : x;
            span[i] = cell_from(sign * x) & -(int32_t)((y[i] >= from) & (y[i] < to));
            y[i] += (float)SIMD16_ROWS;
        }
        simd16_cover(span, whole + strip, visible + strip);
    }
}
#endif

/* Draw one word of every row. */
static void draw_word(const layers_block *block, int32_t lane, int32_t word, layers *restrict out)
{
    uint64_t *const whole = out->whole.word[word];
    memset(whole + out->whole.first, 0, (size_t)(out->whole.last - out->whole.first) * sizeof *whole);
    for (int32_t k = 0; k < block->count; k++) {
        int32_t const l = block->order[lane][k];
        const layers_limb *const limb = &block->limb[l];
        float const *line = limb->line[lane];
        float moved[SIMD16];
        if (word) {
            for (int32_t i = 0; i < SIMD16; i++)
                moved[i] = line[i] + (i & 2 ? 0.0f : (float)(i & 1 ? 64 : -64));
            line = moved;
        }
        if (limb->lines[lane] == 2)
            draw_limb(line, 2, limb->top[lane], limb->end[lane], whole, out->visible[l].word[word]);
        else
            draw_limb(line, LAYERS_LINES, limb->top[lane], limb->end[lane], whole,
                      out->visible[l].word[word]);
    }
}

void KERNEL(layers_draw)(const layers_block *block, int32_t lane, layers *restrict out)
{
    int32_t const column = block->column[lane], width = block->width[lane];
    grid_mask_frame(&out->whole, block->first[lane], block->last[lane], column, width);
    for (int32_t l = 0; l < block->count; l++)
        grid_mask_frame(&out->visible[l], block->limb[l].top[lane] / LAYERS_BAND * LAYERS_BAND,
                        block->limb[l].end[lane], column, width);
    for (int32_t word = 0; 64 * word < width; word++)
        draw_word(block, lane, word, out);
}
