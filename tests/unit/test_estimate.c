/* The estimate of weighted particles, against direct sums in double precision. */
#include "tracker/estimate.h"
#include "tracker/likelihood_step.h"

#include "kernel_check.h"
#include "base/rng.h"
#include "toy_tracker.h"

#include "check.h"

enum { N = 40 };

static gait_tracker *t;
static particle_set *particles;

/* Every particle the same plausible state, of weight 1/N, its joints zero. */
static void reset(void)
{
    particles = &t->particles;
    pf_uniform(&t->filter);
    for (int32_t i = 0; i < N; i++) {
        particle_state const w = {.f = {[F_PHASE] = 0.5f, [F_RATE] = 0.9f, [F_STATURE] = 1.75f}};
        particle_put(particles, i, &w);
    }
    memset(t->joints.value, 0, (size_t)(3 * TOY_POINTS * N) * sizeof *t->joints.value);
}

static float normal(uint32_t index, uint32_t draw)
{
    float n[4];
    rng_normal4(31, 0, 0, index, draw, n);
    return n[0];
}

/* Weights that fall from the particle `best` on, normalised. */
static void set_weights(int32_t best)
{
    double sum = 0.0;
    for (int32_t i = 0; i < N; i++)
        sum += t->filter.weight[i] = i == best ? 2.0 : 0.2 + fabs((double)normal((uint32_t)i, 99)) / 3.0;
    for (int32_t i = 0; i < N; i++)
        t->filter.weight[i] /= sum;
}

static gait_estimate estimate(int32_t best)
{
    gait_estimate e = {0};
    estimate_particles(t, best, &e);
    return e;
}

static double circle(double x) /* to (-1/2, 1/2] */
{
    return x - floor(x + 0.5);
}

/* Weighted resultant of angles in turns: mean direction (turns) and length. */
static void resultant(const float *turns, double scale, double *mean, double *length)
{
    double c = 0.0, s = 0.0;
    for (int i = 0; i < N; i++) {
        c += t->filter.weight[i] * cos(6.283185307179586 * (double)turns[i] * scale);
        s += t->filter.weight[i] * sin(6.283185307179586 * (double)turns[i] * scale);
    }
    *mean = atan2(s, c) / 6.283185307179586;
    *length = hypot(c, s);
}

/* ---- circles ---- */
static void test_phase(void)
{
    static const float centre[] = {0.0f, 0.99f, 0.5f, 0.02f};
    for (size_t k = 0; k < 4; k++) { /* also across 0 / 1 */
        double mean, length;
        reset();
        for (int32_t i = 0; i < N; i++)
            field(particles, F_PHASE)[i] = m_wrap1(centre[k] + 0.03f * normal((uint32_t)i, 1));
        set_weights(4);
        field(particles, F_PHASE)[4] = centre[k];
        resultant(field(particles, F_PHASE), 1.0, &mean, &length);
        gait_estimate const e = estimate(4);
        CHECK_NEAR(circle((double)e.mean.phase - mean), 0.0, 1e-5);
        CHECK(e.mean.phase >= 0.0f && e.mean.phase < 1.0f);
        CHECK_NEAR(e.phase_r, length, 1e-5);
        CHECK_NEAR(e.sd.phase, sqrt(-2.0 * log(length)) / 6.283185307, 1e-4);
        CHECK_NEAR(e.hypothesis_weight, 1.0, 1e-6);
    }
}

static void test_heading(void)
{
    static const float centre[] = {0.0f, 3.1f, -3.1f, 1.5f};
    for (size_t k = 0; k < 4; k++) { /* also across +-pi */
        double mean, length;
        reset();
        for (int32_t i = 0; i < N; i++)
            field(particles, F_HEADING)[i] = m_wrap_pi(centre[k] + 0.1f * normal((uint32_t)i, 2));
        set_weights(7);
        field(particles, F_HEADING)[7] = centre[k];
        resultant(field(particles, F_HEADING), 1.0 / 6.283185307179586, &mean, &length);
        gait_estimate const e = estimate(7);
        CHECK_NEAR(circle((double)e.mean.heading / 6.283185307 - mean), 0.0, 1e-4);
        CHECK(fabsf(e.mean.heading) <= PI_F);
        CHECK_NEAR(e.sd.heading, sqrt(-2.0 * log(length)), 1e-4);
    }
}

