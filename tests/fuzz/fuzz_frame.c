/* fuzz_frame.c - any configuration, camera, start, image, keypoints, pose and time is refused, or the estimate is finite. */
#include "fuzz.h"

static gait_keypoint keypoints[GAIT_MAX_JOINTS];
static gait_camera_pose pose;

static void fill_frame(gait_frame *frame, gait_image *image, fuzz_bytes *b, uint8_t what, int pictures)
{
    *image =
        (gait_image){image->data, FUZZ_WIDTH, FUZZ_HEIGHT, FUZZ_WIDTH * 3, what % 8 ? GAIT_RGB8 : GAIT_GREY8};
    if (what % 8 == 1) {
        /* Must be refused, or stay within its memory; that a stride is longer than the memory cannot be seen. */
        image->width = (int32_t)fuzz_word(b);
        image->stride = (int32_t)fuzz_word(b);
        image->stride = image->stride < FUZZ_WIDTH * 3 ? image->stride : FUZZ_WIDTH * 3;
    } else if (what % 8 == 2)
        image->format = fuzz_take(b);
    if (pictures && (what % 8 < 3 || what % 8 == 7))
        frame->image[0] = *image;
    if (what & 8) {
        for (int j = 0; j < GAIT_MAX_JOINTS; j++)
            keypoints[j] = (gait_keypoint){fuzz_number(b), fuzz_number(b), fuzz_number(b)};
        frame->keypoints[0] = keypoints;
    }
    if (what & 16) {
        gait_camera const c = fuzz_camera();
        memcpy(pose.R, c.R, sizeof pose.R);
        memcpy(pose.t, c.t, sizeof pose.t);
        fuzz_settings("gait_camera_pose", &pose, b);
        frame->pose[0] = &pose;
    }
    if (pictures && what & 32)
        frame->background[0] = *image;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static uint8_t pixels[FUZZ_WIDTH * FUZZ_HEIGHT * 3];
    fuzz_bytes b = {data, size};
    int const pictures = fuzz_one_in(&b, 4); /* features take half of the time */
    gait_tracker_config c = fuzz_config();
    gait_state mean, sd;
    gait_estimate out;
    void *memory;
    uint8_t const mode = fuzz_take(&b);
    if (mode & 1)
        gait_tracker_fill(&c, sizeof c, GAIT_MODE_PAPER);
    c.particles = c.acquisition_particles = 16;
    c.lag = 5;
    c.camera[0] = fuzz_camera();
    c.terms |= mode & 2 ? GAIT_TERM_KEYPOINTS : 0;
    fuzz_settings("gait_tracker_config", &c, &b);
    fuzz_settings("gait_camera", &c.camera[0], &b);
    c.exec.run = NULL;
    gait_tracker *const t = fuzz_tracker(toy_model(), &c, &memory);
    gait_tracker_prior(toy_model(), &mean, &sd, NULL);
    fuzz_settings("gait_state", &mean, &b);
    fuzz_settings("gait_state", &sd, &b);
    int64_t utime = (int32_t)fuzz_word(&b);
    utime *= mode & 4 ? INT64_C(1) << 31 : 1;
    if (t && gait_tracker_start(t, &mean, &sd, utime, NULL) == GAIT_OK)
        for (int n = 0; n < 4 && b.left > 0; n++) {
            gait_frame frame = {.utime = utime};
            gait_image image = {.data = pixels};
            uint8_t const what = fuzz_take(&b);
            for (int i = 0; i < 32; i++)
                memset(pixels + i * 144, fuzz_take(&b), 144);
            fill_frame(&frame, &image, &b, what, pictures);
            if (gait_tracker_step(t, &frame, &out, NULL) == GAIT_OK)
                fuzz_check(&out);
            if (gait_tracker_lagged(t, n % 3, &out, NULL) == GAIT_OK)
                fuzz_check(&out);
            uint64_t const later = what & 64 ? (uint64_t)fuzz_word(&b) << (what & 128 ? 32 : 0) : 33333;
            utime = (int64_t)((uint64_t)utime + later);
        }
    free(memory);
    return 0;
}
