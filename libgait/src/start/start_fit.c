#include "start/start_fit.h"
#include "base/cholesky.h"
#include "base/fmath.h"
#include "image/camera.h"

#include <string.h>

enum { N = START_UNKNOWNS, LD = START_LD };

static const double RATE_SD_HZ = 0.15;  /* strides per second: people in films walk as slowly as they like */
static const double SPEED_SD = 0.4;     /* metres per second, about the speed of the steps */
static const double STILL_SD = 0.1;     /* metres per second, in place */
static const double FLOOR_SD = 0.03;    /* metres: a camera's height is not exact */
static const double PLACE_SD = 3.0;     /* metres, about where the length of the legs puts the person */
static const double IN_PLACE = 8.0;     /* twice the log odds of walking along a path over walking in place */
static const double OTHER_ODDS = 16.0;  /* the same, of the model's first class over another */
static const double DEGREES = 4.0;      /* of freedom of the keypoints' errors */
static const double BEHIND_SDS = 1e3;   /* standard deviations for joints behind the camera */
static const double LEAD = 0.1;         /* statures: the foot lower in the image is nearer than the body */
static const double FOOT_SD = 0.06;     /* metres by which all foot points of a person may be off */
static const double BOX_PLACE = 0.1;    /* metres by which shadows and clothes move all boxes of a person */
static const double COURSE = 0.15;      /* radians: people do not walk exactly where their box moves */
static const double OPEN = 0.3;         /* information that boxes get on heading and phase */
static const float OPEN_SD = 0.9f;      /* radians of standard deviation from which a heading is unknown */
static const float BUILD_SHARE = 0.25f; /* of the sd of scores and posture while the phase is unknown */
static const float SPEEDS_UP = 0.4f;    /* sd of a rate below the usual one, as a share of the difference */
static const float LEAST_PLACE_SD = 0.05f; /* metres */

/* Steps of the finite differences that replace derivatives. */
static const double STEP[N] = {0.02, 0.02, 0.03, 0.03, 0.01, 0.01, 0.01, 0.01, 0.1, 0.1, 0.1};

/* States of up to BLOCK candidates of a class at a moment. */
static void place_states(const state_layout *layout, const double (*theta)[N], int32_t lanes, double at,
                         particle_block *b)
{
    double const ahead = layout->model->direction * at;
    memset(b, 0, sizeof *b);
    for (int32_t i = 0; i < BLOCK; i++) {
        const double *const q = theta[i_min(i, lanes - 1)];
        float sn, cs;
        float const heading = m_wrap_pi_one((float)q[START_HEADING]), way = (float)(q[START_SPEED] * ahead);
        m_sincos_one(heading, &sn, &cs);
        b->f[F_PHASE][i] = m_wrap1((float)(q[START_PHASE] + q[START_RATE] * ahead));
        b->f[F_RATE][i] = f_clamp((float)q[START_RATE], 0.1f, 4.0f);
        b->f[F_X][i] = (float)q[START_X] + way * cs;
        b->f[F_Y][i] = (float)q[START_Y] + way * sn;
        b->f[F_Z][i] = (float)q[START_FLOOR];
        b->f[F_HEADING][i] = heading;
        b->f[F_STATURE][i] = f_clamp((float)q[START_STATURE], LEAST_STATURE, 3.0f);
        for (int32_t k = 0; k < layout->components; k++)
            b->f[F_COEF + k][i] = (float)q[START_SCORE + k];
    }
}

gait_camera start_camera(const gait_start *s, int32_t k)
{
    const start_problem *const p = &s->scratch->problem;
    const start_view *const v = p->person ? &p->person->box[p->frame[k]].view : &s->view[p->frame[k]];
    return camera_placed(&s->cfg.camera, v->R, v->t);
}

/* Two rows of residuals of one lane, between the projection of a point X and (u, v), down-weighted so that their squares
 * are Student's t costs. */
