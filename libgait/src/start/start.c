#include "start/start.h"
#include "base/fmath.h"
#include "image/camera.h"

#include <string.h>

enum { LEAST_FRAMES = 4, LEAST_BOXES = 8 };

static const double LEAST_SPAN = 0.3;   /* seconds that keypoints must cover */
static const double LEG = 0.49;         /* from hip to ankle, statures */
static const double BOX_MISS = 0.01;    /* error of a box due to hair, shoes and blur, heights */
static const float FITS = 1.8f;         /* chi-square per coordinate up to which a walk fits */
static const float LEAST_RATE = 0.3f;   /* strides per second; a person who stands fits a very slow walk */
static const float LEAST_SPEED = 0.25f; /* metres per second of a person who walks, from keypoints */
static const float BOX_SPEED = 0.4f;    /* the same from boxes */
static const float LIKELY = 0.25f;      /* least probability of a hypothesis from boxes to start with */

static int32_t find_point(const gait_model *m, const char *name)
{
    for (int32_t p = 0; p < m->points; p++)
        if (!strcmp(m->point_name[p], name))
            return p;
    return -1;
}

/* Height of a point over the floor while walking: mean over the stride, statures. */
static double height_of(const gait_start *s, int32_t point)
{
    start_scratch *const w = s->scratch;
    double sum = 0.0;
    memset(&w->states, 0, sizeof w->states);
    for (int32_t i = 0; i < BLOCK; i++) {
        w->states.f[F_PHASE][i] = (float)i / (float)BLOCK;
        w->states.f[F_RATE][i] = s->model->stride_hz;
        w->states.f[F_STATURE][i] = s->model->stature_mean;
    }
    particle_block_bodies(&s->layout[0], &w->states, &w->body);
    kin_points(s->model, &w->body, w->points);
    for (int32_t i = 0; i < BLOCK; i++)
        sum += (double)w->points[point][2][i];
    return sum / BLOCK / (double)s->model->stature_mean;
}

gait_start *start_layout(arena *a, const gait_model *m, const gait_start_config *cfg, const kernels *run)
{
    gait_start *const s = TAKE(a, gait_start, 1);
    void *const keypoint = arena_take(a, sizeof *s->keypoint, GAIT_START_MAX_FRAMES);
    start_scratch *const scratch = TAKE(a, start_scratch, 1);
    start_people *const people = TAKE(a, start_people, 1);
    blob_finder const blobs = blob_finder_layout(a, cfg->camera.width, cfg->camera.height);
    if (!s)
        return NULL;
    gait_tracker_config const plain = {.components = i_min(START_SCORES, m->components)};
    *s = (gait_start){.model = m,
                      .run = run,
                      .cfg = *cfg,
                      .hip = {find_point(m, "l_hip"), find_point(m, "r_hip")},
                      .ankle = {find_point(m, "l_ankle"), find_point(m, "r_ankle")},
                      .keypoint = keypoint,
                      .people = people,
                      .blobs = blobs,
                      .scratch = scratch};
    if (s->cfg.stature == 0.0f)
        s->cfg.stature = m->stature_mean;
    if (s->cfg.stature_sd == 0.0f)
        s->cfg.stature_sd = m->stature_sd;
    s->layout[s->striding++] = state_layout_init(m, &plain, run);
    for (int32_t c = 1; c < m->classes; c++)
        if (m->of_class[c]->direction != 0)
            s->layout[s->striding++] = state_layout_of_class(&s->layout[0], c);
    s->crown = height_of(s, find_point(m, "head_top"));
    start_reset(s);
    return s;
}

bool start_knows(const gait_model *m)
{
    static const char *const needed[] = {"l_hip", "r_hip", "l_ankle", "r_ankle", "head_top"};
    bool all = true;
    for (int32_t k = 0; k < 5; k++)
        all &= find_point(m, needed[k]) >= 0;
    return all;
}

void start_reset(gait_start *s)
{
    s->count = 0;
    memset(s->people, 0, sizeof *s->people);
}

void start_add(gait_start *s, int64_t utime, const gait_keypoint *keypoints)
{
    int32_t const slot = s->count % GAIT_START_MAX_FRAMES;
    s->utime[slot] = utime;
    s->view[slot] = start_view_of(&s->cfg.camera);
    for (int32_t j = 0; j < s->model->points; j++) {
        const gait_keypoint *const k = &keypoints[j];
        start_keypoint *const to = &s->keypoint[slot][j];
        *to = (start_keypoint){0};
        if (!(k->sd > 0.0f && k->sd <= FLT_MAX && f_finite(&k->u, 1) && f_finite(&k->v, 1)))
            continue;
        double ideal[2];
        camera_ideal(&s->cfg.camera, (const double[2]){(double)k->u, (double)k->v}, ideal);
        *to = (start_keypoint){ideal[0], ideal[1], (double)k->sd};
    }
    s->count++;
}

