#include "start/start.h"
#include "base/cholesky.h"
#include "base/fmath.h"
#include "image/camera.h"

#include <string.h>

enum {
    N = START_UNKNOWNS,
    LD = 16,                    /* cholesky_padded(N + 1) */
    ROWS = 2 * GAIT_MAX_JOINTS, /* of a frame */
    HEADINGS = 12,
    PHASES = 6,
    LEAST_FRAMES = 4,
    LEAST_BOXES = 8,
    BOX_ROWS = 4
};
_Static_assert((int)N < (int)BLOCK, "a block of bodies holds a candidate and its derivatives");

static const double LEAST_SPAN = 0.3; /* seconds */
static const double LEG = 0.49;       /* from hip to ankle, statures */
static const double RATE_SD = 0.15;   /* strides per second: people in films walk as slowly as they like */
static const double SPEED_SD = 0.4;   /* metres per second, about the speed of the steps */
static const double STILL_SD = 0.1;   /* metres per second, in place */
static const double FLOOR_SD = 0.03;  /* metres: a camera's height is not exact */
static const double PLACE_SD = 3.0;   /* metres, about where the length of the legs puts the person */
static const double IN_PLACE = 8.0;   /* twice the log odds of walking along a path over walking in place */
static const double DEGREES = 4.0;    /* of freedom of the keypoints' errors */
static const double BEHIND = 1e3;     /* standard deviations for joints behind the camera */
static const double LEAD = 0.1; /* statures by which the lower foot is nearer to the camera than the body */
static const double BOX_MISS = 0.01; /* of heights, by hair, shoes and blur */
static const double FOOT_SD = 0.06;  /* metres by which all foot points of a person may be off */
static const double BOX_PLACE = 0.1; /* metres by which shadows and clothes move all boxes of a person */
static const double COURSE = 0.15;   /* radians: people do not walk exactly where their box moves */
static const double OPEN = 0.3;      /* information on a heading that boxes leave open, per square radian */
static const float OPEN_SD = 0.9f;   /* radians of standard deviation from which a heading is unknown */
static const float BUILD_SHARE = 0.25f;    /* of the sd of scores and posture, while the phase is unknown */
static const float SPEEDS_UP = 0.4f;       /* sd of the rate, as a share of what it is below the usual one */
static const float FITS = 1.8f;            /* chi-square per coordinate up to which a walk fits */
static const float LEAST_PLACE_SD = 0.05f; /* metres */
static const float LEAST_RATE = 0.3f;      /* strides per second; a person who stands fits a very slow walk */
static const float LEAST_SPEED = 0.25f;    /* metres per second of a person who walks, from keypoints */
static const float BOX_SPEED = 0.4f;       /* the same from boxes */
static const float LIKELY = 0.25f;         /* least probability of the person in boxes to start with */

/* Steps of the differences that stand for derivatives. */
static const double STEP[N] = {0.02, 0.02, 0.03, 0.03, 0.01, 0.01, 0.01, 0.01, 0.1, 0.1, 0.1};

typedef struct start_problem {           /* the observations that all candidates are fitted to */
    const start_person *person;          /* whose boxes are fitted; NULL: keypoints are */
    int32_t frames, frame[START_FITTED]; /* in the ring */
    double at[START_FITTED];             /* seconds from the middle */
    double share;                        /* of a frame's residuals, as their errors last */
    int32_t observations;
    double place[2];
    int64_t middle;
} start_problem;

struct start_scratch {
    start_problem problem;
    start_candidate candidate[2 * HEADINGS * PHASES];
    particle_block states;
    kin_body body;
    float points[GAIT_MAX_JOINTS][3][BLOCK];
    double A[LD * LD], U[LD * LD], W[(ROWS + N) * LD], prior[N][BLOCK];
    double inverse_sd[START_FITTED][GAIT_MAX_JOINTS]; /* 0: not observed */
    double residual[ROWS][BLOCK];
};

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
    particle_block_bodies(&s->layout, &w->states, &w->body);
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
    if (!s || a->overflow)
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
    s->layout = state_layout_init(m, &plain, run);
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

