#include "pose_path.h"

#include <math.h>
#include <string.h>

static const double FASTEST_POSE =
    20.0; /* metres or radians per second above which a change is a jump, not a motion */

static const timed_pose *pose_at(const pose_path *p, int64_t index)
{
    return &p->pose[index % POSE_PATH_KEPT];
}

bool pose_path_add(pose_path *p, int64_t utime, const gait_camera *camera, message *why)
{
    int64_t const last = p->count > 0 ? pose_at(p, p->count - 1)->utime : INT64_MIN;
    if (!clock_check(utime, why))
        return false;
    if (p->count > 0 && utime <= last && utime > last - POSE_PATH_SET_BACK) {
        p->refused += utime < last; /* repeating a pose is no fault */
        return utime == last || message_set(why, "a camera pose arrived out of order and was dropped; "
                                                 "stamp GAIT_CAMERA_<i> in order");
    }
    if (utime <= last)
        p->count = 0;
    timed_pose *const to = &p->pose[p->count++ % POSE_PATH_KEPT];
    *to = (timed_pose){.utime = utime, .sent = {.turn_sd = p->turn_sd, .place_sd = p->place_sd}};
    memcpy(to->sent.R, camera->R, sizeof to->sent.R);
    memcpy(to->sent.t, camera->t, sizeof to->sent.t);
    for (int i = 0; i < 9; i++)
        to->R[i] = (double)camera->R[i];
    for (int i = 0; i < 3; i++)
        to->centre[i] = -(to->R[i] * (double)camera->t[0] + to->R[3 + i] * (double)camera->t[1] +
                          to->R[6 + i] * (double)camera->t[2]);
    return true;
}

/* out = a b, or a b' if `transposed`. */
static void multiply(const double a[9], const double b[9], bool transposed, double out[9])
{
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) {
            double sum = 0.0;
            for (int k = 0; k < 3; k++)
                sum += a[3 * i + k] * (transposed ? b[3 * j + k] : b[3 * k + j]);
            out[3 * i + j] = sum;
        }
}

/* Axis times angle of a rotation. */
static void turn_of(const double R[9], double turn[3])
{
    const double axis[3] = {R[7] - R[5], R[2] - R[6], R[3] - R[1]};
    double const sine = 0.5 * sqrt(axis[0] * axis[0] + axis[1] * axis[1] + axis[2] * axis[2]);
    double const angle = atan2(sine, 0.5 * (R[0] + R[4] + R[8] - 1.0));
    double const scale = sine > 1e-9 ? 0.5 * angle / sine : 0.5;
    for (int k = 0; k < 3; k++)
        turn[k] = scale * axis[k];
}

/* Rotation by an axis times an angle (Rodrigues). */
static void rotation_of(const double turn[3], double R[9])
{
    double const angle = sqrt(turn[0] * turn[0] + turn[1] * turn[1] + turn[2] * turn[2]);
    double const a = angle > 1e-9 ? sin(angle) / angle : 1.0,
                 b = angle > 1e-9 ? (1.0 - cos(angle)) / (angle * angle) : 0.5;
    const double K[9] = {0, -turn[2], turn[1], turn[2], 0, -turn[0], -turn[1], turn[0], 0};
    double K2[9];
    multiply(K, K, false, K2);
    for (int i = 0; i < 9; i++)
        R[i] = (i % 4 == 0) + a * K[i] + b * K2[i];
}

static void set_pose(const double R[9], const double centre[3], gait_camera_pose *out)
{
    for (int i = 0; i < 9; i++)
        out->R[i] = (float)R[i];
    for (int i = 0; i < 3; i++)
        out->t[i] = (float)-(R[3 * i] * centre[0] + R[3 * i + 1] * centre[1] + R[3 * i + 2] * centre[2]);
}

static double length(const double v[3])
{
    return sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
}

/* Interpolate between two poses; false: there is a gap or a jump between them. */
static bool between(const timed_pose *a, const timed_pose *b, int64_t utime, gait_camera_pose *out,
                    message *why)
{
    double const seconds = 1e-6 * (double)(b->utime - a->utime),
                 share = (double)(utime - a->utime) / (double)(b->utime - a->utime);
    double turned[9], turn[3], way[3], part[9], R[9], centre[3];
    multiply(b->R, a->R, true, turned);
    turn_of(turned, turn);
    for (int k = 0; k < 3; k++)
        way[k] = b->centre[k] - a->centre[k];
    if (b->utime - a->utime > POSE_PATH_GAP)
        return message_set(why, "no camera pose for %.2f s: its frames are not used", seconds);
    if (length(way) > FASTEST_POSE * seconds || length(turn) > FASTEST_POSE * seconds)
        return message_set(why, "the camera jumped by %.2f m and %.0f degrees: frames between are not used",
                           length(way), length(turn) * 57.29578);
    *out = b->sent;
    if (memcmp(&a->sent, &b->sent, sizeof a->sent) == 0)
        return true; /* exactly that pose */
    for (int k = 0; k < 3; k++) {
        turn[k] *= share;
        centre[k] = a->centre[k] + share * way[k];
    }
    rotation_of(turn, part);
    multiply(part, a->R, false, R);
    set_pose(R, centre, out);
    return true;
}

pose_answer pose_path_at(const pose_path *p, int64_t utime, gait_camera_pose *out, message *why)
{
    int64_t const first = p->count > POSE_PATH_KEPT ? p->count - POSE_PATH_KEPT : 0;
    int64_t i = p->count - 1;
    if (p->count == 0 || utime > pose_at(p, i)->utime)
        return POSE_LATER;
    while (i > first && pose_at(p, i - 1)->utime >= utime)
        i--;
    const timed_pose *const b = pose_at(p, i);
    *out = b->sent;
    if (b->utime == utime)
        return POSE_KNOWN;
    if (i == first) {
        message_set(why, "a frame is older than the first camera pose; send poses before frames");
        return POSE_UNKNOWN;
    }
    return between(pose_at(p, i - 1), b, utime, out, why) ? POSE_KNOWN : POSE_UNKNOWN;
}

bool pose_path_now(pose_path *p, int64_t utime, gait_camera_pose *out, message *why)
{
    pose_answer const answer = pose_path_at(p, utime, out, why);
    const timed_pose *const last = p->count > 0 ? pose_at(p, p->count - 1) : NULL;
    bool known = answer == POSE_KNOWN;
    if (answer == POSE_LATER && last && utime - last->utime <= POSE_PATH_LATE) {
        *out = last->sent;
        known = true;
    } else if (answer == POSE_LATER)
        message_set(why, "no camera pose for a frame: send GAIT_CAMERA_<i> with the time of each frame, or "
                         "at least twice a second");
    p->unknown += !known;
    return known;
}
