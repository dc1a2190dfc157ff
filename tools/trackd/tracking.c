#include "tracking.h"

#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

/* ---- start trigger ---- */
void start_trigger_by_file(start_trigger *a, const init_state *init)
{
    *a = (start_trigger){
        .armed = true, .mean = init->mean, .sd = init->sd, .frame = init->frame, .last_frame = -1};
}

void start_trigger_by_time(start_trigger *a, const gait_state *mean, const gait_state *sd, int64_t utime,
                           int64_t before)
{
    *a = (start_trigger){.armed = true,
                         .mean = *mean,
                         .sd = *sd,
                         .frame = -1,
                         .utime = utime,
                         .before = before,
                         .last_frame = -1};
}

/* The frame of the start was lost: interpolate its capture time between its neighbours. */
static start_trigger_answer lost_frame(const start_trigger *a, int64_t number, int64_t frame_utime,
                                       int64_t *utime, message *why)
{
    if (a->last_frame < 0) {
        message_set(why,
                    "the stream began at frame %" PRId64 ", the start is for frame %" PRId64
                    ": begin it earlier or send START",
                    number, a->frame);
        return START_TRIGGER_MISSED;
    }
    double const share = (double)(a->frame - a->last_frame) / (double)(number - a->last_frame);
    *utime = a->last_utime + (int64_t)(share * (double)(frame_utime - a->last_utime));
    return START_TRIGGER_START;
}

static start_trigger_answer by_number(start_trigger *a, const image_view *frame, int64_t *utime, message *why)
{
    int64_t const number = frame->frame >= 0 ? frame->frame : a->received++;
    if (number == a->frame) {
        *utime = frame->utime;
        return START_TRIGGER_START;
    }
    if (number > a->frame)
        return lost_frame(a, number, frame->utime, utime, why);
    a->last_frame = number;
    a->last_utime = frame->utime;
    return START_TRIGGER_WAIT;
}

start_trigger_answer start_trigger_reached(start_trigger *a, const image_view *frame, double max_gap,
                                           int64_t *utime, message *why)
{
    start_trigger_answer answer = START_TRIGGER_START;
    *utime = a->utime ? a->utime : frame->utime;
    if (a->frame >= 0)
        answer = by_number(a, frame, utime, why);
    else if (a->utime ? frame->utime < a->utime : frame->utime == a->before)
        answer = START_TRIGGER_WAIT;
    double const late = (double)(frame->utime - *utime) * 1e-6;
    if (answer == START_TRIGGER_START && late > max_gap) {
        message_set(why,
                    "the first frame is %.3f s later than the start: begin the stream earlier or send START",
                    late);
        answer = START_TRIGGER_MISSED;
    }
    a->armed = answer == START_TRIGGER_WAIT;
    return answer;
}

/* ---- tracker ---- */
static size_t padded(size_t bytes)
{
    return (bytes + GAIT_ALIGN - 1) / GAIT_ALIGN * GAIT_ALIGN;
}

bool tracking_open(tracking *t, const char *model_path, const gait_tracker_config *config, message *why)
{
    gait_error err = {.text = ""};
    *t = (tracking){.config = *config};
    if (!model_file_open(&t->file, model_path, why))
        return false;
    t->model = t->file.model;
    t->memory_bytes = t->model_bytes = t->file.bytes;
    if (gait_model_get_info(t->model, &t->info, &err) == GAIT_OK &&
        gait_tracker_prior(t->model, &t->prior_mean, &t->prior_sd, &err) == GAIT_OK)
        return true;
    return message_set(why, "%.100s: %s", model_path, err.text);
}

void tracking_share(tracking *t, tracking *first)
{
    *t = (tracking){.first = first,
                    .model = first->model,
                    .info = first->info,
                    .prior_mean = first->prior_mean,
                    .prior_sd = first->prior_sd,
                    .config = first->config};
    first->several = true;
}

void tracking_close(tracking *t)
{
    free(t->block);
    model_file_close(&t->file);
    *t = (tracking){0};
}

