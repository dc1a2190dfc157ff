#include "start/people.h"
#include "image/camera.h"

#include <string.h>

static const double SHORTEST = 1.2, TALLEST = 2.4; /* metres; shadows make people appear taller */
static const double BLUR = 0.25;         /* heights by which a foot point may move by errors alone */
static const double HEIGHTS_PER_S = 2.0; /* heights per second */
static const double STANDS = 0.5;        /* probability of a person who stays, against one who walks */

start_view start_view_of(const gait_camera *c)
{
    start_view v;
    memcpy(v.R, c->R, sizeof v.R);
    memcpy(v.t, c->t, sizeof v.t);
    return v;
}

bool people_box(const gait_camera *c, const gait_box *in, start_box *out)
{
    if (!(in->sd >= 0.0f && in->sd <= FLT_MAX && f_finite(in->foot, 2) && f_finite(in->head, 2)))
        return false;
    camera_ideal(c, (const double[2]){(double)in->foot[0], (double)in->foot[1]}, out->foot);
    camera_ideal(c, (const double[2]){(double)in->head[0], (double)in->head[1]}, out->head);
    out->sd = (double)in->sd;
    out->view = start_view_of(c);
    return true;
}

double people_stature(const gait_camera *c, const start_box *b)
{
    float lens[3];
    double foot[3], head[3];
    camera_to(c, (const float[3]){0.0f, 0.0f, 0.0f}, lens); /* the vector from the lens to the origin */
    double const above = -(double)lens[2];
    camera_ray(c, b->foot, foot);
    camera_ray(c, b->head, head);
    double const flat = sqrt(foot[0] * foot[0] + foot[1] * foot[1]),
                 head_flat = sqrt(head[0] * head[0] + head[1] * head[1]);
    if (!(above > 0.0 && foot[2] < 0.0 && head_flat > 0.0))
        return (double)NAN;
    return above + above * flat / -foot[2] * head[2] / head_flat;
}

/* Distance of a box from a person's last one, relative to how far the person can have walked since. */
static double far_from(const start_person *p, int64_t utime, const start_box *b)
{
    int32_t const last = (p->count - 1) % GAIT_START_MAX_FRAMES;
    const start_box *const was = &p->box[last];
    double const seconds = 1e-6 * (double)(utime - p->utime[last]);
    return people_distance(b->foot, was->foot) /
           ((BLUR + HEIGHTS_PER_S * seconds) * people_distance(was->head, was->foot));
}

/* The person in a box: one known from earlier frames, a new one, or NULL if there are too many. */
static start_person *whose(start_people *people, int64_t utime, const start_box *b)
{
    start_person *nearest = NULL, *unused = NULL;
    double least = 1.0;
    for (int32_t k = 0; k < GAIT_START_MAX_PEOPLE; k++) {
        start_person *const p = &people->person[k];
        int64_t const last = p->count ? p->utime[(p->count - 1) % GAIT_START_MAX_FRAMES] : 0;
        if (p->count == 0)
            unused = unused ? unused : p;
        else if (last < utime && far_from(p, utime, b) < least) {
            least = far_from(p, utime, b);
            nearest = p;
        }
    }
    return nearest ? nearest : unused;
}

void people_add(start_people *people, const gait_camera *c, int64_t utime, const gait_box *boxes,
                int32_t count)
{
    people->utime = utime;
    people->begun = true;
    for (int32_t k = 0; k < GAIT_START_MAX_PEOPLE; k++) { /* forget people who have left */
        start_person *const p = &people->person[k];
        if (p->count > 0 && p->utime[(p->count - 1) % GAIT_START_MAX_FRAMES] < utime - START_KEEP)
            p->count = 0;
    }
    for (int32_t i = 0; i < count; i++) {
        start_box b;
        if (!people_box(c, &boxes[i], &b) || !(people_distance(b.head, b.foot) >= 1.0))
            continue;
        double const stature = people_stature(c, &b);
        start_person *const p = stature >= SHORTEST && stature <= TALLEST ? whose(people, utime, &b) : NULL;
        if (!p)
            continue;
        p->utime[p->count % GAIT_START_MAX_FRAMES] = utime;
        p->box[p->count % GAIT_START_MAX_FRAMES] = b;
        p->count = p->count == INT32_MAX ? p->count - GAIT_START_MAX_FRAMES + 1 : p->count + 1;
    }
}

int32_t people_merge(gait_hypothesis *all, int32_t n, gait_hypothesis *own, int32_t count, int32_t frames)
{
    for (int32_t i = 0; i < count; i++) {
        own[i].probability *= (float)((double)frames * (own[i].in_place ? STANDS : 1.0));
        if (n == GAIT_START_MAX_HYPOTHESES && own[i].probability <= all[n - 1].probability)
            continue;
        int32_t at = n < GAIT_START_MAX_HYPOTHESES ? n++ : n - 1;
        for (; at > 0 && all[at - 1].probability < own[i].probability; at--)
            all[at] = all[at - 1];
        all[at] = own[i];
    }
    return n;
}

int32_t people_normalise(gait_hypothesis *all, int32_t n)
{
    double sum = 0.0;
    for (int32_t i = 0; i < n; i++)
        sum += (double)all[i].probability;
    for (int32_t i = 0; i < n; i++)
        all[i].probability = (float)((double)all[i].probability / sum);
    return n;
}