/* With a uniform phase the certainty is 0, and the reported phase is still valid. */
static void test_no_phase(void)
{
    reset();
    for (int32_t i = 0; i < N; i++)
        field(particles, F_PHASE)[i] = (float)i / N;
    gait_estimate const e = estimate(0);
    CHECK_NEAR(e.phase_r, 0.0, 1e-5);
    CHECK(e.sd.phase > 0.5f && isfinite(e.sd.phase));
    CHECK(e.mean.phase >= 0.0f && e.mean.phase < 1.0f);
    CHECK_NEAR(e.hypothesis_weight, 11.0 / N, 0.051); /* within 0.15 of the best: 11 .. 13 of 40 */
}

/* ---- the dominant hypothesis ---- */

/* Two groups half a stride (or half a turn) apart: the mean is that of the group of the best particle. */
static void test_modes(void)
{
    for (int by_heading = 0; by_heading < 2; by_heading++)
        for (int32_t best = 0; best < 2; best++) {
            double mass = 0.0, stature = 0.0, all = 0.0, square = 0.0;
            reset();
            set_weights(best);
            for (int32_t i = 0; i < N; i++) { /* even ones: group 0 */
                field(particles, by_heading ? F_HEADING : F_PHASE)[i] =
                    i % 2 ? 0.2f + (by_heading ? 2.0f : 0.5f) : 0.2f + 0.001f * (float)i;
                field(particles, F_STATURE)[i] = i % 2 ? 1.6f : 1.9f;
                field(particles, F_RATE)[i] = i % 2 ? 0.8f : 1.0f;
                double const w = t->filter.weight[i];
                mass += i % 2 == best ? w : 0.0;
                stature += i % 2 == best ? w * (double)field(particles, F_STATURE)[i] : 0.0;
                all += w * (double)field(particles, F_STATURE)[i];
            }
            for (int32_t i = 0; i < N; i++) {
                double const d = (double)field(particles, F_STATURE)[i] - all;
                square += t->filter.weight[i] * d * d;
            }
            gait_estimate const e = estimate(best);
            CHECK_NEAR(e.hypothesis_weight, mass, 1e-6);
            CHECK_NEAR(e.mean.stature, stature / mass, 1e-6);
            CHECK_NEAR(e.mean.stride_hz, best ? 0.8 : 1.0, 1e-6);
            CHECK_NEAR(e.sd.stature, sqrt(square), 1e-6); /* over all particles */
            CHECK(e.best.stature == field(particles, F_STATURE)[best]);
            if (by_heading)
                CHECK_NEAR(e.mean.heading, best ? 2.2 : 0.22, 0.03);
            else
                CHECK_NEAR(e.mean.phase, best ? 0.7 : 0.22, 0.03);
        }
}

/* ---- rotations ---- */
static void rotation(float heading, float pitch, float roll, double R[9])
{
    double const ch = cos((double)heading), sh = sin((double)heading), cp = cos((double)pitch);
    double const sp = sin((double)pitch), cr = cos((double)roll), sr = sin((double)roll);
    const double out[9] = {ch * cp,
                           ch * sp * sr - sh * cr,
                           ch * sp * cr + sh * sr,
                           sh * cp,
                           sh * sp * sr + ch * cr,
                           sh * sp * cr - ch * sr,
                           -sp,
                           cp * sr,
                           cp * cr};
    memcpy(R, out, sizeof out);
}

