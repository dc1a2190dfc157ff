#include "tracking.h"

#include <stdlib.h>
#include <string.h>

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

void tracking_close(tracking *t)
{
    free(t->block);
    model_file_close(&t->file);
    *t = (tracking){0};
}

bool tracking_set_camera(tracking *t, const gait_camera *camera, message *why)
{
    gait_error err = {.text = ""};
    size_t bytes = 0;
    size_t const picture = padded((size_t)camera->width * (size_t)camera->height * 3);
    t->config.camera[0] = *camera;
    gait_result status = gait_tracker_bytes(t->model, &t->config, &bytes, &err);
    if (status == GAIT_OK) {
        t->block = aligned_alloc(GAIT_ALIGN, padded(bytes) + 2 * picture);
        if (!t->block)
            return message_set(why, "not enough memory for a tracker of %zu bytes", bytes + 2 * picture);
        status = gait_tracker_init(t->block, bytes, t->model, &t->config, &t->tracker, &err);
    }
    if (status != GAIT_OK)
        return message_set(why, "cannot make the tracker: %s (%s)", err.text, gait_result_name(status));
    t->plate = t->block + padded(bytes);
    t->pixels = t->plate + picture;
    t->tracker_bytes = bytes;
    t->picture_bytes = 2 * picture;
    t->memory_bytes += padded(bytes) + 2 * picture;
    return true;
}

static size_t row_bytes(const gait_image *image)
{
    return (size_t)image->width * (image->format == GAIT_GREY8 ? 1 : 3);
}

static bool same_picture(const gait_image *a, const gait_image *b)
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
        return message_set(why, "background of %dx%d, the camera has %dx%d; take both alike", plate->width,
                           plate->height, c->width, c->height);
    if (same_picture(&t->background, plate))
        return true;
    size_t const row = row_bytes(plate);
    for (int32_t y = 0; y < plate->height; y++)
        memcpy(t->plate + (size_t)y * row, plate->data + (ptrdiff_t)y * plate->stride, row);
    t->background = (gait_image){t->plate, plate->width, plate->height, (int32_t)row, plate->format};
    gait_result const status = gait_tracker_set_background(t->tracker, 0, &t->background, NULL);
    return status == GAIT_OK || message_set(why, "background refused: %s", gait_result_name(status));
}

bool tracking_start(tracking *t, const gait_state *mean, const gait_state *sd, int64_t utime, message *why)
{
    gait_error err = {.text = ""};
    return gait_tracker_start(t->tracker, mean, sd, utime, &err) == GAIT_OK ||
           message_set(why, "%s; send another START", err.text);
}