/* Middle of two joints; false: one is not observed. */
static bool middle_of(const gait_start *s, int32_t frame, const int32_t joint[2], double uv[2])
{
    const start_keypoint *const a = &s->keypoint[frame][joint[0]], *const b = &s->keypoint[frame][joint[1]];
    uv[0] = 0.5 * (a->u + b->u);
    uv[1] = 0.5 * (a->v + b->v);
    return a->sd > 0.0 && b->sd > 0.0;
}

/* Median of n numbers, whose order changes; m_median() would take the upper of the two in the middle. */
static double median(double *x, int32_t n)
{
    for (int32_t i = 1; i < n; i++) {
        double const v = x[i];
        int32_t j = i;
        for (; j > 0 && x[j - 1] > v; j--)
            x[j] = x[j - 1];
        x[j] = v;
    }
    return n % 2 ? x[n / 2] : 0.5 * (x[n / 2 - 1] + x[n / 2]);
}

/* Whether the camera is at one place in all frames that are fitted. */
static bool stands_still(const gait_start *s, int32_t frames)
{
    gait_camera const first = start_camera(s, 0);
    bool same = true;
    for (int32_t k = 1; k < frames; k++) {
        gait_camera const c = start_camera(s, k);
        same &= memcmp(&c, &first, sizeof c) == 0;
    }
    return same;
}

/* Estimate the place on the floor: below the hips, at the distance at which the legs have their usual length, as seen from
 * the camera of the middle frame.  Returns the person's height in the image, pixels. */
static double rough_place(const gait_start *s, start_problem *p)
{
    double leg[START_FITTED], u[START_FITTED], v[START_FITTED];
    int32_t const middle = p->frames / 2;
    gait_camera const cam = start_camera(s, middle), *const c = &cam;
    for (int32_t k = 0; k < p->frames; k++) {
        double hips[2], ankles[2];
        if (p->person) {
            const start_box *const b = &p->person->box[p->frame[k]];
            leg[k] = LEG * people_distance(b->head, b->foot);
            u[k] = 0.5 * (b->head[0] + b->foot[0]);
            v[k] = 0.5 * (b->head[1] + b->foot[1]);
            continue;
        }
        (void)middle_of(s, p->frame[k], s->hip, hips);
        (void)middle_of(s, p->frame[k], s->ankle, ankles);
        leg[k] = people_distance(hips, ankles);
        u[k] = hips[0];
        v[k] = hips[1];
    }
    double const pixels = median(leg, p->frames) / LEG; /* of the person's height */
    double const focal = 0.5 * (double)(c->fx + c->fy),
                 away = focal * (double)s->cfg.stature / f_max((float)pixels, 1.0f);
    bool const still = stands_still(s, p->frames);
    double const x = ((still ? median(u, p->frames) : u[middle]) - (double)c->cx) / (double)c->fx;
    double const y = ((still ? median(v, p->frames) : v[middle]) - (double)c->cy) / (double)c->fy;
    for (int32_t k = 0; k < 2; k++) { /* R'(ray - t) */
        double const camera[3] = {away * x - (double)c->t[0], away * y - (double)c->t[1],
                                  away - (double)c->t[2]};
        p->place[k] =
            (double)c->R[k] * camera[0] + (double)c->R[3 + k] * camera[1] + (double)c->R[6 + k] * camera[2];
    }
    return pixels;
}

/* Set the standard deviations of the keypoints; `miss`: pixels between the model's joints and the detector's. */
static void set_noise(gait_start *s, double miss)
{
    start_scratch *const w = s->scratch;
    for (int32_t k = 0; k < w->problem.frames; k++)
        for (int32_t j = 0; j < (w->problem.person ? 1 : s->model->points); j++) {
            double const sd = w->problem.person ? w->problem.person->box[w->problem.frame[k]].sd
                                                : s->keypoint[w->problem.frame[k]][j].sd;
            w->inverse_sd[k][j] = sd > 0.0 ? 1.0 / sqrt(sd * sd + miss * miss) : 0.0;
        }
}

/* Frames of the ring that can be fitted, in order of time; returns how many. */
static int32_t usable_frames(const gait_start *s, const start_problem *p,
                             int32_t usable[GAIT_START_MAX_FRAMES])
{
    int32_t const count = p->person ? p->person->count : s->count, kept = i_min(count, GAIT_START_MAX_FRAMES);
    const int64_t *const utime = p->person ? p->person->utime : s->utime;
    int64_t const newest = p->person ? s->people->utime : utime[i_max(count - 1, 0) % GAIT_START_MAX_FRAMES];
    int32_t n = 0;
    for (int32_t k = count - kept; k < count; k++) {
        double uv[2];
        int32_t const f = k % GAIT_START_MAX_FRAMES;
        bool const shown = p->person || (middle_of(s, f, s->hip, uv) && middle_of(s, f, s->ankle, uv));
        if (shown && utime[f] >= newest - START_KEEP)
            usable[n++] = f;
    }
    return n;
}

