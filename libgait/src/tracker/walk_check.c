#include "tracker/walk_check.h"
#include "base/fmath.h"
#include "tracker/likelihood_step.h"

static const int64_t APART = 200000; /* microseconds between the frames compared */
static const int64_t TOO_LATE =
    400000; /* microseconds over which a walk is no longer predicted well enough */

/* Where a body is after so many seconds of walking on as it did. */
static particle_state walk_on(const gait_tracker *t, const particle_state *from, float seconds)
{
    particle_state p = *from;
    float const way = way_of_walk(t, &t->layout, from, seconds);
    float sn, cs;
    m_sincos_one(from->f[F_HEADING], &sn, &cs);
    p.f[F_PHASE] = m_wrap1(from->f[F_PHASE] + in_walking_time(t, seconds) * from->f[F_RATE]);
    p.f[F_X] += way * cs;
    p.f[F_Y] += way * sn;
    return p;
}

void walk_check_update(gait_tracker *t, const particle_state *mean)
{
    walk_check *const w = t->walk_check;
    if (!w)
        return;
    int64_t const age = t->core->utime - t->core->start_utime, since = age - w->age;
    if (w->cameras && since < APART)
        return;
    if (w->cameras && since < TOO_LATE) {
        particle_state const walked = walk_on(t, &w->body, 1e-6f * (float)since);
        float const nats = likelihood_since(t, &walked, w->cameras, t->walk_check_patch) -
                           likelihood_since(t, &w->body, w->cameras, t->walk_check_patch);
        w->nats = w->judged ? 0.5f * (w->nats + nats) : nats;
        w->judged = 1;
    }
    w->age = age;
    w->body = *mean;
    w->cameras = likelihood_sample(t, mean, t->walk_check_patch);
}

bool walk_check_passes(const gait_tracker *t)
{
    const walk_check *const w = t->walk_check;
    return !w || t->cfg.stayed_nats == 0.0f || w->nats >= -t->cfg.stayed_nats;
}
