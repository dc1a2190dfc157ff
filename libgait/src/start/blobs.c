#include "start/blobs.h"
#include <string.h>

enum {
    LEAST_STEP = 14,   /* smallest change that counts, grey levels */
    NOISE_STEPS = 5,   /* the same in robust standard deviations of the image noise */
    SCENE_CHANGE = 18, /* change of half of an image from which it shows another scene, grey levels */
    GAP = 3,           /* cells of low contrast that may interrupt a body */
    LEAST_HEIGHT = 15, /* of a person, cells */
    PEOPLE_PART =
        2, /* if fewer than half of the changed cells belong to people, the background does not fit */
    MOST_CELLS = 320 /* in each direction */
};

/* Bin of a histogram that holds the median. */
static int32_t middle_of(const int32_t *count, int32_t bins)
{
    int64_t total = 0, sum = 0;
    int32_t i = 0;
    for (int32_t k = 0; k < bins; k++)
        total += count[k];
    while (i < bins - 1 && (sum += count[i]) * 2 < total)
        i++;
    return i;
}

static int32_t i_abs(int32_t x)
{
    return x < 0 ? -x : x;
}

/* Grey level of a pixel: of one channel, or of all if the formats differ (channel -1). */
static int32_t level(const gait_image *image, int32_t x, int32_t y, int32_t channel)
{
    const uint8_t *const row = image->data + (ptrdiff_t)y * image->stride;
    if (image->format == GAIT_GREY8)
        return row[x];
    return channel >= 0 ? row[3 * x + channel] : (row[3 * x] + 2 * row[3 * x + 1] + row[3 * x + 2]) / 4;
}

static int32_t difference(const blob_finder *f, const gait_image *a, const gait_image *b, int32_t cell,
                          int32_t channel)
{
    int32_t const x = cell % f->width * f->step, y = cell / f->width * f->step;
    return level(a, x, y, channel) - level(b, x, y, channel);
}

/* Change of each cell against the background, less the median change: most of the image is background, so that is the
 * change of the exposure. */
static void compare(const blob_finder *f, const gait_image *image, const gait_image *background)
{
    bool const alike = image->format == background->format && image->format != GAIT_GREY8;
    int32_t const cells = f->width * f->height, first = alike ? 0 : -1, last = alike ? 2 : -1;
    memset(f->change, 0, (size_t)cells * sizeof *f->change);
    for (int32_t c = first; c <= last; c++) {
        int32_t count[511] = {0};
        for (int32_t i = 0; i < cells; i++)
            count[255 + difference(f, image, background, i, c)]++;
        int32_t const exposure = middle_of(count, 511) - 255;
        for (int32_t i = 0; i < cells; i++) {
            int32_t const d = i_min(i_abs(difference(f, image, background, i, c) - exposure), 255);
            f->change[i] = (int16_t)(d > f->change[i] ? d : f->change[i]);
        }
    }
}

/* Mean over 3 x 3 cells, in quarters of a grey level; returns four times the median. */
static int32_t smooth(const blob_finder *f)
{
    int32_t count[1024] = {0};
    for (int32_t y = 0; y < f->height; y++)
        for (int32_t x = 0; x < f->width; x++) {
            int32_t sum = 0, n = 0;
            for (int32_t v = y - (y > 0); v <= y + (y < f->height - 1); v++)
                for (int32_t u = x - (x > 0); u <= x + (x < f->width - 1); u++, n++)
                    sum += f->change[v * f->width + u];
            f->smooth[y * f->width + x] = (int16_t)(4 * sum / n);
            count[4 * sum / n]++;
        }
    return middle_of(count, 1024);
}

typedef struct patch {
    int32_t x0, x1, y0, y1, area; /* x1 and y1 included; cells */
} patch;