/* The mean rotation minimises the sum of squared chordal distances: no small turn of it is better. */
static void test_rotation(void)
{
    for (uint32_t round = 0; round < 8; round++) {
        double sum[9] = {0}, R[9], best = 0.0;
        reset();
        set_weights(3);
        for (uint32_t i = 0; i < N; i++) {
            float *const angle[] = {&field(particles, F_HEADING)[i], &field(particles, F_PITCH)[i],
                                    &field(particles, F_ROLL)[i]};
            for (uint32_t k = 0; k < 3; k++)
                *angle[k] =
                    (k ? 0.3f : 2.9f) * normal(round, 60 + k) + (i == 3 ? 0.0f : 0.12f) * normal(i, 10 + k);
            *angle[0] = m_wrap_pi(*angle[0]);
            rotation(*angle[0], *angle[1], *angle[2], R);
            for (int k = 0; k < 9; k++)
                sum[k] += t->filter.weight[i] * R[k];
        }
        gait_estimate const e = estimate(3);
        CHECK_NEAR(e.hypothesis_weight, 1.0, 1e-6);
        rotation(e.mean.heading, e.mean.pitch, e.mean.roll, R);
        for (int k = 0; k < 9; k++)
            best += R[k] * sum[k]; /* larger: nearer */
        CHECK(best > 2.5);
        for (int k = 0; k < 6; k++) {
            float const d = k % 2 ? 0.01f : -0.01f;
            double near = 0.0;
            rotation(e.mean.heading + (k / 2 == 0 ? d : 0), e.mean.pitch + (k / 2 == 1 ? d : 0),
                     e.mean.roll + (k / 2 == 2 ? d : 0), R);
            for (int i = 0; i < 9; i++)
                near += R[i] * sum[i];
            CHECK(near < best);
        }
    }
}

/* ---- joints and the rest ---- */
static void test_joints(void)
{
    reset();
    set_weights(11);
    for (uint32_t i = 0; i < 3 * TOY_POINTS * N; i++)
        t->joints.value[i] = (float)(i / N % 7) + (0.1f + 0.01f * (float)(i / N)) * normal(i, 3);
    gait_estimate const e = estimate(11);
    for (int p = 0; p < 3 * TOY_POINTS; p++) {
        double sum = 0.0, square = 0.0;
        for (int i = 0; i < N; i++)
            sum += t->filter.weight[i] * (double)t->joints.value[p * N + i];
        for (int i = 0; i < N; i++)
            square += t->filter.weight[i] * pow((double)t->joints.value[p * N + i] - sum, 2.0);
        CHECK_NEAR(e.pose.joint[p / 3][p % 3], sum, 1e-6);
        double const model = 0.01 * (double)e.mean.stature;
        CHECK_NEAR(e.joint_sd[p / 3][p % 3], sqrt(square + model * model), 1e-6);
    }
    for (int k = 0; k < 3; k++)
        CHECK(e.sd.pelvis[k] == e.joint_sd[0][k]);
    CHECK(e.pose.joint[TOY_POINTS][0] == 0.0f && e.joint_sd[TOY_POINTS][1] == 0.0f); /* unused */
}

/* Joints placed anew, some particles at a time, give the same bits as those kept from the likelihood step. */
static void test_joints_in_parts(void)
{
    enum { MANY = 300, AT_ONCE = 128 };
    gait_tracker_config cfg = toy_config(1);
    cfg.particles = MANY;
    gait_tracker *const many = toy_tracker_new(&cfg);
    gait_estimate kept = {0}, anew = {0};
    toy_tracker_start(many, 0, 1.0f);
    for (int32_t i = 0; i < MANY; i++)
        many->filter.weight[i] *= 0.5 + (double)(i % 3) / 2.0;
    likelihood_step(many);
    estimate_particles(many, 7, &kept);
    many->joints.most = AT_ONCE;
    memset(many->joints.value, 0xff, AT_ONCE * sizeof *many->joints.value);
    estimate_particles(many, 7, &anew);
    CHECK(memcmp(&kept, &anew, sizeof kept) == 0 && kept.joint_sd[3][0] > 0.001f);
    toy_tracker_free(many);
}

