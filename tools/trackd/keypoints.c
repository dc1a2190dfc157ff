#include "keypoints.h"

#include "gaitmsg_tracks_t.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* ---- keypoints_view ---- */
#define LEAST_CONFIDENCE 0.1f /* points below it count as not seen, as in files of tracks */

static bool take_track(byte_reader *r, track_view *out)
{
    out->name = bytes_text(r);
    out->u = bytes_float(r);
    out->v = bytes_float(r);
    out->confidence = bytes_float(r);
    return r->ok;
}

bool keypoints_view_open(keypoints_view *v, const void *message_bytes, size_t size, message *why)
{
    byte_reader r = {.at = message_bytes, .left = size, .ok = true};
    track_view each;
    if (bytes_int(&r, 8) != __gaitmsg_tracks_t_get_hash())
        return message_set(why, "not a gaitmsg.tracks_t (another type or version)");
    v->utime = bytes_int(&r, 8);
    v->frame = bytes_int(&r, 8);
    v->count = bytes_int32(&r);
    v->tracks = r;
    for (int32_t i = 0; r.ok && i < v->count; i++)
        take_track(&r, &each);
    return (r.ok && v->count >= 0) || message_set(why, "damaged message: shorter than its lengths say");
}

bool keypoints_view_next(keypoints_view *v, track_view *out)
{
    return v->count-- > 0 && take_track(&v->tracks, out);
}

double keypoints_view_sd(const track_view *track, double sd)
{
    return track->confidence >= LEAST_CONFIDENCE ? sd / (double)track->confidence : -1.0;
}

void keypoints_sieve_begin(keypoints_sieve *s)
{
    memset(s->named, 0, sizeof s->named);
}

bool keypoints_sieve_pass(keypoints_sieve *s, const track_view *track, int32_t joint)
{
    static const char *const reason[] = {"the model does not know it", "its message names it twice",
                                         "its confidence is not from 0 to 1"};
    bool const sure = track->confidence >= 0.0f && track->confidence <= 1.0f; /* NaN is not */
    int const why = joint < 0 ? 0 : s->named[joint] ? 1 : !sure ? 2 : -1;
    if (joint >= 0)
        s->named[joint] = true;
    if (why < 0)
        return true;
    s->left_out++;
    if (!s->told[why])
        fprintf(stderr, "gait-trackd: tracks: point '%.40s' is left out, %s; all such points are counted\n",
                track->name, reason[why]);
    s->told[why] = true;
    return false;
}

bool keypoints_view_strangers(message *why)
{
    return message_set(why, "tracks of no point that the model knows; name them pelvis, l_knee and so on");
}

/* ---- keypoint_cue ---- */
enum { BESIDE_PIXELS = 1 << 16 }; /* of an image_t: its fields, metadata, the padding of rows */

void keypoint_cue_open(keypoint_cue *cue, const gait_model *model, int32_t joints, float sd)
{
    *cue = (keypoint_cue){.model = model, .joints = joints, .sd = sd, .frame_utime = -1};
    for (int32_t i = 0; i < KEYPOINT_CUE_PAST; i++)
        cue->past[i].utime = -1;
}

void keypoint_cue_close(keypoint_cue *cue)
{
    free(cue->held);
    *cue = (keypoint_cue){0};
}

void keypoint_cue_forget(keypoint_cue *cue)
{
    cue->frame_utime = -1;
}

bool keypoint_cue_room(keypoint_cue *cue, const gait_camera *camera, message *why)
{
    cue->room = (size_t)camera->width * (size_t)camera->height * 3 + BESIDE_PIXELS;
    cue->held = malloc(cue->room);
    return cue->held ||
           message_set(why, "--tracks-term: not enough memory for a frame of %zu bytes", cue->room);
}

static int32_t find(const keypoint_cue *cue, const char *name)
{
    for (int32_t j = 0; j < cue->joints; j++)
        if (strcmp(gait_model_joint_name(cue->model, j), name) == 0)
            return j;
    return -1;
}

bool keypoint_cue_take(keypoint_cue *cue, keypoints_view *v, message *why)
{
    cue_joints *const to = &cue->past[cue->messages++ % KEYPOINT_CUE_PAST];
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
    keypoints_sieve_begin(&cue->sieve);
    while (keypoints_view_next(v, &track)) {
        int32_t const j = find(cue, track.name);
        known += j >= 0;
        if (keypoints_sieve_pass(&cue->sieve, &track, j))
            to->track[j] =
                (gait_keypoint){track.u, track.v, (float)keypoints_view_sd(&track, (double)cue->sd)};
    }
    if (announced && known == 0)
        return keypoints_view_strangers(why);
    to->utime = v->utime;
    return true;
}

const gait_keypoint *keypoint_cue_at(const keypoint_cue *cue, int64_t utime)
{
    for (int32_t i = 0; i < KEYPOINT_CUE_PAST; i++)
        if (cue->past[i].utime == utime)
            return cue->past[i].track;
    return NULL;
}

const gait_keypoint *keypoint_cue_use(keypoint_cue *cue, int64_t utime)
{
    const gait_keypoint *const found = keypoint_cue_at(cue, utime);
    cue->frame_utime = utime;
    cue->used += found != NULL;
    return found;
}

bool keypoint_cue_hold(keypoint_cue *cue, int64_t utime, const void *image, size_t bytes, int64_t arrival)
{
    if (!cue->held || bytes > cue->room)
        return false;
    memcpy(cue->held, image, bytes);
    cue->held_bytes = bytes;
    cue->held_utime = utime;
    cue->held_arrival = arrival;
    return true;
}