static void point_residuals(const gait_start *s, const gait_camera *cam, const float X[3], double u, double v,
                            double weight, int32_t row, int32_t lane)
{
    start_scratch *const w = s->scratch;
    float uv[2];
    double du = BEHIND_SDS, dv = BEHIND_SDS;
    if (camera_project(cam, X, uv) > CAMERA_NEAR) {
        du = ((double)uv[0] - u) * weight;
        dv = ((double)uv[1] - v) * weight;
    }
    double const square = du * du + dv * dv;
    double const robust = square > 1e-9 ? sqrt(DEGREES * m_log64(1.0 + square / DEGREES) / square) : 1.0;
    w->residual[row][lane] = robust * du;
    w->residual[row + 1][lane] = robust * dv;
}

/* Residuals of a frame's box: rows x lanes. */
static int32_t box_residuals(const gait_start *s, const state_layout *layout, int32_t k,
                             const double (*theta)[N], int32_t lanes)
{
    start_scratch *const w = s->scratch;
    const start_problem *const p = &w->problem;
    const start_box *const b = &p->person->box[p->frame[k]];
    double const weight = w->inverse_sd[k][0];
    gait_camera const cam = start_camera(s, k);
    place_states(layout, theta, lanes, p->at[k], &w->states);
    for (int32_t i = 0; i < lanes; i++) {
        float X[3] = {w->states.f[F_X][i], w->states.f[F_Y][i], w->states.f[F_Z][i]}, from[3];
        float const tall = w->states.f[F_STATURE][i];
        camera_to(&cam, X, from);
        float const away = __builtin_sqrtf(from[0] * from[0] + from[1] * from[1]);
        float const lead = away > 0.0f ? (float)LEAD * tall / away : 0.0f;
        float const foot[3] = {X[0] - lead * from[0], X[1] - lead * from[1], X[2]};
        X[2] += (float)s->crown * tall;
        point_residuals(s, &cam, foot, b->foot[0], b->foot[1], weight, 0, i);
        point_residuals(s, &cam, X, b->head[0], b->head[1], weight, 2, i);
    }
    return START_BOX_ROWS;
}

/* Residuals of a frame's keypoints: rows x lanes. */
static int32_t frame_residuals(const gait_start *s, const state_layout *layout, int32_t k,
                               const double (*theta)[N], int32_t lanes)
{
    start_scratch *const w = s->scratch;
    const start_problem *const p = &w->problem;
    int32_t rows = 0;
    if (p->person)
        return box_residuals(s, layout, k, theta, lanes);
    gait_camera const cam = start_camera(s, k);
    place_states(layout, theta, lanes, p->at[k], &w->states);
    particle_block_bodies(layout, &w->states, &w->body);
    kin_points(layout->model, &w->body, w->points);
    for (int32_t j = 0; j < s->model->points; j++) {
        const start_keypoint *const found = &s->keypoint[p->frame[k]][j];
        double const weight = w->inverse_sd[k][j];
        if (!(weight > 0.0))
            continue;
        for (int32_t i = 0; i < lanes; i++) {
            float const X[3] = {w->points[j][0][i], w->points[j][1][i], w->points[j][2][i]};
            point_residuals(s, &cam, X, found->u, found->v, weight, rows, i);
        }
        rows += 2;
    }
    return rows;
}

/* The prior's residuals of one candidate. */
static void prior_residuals(const gait_start *s, const gait_model *m, const double *q, bool in_place,
                            double r[N])
{
    const start_problem *const p = &s->scratch->problem;
    double const usual = (double)m->stride_length * q[START_STATURE] * q[START_RATE];
    r[START_X] = (q[START_X] - p->place[0]) / PLACE_SD;
    r[START_Y] = (q[START_Y] - p->place[1]) / PLACE_SD;
    r[START_HEADING] = r[START_PHASE] = 0.0;
    r[START_SPEED] = in_place ? q[START_SPEED] / STILL_SD : (q[START_SPEED] - usual) / SPEED_SD;
    r[START_RATE] = (q[START_RATE] - (double)m->stride_hz) / RATE_SD_HZ;
    r[START_STATURE] = (q[START_STATURE] - (double)s->cfg.stature) / (double)s->cfg.stature_sd;
    r[START_FLOOR] = q[START_FLOOR] / (p->person ? FOOT_SD : FLOOR_SD);
    for (int32_t k = 0; k < START_SCORES; k++)
        r[START_SCORE + k] = q[START_SCORE + k];
}