/* Put the place on the floor below the hips, at the distance at which the legs have their usual length; returns the
 * person's height, pixels. */
static double rough_place(const gait_start *s, start_problem *p)
{
    double leg[START_FITTED], u[START_FITTED], v[START_FITTED];
    const gait_camera *const c = &s->cfg.camera;
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
    double const x = (median(u, p->frames) - (double)c->cx) / (double)c->fx;
    double const y = (median(v, p->frames) - (double)c->cy) / (double)c->fy;
    for (int32_t k = 0; k < 2; k++) { /* R'(ray - t) */
        double const camera[3] = {away * x - (double)c->t[0], away * y - (double)c->t[1],
                                  away - (double)c->t[2]};
        p->place[k] =
            (double)c->R[k] * camera[0] + (double)c->R[3 + k] * camera[1] + (double)c->R[6 + k] * camera[2];
    }
    return pixels;
}

/* Standard deviations of the keypoints, with `miss` pixels by which the model's joints miss the detector's. */
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
        p->observations += p->person ? BOX_ROWS : 0;
    }
    double const apart =
        s->cfg.error_time > 0.0f ? 1.0 + span / (double)s->cfg.error_time : (double)p->frames;
    p->share = apart < (double)p->frames ? apart / (double)p->frames : 1.0;
    return span >= (p->person ? (double)s->cfg.box_time : LEAST_SPAN);
}

/* States of up to BLOCK candidates at a moment. */
static void place_states(const gait_start *s, const double (*theta)[N], int32_t lanes, double at,
                         particle_block *b)
{
    memset(b, 0, sizeof *b);
    for (int32_t i = 0; i < BLOCK; i++) {
        const double *const q = theta[i_min(i, lanes - 1)];
        float sn, cs;
        float const heading = m_wrap_pi((float)q[START_HEADING]), way = (float)(q[START_SPEED] * at);
        m_sincos_one(heading, &sn, &cs);
        b->f[F_PHASE][i] = m_wrap1((float)(q[START_PHASE] + q[START_RATE] * at));
        b->f[F_RATE][i] = f_clamp((float)q[START_RATE], 0.1f, 4.0f);
        b->f[F_X][i] = (float)q[START_X] + way * cs;
        b->f[F_Y][i] = (float)q[START_Y] + way * sn;
        b->f[F_Z][i] = (float)q[START_FLOOR];
        b->f[F_HEADING][i] = heading;
        b->f[F_STATURE][i] = f_clamp((float)q[START_STATURE], LEAST_STATURE, 3.0f);
        for (int32_t k = 0; k < s->layout.components; k++)
            b->f[F_COEF + k][i] = (float)q[START_SCORE + k];
    }
}

/* Two rows of residuals of one lane: of a point X and where it is found, down-weighted so that their squares are
 * Student's t costs. */
static void point_residuals(const gait_start *s, const float X[3], double u, double v, double weight,
                            int32_t row, int32_t lane)
{
    start_scratch *const w = s->scratch;
    float uv[2];
    double du = BEHIND, dv = BEHIND;
    if (camera_project(&s->cfg.camera, X, uv) > CAMERA_NEAR) {
        du = ((double)uv[0] - u) * weight;
        dv = ((double)uv[1] - v) * weight;
    }
    double const square = du * du + dv * dv;
    double const robust = square > 1e-9 ? sqrt(DEGREES * m_log64(1.0 + square / DEGREES) / square) : 1.0;
    w->residual[row][lane] = robust * du;
    w->residual[row + 1][lane] = robust * dv;
}

/* Residuals of a frame's box: rows x lanes. */
static int32_t box_residuals(const gait_start *s, int32_t k, const double (*theta)[N], int32_t lanes)
{
    start_scratch *const w = s->scratch;
    const start_problem *const p = &w->problem;
    const start_box *const b = &p->person->box[p->frame[k]];
    double const weight = w->inverse_sd[k][0];
    place_states(s, theta, lanes, p->at[k], &w->states);
    for (int32_t i = 0; i < lanes; i++) {
        float X[3] = {w->states.f[F_X][i], w->states.f[F_Y][i], w->states.f[F_Z][i]}, from[3];
        float const tall = w->states.f[F_STATURE][i];
        camera_to(&s->cfg.camera, X, from);
        float const away = __builtin_sqrtf(from[0] * from[0] + from[1] * from[1]);
        float const lead = away > 0.0f ? (float)LEAD * tall / away : 0.0f;
        float const foot[3] = {X[0] - lead * from[0], X[1] - lead * from[1], X[2]};
        X[2] += (float)s->crown * tall;
        point_residuals(s, foot, b->foot[0], b->foot[1], weight, 0, i);
        point_residuals(s, X, b->head[0], b->head[1], weight, 2, i);
    }
    return BOX_ROWS;
}

