#include "image/features.h"
#include "base/base.h"

features features_layout(arena *a)
{
    features f = {0};
    f.edge = TAKE(a, edge_cell, VIEW_PIXELS);
    f.pairs = TAKE(a, uint16_t, VIEW_PIXELS);
    f.foreground =
        (uint64_t (*)[GRID_SIZE][GRID_WORDS])arena_take(a, sizeof *f.foreground, FOREGROUND_PLANES);
    f.inside = (uint64_t (*)[GRID_WORDS])arena_take(a, sizeof *f.inside, GRID_SIZE);
    f.words = (uint64_t (*)[FOREGROUND_PLANES + 1][GRID_SIZE]) arena_take(a, sizeof *f.words, GRID_STARTS);
    return f;
}

features_scratch features_scratch_layout(arena *a)
{
    features_scratch s;
    s.planes = view_planes_layout(a, 3);
    s.grey = TAKE(a, uint8_t, VIEW_PIXELS);
    s.surface = TAKE(a, int8_t, VIEW_PIXELS);
    s.rows = TAKE(a, edge_rows, 1);
    return s;
}

/* Recompute which cells lie inside the camera's image if the region has moved. */
static void refresh_inside(const kernels *run, features *f, const gait_camera *cam)
{
    const view_map *const now = &f->map, *const then = &f->inside_map;
    if (now->scale == then->scale && now->u0 == then->u0 && now->v0 == then->v0)
        return;
    run->view_inside(now, cam, f->inside);
    f->inside_map = *now;
}

/* Take out the cells whose middle shows another person. */
static void leave_others(features *f)
{
    const gait_image *const p = f->people;
    float const step = 2.0f / f->map.scale, first = 0.25f * step + 0.5f;
    f->inside_map.scale = 0.0f;
    for (int32_t i = 0; i < GRID_SIZE * GRID_SIZE; i++) {
        int32_t const x = i % GRID_SIZE, y = i / GRID_SIZE;
        float const u = f->map.u0 + first + step * (float)x, v = f->map.v0 + first + step * (float)y;
        if (!(u >= 0.0f && v >= 0.0f && u < (float)p->width && v < (float)p->height))
            continue;
        uint8_t const who = p->data[(int32_t)v * (ptrdiff_t)p->stride + (int32_t)u];
        if (who && who != f->person)
            f->inside[y][x / 64] &= ~((uint64_t)1 << x % 64);
    }
}

void features_begin(features *f, const gait_image *im, features_scratch *s)
{
    f->has_image = im->data != NULL;
    f->has_foreground = false;
    s->planes.channels = image_channels(im->format);
}

void features_sample(const kernels *run, const features *f, int32_t band, const gait_camera *cam,
                     const gait_image *im, features_scratch *s)
{
    enum { ROWS = VIEW_SIZE / FEATURES_BANDS };
    if (!f->has_image)
        return;
    run->view_rows(&f->map, cam, im, band * ROWS, (band + 1) * ROWS, &s->planes);
    run->view_grey(&s->planes, band * ROWS, (band + 1) * ROWS, s->grey);
}

/* One word of each row, beginning at a column. */
static void words_of(const uint64_t (*row)[GRID_WORDS], int32_t column, uint64_t *restrict out)
{
    for (int32_t y = 0; y < GRID_SIZE; y++)
        out[y] = column < 64 ? row[y][0] >> column | row[y][1] << 1 << (63 - column) : row[y][1];
}

void features_words(features *f)
{
    for (int32_t s = 0; s < GRID_STARTS; s++) {
        for (int32_t k = 0; k < FOREGROUND_PLANES; k++)
            words_of((const uint64_t (*)[GRID_WORDS])f->foreground[k], s * GRID_STEP, f->words[s][k]);
        words_of((const uint64_t (*)[GRID_WORDS])f->inside, s * GRID_STEP, f->words[s][FOREGROUND_PLANES]);
    }
}

static void foreground(const kernels *run, features *f, const gait_camera *cam, const view_planes *plate,
                       const features_scratch *s)
{
    view_planes const luma = {.channel = {s->grey}, .channels = 1};
    refresh_inside(run, f, cam);
    if (f->people)
        leave_others(f);
    f->has_foreground = plate != NULL;
    if (!f->has_foreground)
        return;
    run->features_foreground(f, plate->channels == 1 ? &luma : &s->planes, plate);
    features_words(f);
}

static void surface(const kernels *run, features *f, bool raw, const features_scratch *s)
{
    if (raw)
        for (int32_t i = 0; i < VIEW_PIXELS; i++)
            s->surface[i] = (int8_t)i_max(s->grey[i] - 128, -127);
    else
        run->features_contrast(s->grey, s->surface);
    run->features_pairs(s->surface, f->pairs);
}

void features_map(const kernels *run, features *f, int32_t map, const gait_camera *cam,
                  const view_planes *plate, bool raw, features_scratch *s)
{
    if (map == FEATURES_EDGES)
        run->features_edges(s->grey, f->edge, s->rows);
    else if (map == FEATURES_SURFACE)
        surface(run, f, raw, s);
    else
        foreground(run, f, cam, plate, s);
}