/* Costs of up to BLOCK candidates of one mode and class. */
static void costs(const gait_start *s, const state_layout *layout, const double (*theta)[N], int32_t lanes,
                  bool in_place, double *cost, double *chi2)
{
    start_scratch *const w = s->scratch;
    double const odds = (in_place && !w->problem.person ? IN_PLACE : 0.0) +
                        (layout->model->motion_class == 0 ? 0.0 : OTHER_ODDS);
    memset(chi2, 0, (size_t)lanes * sizeof *chi2);
    for (int32_t k = 0; k < w->problem.frames; k++) {
        int32_t const rows = frame_residuals(s, layout, k, theta, lanes);
        for (int32_t row = 0; row < rows; row++)
            for (int32_t i = 0; i < lanes; i++)
                chi2[i] += w->residual[row][i] * w->residual[row][i];
    }
    for (int32_t i = 0; i < lanes; i++) {
        double r[N];
        prior_residuals(s, layout->model, theta[i], in_place, r);
        cost[i] = chi2[i] * w->problem.share + odds;
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
        prior_residuals(s, c->layout->model, theta[i], c->in_place, r[i]);
    }
    memset(w->A, 0, sizeof w->A);
    for (int32_t k = 0; k <= w->problem.frames; k++) {
        bool const prior = k == w->problem.frames;
        int32_t const rows = prior ? N : frame_residuals(s, c->layout, k, (const double (*)[N])theta, N + 1);
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
    for (int32_t i = 0; i < N; i++) { /* no further than the linearisation is valid */
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
            costs(s, c->layout, (const double (*)[N])next, 1, c->in_place, &cost, &chi2);
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

/* Every heading and phase of a mode and class, with its usual rate and speed, from candidate n on; returns how many there
 * are then. */
static int32_t propose_mode(const gait_start *s, const state_layout *layout, bool in_place, int32_t n)
{
    start_scratch *const w = s->scratch;
    const gait_model *const m = layout->model;
    int32_t const phases = w->problem.person ? 1 : START_PHASES;
    int32_t const headings = in_place && w->problem.person ? 1 : START_HEADINGS;
    for (int32_t first = 0; first < headings * phases; first += BLOCK) {
        int32_t const lanes = i_min(BLOCK, headings * phases - first);
        double theta[BLOCK][N] = {{0.0}}, cost[BLOCK], chi2[BLOCK];
        for (int32_t i = 0; i < lanes; i++) {
            double *const q = theta[i];
            q[START_X] = w->problem.place[0];
            q[START_Y] = w->problem.place[1];
            q[START_HEADING] = (double)((first + i) / phases) * 2.0 * (double)PI_F / START_HEADINGS;
            q[START_PHASE] = (double)((first + i) % phases) / phases;
            q[START_RATE] = (double)m->stride_hz;
            q[START_STATURE] = (double)s->cfg.stature;
            q[START_SPEED] = in_place ? 0.0 : (double)m->stride_length * q[START_STATURE] * q[START_RATE];
        }
        costs(s, layout, (const double (*)[N])theta, lanes, in_place, cost, chi2);
        for (int32_t i = 0; i < lanes; i++, n++) {
            w->candidate[n] =
                (start_candidate){.cost = cost[i], .chi2 = chi2[i], .layout = layout, .in_place = in_place};
            memcpy(w->candidate[n].theta, theta[i], sizeof theta[i]);
        }
    }
    return n;
}

/* The best candidates of all modes and classes; returns how many. */
static int32_t propose(const gait_start *s)
{
    start_candidate *const c = s->scratch->candidate;
    int32_t const classes = s->scratch->problem.person ? 1 : s->striding;
    int32_t n = 0;
    for (int32_t k = 0; k < classes; k++)
        for (int32_t in_place = 0; in_place < 2; in_place++) {
            int32_t const proposed = propose_mode(s, &s->layout[k], in_place, n);
            n = i_min(proposed, START_REFINED);
            best_first(c, proposed, n);
        }
    return n;
}

/* Whether two candidates have converged to the same solution. */
static bool same(const start_candidate *a, const start_candidate *b, bool boxes)
{
    if (boxes && a->in_place && b->in_place)
        return true;
    float const turn = m_wrap_pi_one((float)(a->theta[START_HEADING] - b->theta[START_HEADING]));
    float const phase = m_wrap_pi_one(TWO_PI_F * (float)(a->theta[START_PHASE] - b->theta[START_PHASE]));
    return a->in_place == b->in_place && a->layout == b->layout && fabsf(turn) < 0.3f && fabsf(phase) < 0.6f;
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

int32_t start_fit(const gait_start *s, int32_t capacity)
{
    start_candidate *const c = s->scratch->candidate;
    bool const boxes = s->scratch->problem.person != NULL;
    int32_t const refined = propose(s);
    for (int32_t i = 0; i < refined; i++)
        refine(s, &c[i], boxes ? 8 : 3);
    best_first(c, refined, refined);
    int32_t const n = i_min(distinct(c, refined, boxes), i_min(capacity, GAIT_START_MAX_HYPOTHESES));
    for (int32_t i = 0; i < n; i++)
        refine(s, &c[i], 15);
    best_first(c, n, n);
    return distinct(c, n, boxes);
}

static float root(double variance)
{
    return __builtin_sqrtf(f_max((float)variance, 0.0f));
}

/* Widen standard deviations.  Keypoints are less exact than their scatter suggests, because a detector's errors last, and
 * a person who has just begun to walk will soon be faster. */
static void widen(const gait_model *m, gait_hypothesis *h)
{
    h->sd.phase = f_clamp(h->sd.phase, 0.03f, 0.5f);
    h->sd.heading = f_clamp(h->sd.heading, 0.08f, PI_F);
    h->sd.stature = f_max(h->sd.stature, 0.03f);
    h->sd.stride_hz = f_max(h->sd.stride_hz, f_max(0.03f, SPEEDS_UP * (m->stride_hz - h->mean.stride_hz)));
    for (int32_t k = 0; k < 3; k++)
        h->sd.pelvis[k] = f_clamp(h->sd.pelvis[k], LEAST_PLACE_SD, MOST_SD);
}

/* Widen the standard deviations of what boxes do not determine; returns what this adds to the covariance of x and y. */
static double leave_open(const gait_start *s, const start_candidate *c, gait_hypothesis *h)
{
    h->mean.phase = 0.0f;
    h->sd.phase = s->prior_sd.phase;
    h->mean.pelvis[2] -= (float)c->theta[START_FLOOR]; /* an error of the boxes, not of the floor */
    float ray[3];
    camera_to(&s->cfg.camera, h->mean.pelvis, ray);
    double const along =
        BOX_PLACE * BOX_PLACE / (double)(ray[0] * ray[0] + ray[1] * ray[1]); /* the viewing ray */
    for (int32_t k = 0; k < 2; k++) {
        double const own = (double)h->sd.pelvis[k];
        h->sd.pelvis[k] =
            f_clamp(root(own * own + along * (double)(ray[k] * ray[k])), LEAST_PLACE_SD, MOST_SD);
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
    return along * (double)(ray[0] * ray[1]);
}

/* Derivatives of what is described by the unknowns: state at a moment, in place of that in the middle of the frames, and
 * the others as they are.  Afterwards rows (of U^-T) whose products are covariances. */
static void describe_errors(const start_scratch *w, const start_candidate *c, double at, double row[N][LD])
{
    float sn, cs;
    double const ahead = c->layout->model->direction * at, way = ahead * c->theta[START_SPEED];
    m_sincos_one((float)c->theta[START_HEADING], &sn, &cs);
    memset(row, 0, N * sizeof *row);
    row[START_PHASE][START_RATE] = ahead;
    row[START_X][START_SPEED] = ahead * (double)cs;
    row[START_X][START_HEADING] = -way * (double)sn;
    row[START_Y][START_SPEED] = ahead * (double)sn;
    row[START_Y][START_HEADING] = way * (double)cs;
    for (int32_t i = 0; i < N; i++) {
        row[i][i] = 1.0;
        cholesky_forward_vector(w->U, N, LD, row[i]);
    }
}

static double product(const double *a, const double *b)
{
    double sum = 0.0;
    for (int32_t i = 0; i < N; i++)
        sum += a[i] * b[i];
    return sum;
}

static float sd_of(const double *row)
{
    return root(product(row, row));
}

/* Correlation of the state, whose standard deviations have been widened, with `added` covariance of x and y. */
static void correlate(const double row[N][LD], double added, gait_hypothesis *h)
{
    static const uint8_t of[DYNAMICS_CORRELATED] = {START_PHASE,   START_RATE, START_STATURE,
                                                    START_HEADING, START_X,    START_Y};
    float const widened[DYNAMICS_CORRELATED] = {h->sd.phase,   h->sd.stride_hz, h->sd.stature,
                                                h->sd.heading, h->sd.pelvis[0], h->sd.pelvis[1]};
    float sd[DYNAMICS_CORRELATED];
    memset(h->correlation, 0, sizeof h->correlation);
    for (int32_t i = 0; i < DYNAMICS_CORRELATED; i++) {
        sd[i] = f_max(widened[i], sd_of(row[of[i]]));
        h->correlation[i][i] = 1.0f;
        for (int32_t k = 0; k < i; k++) {
            double const more = of[i] == START_Y && of[k] == START_X ? added : 0.0;
            float const r = (float)(product(row[of[i]], row[of[k]]) + more) / (sd[i] * sd[k]);
            if (fabsf(r) <= 1.0f) /* not if the equations have no solution */
                h->correlation[i][k] = h->correlation[k][i] = r;
        }
    }
}

double start_describe(const gait_start *s, const start_candidate *c, double at, gait_hypothesis *h)
{
    start_scratch *const w = s->scratch;
    double row[N][LD], theta[1][N], step[LD];
    linearise(s, c);
    if (!solve_step(s, 0.0, step))
        memset(w->U, 0, sizeof w->U);
    describe_errors(w, c, at, row);
    memcpy(theta[0], c->theta, sizeof theta[0]);
    place_states(c->layout, (const double (*)[N])theta, 1, at, &w->states);
    particle_state now = {{0}};
    for (int32_t f = 0; f < F_MAX; f++)
        now.f[f] = w->states.f[f][0];
    h->mean = particle_to_state(c->layout, &now);
    h->sd = s->prior_sd;
    h->sd.phase = sd_of(row[START_PHASE]);
    h->sd.stride_hz = sd_of(row[START_RATE]);
    h->sd.stature = sd_of(row[START_STATURE]);
    h->sd.heading = sd_of(row[START_HEADING]);
    h->sd.pelvis[0] = sd_of(row[START_X]);
    h->sd.pelvis[1] = sd_of(row[START_Y]);
    h->sd.pelvis[2] = sd_of(row[START_FLOOR]);
    for (int32_t k = 0; k < c->layout->components; k++)
        h->sd.coef[k] = sd_of(row[START_SCORE + k]);
    double added = 0.0;
    if (w->problem.person)
        added = leave_open(s, c, h);
    else
        widen(c->layout->model, h);
    correlate((const double (*)[LD])row, added, h);
    h->speed = (float)c->theta[START_SPEED];
    h->speed_sd = sd_of(row[START_SPEED]);
    h->in_place = c->in_place;
    if (c->in_place)
        h->sd.turn_rate = 0.0f;
    h->observations = w->problem.observations;
    h->chi2_per_observation = (float)(c->chi2 / (double)w->problem.observations);
    return -cholesky_log_det(w->U, N, LD);
}