/* Choose the frames to fit; false: too few. */
static bool choose_frames(gait_start *s, start_problem *p)
{
    const int64_t *const utime = p->person ? p->person->utime : s->utime;
    int32_t usable[GAIT_START_MAX_FRAMES];
    int32_t const n = usable_frames(s, p, usable);
    if (n < (p->person ? LEAST_BOXES : LEAST_FRAMES))
        return false;
    int64_t const first = utime[usable[0]], last = utime[usable[n - 1]];
    double const span = 1e-6 * (double)(last - first);
    p->frames = i_min(n, START_FITTED);
    p->middle = first + (last - first) / 2;
    p->observations = 0;
    for (int32_t k = 0; k < p->frames; k++) {
        p->frame[k] = usable[k * (n - 1) / (p->frames - 1)];
        p->at[k] = 1e-6 * (double)(utime[p->frame[k]] - p->middle);
        for (int32_t j = 0; j < s->model->points && !p->person; j++)
            p->observations += s->keypoint[p->frame[k]][j].sd > 0.0 ? 2 : 0;
        p->observations += p->person ? START_BOX_ROWS : 0;
    }
    double const apart =
        s->cfg.error_time > 0.0f ? 1.0 + span / (double)s->cfg.error_time : (double)p->frames;
    p->share = apart < (double)p->frames ? apart / (double)p->frames : 1.0;
    return span >= (p->person ? (double)s->cfg.box_time : LEAST_SPAN);
}

/* Hypotheses of the problem, whose probabilities sum to 1; returns how many, -1 if there are too few frames. */
static int32_t solve_problem(gait_start *s, int64_t utime, gait_hypothesis *out, int32_t capacity)
{
    start_scratch *const w = s->scratch;
    double weight[GAIT_START_MAX_HYPOTHESES], sum = 0.0, top = -DBL_MAX;
    bool const boxes = w->problem.person != NULL;
    if (!choose_frames(s, &w->problem))
        return -1;
    double const pixels = rough_place(s, &w->problem);
    set_noise(s, (boxes ? BOX_MISS : (double)s->cfg.joint_sd) * pixels);
    int32_t const n = start_fit(s, capacity);
    double const at = 1e-6 * (double)(utime - w->problem.middle);
    for (int32_t i = 0; i < n; i++) {
        weight[i] = start_describe(s, &w->candidate[i], at, &out[i]) - 0.5 * w->candidate[i].cost;
        top = weight[i] > top ? weight[i] : top;
    }
    for (int32_t i = 0; i < n; i++)
        sum += m_exp64(weight[i] - top);
    for (int32_t i = 0; i < n; i++)
        out[i].probability = (float)(m_exp64(weight[i] - top) / sum);
    return n;
}

/* Hypotheses of all people in the boxes. */
static int32_t solve_people(gait_start *s, int64_t utime, gait_hypothesis *out, int32_t capacity)
{
    start_scratch *const w = s->scratch;
    int32_t n = 0;
    bool enough = false;
    for (int32_t k = 0; k < GAIT_START_MAX_PEOPLE; k++) {
        gait_hypothesis own[GAIT_START_MAX_HYPOTHESES];
        int32_t usable[GAIT_START_MAX_FRAMES];
        w->problem.person = &s->people->person[k];
        int32_t const found = solve_problem(s, utime, own, GAIT_START_MAX_HYPOTHESES / 2);
        enough |= found >= 0;
        n = people_merge(out, n, own, found, usable_frames(s, &w->problem, usable));
    }
    return enough ? people_normalise(out, i_min(n, capacity)) : -1;
}

int32_t start_solve(gait_start *s, int64_t utime, gait_hypothesis *out, int32_t capacity)
{
    s->scratch->problem.person = NULL;
    int32_t const n = solve_problem(s, utime, out, capacity);
    if (n >= 0)
        return n;
    gait_hypothesis of_people[GAIT_START_MAX_HYPOTHESES];
    int32_t const found = solve_people(s, utime, of_people, i_min(capacity, GAIT_START_MAX_HYPOTHESES));
    memcpy(out, of_people, (size_t)i_max(found, 0) * sizeof *out);
    return found;
}

bool start_walks(const gait_hypothesis *h)
{
    if (h->sd.phase >= 0.5f) /* from boxes, which leave it open */
        return !h->in_place && h->speed > f_max(BOX_SPEED, 2.0f * h->speed_sd) && h->probability > LIKELY &&
               h->sd.heading < PI_F && h->chi2_per_observation < FITS;
    return h->mean.stride_hz > LEAST_RATE && (h->in_place || h->speed > LEAST_SPEED) &&
           h->chi2_per_observation < FITS;
}