/* Residuals of a frame's keypoints: rows x lanes. */
static int32_t frame_residuals(const gait_start *s, int32_t k, const double (*theta)[N], int32_t lanes)
{
    start_scratch *const w = s->scratch;
    const start_problem *const p = &w->problem;
    int32_t rows = 0;
    if (p->person)
        return box_residuals(s, k, theta, lanes);
    place_states(s, theta, lanes, p->at[k], &w->states);
    particle_block_bodies(&s->layout, &w->states, &w->body);
    kin_points(s->model, &w->body, w->points);
    for (int32_t j = 0; j < s->model->points; j++) {
        const start_keypoint *const found = &s->keypoint[p->frame[k]][j];
        double const weight = w->inverse_sd[k][j];
        if (!(weight > 0.0))
            continue;
        for (int32_t i = 0; i < lanes; i++) {
            float const X[3] = {w->points[j][0][i], w->points[j][1][i], w->points[j][2][i]};
            point_residuals(s, X, found->u, found->v, weight, rows, i);
        }
        rows += 2;
    }
    return rows;
}

/* The prior's residuals of one candidate. */
static void prior_residuals(const gait_start *s, const double *q, bool in_place, double r[N])
{
    const start_problem *const p = &s->scratch->problem;
    const gait_model *const m = s->model;
    double const usual = (double)m->stride_length * q[START_STATURE] * q[START_RATE];
    r[START_X] = (q[START_X] - p->place[0]) / PLACE_SD;
    r[START_Y] = (q[START_Y] - p->place[1]) / PLACE_SD;
    r[START_HEADING] = r[START_PHASE] = 0.0;
    r[START_SPEED] = in_place ? q[START_SPEED] / STILL_SD : (q[START_SPEED] - usual) / SPEED_SD;
    r[START_RATE] = (q[START_RATE] - (double)m->stride_hz) / RATE_SD;
    r[START_STATURE] = (q[START_STATURE] - (double)s->cfg.stature) / (double)s->cfg.stature_sd;
    r[START_FLOOR] = q[START_FLOOR] / (p->person ? FOOT_SD : FLOOR_SD);
    for (int32_t k = 0; k < START_SCORES; k++)
        r[START_SCORE + k] = q[START_SCORE + k];
}

/* Costs of up to BLOCK candidates of one mode. */
static void costs(const gait_start *s, const double (*theta)[N], int32_t lanes, bool in_place, double *cost,
                  double *chi2)
{
    start_scratch *const w = s->scratch;
    memset(chi2, 0, (size_t)lanes * sizeof *chi2);
    for (int32_t k = 0; k < w->problem.frames; k++) {
        int32_t const rows = frame_residuals(s, k, theta, lanes);
        for (int32_t row = 0; row < rows; row++)
            for (int32_t i = 0; i < lanes; i++)
                chi2[i] += w->residual[row][i] * w->residual[row][i];
    }
    for (int32_t i = 0; i < lanes; i++) {
        double r[N];
        prior_residuals(s, theta[i], in_place, r);
        cost[i] = chi2[i] * w->problem.share + (in_place && !w->problem.person ? IN_PLACE : 0.0);
        for (int32_t k = 0; k < N; k++)
            cost[i] += r[k] * r[k];
    }
}

