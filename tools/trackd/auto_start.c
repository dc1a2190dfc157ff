#include "auto_start.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* ---- blobs ---- */
enum {
    LEAST_STEP = 14, /* smallest change that counts, grey levels */
    NOISE_STEPS = 5, /* the same in robust standard deviations of the image noise */
    ANOTHER = 18,    /* change of half of an image that means another scene, grey levels */
    GAP = 3,         /* cells of low contrast that may interrupt a body */
    LEAST_HEIGHT = 15
};

/* Where the running sum of a histogram passes half of it. */
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

/* Change of each cell against the background, less that of the exposure: most of the image is background. */
static void compare(blob_finder *f, const gait_image *image, const gait_image *plate)
{
    bool const alike = image->format == plate->format && image->format != GAIT_GREY8;
    int32_t const cells = f->width * f->height, first = alike ? 0 : -1, last = alike ? 2 : -1;
    memset(f->change, 0, (size_t)cells * sizeof *f->change);
    for (int32_t c = first; c <= last; c++) {
        int32_t count[511] = {0};
        for (int32_t i = 0; i < cells; i++)
            count[255 + difference(f, image, plate, i, c)]++;
        int32_t const exposure = middle_of(count, 511) - 255;
        for (int32_t i = 0; i < cells; i++) {
            int32_t const d = abs(difference(f, image, plate, i, c) - exposure);
            f->change[i] = (int16_t)(d > f->change[i] ? d : f->change[i]);
        }
    }
}

/* Mean over 3 x 3 cells, in quarters of a grey level; returns four times the median. */
static int32_t smooth(blob_finder *f)
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
    int32_t x0, x1, y0, y1, area; /* the last ones belong to it */
} patch;

/* All cells connected to `from`, over vertical gaps of up to GAP cells, into f->queue. */
static patch flood(blob_finder *f, int32_t from)
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

/* Whether it is in full view and upright, and fills its box as a standing person does. */
static bool person_like(const blob_finder *f, const patch *p)
{
    int32_t const wide = p->x1 - p->x0 + 1, tall = p->y1 - p->y0 + 1;
    return p->x0 > 0 && p->y0 > 0 && p->x1 < f->width - 1 && p->y1 < f->height - 1 && tall >= LEAST_HEIGHT &&
           tall > wide && 20 * p->area > 3 * wide * tall;
}

/* Median column of the region in f->queue between two rows, cells. */
static double column_of(const blob_finder *f, const patch *p, int32_t last_row)
{
    int32_t count[BLOB_CELLS / 320] = {0};
    for (int32_t k = 0; k < p->area; k++)
        if (f->queue[k] / f->width <= last_row)
            count[f->queue[k] % f->width]++;
    return (double)middle_of(count, f->width);
}

static void measure(const blob_finder *f, const patch *p, blob *out)
{
    double const s = f->step, tall = p->y1 - p->y0 + 1;
    out->foot[0] = s * column_of(f, p, p->y1);
    out->foot[1] = s * (p->y1 + 0.5);
    out->head[0] = s * column_of(f, p, p->y0 + (int32_t)(0.1 * tall));
    out->head[1] = s * (p->y0 - 0.5);
    out->area = p->area;
}

/* Fill f->smooth; returns four times the median. */
static int32_t change(blob_finder *f, const gait_image *image, const gait_image *plate)
{
    int32_t const larger = image->width > image->height ? image->width : image->height;
    f->step = (larger + 319) / 320;
    f->width = image->width / f->step;
    f->height = image->height / f->step;
    compare(f, image, plate);
    return smooth(f);
}

bool blob_another_scene(blob_finder *f, const gait_image *image, const gait_image *plate)
{
    return change(f, image, plate) > 4 * ANOTHER;
}