/* Of one camera whose start had an uncertain stature: size and distance, as a fraction of both. */
static void test_size(void)
{
    const gait_camera *const cam = &t->cfg.camera[0];
    double const start_sd = 0.02, share = 0.01 * start_sd / sqrt(0.01 * 0.01 + start_sd * start_sd);
    reset();
    set_weights(11);
    for (uint32_t i = 0; i < 3 * TOY_POINTS * N; i++)
        t->joints.value[i] = 0.1f * (float)(i / N) + 0.02f * normal(i, 3);
    gait_estimate const sure = estimate(11);
    t->core->stature_sd_ratio = (float)start_sd;
    gait_estimate const e = estimate(11);
    for (int p = 0; p < TOY_POINTS; p++)
        for (int k = 0; k < 3; k++) {
            double lens = 0.0; /* -R't */
            for (int r = 0; r < 3; r++)
                lens -= (double)cam->R[3 * r + k] * (double)cam->t[r];
            double const off = share * ((double)e.pose.joint[p][k] - lens);
            CHECK_NEAR(pow((double)e.joint_sd[p][k], 2.0), pow((double)sure.joint_sd[p][k], 2.0) + off * off,
                       1e-6);
        }
    double const tall = share * (double)e.mean.stature;
    CHECK_NEAR(pow((double)e.sd.stature, 2.0), pow((double)sure.sd.stature, 2.0) + tall * tall, 1e-8);
    CHECK(e.sd.stature > sure.sd.stature && e.joint_sd[0][1] > sure.joint_sd[0][1]);
    t->cfg.cameras = 2; /* two measure the distance */
    gait_estimate const two = estimate(11);
    CHECK(memcmp(two.joint_sd, sure.joint_sd, sizeof sure.joint_sd) == 0);
    t->cfg.cameras = 1;
    t->core->stature_sd_ratio = 0.0f;
}

/* Means of the plain fields, the pelvis they imply, speed, and angles of the mean state. */
static void test_fields(void)
{
    double mean[F_COEF + 4] = {0};
    reset();
    set_weights(2);
    for (uint32_t i = 0; i < N; i++)
        for (int f = 0; f < particles->fields; f++) {
            float *const v = &field(particles, f)[i];
            *v = (f == F_STATURE ? 1.7f
                  : f == F_RATE  ? 0.9f
                  : f == F_PHASE ? 0.4f
                                 : 0.3f) +
                 0.02f * normal(i, 20 + (uint32_t)f);
            mean[f] += t->filter.weight[i] * (double)*v;
        }
    gait_estimate const e = estimate(2);
    CHECK_NEAR(e.mean.stature, mean[F_STATURE], 1e-6);
    CHECK_NEAR(e.mean.stride_hz, mean[F_RATE], 1e-6);
    CHECK_NEAR(e.mean.coef[0], mean[F_COEF], 1e-6);
    CHECK_NEAR(e.mean.coef[1], mean[F_COEF + 1], 1e-6);
    CHECK_NEAR(e.mean.proportion[0], mean[F_COEF + 2], 1e-6);
    CHECK_NEAR(e.mean.offset[TOY_TORSO], mean[F_COEF + 3], 1e-6);
    CHECK(e.sd.coef[0] > 0.01f && e.sd.offset[TOY_TORSO] > 0.01f && e.sd.proportion[0] > 0.01f &&
          e.sd.stride_hz > 0.01f && e.sd.coef[2] == 0.0f);
    particle_state w = {{0}};
    for (int f = 0; f < particles->fields; f++)
        w.f[f] = (float)mean[f];
    w.f[F_PHASE] = e.mean.phase;
    w.f[F_HEADING] = e.mean.heading;
    gait_state const s = particle_to_state(&t->layout, &w);
    for (int k = 0; k < 3; k++)
        CHECK_NEAR(e.mean.pelvis[k], s.pelvis[k], 1e-5);
    gait_pose pose;
    CHECK(gait_model_pose(toy_model(), &e.mean, &pose, NULL) == GAIT_OK);
    CHECK(memcmp(pose.angle, e.pose.angle, sizeof pose.angle) == 0);
    particle_state const heaviest = particle_get(particles, 2);
    gait_state const best = particle_to_state(&t->layout, &heaviest);
    CHECK(memcmp(&best, &e.best, sizeof best) == 0);
    double forward = 0.0;
    for (int j = 0; j < TOY_PHASES; j++)
        for (int k = 0; k < 3; k++)
            forward +=
                (k ? mean[F_COEF + k - 1] : 1.0) / TOY_PHASES *
                (double)toy_model()->curves[(k * TOY_PHASES + j) * TOY_CHANNELS + TOY_ROOT + ROOT_FORWARD];
    CHECK_NEAR(e.speed, mean[F_STATURE] * mean[F_RATE] * forward, 1e-4);
    particle_state const place = particle_set_place(particles, t->filter.weight);
    CHECK_NEAR(place.f[F_X], mean[F_X], 1e-6);
    CHECK_NEAR(place.f[F_Y], mean[F_Y], 1e-6);
    CHECK_NEAR(place.f[F_Z], mean[F_Z], 1e-6);
    CHECK_NEAR(place.f[F_STATURE], mean[F_STATURE], 1e-6);
}

