#include "tracks_view.h"

#include "gaitmsg_tracks_t.h"

#define LEAST_CONFIDENCE 0.1f /* points below it count as not seen, as in files of tracks */

static bool take_track(byte_reader *r, track_view *out)
{
    out->name = bytes_text(r);
    out->u = bytes_float(r);
    out->v = bytes_float(r);
    out->confidence = bytes_float(r);
    return r->ok;
}

bool tracks_view_open(tracks_view *v, const void *message_bytes, size_t size, message *why)
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

bool tracks_view_next(tracks_view *v, track_view *out)
{
    return v->count-- > 0 && take_track(&v->tracks, out);
}

double tracks_view_sd(const track_view *track, double sd)
{
    float const confidence = track->confidence < 1.0f ? track->confidence : 1.0f;
    return confidence >= LEAST_CONFIDENCE ? sd / (double)confidence : -1.0;
}

bool tracks_view_strangers(message *why)
{
    return message_set(why, "tracks of no point that the model knows; name them pelvis, l_knee and so on");
}
