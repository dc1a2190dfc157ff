/* Simulation-based calibration of the library's dynamics (Talts et al. 2018): truths walk by eqs. 5-9 written
 * out here in double precision, every field is observed with normal noise, and the truth ranks uniformly among
 * draws of the filter's posterior: an error in the prior, the motion, the weights or resampling shows. */
#include "toy_crowd.h"

enum { FIELDS = F_COEF + 4, FRAMES = 5, NORMALS = 16 };

static const double DT = 0.1, PI = 3.14159265358979324;

/* Standard deviations of the start. */
static const double start_sd[FIELDS] = {
    [F_PHASE] = 0.05,  [F_RATE] = 0.05,    [F_X] = 0.1,        [F_Y] = 0.1,        [F_Z] = 0.02,
    [F_HEADING] = 0.2, [F_PITCH] = 0.05,   [F_ROLL] = 0.05,    [F_STATURE] = 0.05, [F_TURN] = 0.3,
    [F_COEF] = 0.7,    [F_COEF + 1] = 0.7, [F_COEF + 2] = 0.7, [F_COEF + 3] = 0.05};

static dynamics lively(uint64_t seed)
{
    dynamics const d = quiet(GAIT_MODE_DEFAULT, seed);
    cfg.settle_time = 9.0f; /* stature may change all along */
    cfg.rate_noise = 0.05f;
    cfg.phase_noise = 0.05f;
    cfg.forward_noise = 0.1f;
    cfg.lateral_noise = 0.06f;
    cfg.vertical_noise = 0.03f;
    cfg.heading_noise = 0.2f;
    cfg.turn_sd = 0.5f;
    cfg.turn_time = 0.5f;
    cfg.tilt_noise = 0.08f;
    cfg.coef_noise = 0.8f;
    cfg.coef_time = 2.0f;
    cfg.stature_noise_start = 0.6f; /* 0.03 of stature */
    cfg.proportion_noise = 0.8f;
    cfg.offset_noise = 1.2f;
    return d;
}

static void normals(uint64_t seed, uint32_t stream, int frame, double out[NORMALS])
{
    float n[4];
    for (uint32_t k = 0; k < NORMALS; k++) {
        rng_normal4(seed, stream, (uint32_t)frame, k / 4, 0, n);
        out[k] = (double)n[k % 4];
    }
}

/* ---- the model, written out ---- */

/* Ornstein-Uhlenbeck: return to zero with time constant tau against noise per sqrt(second). */
static double relaxed(double x, double tau, double noise, double n)
{
    double const keep = exp(-DT / tau);
    return keep * x + noise * sqrt(0.5 * tau * (1.0 - keep * keep)) * n;
}

/* Independent normals about the state of a pelvis, but half of the people do not turn; the pelvis's height over the
 * ground and the floor's own level (0 +- 0.03 m) are two measurements of one thing. */
static void truth_start(const state_layout *rule, const gait_state *mean, const double n[NORMALS], double *x)
{
    double const floor = 0.03, height_sd = start_sd[F_Z],
                 trust = floor * floor / (floor * floor + height_sd * height_sd);
    double s[FIELDS];
    for (int f = 0; f < FIELDS; f++)
        s[f] = start_sd[f] * n[f];
    gait_state const drawn = {
        .phase = mean->phase + (float)s[F_PHASE],
        .stride_hz = mean->stride_hz + (float)s[F_RATE],
        .stature = mean->stature + (float)s[F_STATURE],
        .heading = mean->heading + (float)s[F_HEADING],
        .pitch = mean->pitch + (float)s[F_PITCH],
        .roll = mean->roll + (float)s[F_ROLL],
        .turn_rate = n[FIELDS] < 0.0 ? 0.0f : (float)(sqrt(2.0) * s[F_TURN]),
        .pelvis = {mean->pelvis[0] + (float)s[F_X], mean->pelvis[1] + (float)s[F_Y], mean->pelvis[2]},
        .coef = {(float)s[F_COEF], (float)s[F_COEF + 1]},
        .proportion = {(float)s[F_COEF + 2]},
        .offset = {[OFFSET_ANGLE] = (float)s[F_COEF + 3]}};
    particle_state const w = particle_from_state(rule, &drawn);
    for (int f = 0; f < FIELDS; f++)
        x[f] = (double)w.f[f];
    x[F_Z] = trust * x[F_Z] + sqrt(trust) * s[F_Z];
}

/* Eqs. 5-9 of Ormoneit et al. with the details of doc/method.md. */
static void truth_move(const gait_model *m, const double n[NORMALS], double *x)
{
    double const own = (double)m->stride_hz, root = sqrt(DT);
    float const score[] = {(float)x[F_COEF], (float)x[F_COEF + 1]};
    double const turn = x[F_RATE] * DT + 0.05 * root * n[0];
    double const middle = x[F_PHASE] + 0.5 * turn;
    double const speed =
        (double)root_channel(m, ROOT_FORWARD, (float)(middle - floor(middle)), 0.0f, score, 2);
    double const ahead = x[F_STATURE] * speed * turn + 0.1 * root * n[1], aside = 0.06 * root * n[2];
    double const curve = x[F_TURN] * DT, way = x[F_HEADING] + 0.5 * curve;
    double const changes = 0.9103; /* normals above it: 1 - exp(-DT / 0.5) */
    x[F_PHASE] += turn - floor(x[F_PHASE] + turn);
    x[F_RATE] = own + relaxed(x[F_RATE] - own, 5.0, 0.05 * own, n[3]);
    x[F_X] += ahead * cos(way) - aside * sin(way);
    x[F_Y] += ahead * sin(way) + aside * cos(way);
    x[F_HEADING] += curve + 0.2 * root * n[4];
    if (n[15] > changes)
        x[F_TURN] = n[14] > 0.0 ? 0.5 * n[13] : 0.0;
    x[F_Z] = relaxed(x[F_Z], 1.1, 0.03, n[5]);
    x[F_PITCH] = relaxed(x[F_PITCH], 1.1, 0.08, n[6]);
    x[F_ROLL] = relaxed(x[F_ROLL], 1.1, 0.08, n[7]);
    x[F_STATURE] *= 1.0 + 0.03 * root * n[8];
    for (int k = 0; k < 2; k++)
        x[F_COEF + k] = relaxed(x[F_COEF + k], 2.0, 0.8, n[9 + k]);
    x[F_COEF + 2] =
        relaxed(x[F_COEF + 2], 2.0 / (0.8 * 0.8), 0.8, n[11]); /* stationary standard deviation 1 */
    x[F_COEF + 3] = relaxed(x[F_COEF + 3], 2.0 / (1.2 * 1.2), 0.06, n[12]); /* 1.2 of 0.05 */
}