/* All cells connected to `from`, over vertical gaps of up to GAP cells, into f->queue. */
static patch flood(const blob_finder *f, int32_t from)
{
    patch p = {f->width, 0, f->height, 0, 0};
    f->queue[p.area++] = from;
    f->mask[from] = 2;
    for (int32_t k = 0; k < p.area; k++) {
        int32_t const x = f->queue[k] % f->width, y = f->queue[k] / f->width;
        p.x0 = x < p.x0 ? x : p.x0;
        p.x1 = x > p.x1 ? x : p.x1;
        p.y0 = y < p.y0 ? y : p.y0;
        p.y1 = y > p.y1 ? y : p.y1;
        for (int32_t v = y - GAP; v <= y + GAP; v++)
            for (int32_t u = x - 1; u <= x + 1; u++)
                if (u >= 0 && u < f->width && v >= 0 && v < f->height && f->mask[v * f->width + u] == 1) {
                    f->mask[v * f->width + u] = 2;
                    f->queue[p.area++] = v * f->width + u;
                }
    }
    return p;
}

/* Whether a region is in full view and upright, and fills its box as a standing person does. */
static bool person_like(const blob_finder *f, const patch *p)
{
    int32_t const wide = p->x1 - p->x0 + 1, tall = p->y1 - p->y0 + 1;
    return p->x0 > 0 && p->y0 > 0 && p->x1 < f->width - 1 && p->y1 < f->height - 1 && tall >= LEAST_HEIGHT &&
           tall > wide && 20 * p->area > 3 * wide * tall;
}

/* Median column of the region in f->queue between two rows, cells. */
static double column_of(const blob_finder *f, const patch *p, int32_t last_row)
{
    int32_t count[MOST_CELLS] = {0};
    for (int32_t k = 0; k < p->area; k++)
        if (f->queue[k] / f->width <= last_row)
            count[f->queue[k] % f->width]++;
    return (double)middle_of(count, f->width);
}

static gait_box measure(const blob_finder *f, const patch *p)
{
    double const s = f->step, tall = p->y1 - p->y0 + 1;
    int32_t const crown = p->y0 + (int32_t)(0.1 * tall);
    return (gait_box){.foot = {(float)(s * column_of(f, p, p->y1)), (float)(s * (p->y1 + 0.5))},
                      .head = {(float)(s * column_of(f, p, crown)), (float)(s * (p->y0 - 0.5))},
                      .sd = (float)s};
}

blob_finder blob_finder_layout(arena *a, int32_t width, int32_t height)
{
    int32_t const larger = i_max(width, height), step = (larger + MOST_CELLS - 1) / MOST_CELLS;
    blob_finder f = {.step = step, .width = i_max(width / step, 1), .height = i_max(height / step, 1)};
    int32_t const cells = f.width * f.height;
    f.change = TAKE(a, int16_t, cells);
    f.smooth = TAKE(a, int16_t, cells);
    f.mask = TAKE(a, uint8_t, cells);
    f.queue = TAKE(a, int32_t, cells);
    return f;
}

bool blob_other_scene(const blob_finder *f, const gait_image *image, const gait_image *background)
{
    compare(f, image, background);
    return smooth(f) > 4 * SCENE_CHANGE;
}

int32_t blob_find(const blob_finder *f, const gait_image *image, const gait_image *background, gait_box *out,
                  int32_t capacity)
{
    int32_t area[GAIT_START_MAX_PEOPLE], found = 0;
    int64_t changed = 0, of_people = 0; /* cells */
    int32_t const most = i_min(capacity, GAIT_START_MAX_PEOPLE);
    compare(f, image, background);
    int32_t const noise = NOISE_STEPS * smooth(f) * 3 / 2, least = i_max(noise, 4 * LEAST_STEP);
    for (int32_t i = 0; i < f->width * f->height; i++)
        f->mask[i] = f->smooth[i] > least;
    for (int32_t i = 0; i < f->width * f->height; i++) {
        if (f->mask[i] != 1)
            continue;
        patch const p = flood(f, i);
        changed += p.area;
        of_people += person_like(f, &p) ? p.area : 0;
        if (!person_like(f, &p) || (found == most && p.area <= area[found - 1]))
            continue;
        int32_t at = found < most ? found++ : found - 1;
        for (; at > 0 && area[at - 1] < p.area; at--) {
            area[at] = area[at - 1];
            out[at] = out[at - 1];
        }
        area[at] = p.area;
        out[at] = measure(f, &p);
    }
    return of_people * PEOPLE_PART < changed ? 0 : found;
}