bool blob_find(blob_finder *f, const gait_image *image, const gait_image *plate, blob *out)
{
    out->area = 0;
    int32_t const noise = NOISE_STEPS * change(f, image, plate) * 3 / 2,
                  least = noise > 4 * LEAST_STEP ? noise : 4 * LEAST_STEP;
    for (int32_t i = 0; i < f->width * f->height; i++)
        f->mask[i] = f->smooth[i] > least;
    for (int32_t i = 0; i < f->width * f->height; i++) {
        if (f->mask[i] != 1)
            continue;
        patch const p = flood(f, i);
        if (p.area > out->area && person_like(f, &p))
            measure(f, &p, out);
    }
    return out->area > 0;
}

/* ---- first state ---- */
/* As in python/gait/track/auto_start.py and person_detection.py. */
static const double WINDOW = 1.0, KEEP = 1.5; /* seconds */
static const double LEAD = 0.1; /* statures by which the lowest foot is nearer than the pelvis */
static const double DEPTH_SD = 0.10,
                    DEPTH_SHARE = 0.02;             /* along the ray: metres, and fraction of the distance */
static const double HEAD_SD = 0.03, SIDE_SD = 0.06; /* metres */
static const double SLOW = 0.4;                     /* metres per second below which a person stands */
static const double HEADING_SD = 0.2;               /* radians, at least */
static const double SHORTEST = 1.2, TALLEST = 2.4;  /* metres by foot and head ray */
static const float BUILD_SHARE = 0.25f;             /* of the standard deviations of scores and posture */
enum { ENOUGH = 8 };

void auto_start_reset(auto_start *s)
{
    s->count = 0;
}

/* Lens and, in the world, the direction of a pixel's ray; the lens distortion is undone by iteration. */
static void ray_of(const gait_camera *c, const double pixel[2], double lens[3], double ray[3])
{
    double const u = (pixel[0] - (double)c->cx) / (double)c->fx,
                 v = (pixel[1] - (double)c->cy) / (double)c->fy;
    const float *const k = c->distortion;
    double x = u, y = v;
    for (int i = 0; i < 20; i++) {
        double const r2 = x * x + y * y,
                     radial = 1 + r2 * ((double)k[0] + r2 * ((double)k[1] + r2 * (double)k[4]));
        double const dx = 2 * (double)k[2] * x * y + (double)k[3] * (r2 + 2 * x * x);
        double const dy = (double)k[2] * (r2 + 2 * y * y) + 2 * (double)k[3] * x * y;
        x = (u - dx) / radial;
        y = (v - dy) / radial;
    }
    for (int a = 0; a < 3; a++) {
        ray[a] = (double)c->R[a] * x + (double)c->R[3 + a] * y + (double)c->R[6 + a];
        lens[a] = -((double)c->R[a] * (double)c->t[0] + (double)c->R[3 + a] * (double)c->t[1] +
                    (double)c->R[6 + a] * (double)c->t[2]);
    }
}

/* Position of a blob that stands on the ground and is as tall as a person. */
static bool place_blob(const gait_camera *c, const blob *b, detection *out)
{
    double lens[3], foot[3], head[3];
    ray_of(c, b->foot, lens, foot);
    ray_of(c, b->head, lens, head);
    double const flat = hypot(foot[0], foot[1]), head_flat = hypot(head[0], head[1]);
    if (!(lens[2] > 0 && foot[2] < 0 && flat > 0 && head_flat > 0))
        return false;
    out->distance = -lens[2] / foot[2] * flat;
    out->away[0] = foot[0] / flat;
    out->away[1] = foot[1] / flat;
    out->head_slope = head[2] / head_flat;
    double const tall = lens[2] + out->distance * out->head_slope;
    return tall >= SHORTEST && tall <= TALLEST;
}

