/* fuzz_files.c - what gait-trackd reads besides models: camera, start, configuration, background, snapshot, JPEG frame. */
#define _GNU_SOURCE /* memfd_create */
#include "../../tools/trackd/cameras.h"
#include "../../tools/trackd/input_files.h"
#include "../../tools/trackd/settings.h"
#include "../../tools/trackd/snapshot_file.h"

#include "daemon.h"

enum { CAMERA, INIT, SETTINGS, BACKGROUND, SNAPSHOT, JPEG, KINDS };

/* A service whose tracker has followed its person for some frames. */
static service *running(const memory_file *file)
{
    static sink out;
    static service_shared shared = {.out = &out, .threads = 1};
    static service s = {.shared = &shared};
    size_t bytes;
    message why;
    gait_state mean, sd;
    if (s.track.tracker)
        return &s;
    gait_tracker_config const config = fuzz_config();
    gait_camera const camera = fuzz_camera();
    const void *const toy = toy_model_blob(&bytes);
    memory_file_write(file, toy, bytes);
    shared.max_gap = 2;
    shared.max_pixels = FUZZ_WIDTH * FUZZ_HEIGHT;
    gait_tracker_prior(toy_model(), &mean, &sd, NULL);
    camera_use(&shared.slot, &camera);
    if (!tracking_open(&s.track, file->path, &config, &why) || !service_open(&s, NULL, false, &why) ||
        !service_make_trackers(&s, &why) || !tracking_start(&s.track, &mean, &sd, 0, &why))
        abort();
    fuzz_steps(s.track.tracker, 0, 2, 1);
    return &s;
}

static void snapshot(const memory_file *file)
{
    service *const s = running(file);
    snapshot_file f = {.path = file->path};
    snapshot_file_resume(&f, s);
    if (s->track.tracker)
        fuzz_steps(s->track.tracker, s->last_utime + 40000, 1, 1);
}

static void jpeg(fuzz_bytes *b)
{
    int32_t const width = 1 + fuzz_take(b) % 64, height = 1 + fuzz_take(b) % 64;
    uint8_t *const pixels = malloc((size_t)(3 * width * height));
    gait_image out;
    message why;
    if (pixels && jpeg_decode(b->at, b->left, width, height, pixels, &out, &why) &&
        (out.width != width || out.height != height || out.stride > 3 * width))
        abort();
    free(pixels);
}

/* Every fault is one line, whatever was read. */
static void check_line(bool ok, const message *why)
{
    if (!ok && (!why->text[0] || strchr(why->text, '\n')))
        abort();
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static memory_file file, model;
    fuzz_bytes b = {data, size};
    uint8_t const kind = fuzz_take(&b) % KINDS;
    message why = {.text = ""};
    if (!file.path[0]) {
        file = memory_file_make();
        model = memory_file_make();
    }
    if (kind == SNAPSHOT)
        running(&model);
    memory_file_write(&file, b.at, b.left);
    if (kind == CAMERA) {
        gait_camera camera;
        check_line(camera_file_read(file.path, &camera, &why), &why);
    } else if (kind == INIT) {
        init_state init;
        check_line(init_file_read(file.path, toy_model(), &init, &why), &why);
    } else if (kind == SETTINGS) {
        static settings s;
        char *argv[] = {"gait-trackd", "--config", file.path, NULL};
        check_line(settings_read(&s, 3, argv, &why) == OPTION_OK, &why);
    } else if (kind == BACKGROUND) {
        file_bytes bytes;
        gait_image image;
        bool const ok = pnm_read(file.path, &bytes, &image, &why);
        check_line(ok, &why);
        if (ok) { /* all of its pixels can be read */
            free(fuzz_copy(image.data, (size_t)image.stride * (size_t)image.height));
            free(bytes.data);
        }
    } else if (kind == SNAPSHOT)
        snapshot(&file);
    else
        jpeg(&b);
    return 0;
}