/* Normal equations [J, -r]'[J, -r] about a candidate. */
static void linearise(const gait_start *s, const start_candidate *c)
{
    start_scratch *const w = s->scratch;
    double theta[BLOCK][N], r[BLOCK][N], scale = sqrt(w->problem.share);
    for (int32_t i = 0; i <= N; i++) {
        memcpy(theta[i], c->theta, sizeof theta[i]);
        if (i > 0)
            theta[i][i - 1] += STEP[i - 1];
        prior_residuals(s, theta[i], c->in_place, r[i]);
    }
    memset(w->A, 0, sizeof w->A);
    for (int32_t k = 0; k <= w->problem.frames; k++) {
        bool const prior = k == w->problem.frames;
        int32_t const rows = prior ? N : frame_residuals(s, k, (const double (*)[N])theta, N + 1);
        memset(w->W, 0, (size_t)rows * LD * sizeof *w->W);
        for (int32_t row = 0; row < rows; row++) {
            double *const out = w->W + row * LD;
            double const now = prior ? r[0][row] : scale * w->residual[row][0];
            for (int32_t i = 0; i < N; i++) {
                double const then = prior ? r[i + 1][row] : scale * w->residual[row][i + 1];
                out[i] = (then - now) / STEP[i];
            }
            out[N] = -now;
        }
        s->run->cholesky_rank(w->A, LD, w->W, rows);
    }
    if (w->problem.person) {
        w->A[START_HEADING * (LD + 1)] += OPEN;
        w->A[START_PHASE * (LD + 1)] += OPEN;
    }
}

/* Step of Levenberg and Marquardt; false: the equations have no solution. */
static bool solve_step(const gait_start *s, double damping, double step[LD])
{
    start_scratch *const w = s->scratch;
    memcpy(w->U, w->A, sizeof w->U);
    for (int32_t i = 0; i < N; i++)
        w->U[i * (LD + 1)] *= 1.0 + damping;
    if (!s->run->cholesky_factor(w->U, w->U, N, LD))
        return false;
    cholesky_solve(w->U, N, LD, step);
    for (int32_t i = 0; i < N; i++) { /* no further than the derivatives hold */
        double const most = 30.0 * STEP[i];
        step[i] = step[i] > most ? most : step[i] < -most ? -most : step[i];
    }
    return true;
}

static void refine(const gait_start *s, start_candidate *c, int32_t iterations)
{
    double damping = 1e-2;
    for (int32_t n = 0; n < iterations; n++) {
        double const before = c->cost;
        bool better = false;
        linearise(s, c);
        for (int32_t trial = 0; trial < 4 && !better; trial++) {
            double step[LD], next[1][N], cost, chi2;
            if (!solve_step(s, damping, step))
                return;
            for (int32_t i = 0; i < N; i++)
                next[0][i] = c->theta[i] + step[i];
            costs(s, (const double (*)[N])next, 1, c->in_place, &cost, &chi2);
            better = cost < c->cost;
            damping *= better ? 0.25 : 4.0;
            if (better) {
                memcpy(c->theta, next[0], sizeof c->theta);
                c->cost = cost;
                c->chi2 = chi2;
            }
        }
        if (!better || before - c->cost < 1e-3 * (1.0 + c->cost))
            return;
    }
}

/* The first n candidates become the best n, in order. */
static void best_first(start_candidate *c, int32_t count, int32_t n)
{
    for (int32_t k = 0; k < n; k++) {
        int32_t best = k;
        for (int32_t i = k + 1; i < count; i++)
            best = c[i].cost < c[best].cost ? i : best;
        start_candidate const moved = c[best];
        c[best] = c[k];
        c[k] = moved;
    }
}