void tracking_drop_camera(tracking *t)
{
    t->memory_bytes -= t->tracker_bytes + t->picture_bytes;
    t->tracker_bytes = t->picture_bytes = 0;
    free(t->block);
    t->block = t->plate = t->pixels = t->nearest = t->drawing = NULL;
    t->tracker = NULL;
    t->start = NULL;
    t->background = t->decoded = (gait_image){0};
}

bool tracking_set_camera(tracking *t, const gait_camera *camera, message *why)
{
    gait_error err = {.text = ""};
    gait_start_config start;
    size_t bytes = 0, start_bytes = 0;
    size_t const pixels = (size_t)camera->width * (size_t)camera->height;
    size_t const picture = padded(3 * pixels), byte_each = t->several ? padded(pixels) : 0;
    size_t const pictures = t->first ? 0 : 2 * picture + 2 * byte_each;
    tracking_drop_camera(t);
    if (t->first && !t->first->block)
        return message_set(why, "there is no tracker of the first person");
    t->config.camera[0] = *camera;
    gait_start_default(&start);
    start.camera = *camera;
    start.cpu_mask = t->config.cpu_mask;
    gait_result status = gait_tracker_bytes(t->model, &t->config, &bytes, &err);
    if (status == GAIT_OK)
        status = gait_start_bytes(t->model, &start, &start_bytes, &err);
    size_t const before = padded(bytes) + padded(start_bytes);
    if (status == GAIT_OK) {
        t->block = aligned_memory(before + pictures, "tracker", why);
        if (!t->block)
            return false;
        status = gait_tracker_init(t->block, bytes, t->model, &t->config, &t->tracker, &err);
    }
    if (status == GAIT_OK)
        status = gait_start_init(t->block + padded(bytes), start_bytes, t->model, &start, &t->start, &err);
    if (status != GAIT_OK) {
        tracking_drop_camera(t);
        return message_set(why, "cannot create the tracker: %s (%s)", err.text, gait_result_name(status));
    }
    t->tracker_bytes = before;
    t->picture_bytes = pictures;
    t->memory_bytes += before + pictures;
    if (t->first)
        return true;
    t->plate = t->block + before;
    t->pixels = t->plate + picture;
    if (t->several) {
        t->nearest = t->pixels + picture;
        t->drawing = t->nearest + byte_each;
    }
    return true;
}

static size_t row_bytes(const gait_image *image)
{
    return (size_t)image->width * (image->format == GAIT_GREY8 ? 1 : 3);
}

static bool same_image(const gait_image *a, const gait_image *b)
{
    if (!a->data || a->format != b->format)
        return false;
    for (int32_t y = 0; y < a->height; y++)
        if (memcmp(a->data + (ptrdiff_t)y * a->stride, b->data + (ptrdiff_t)y * b->stride, row_bytes(a)) != 0)
            return false;
    return true;
}

bool tracking_set_background(tracking *t, const gait_image *plate, message *why)
{
    const gait_camera *const c = &t->config.camera[0];
    if (plate->width != c->width || plate->height != c->height)
        return message_set(why, "background of %dx%d, but the camera has %dx%d; give equal sizes",
                           plate->width, plate->height, c->width, c->height);
    if (same_image(&t->background, plate))
        return true;
    size_t const row = row_bytes(plate);
    for (int32_t y = 0; y < plate->height; y++)
        memcpy(t->plate + (size_t)y * row, plate->data + (ptrdiff_t)y * plate->stride, row);
    t->background = (gait_image){t->plate, plate->width, plate->height, (int32_t)row, plate->format};
    gait_result const status = gait_tracker_set_background(t->tracker, 0, &t->background, NULL);
    return status == GAIT_OK || message_set(why, "background rejected: %s", gait_result_name(status));
}

void tracking_share_background(tracking *t)
{
    t->background = t->first->background;
    if (t->tracker)
        gait_tracker_set_background(t->tracker, 0, &t->background, NULL); /* it fits the first one's */
}

bool tracking_start(tracking *t, const gait_state *mean, const gait_state *sd, int64_t utime, message *why)
{
    gait_error err = {.text = ""};
    return gait_tracker_start(t->tracker, mean, sd, utime, &err) == GAIT_OK ||
           message_set(why, "%s; send another START", err.text);
}
