#include "keypoints.h"

#include "gaitmsg_tracks2_t.h"
#include "gaitmsg_tracks_t.h"

#include <math.h>
#include <string.h>

/* ---- messages ---- */
#define LEAST_CONFIDENCE 0.1f /* keypoints below it count as not seen, as in keypoint files */

static bool read_keypoint(byte_reader *r, bool profiled, keypoint_view *out)
{
    *out = (keypoint_view){.sd = -1.0f};
    out->name = bytes_text(r);
    out->u = bytes_float(r);
    out->v = bytes_float(r);
    out->confidence = bytes_float(r);
    if (profiled) {
        out->sd = bytes_float(r);
        out->lasting_sd = bytes_float(r);
        out->correlation = bytes_float(r);
    }
    return r->ok;
}

bool keypoints_view_open(keypoints_view *v, const void *message_bytes, size_t size, message *why)
{
    byte_reader r = {.at = message_bytes, .left = size, .ok = true};
    keypoint_view each;
    int64_t const type = bytes_int(&r, 8);
    v->profiled = type == __gaitmsg_tracks2_t_get_hash();
    if (!v->profiled && type != __gaitmsg_tracks_t_get_hash())
        return message_set(why, "not a gaitmsg.tracks_t or tracks2_t (another type or version)");
    v->utime = bytes_int(&r, 8);
    v->frame = bytes_int(&r, 8);
    v->count = bytes_int32(&r);
    v->rest = r;
    for (int32_t i = 0; r.ok && i < v->count; i++)
        read_keypoint(&r, v->profiled, &each);
    return r.ok && v->count >= 0 ? clock_check(v->utime, why)
                                 : message_set(why, "damaged message: shorter than its lengths state");
}

bool keypoints_view_next(keypoints_view *v, keypoint_view *out)
{
    return v->count-- > 0 && read_keypoint(&v->rest, v->profiled, out);
}

double keypoints_view_sd(const keypoint_view *k, double sd)
{
    if (k->confidence < LEAST_CONFIDENCE)
        return -1.0;
    return k->sd >= 0.0f ? (double)k->sd : sd / (double)k->confidence;
}

double keypoints_view_independent_sd(const keypoint_view *k, double sd, double step)
{
    double const all = keypoints_view_sd(k, sd);
    if (all < 0.0 || k->sd < 0.0f || step <= 0.0)
        return all;
    double const lasting = fmin((double)k->lasting_sd, all);
    double const changing = fmax((double)k->correlation / step, 1.0) * (all * all - lasting * lasting);
    return sqrt(lasting * lasting + changing);
}

void keypoints_filter_begin(keypoints_filter *f)
{
    memset(f->named, 0, sizeof f->named);
}

bool keypoints_filter_pass(keypoints_filter *f, const keypoint_view *k, int32_t joint)
{
    static const char *const reason[] = {
        "the model does not know it", "its message names it twice",
        "its confidence is not from 0 to 1, or a standard deviation is wrong"};
    bool valid = k->confidence >= 0.0f && k->confidence <= 1.0f; /* false for NaN */
    if (k->sd != -1.0f && k->confidence >= LEAST_CONFIDENCE)
        valid = valid && k->sd > 0.0f && k->lasting_sd >= 0.0f && k->correlation >= 0.0f &&
                isfinite(k->sd + k->lasting_sd + k->correlation);
    int const why = joint < 0 ? 0 : f->named[joint] ? 1 : !valid ? 2 : -1;
    if (joint >= 0)
        f->named[joint] = true;
    if (why < 0)
        return true;
    f->left_out++;
    if (!f->reported[why])
        log_event("keypoint '%.40s' is ignored: %s; all such keypoints are counted", k->name, reason[why]);
    f->reported[why] = true;
    return false;
}

bool keypoints_view_unknown(message *why)
{
    return message_set(why, "the model knows none of these keypoints; name them pelvis, l_knee and so on");
}

/* ---- keypoints for the tracker ---- */
enum { LONGEST_INTERVAL = 250000 }; /* microseconds between two frames that count as time without keypoints */

void keypoint_cue_open(keypoint_cue *cue, const gait_model *model, int32_t joints, float sd)
{
    *cue = (keypoint_cue){.model = model, .joints = joints, .sd = sd, .frame_utime = -1};
    for (int32_t i = 0; i < KEYPOINT_CUE_PAST; i++)
        cue->past[i].utime = -1;
}

void keypoint_cue_resume(keypoint_cue *cue, int64_t utime)
{
    cue->frame_utime = utime;
}

void keypoint_cue_forget(keypoint_cue *cue)
{
    cue->frame_utime = -1;
    cue->unseen = 0;
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
    cue_keypoints *const to = &cue->past[cue->messages++ % KEYPOINT_CUE_PAST];
    bool const announced = v->count > 0;
    int32_t known = 0;
    keypoint_view k;
    to->utime = -1;
    if (v->utime <= cue->frame_utime) {
        cue->late++;
        return message_set(why, "keypoints arrived after their frame had been tracked; publish them "
                                "before the next frame");
    }
    to->observed = false;
    for (int32_t j = 0; j < cue->joints; j++)
        to->joint[j].sd = -1.0f;
    keypoints_filter_begin(&cue->filter);
    while (keypoints_view_next(v, &k)) {
        int32_t const j = find(cue, k.name);
        known += j >= 0;
        if (!keypoints_filter_pass(&cue->filter, &k, j))
            continue;
        to->joint[j] = (gait_keypoint){k.u, k.v, (float)keypoints_view_sd(&k, (double)cue->sd)};
        to->observed = to->observed || to->joint[j].sd >= 0.0f;
    }
    if (announced && known == 0)
        return keypoints_view_unknown(why);
    to->utime = v->utime;
    return true;
}

static const cue_keypoints *message_at(const keypoint_cue *cue, int64_t utime)
{
    for (int32_t i = 0; i < KEYPOINT_CUE_PAST; i++)
        if (cue->past[i].utime == utime)
            return &cue->past[i];
    return NULL;
}

bool keypoint_cue_arrived(const keypoint_cue *cue, int64_t utime)
{
    return message_at(cue, utime) != NULL;
}

const gait_keypoint *keypoint_cue_at(const keypoint_cue *cue, int64_t utime)
{
    const cue_keypoints *const found = message_at(cue, utime);
    return found && found->observed ? found->joint : NULL;
}

const gait_keypoint *keypoint_cue_use(keypoint_cue *cue, int64_t utime)
{
    const gait_keypoint *const found = keypoint_cue_at(cue, utime);
    int64_t const interval = cue->frame_utime < 0 ? 0 : utime - cue->frame_utime;
    cue->unseen = found ? 0 : cue->unseen + (interval < LONGEST_INTERVAL ? interval : LONGEST_INTERVAL);
    cue->frame_utime = utime;
    cue->used += found != NULL;
    return found;
}