/* Every heading, phase and mode, walking with the model's usual rate and speed; returns how many. */
static int32_t propose(const gait_start *s)
{
    start_scratch *const w = s->scratch;
    int32_t n = 0;
    int32_t const phases = w->problem.person ? 1 : PHASES;
    for (int32_t mode = 0; mode < 2; mode++) {
        int32_t const headings = mode && w->problem.person ? 1 : HEADINGS;
        for (int32_t first = 0; first < headings * phases; first += BLOCK) {
            int32_t const lanes = i_min(BLOCK, headings * phases - first);
            double theta[BLOCK][N] = {{0.0}}, cost[BLOCK], chi2[BLOCK];
            for (int32_t i = 0; i < lanes; i++) {
                double *const q = theta[i];
                q[START_X] = w->problem.place[0];
                q[START_Y] = w->problem.place[1];
                q[START_HEADING] = (double)((first + i) / phases) * 2.0 * (double)PI_F / HEADINGS;
                q[START_PHASE] = (double)((first + i) % phases) / phases;
                q[START_RATE] = (double)s->model->stride_hz;
                q[START_STATURE] = (double)s->cfg.stature;
                q[START_SPEED] =
                    mode ? 0.0 : (double)s->model->stride_length * q[START_STATURE] * q[START_RATE];
            }
            costs(s, (const double (*)[N])theta, lanes, mode == 1, cost, chi2);
            for (int32_t i = 0; i < lanes; i++, n++) {
                w->candidate[n] = (start_candidate){.cost = cost[i], .chi2 = chi2[i], .in_place = mode == 1};
                memcpy(w->candidate[n].theta, theta[i], sizeof theta[i]);
            }
        }
    }
    return n;
}

/* Whether two proposals have led to the same answer. */
static bool same(const start_candidate *a, const start_candidate *b, bool boxes)
{
    if (boxes && a->in_place && b->in_place)
        return true;
    float const turn = m_wrap_pi((float)(a->theta[START_HEADING] - b->theta[START_HEADING]));
    float const phase = m_wrap_pi(TWO_PI_F * (float)(a->theta[START_PHASE] - b->theta[START_PHASE]));
    return a->in_place == b->in_place && fabsf(turn) < 0.3f && fabsf(phase) < 0.6f;
}

/* Leave out candidates that repeat an earlier one; returns how many are left. */
static int32_t distinct(start_candidate *c, int32_t n, bool boxes)
{
    int32_t left = 0;
    for (int32_t i = 0; i < n; i++) {
        bool found = false;
        for (int32_t k = 0; k < left; k++)
            found |= same(&c[k], &c[i], boxes);
        if (!found)
            c[left++] = c[i];
    }
    return left;
}

static float root(double variance)
{
    return __builtin_sqrtf(f_max((float)variance, 0.0f));
}

/* Keypoints are less exact than their scatter suggests, because errors of a detector last.  A person who has just begun
 * to walk will soon be faster. */
static void widen(const gait_start *s, gait_hypothesis *h)
{
    h->sd.phase = f_max(h->sd.phase, 0.03f);
    h->sd.heading = f_max(h->sd.heading, 0.08f);
    h->sd.stature = f_max(h->sd.stature, 0.03f);
    h->sd.stride_hz =
        f_max(h->sd.stride_hz, f_max(0.03f, SPEEDS_UP * (s->model->stride_hz - h->mean.stride_hz)));
    for (int32_t k = 0; k < 3; k++)
        h->sd.pelvis[k] = f_clamp(h->sd.pelvis[k], LEAST_PLACE_SD, 10.0f);
}

/* Widen the standard deviations of what boxes do not determine. */
static void leave_open(const gait_start *s, const start_candidate *c, gait_hypothesis *h)
{
    h->mean.phase = 0.0f;
    h->sd.phase = s->prior_sd.phase;
    h->mean.pelvis[2] -= (float)c->theta[START_FLOOR]; /* an error of the boxes, not of the floor */
    float ray[3];
    camera_to(&s->cfg.camera, h->mean.pelvis, ray);
    for (int32_t k = 0; k < 2; k++) { /* along the viewing ray */
        double const share = (double)(ray[k] * ray[k] / (ray[0] * ray[0] + ray[1] * ray[1])),
                     own = (double)h->sd.pelvis[k];
        h->sd.pelvis[k] = f_max(root(own * own + share * BOX_PLACE * BOX_PLACE), LEAST_PLACE_SD);
    }
    if (c->in_place) {
        h->mean.stride_hz = s->model->stride_hz;
        h->sd.stride_hz = s->prior_sd.stride_hz;
    }
    h->sd.heading = root((double)h->sd.heading * (double)h->sd.heading + COURSE * COURSE);
    if (c->in_place || h->sd.heading > OPEN_SD) {
        h->mean.heading = c->in_place ? 0.0f : h->mean.heading;
        h->sd.heading = PI_F;
    }
    for (int32_t k = 0; k < s->model->components; k++)
        h->sd.coef[k] = BUILD_SHARE * s->prior_sd.coef[k];
    for (int32_t k = 0; k < s->model->angles; k++)
        h->sd.offset[k] = BUILD_SHARE * s->prior_sd.offset[k];
}