static int ascending(const void *a, const void *b)
{
    double const x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

static double median(double *values, int32_t n)
{
    qsort(values, (size_t)n, sizeof *values, ascending);
    return n % 2 ? values[n / 2] : 0.5 * (values[n / 2 - 1] + values[n / 2]);
}

/* Height of the crown over ground while walking, statures. */
static double crown_share(const gait_model *m, double stature)
{
    gait_model_info info;
    double sum = 0;
    int32_t crown = 0;
    gait_model_get_info(m, &info, NULL);
    for (int32_t j = 0; j < info.joints; j++)
        crown = strcmp(gait_model_joint_name(m, j), "head_top") == 0 ? j : crown;
    for (int i = 0; i < 8; i++) {
        gait_state s = {.phase = (float)i / 8, .stature = (float)stature};
        gait_pose pose;
        float height;
        if (gait_model_pelvis_height(m, &s, &height, NULL) != GAIT_OK ||
            gait_model_pose(m, &s, &pose, NULL) != GAIT_OK)
            return 1;
        sum += (double)(pose.joint[crown][2] + height);
    }
    return sum / 8 / stature;
}

static double depth_sd(double distance)
{
    return hypot(DEPTH_SD, DEPTH_SHARE * distance);
}

/* Stature and one common factor on the distances by the feet, from the height at which the head rays pass (a
 * linear Gaussian update); returns the factor. */
static double scale_of(const auto_start *s, double lens_height, const gait_model *m, gait_state *mean,
                       gait_state *sd)
{
    double at[AUTO_START_DETECTIONS], further[AUTO_START_DETECTIONS], distance[AUTO_START_DETECTIONS];
    double const share = crown_share(m, (double)mean->stature), known = (double)mean->stature;
    for (int32_t i = 0; i < s->count; i++) {
        distance[i] = s->past[i].distance + LEAD * known;
        at[i] = lens_height + distance[i] * s->past[i].head_slope;
        further[i] = lens_height + 1.1 * distance[i] * s->past[i].head_slope;
    }
    double const stature = median(at, s->count) / share,
                 slope = (median(further, s->count) / share - stature) / 0.1;
    double const middle = median(distance, s->count), factor_sd = depth_sd(middle) / middle;
    double const stature_var = (double)sd->stature * (double)sd->stature, factor_var = factor_sd * factor_sd;
    double const surprise = stature - known,
                 total = stature_var + slope * slope * factor_var + HEAD_SD * HEAD_SD;
    mean->stature = (float)(known + stature_var / total * surprise);
    sd->stature = (float)sqrt(stature_var - stature_var * stature_var / total);
    return 1 - slope * factor_var / total * surprise;
}

typedef struct path { /* straight, over the ground */
    double end[2], velocity[2], velocity_sd;
} path;

/* One coordinate of the line through the places: the median of the slopes of all pairs well apart (Theil
 * 1950). */
static void fit(const double *time, const double *place, int32_t n, double *end, double *velocity)
{
    static double slope[AUTO_START_DETECTIONS * AUTO_START_DETECTIONS / 2];
    double level[AUTO_START_DETECTIONS];
    int32_t const apart = n / 3 > 1 ? n / 3 : 1;
    int32_t count = 0;
    for (int32_t i = 0; i < n; i++)
        for (int32_t k = i + apart; k < n; k++)
            slope[count++] = (place[k] - place[i]) / (time[k] - time[i]);
    *velocity = median(slope, count);
    for (int32_t i = 0; i < n; i++)
        level[i] = place[i] - (time[i] - time[n - 1]) * *velocity;
    *end = median(level, n);
}

static path path_of(const auto_start *s, const double lens[3], double lead, double factor)
{
    double time[AUTO_START_DETECTIONS], place[2][AUTO_START_DETECTIONS], off[AUTO_START_DETECTIONS],
        mean = 0, square = 0;
    int32_t const n = s->count;
    path p;
    for (int32_t i = 0; i < n; i++) {
        double const d = (s->past[i].distance + lead) * factor;
        time[i] = 1e-6 * (double)(s->past[i].utime - s->past[0].utime);
        for (int a = 0; a < 2; a++)
            place[a][i] = lens[a] + d * s->past[i].away[a];
        mean += time[i] / n;
    }
    for (int a = 0; a < 2; a++)
        fit(time, place[a], n, &p.end[a], &p.velocity[a]);
    for (int32_t i = 0; i < n; i++) {
        double const back = time[i] - time[n - 1];
        off[i] = hypot(place[0][i] - p.end[0] - back * p.velocity[0],
                       place[1][i] - p.end[1] - back * p.velocity[1]);
        square += (time[i] - mean) * (time[i] - mean);
    }
    p.velocity_sd =
        3 * 1.4826 * median(off, n) / sqrt(square); /* 3: errors of neighbouring frames are correlated */
    return p;
}

/* Heading and cadence from the motion; false if it is too slow. */
static bool set_motion(const path *p, const gait_model *m, gait_state *mean, gait_state *sd)
{
    gait_model_info info;
    double const speed = hypot(p->velocity[0], p->velocity[1]),
                 speed_rel_sd = p->velocity_sd / (speed > 1e-6 ? speed : 1e-6);
    if (speed < SLOW || speed_rel_sd > 0.5)
        return false;
    gait_model_get_info(m, &info, NULL);
    mean->heading = (float)atan2(p->velocity[1], p->velocity[0]);
    sd->heading = (float)hypot(HEADING_SD, speed_rel_sd);
    double const rate = speed / (double)(info.stride_length * mean->stature);
    double const rate_sd = rate * hypot(speed_rel_sd, (double)(info.stride_length_sd / info.stride_length));
    double const known = 1 / ((double)sd->stride_hz * (double)sd->stride_hz),
                 measured = 1 / (rate_sd * rate_sd);
    mean->stride_hz = (float)(((double)mean->stride_hz * known + rate * measured) / (known + measured));
    sd->stride_hz = (float)(1 / sqrt(known + measured));
    return true;
}

static bool first_state(const auto_start *s, const gait_camera *camera, const gait_model *model,
                        gait_state *mean, gait_state *sd)
{
    double lens[3], ray[3], height_lead = LEAD * (double)mean->stature;
    ray_of(camera, (double[2]){(double)camera->cx, (double)camera->cy}, lens, ray);
    double const factor = scale_of(s, lens[2], model, mean, sd);
    path const p = path_of(s, lens, height_lead, factor);
    if (!set_motion(&p, model, mean, sd) ||
        gait_model_pelvis_height(model, mean, &mean->pelvis[2], NULL) != GAIT_OK)
        return false;
    double const x = p.end[0] - lens[0], y = p.end[1] - lens[1], distance = hypot(x, y),
                 depth = depth_sd(distance);
    mean->pelvis[0] = (float)p.end[0];
    mean->pelvis[1] = (float)p.end[1];
    sd->pelvis[0] = (float)(hypot(depth * x, SIDE_SD * y) / distance);
    sd->pelvis[1] = (float)(hypot(depth * y, SIDE_SD * x) / distance);
    sd->pelvis[2] = 0.03f;
    for (int k = 0; k < GAIT_MAX_COMPONENTS; k++)
        sd->coef[k] *= BUILD_SHARE;
    for (int a = 0; a < GAIT_MAX_ANGLES; a++)
        sd->offset[a] *= BUILD_SHARE;
    return true;
}

static double age(const auto_start *s, int64_t utime)
{
    return 1e-6 * (double)(utime - s->past[0].utime);
}

bool auto_start_add(auto_start *s, const gait_image *frame, const gait_image *plate,
                    const gait_camera *camera, const gait_model *model, int64_t utime, gait_state *mean,
                    gait_state *sd)
{
    blob b;
    detection one = {.utime = utime};
    while (s->count > 0 && (age(s, utime) >= KEEP || age(s, utime) < 0 || s->count == AUTO_START_DETECTIONS))
        memmove(s->past, s->past + 1, (size_t)--s->count * sizeof *s->past);
    if (!blob_find(&s->finder, frame, plate, &b) || !place_blob(camera, &b, &one))
        return false;
    if (s->count == 0 || utime > s->past[s->count - 1].utime)
        s->past[s->count++] = one;
    return s->count >= ENOUGH && age(s, utime) >= WINDOW && first_state(s, camera, model, mean, sd);
}
