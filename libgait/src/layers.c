#include "layers.h"
#include <string.h>

int32_t layers_order(const float *depth, int32_t stride, int32_t limbs, int32_t *order)
{
    int32_t n = 0;
    for (int32_t l = 0; l < limbs; l++) {
        float const d = depth[l * stride];
        if (!(d > 0.0f))
            continue;
        int32_t k = n++;
        for (; k > 0 && depth[order[k - 1] * stride] > d; k--)
            order[k] = order[k - 1];
        order[k] = l;
    }
    return n;
}

void layers_polygon(const outline_block *outline, int32_t limb, int32_t vertices, int32_t lane, float *x,
                    float *y)
{
    for (int32_t k = 0; k < vertices; k++) {
        x[k] = 0.5f * outline->x[limb][k][lane] - 0.25f; /* centre of cell c is working pixel 2 c + 1/2 */
        y[k] = 0.5f * outline->y[limb][k][lane] - 0.25f;
    }
}

void layers_draw(const outline_block *outline, const limb_geometry *limbs, int32_t count, int32_t lane,
                 layers *out)
{
    int32_t order[MODEL_MAX_LIMBS];
    int32_t const drawn = layers_order(&outline->depth[0][lane], BLOCK, count, order);
    memset(out->whole.row, 0, sizeof out->whole.row);
    out->whole.first = RAST_SIZE;
    out->whole.last = 0;
    for (int32_t l = 0; l < count; l++)
        out->visible[l].first = out->visible[l].last = 0;
    for (int32_t k = 0; k < drawn; k++) {
        int32_t const l = order[k], n = outline_vertices(&limbs[l]);
        float x[RAST_MAX_VERTICES], y[RAST_MAX_VERTICES];
        rast_spans spans;
        rast_mask *const mask = &out->visible[l];
        layers_polygon(outline, l, n, lane, x, y);
        rast_convex(x, y, n, 0, RAST_SIZE, &spans);
        rast_fill(&spans, mask);
        out->whole.first = i_min(out->whole.first, mask->first);
        out->whole.last = i_max(out->whole.last, mask->last);
        for (int32_t row = mask->first; row < mask->last; row++)
            for (int32_t w = 0; w < RAST_WORDS; w++) {
                uint64_t const covered = out->whole.row[row][w];
                out->whole.row[row][w] = covered | mask->row[row][w];
                mask->row[row][w] &= ~covered;
            }
    }
    if (out->whole.first > out->whole.last)
        out->whole.first = out->whole.last = 0;
}