/* State of a candidate at a moment, with its standard deviations; returns the log of the root of the determinant of
 * its covariance. */
static double describe(gait_start *s, const start_candidate *c, double at, gait_hypothesis *h)
{
    start_scratch *const w = s->scratch;
    double covariance[N][LD], theta[1][N], step[LD];
    linearise(s, c);
    if (!solve_step(s, 0.0, step))
        memset(w->U, 0, sizeof w->U);
    for (int32_t i = 0; i < N; i++) {
        memset(covariance[i], 0, sizeof covariance[i]);
        covariance[i][i] = 1.0;
        cholesky_forward_vector(w->U, N, LD, covariance[i]);
        cholesky_backward(w->U, N, LD, covariance[i]);
    }
    memcpy(theta[0], c->theta, sizeof theta[0]);
    place_states(s, (const double (*)[N])theta, 1, at, &w->states);
    particle_state now = {{0}};
    for (int32_t f = 0; f < F_MAX; f++)
        now.f[f] = w->states.f[f][0];
    h->mean = particle_to_state(&s->layout, &now);
    h->sd = s->prior_sd;
    double const ahead = at * at;
    h->sd.phase = root(covariance[START_PHASE][START_PHASE] + 2.0 * at * covariance[START_PHASE][START_RATE] +
                       ahead * covariance[START_RATE][START_RATE]);
    h->sd.stride_hz = root(covariance[START_RATE][START_RATE]);
    h->sd.stature = root(covariance[START_STATURE][START_STATURE]);
    h->sd.heading = root(covariance[START_HEADING][START_HEADING]);
    double const moved = ahead * covariance[START_SPEED][START_SPEED];
    h->sd.pelvis[0] = root(covariance[START_X][START_X] + moved);
    h->sd.pelvis[1] = root(covariance[START_Y][START_Y] + moved);
    h->sd.pelvis[2] = root(covariance[START_FLOOR][START_FLOOR]);
    for (int32_t k = 0; k < s->layout.components; k++)
        h->sd.coef[k] = root(covariance[START_SCORE + k][START_SCORE + k]);
    if (w->problem.person)
        leave_open(s, c, h);
    else
        widen(s, h);
    h->speed = (float)c->theta[START_SPEED];
    h->speed_sd = root(covariance[START_SPEED][START_SPEED]);
    h->in_place = c->in_place;
    h->observations = w->problem.observations;
    h->chi2_per_observation = (float)(c->chi2 / (double)w->problem.observations);
    return -cholesky_log_det(w->U, N, LD);
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
    int32_t const proposed = propose(s), refined = i_min(proposed, START_REFINED);
    best_first(w->candidate, proposed, refined);
    for (int32_t i = 0; i < refined; i++)
        refine(s, &w->candidate[i], boxes ? 8 : 3);
    best_first(w->candidate, refined, refined);
    int32_t n = i_min(distinct(w->candidate, refined, boxes), i_min(capacity, GAIT_START_MAX_HYPOTHESES));
    for (int32_t i = 0; i < n; i++)
        refine(s, &w->candidate[i], 15);
    best_first(w->candidate, n, n);
    n = distinct(w->candidate, n, boxes);
    double const at = 1e-6 * (double)(utime - w->problem.middle);
    for (int32_t i = 0; i < n; i++) {
        weight[i] = describe(s, &w->candidate[i], at, &out[i]) - 0.5 * w->candidate[i].cost;
        top = weight[i] > top ? weight[i] : top;
    }
    for (int32_t i = 0; i < n; i++)
        sum += m_exp64(weight[i] - top);
    for (int32_t i = 0; i < n; i++)
        out[i].probability = (float)(m_exp64(weight[i] - top) / sum);
    return n;
}

/* Hypotheses of everyone in the boxes. */
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
