#include "filter/class_change.h"
#include "base/rng.h"

static const float STEPS = 2.0f; /* both legs change class alike: phases count modulo half a stride */
static const float ANY = 4.0f;   /* sd of a phase, strides: in effect uniform */
static const float JITTER_HEADING = 0.1f;    /* sd, radians: people who change class often turn a little */
static const float RELATIVE_RATE_SD = 0.07f; /* relative; that of the people learnt from, if it is larger */
static const float POSTURE_SHARE = 0.3f;     /* of the posture's sd: by this the posture changes at once */
static const float RESUMED_SD = 0.03f;       /* of the phase of people who have walked on, strides */
static const float NEVER_STOOD =
    1.28f; /* normal quantile of the share, 0.9, of them among those who seem to stand for a moment */

float class_change_rate(const gait_model *m, int32_t to, float phase, float stride_hz)
{
    const float *const c = m->class_change + CLASS_CHANGE * (m->motion_class * m->classes + to);
    if (m->direction == 0 || c[CHANGE_RATE] == 0.0f)
        return c[CHANGE_RATE];
    float sn, cs;
    m_sincos_one(STEPS * TWO_PI_F * (phase - c[CHANGE_PHASE]), &sn, &cs);
    return c[CHANGE_RATE] *
           m_exp(c[CHANGE_CONCENTRATION] * (cs - 1.0f) + c[CHANGE_SLOPE] * kin_pace(m, stride_hz));
}

/* A phase at which people who stood still begin to move, with either leg; n, other: normal. */
static float first_phase(const float *change, float n, float other)
{
    float const concentration = change[CHANGE_CONCENTRATION];
    float const sd = concentration > 0.0f ? 1.0f / (STEPS * TWO_PI_F * __builtin_sqrtf(concentration)) : ANY;
    return m_wrap1(change[CHANGE_PHASE] + sd * n + (other < 0.0f ? 0.0f : 0.5f));
}

/* Draw four standard normal numbers of particle i. */
static __attribute__((noinline)) void normals(const class_entry *e, int32_t i, int32_t draw, float n[4])
{
    rng_normal4(e->seed, STREAM_CLASS, e->frame, (uint32_t)i, (uint32_t)draw, n);
}

void class_change_enter(const class_entry *e, int32_t from, int32_t i, particle_state *p)
{
    const state_layout *const r = e->layout;
    const gait_model *const m = r->model, *const before = m->of_class[from];
    const float *const change = m->class_change + CLASS_CHANGE * (from * m->classes + m->motion_class);
    bool const other_curves = m->curves != before->curves;
    float n[4], resumed[4];
    normals(e, i, 1, resumed);
    bool const resumes = e->resumes && before->direction == 0 && resumed[0] < NEVER_STOOD;
    normals(e, i, 0, n);
    p->f[F_HEADING] = m_wrap_pi(p->f[F_HEADING] + JITTER_HEADING * n[0]);
    if (m->direction == 0)
        p->f[F_PHASE] = 0.0f;
    else if (resumes)
        p->f[F_PHASE] =
            m_wrap1(e->phase + (float)m->direction * e->seconds * p->f[F_RATE] + RESUMED_SD * resumed[1]);
    else if (before->direction == 0)
        p->f[F_PHASE] = first_phase(change, n[1], n[3]);
    if (m->direction != 0 && !resumes && (before->direction == 0 || other_curves))
        p->f[F_RATE] = dynamics_reflect_rate(m->stride_hz +
                                             f_max(m->stride_hz_sd, RELATIVE_RATE_SD * m->stride_hz) * n[2]);
    for (int32_t k = 0; other_curves && k < r->curve_components; k++) {
        if (k % 4 == 0)
            normals(e, i, 2 + k / 4, n);
        p->f[F_COEF + k] = e->score[k] + e->score_sd * n[k % 4];
    }
    for (int32_t k = 0; k < r->offsets; k++) {
        int32_t const at = state_layout_offset(r) + k;
        float const was = model_posture_sd(before, r->angle[k]), sd = model_posture_sd(m, r->angle[k]);
        if (k % 4 == 0)
            normals(e, i, 8 + k / 4, n);
        p->f[at] = f_min(1.0f, sd / was) * p->f[at] + (sd > was ? POSTURE_SHARE * sd * n[k % 4] : 0.0f);
    }
}
