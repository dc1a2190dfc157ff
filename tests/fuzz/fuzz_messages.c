/* fuzz_messages.c - any messages, in any order: gait-trackd answers or complains, with lift, keypoints (also those of
 * one of several people, or of two), a moving camera and a further one. */
#include "../../tools/trackd/receiver.c"

#include "daemon.h"

#include "../unit/toy_segment.h"

#include "gaitmsg_image_t.h"
#include "gaitmsg_tracks2_t.h"
#include "gaitmsg_tracks_t.h"

static void start(service *s, lift_service *lift, keypoint_cue *cue, pose_path *path, sink *out,
                  further *more, pose_path *more_path, service *second, keypoint_cue *second_cue,
                  uint8_t choice)
{
    static memory_file model, segments;
    static uint8_t blob[TOY_BYTES];
    static toy_segments made;
    gait_tracker_config config = fuzz_config();
    lift_settings const set = {.sd = 3, .lag = 2, .cpu_mask = ~0u};
    message why;
    size_t bytes;
    if (!model.path[0]) {
        model = memory_file_make();
        segments = memory_file_make();
        const void *const toy = toy_model_blob(&bytes);
        memory_file_write(&model, toy, bytes);
        toy_segments_fill(&made, 1, 0);
        memory_file_write(&segments, blob, toy_segments_write(blob, &made));
    }
    config.terms |= choice & 1 ? GAIT_TERM_KEYPOINTS : 0;
    bool ok = tracking_open(&s->track, model.path, &config, &why);
    if (choice & 1) {
        keypoint_cue_open(cue, s->track.model, s->track.info.joints, 4);
        s->cue = cue;
        s->person = choice & 32 ? 2 : 0;
    }
    if (choice & 2) {
        ok = ok && lift_service_open(lift, segments.path, &set, out, &why);
        s->shared->lift = lift;
    } else if (choice & 4)
        s->shared->path = path;
    if (choice & 16 && further_open(more, "1", 0, &why)) {
        s->shared->further = more;
        more->camera[0].path = s->shared->path ? more_path : NULL;
    }
    s->shared->max_gap = 2;
    s->shared->max_pixels = 2 * FUZZ_WIDTH * FUZZ_HEIGHT;
    ok = ok && service_open(s, NULL, choice & 8, &why);
    if (choice & 64 && s->cue && !s->shared->lift && !s->shared->further) {
        keypoint_cue_open(second_cue, s->track.model, s->track.info.joints, 4);
        s->person = 1;
        service_share(second, s, 2, second_cue);
        ok = ok && service_open(second, NULL, choice & 8, &why);
    }
    if (!ok)
        abort();
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static service_shared shared;
    static service s, second;
    static lift_service lift;
    static keypoint_cue cue, second_cue;
    static pose_path path;
    static further more;
    static pose_path more_path;
    static const struct handler {
        lcm_msg_handler_t call;
        int64_t (*type)(void);
    } handlers[] = {
        {on_frame, __gaitmsg_image_t_get_hash},       {on_camera, __gaitmsg_camera_t_get_hash},
        {on_background, __gaitmsg_image_t_get_hash},  {on_keypoints, __gaitmsg_tracks_t_get_hash},
        {on_command, __gaitmsg_command_t_get_hash},   {on_status, __gaitmsg_status_t_get_hash},
        {on_keypoints, __gaitmsg_tracks2_t_get_hash},
    };
    static const struct handler of_further[] = {{on_further_frame, __gaitmsg_image_t_get_hash},
                                                {on_camera, __gaitmsg_camera_t_get_hash},
                                                {on_further_background, __gaitmsg_image_t_get_hash}};
    enum {
        HANDLERS = sizeof handlers / sizeof *handlers,
        FURTHER = sizeof of_further / sizeof *of_further,
        TYPE = 8
    };
    fuzz_bytes b = {data, size};
    sink out = {0};
    snapshot_file snapshot = {0};
    shared = (service_shared){.out = &out, .threads = 1};
    s = second = (service){.shared = &shared};
    lift = (lift_service){0};
    cue = (keypoint_cue){0};
    path = more_path = (pose_path){.turn_sd = 0.01f, .place_sd = 0.01f};
    more = (further){0};
    start(&s, &lift, &cue, &path, &out, &more, &more_path, &second, &second_cue, fuzz_take(&b));
    receiver r = {.service = &s, .log = true, .snapshot = &snapshot};
    while (b.left > 0) { /* kind, length, and the message, without its type unless the type is damaged */
        uint8_t const kind = fuzz_take(&b);
        size_t const stated = (size_t)(fuzz_take(&b) << 8 | fuzz_take(&b)),
                     n = stated < b.left ? stated : b.left;
        bool const is_further = shared.further && kind & 64;
        struct handler const h = is_further ? of_further[kind % FURTHER] : handlers[kind % 8 % HANDLERS];
        int64_t const type = h.type();
        uint8_t *const message_bytes =
            malloc(TYPE + n); /* ends with the message, so that an overrun is noticed */
        if (!message_bytes)
            abort();
        for (int i = 0; i < TYPE; i++)
            message_bytes[i] = (uint8_t)((uint64_t)type >> (56 - 8 * i));
        memcpy(message_bytes + TYPE, b.at, n);
        lcm_recv_buf_t const buffer = {.data = message_bytes + (kind & 128 ? TYPE : 0),
                                       .data_size = (uint32_t)(n + (kind & 128 ? 0 : TYPE)),
                                       .recv_utime = 1};
        h.call(&buffer, s.next && kind & 32 ? "FUZZ_2" : is_further ? "FUZZ_1" : "FUZZ_0", &r);
        b.at += n;
        b.left -= n;
        free(message_bytes);
        for (service *each = kind & 24 ? NULL : &s; each; each = each->next) /* quantiles take long */
            service_send_status(each);
    }
    flush_held(&r);
    if (shared.lift)
        lift_service_close(shared.lift);
    if (s.next)
        service_close(s.next);
    service_close(&s);
    service_shared_close(&shared);
    further_close(&more);
    return 0;
}