/* Sums of any number of particles at any address: every instruction set gives the same bits, marks the dominant particles
 * and writes nothing else; and the sums equal plain ones. */
static void test_sums(void)
{
    enum { MOST = 300 };
    static float v[3][MOST + 4];
    static double weight[MOST + 4];
    static unsigned char memory[2][MOST + 2 * GUARD];
    for (int32_t n = 1; n <= MOST; n += n < 40 ? 1 : 37) {
        int32_t const off = n % 4;
        double plain[3] = {0.0}, mass = 0.0;
        for (int32_t i = 0; i < n; i++) {
            float x[4];
            rng_normal4(77, 0, (uint32_t)n, (uint32_t)i, 0, x);
            for (int32_t k = 0; k < 3; k++)
                v[k][off + i] = x[k];
            weight[off + i] = (double)(x[3] * x[3]);
        }
        double out[2][24];
        for (int k = -1; k < isa_count(); k++) {
            const kernels *const run = k < 0 ? isa_scalar() : isa_at(k);
            double *const to = out[k >= 0];
            const double *const w = weight + off;
            guarded const g = guard_fill(memory[k >= 0], (size_t)n);
            to[0] = run->estimate_dominant(v[0] + off, v[1] + off, w, n, n / 2, g.begin);
            double lane[3][SUM_LANES] = {{0.0}};
            to[1] = to[2] = to[3] = 0.0;
            run->estimate_moments(v[2] + off, w, g.begin, n, 0.25, lane);
            for (int i = 0; i < 3 * SUM_LANES; i++)
                to[1 + i / SUM_LANES] += lane[i / SUM_LANES][i % SUM_LANES];
            run->estimate_resultant(v[1] + off, 1.5f, w, g.begin, n, to + 4);
            run->estimate_rotations(v[0] + off, v[1] + off, v[2] + off, w, g.begin, n, to + 8);
            CHECK(guard_whole(&g));
            CHECK(k < 0 || memcmp(out[0], out[1], sizeof out[0]) == 0);
            CHECK(k < 0 || memcmp(memory[0], memory[1], sizeof memory[0]) == 0);
        }
        for (int32_t i = 0; i < n; i++) {
            double const d = (double)v[2][off + i] - 0.25;
            plain[0] += weight[off + i] * d;
            plain[1] += weight[off + i] * d * d;
            plain[2] += memory[0][GUARD + i] ? weight[off + i] * d : 0.0;
            mass += memory[0][GUARD + i] ? weight[off + i] : 0.0;
        }
        CHECK(memory[0][GUARD + n / 2] == 1);
        CHECK_NEAR(out[0][0], mass, 1e-9);
        for (int k = 0; k < 3; k++)
            CHECK_NEAR(out[0][1 + k], plain[k], 1e-9);
        CHECK_NEAR(out[0][8] + out[0][13] + out[0][18] + out[0][23], mass, 1e-5 * (1.0 + mass)); /* unit */
    }
}

int main(void)
{
    test_sums();
    gait_tracker_config cfg = toy_config(1);
    cfg.particles = N;
    cfg.offset_angles = 1u << TOY_TORSO;
    cfg.proportions = -1;
    cfg.joint_sd_model = 0.01f;
    t = toy_tracker_new(&cfg);
    test_phase();
    test_heading();
    test_no_phase();
    test_modes();
    test_rotation();
    test_joints();
    test_joints_in_parts();
    test_size();
    test_fields();
    toy_tracker_free(t);
    return CHECK_DONE();
}
