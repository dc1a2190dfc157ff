#include "tracks_cue.h"

#include <stdlib.h>
#include <string.h>

enum { BESIDE_PIXELS = 1 << 16 }; /* of an image_t: its fields, metadata, the padding of rows */

void tracks_cue_open(tracks_cue *cue, const gait_model *model, int32_t joints, float sd)
{
    *cue = (tracks_cue){.model = model, .joints = joints, .sd = sd, .frame_utime = -1};
    for (int32_t i = 0; i < TRACKS_CUE_PAST; i++)
        cue->past[i].utime = -1;
}

void tracks_cue_close(tracks_cue *cue)
{
    free(cue->held);
    *cue = (tracks_cue){0};
}

void tracks_cue_forget(tracks_cue *cue)
{
    cue->frame_utime = -1;
}

bool tracks_cue_room(tracks_cue *cue, const gait_camera *camera, message *why)
{
    cue->room = (size_t)camera->width * (size_t)camera->height * 3 + BESIDE_PIXELS;
    cue->held = malloc(cue->room);
    return cue->held ||
           message_set(why, "--tracks-term: not enough memory for a frame of %zu bytes", cue->room);
}

static int32_t find(const tracks_cue *cue, const char *name)
{
    for (int32_t j = 0; j < cue->joints; j++)
        if (strcmp(gait_model_joint_name(cue->model, j), name) == 0)
            return j;
    return -1;
}

bool tracks_cue_take(tracks_cue *cue, tracks_view *v, message *why)
{
    cue_joints *const to = &cue->past[cue->messages++ % TRACKS_CUE_PAST];
    bool const announced = v->count > 0;
    int32_t known = 0;
    track_view track;
    to->utime = -1;
    if (v->utime <= cue->frame_utime) {
        cue->late++;
        return message_set(why,
                           "tracks came after their frame was tracked, and are of no use to it; publish them "
                           "before the next frame");
    }
    for (int32_t j = 0; j < cue->joints; j++)
        to->track[j].sd = -1.0f;
    tracks_sieve_begin(&cue->sieve);
    while (tracks_view_next(v, &track)) {
        int32_t const j = find(cue, track.name);
        known += j >= 0;
        if (tracks_sieve_pass(&cue->sieve, &track, j))
            to->track[j] = (gait_track){track.u, track.v, (float)tracks_view_sd(&track, (double)cue->sd)};
    }
    if (announced && known == 0)
        return tracks_view_strangers(why);
    to->utime = v->utime;
    return true;
}

const gait_track *tracks_cue_at(const tracks_cue *cue, int64_t utime)
{
    for (int32_t i = 0; i < TRACKS_CUE_PAST; i++)
        if (cue->past[i].utime == utime)
            return cue->past[i].track;
    return NULL;
}

const gait_track *tracks_cue_use(tracks_cue *cue, int64_t utime)
{
    const gait_track *const found = tracks_cue_at(cue, utime);
    cue->frame_utime = utime;
    cue->used += found != NULL;
    return found;
}

bool tracks_cue_hold(tracks_cue *cue, int64_t utime, const void *image, size_t bytes, int64_t arrival)
{
    if (!cue->held || bytes > cue->room)
        return false;
    memcpy(cue->held, image, bytes);
    cue->held_bytes = bytes;
    cue->held_utime = utime;
    cue->held_arrival = arrival;
    return true;
}
