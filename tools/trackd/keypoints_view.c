#include "keypoints_view.h"

#include "gaitmsg_tracks_t.h"

#include <stdio.h>
#include <string.h>

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