/* ---- what is observed: every field in every frame, `noise` times as uncertain as at the start ---- */

/* A field's difference from a value; of phase and heading the shorter way round. */
static double apart(int field, double a, double b)
{
    double const turn = field == F_PHASE ? 1.0 : field == F_HEADING ? 2.0 * PI : 0.0;
    return turn > 0.0 ? a - b - turn * floor((a - b) / turn + 0.5) : a - b;
}

static float log_likelihood(const particle_state *w, const double observed[FIELDS], double noise)
{
    double cost = 0.0;
    for (int f = 0; f < FIELDS; f++) {
        double const z = apart(f, (double)w->f[f], observed[f]) / (noise * start_sd[f]);
        cost += 0.5 * z * z;
    }
    return (float)-cost;
}

static void crowd_start(crowd *c, const gait_state *mean)
{
    gait_state sd = {.phase = (float)start_sd[F_PHASE],
                     .stride_hz = (float)start_sd[F_RATE],
                     .stature = (float)start_sd[F_STATURE],
                     .heading = (float)start_sd[F_HEADING],
                     .pitch = (float)start_sd[F_PITCH],
                     .roll = (float)start_sd[F_ROLL],
                     .turn_rate = (float)start_sd[F_TURN],
                     .pelvis = {(float)start_sd[F_X], (float)start_sd[F_Y], (float)start_sd[F_Z]},
                     .coef = {(float)start_sd[F_COEF], (float)start_sd[F_COEF + 1]},
                     .proportion = {(float)start_sd[F_COEF + 2]}};
    sd.offset[OFFSET_ANGLE] = (float)start_sd[F_COEF + 3];
    for (int32_t i = 0; i < c->p.n; i++)
        c->now[i] = dynamics_draw(&c->d, mean, &sd, NULL, i);
}

/* Nearly 0: gives random ranks to people who walk straight on, whose turn rates are equal. */
static double lot(uint64_t run, int field, int32_t i)
{
    float n[4];
    rng_normal4(run, 104, (uint32_t)field, (uint32_t)i, 0, n);
    return 1e-9 * (double)n[0];
}

/* One truth, one filter; counts the truth's rank in every field, of the difference from what was observed
 * last. */
static void simulate(uint64_t run, int32_t particles, double noise, int32_t count[FIELDS][RANKS])
{
    static float ll[TOY_MOST];
    static double value[TOY_MOST];
    gait_state const mean = toy_state(0.2f);
    dynamics const d = lively(run);
    crowd c = crowd_new(&d, particles);
    double x[FIELDS], observed[FIELDS], n[NORMALS];
    crowd_start(&c, &mean);
    normals(run, 100, 0, n);
    truth_start(&d.rule, &mean, n, x);
    for (int t = 1; t <= FRAMES; t++) {
        normals(run, 101, t, n);
        truth_move(toy_model(), n, x);
        normals(run, 102, t, n);
        for (int f = 0; f < FIELDS; f++)
            observed[f] = x[f] + noise * start_sd[f] * n[f];
        crowd_predict(&c, (float)DT, (float)(t * DT), (uint32_t)t);
        for (int32_t i = 0; i < particles; i++)
            ll[i] = log_likelihood(c.now + i, observed, noise);
        crowd_update(&c, ll);
    }
    pf_resample_multinomial(&c.p, run, 103, 0);
    for (int f = 0; f < FIELDS; f++) {
        for (int32_t i = 0; i < particles; i++)
            value[i] = apart(f, (double)c.now[i].f[f], observed[f]) + lot(run, f, i);
        count[f][ranks_of(c.p.parent, value, apart(f, x[f], observed[f]) + lot(run, f, -1))]++;
    }
}

static void test_ranks(int32_t runs, int32_t particles, double noise)
{
    int32_t count[FIELDS][RANKS] = {{0}};
    for (uint64_t run = 1; run <= (uint64_t)runs; run++)
        simulate(run, particles, noise, count);
    for (int f = 0; f < FIELDS; f++) {
        CHECK(ranks_chi2(count[f]) < RANKS_LIMIT);
        FIGURE("C6 noise %g, field %d: chi square %.1f\n", noise, f, ranks_chi2(count[f]));
    }
}

int main(void)
{
    test_ranks(2000, 256, 1e3); /* hardly anything is observed: only prior and motion count */
    test_ranks(400, 4096, 3.5); /* particles enough for fourteen fields */
    return CHECK_DONE();
}
