/* The likelihood as a whole: surface points, their comparison, and the true body above displaced ones. */
#include "api/kernels.h"
#include "likelihood/template.h"
#include "toy_body.h"

#include "check.h"

enum { SAMPLES = TOY_LIMBS * LIKE_SAMPLES };

enum { IMAGE_TERMS = 4 }; /* those that read the image; like_keypoints has a test of its own */

static const like_term *const terms[IMAGE_TERMS] = {&like_texture, &like_silhouette, &like_edges,
                                                    &like_template};
static uint8_t wall[SCENE_PIXELS], now[SCENE_PIXELS], before[SCENE_PIXELS];

/* ---- surface points ---- */
static void test_surface(void)
{
    const toy_body *const v = toy_body_new(0, GAIT_MODE_DEFAULT);
    double off = 0.0, bent = 0.0, inward = 1.0, middle = 0.0;
    for (int32_t l = 0; l < TOY_LIMBS; l++) {
        const limb_geometry *const g = &v->setup.geometry[l];
        const like_surface *const s = &v->setup.surface[l];
        double axis[3], length2 = 0.0, mean = 0.0;
        for (int k = 0; k < 3; k++) {
            axis[k] = (double)g->end[k] - (double)g->start[k];
            length2 += axis[k] * axis[k];
        }
        for (int i = 0; i < LIKE_SAMPLES; i++) {
            double z = 0.0, lat = 0.0, sag = 0.0, size = 0.0, out = 0.0;
            for (int k = 0; k < 3; k++) {
                double const p = (double)s->point[k][i] - (double)g->start[k], n = (double)s->normal[k][i];
                z += p * axis[k] / length2;
                lat += p * (double)g->lateral[k];
                sag += p * (double)g->sagittal[k];
                size += n * n;
                out += n * (p - axis[k] * 0.5);
            }
            double a = (double)g->a0 + z * (double)(g->a1 - g->a0),
                   b = (double)g->b0 + z * (double)(g->b1 - g->b0);
            if (g->shape == LIMB_ELLIPSOID) {
                a = (double)g->a0 * sqrt(1.0 - (2.0 * z - 1.0) * (2.0 * z - 1.0));
                b = a * (double)g->b0 / (double)g->a0;
            }
            off = fmax(off, fabs(hypot(lat / a, sag / b) - 1.0));
            bent = fmax(bent, fabs(size - 1.0));
            inward = fmin(inward, out);
            mean += z / LIKE_SAMPLES;
        }
        middle = fmax(middle, fabs(mean - 0.5));
    }
    CHECK_NEAR(off, 0.0, 1e-4);
    CHECK_NEAR(bent, 0.0, 1e-5);
    CHECK(inward > 0.0);
    CHECK_NEAR(middle, 0.0, 1e-5);
}

/* Each sample shows the map where its point projects, or nothing where the point faces away or lies behind a limb. */
static void test_sample(void)
{
    toy_body *const v = toy_body_new(1, GAIT_MODE_DEFAULT);
    gait_state const s = toy_walk(0.6f);
    static uint8_t ids[SCENE_PIXELS];
    kin_frames frames;
    int32_t seen = 0, back = 0, wrong = 0, covered = 0, far = 0;
    toy_shot(1, 18, now);
    toy_body_aim(v, &s);
    toy_body_at(v, now, NULL);
    toy_body_body(v, &s);
    CHECK(model_place_state(toy_model(), &s, &frames) == GAIT_OK);
    CHECK(gait_render(toy_model(), &v->cam, &s, ids, SCENE_W, NULL) == GAIT_OK);
    for (int32_t l = 0; l < TOY_LIMBS; l++)
        for (int i = 0; i < LIKE_SAMPLES; i++) {
            const like_surface *const f = &v->setup.surface[l];
            float p[3], uv[2] = {0}, incidence = 0.0f, range = 0.0f;
            for (int k = 0; k < 3; k++) {
                const float *const r = frames.R + 9 * v->setup.geometry[l].frame + 3 * k;
                const float *const projection = v->cam.R; /* camera centre: -R't */
                float const centre = -(projection[k] * v->cam.t[0] + projection[3 + k] * v->cam.t[1] +
                                       projection[6 + k] * v->cam.t[2]);
                float const n = r[0] * f->normal[0][i] + r[1] * f->normal[1][i] + r[2] * f->normal[2][i];
                p[k] = frames.o[3 * v->setup.geometry[l].frame + k] +
                       s.stature * (r[0] * f->point[0][i] + r[1] * f->point[1][i] + r[2] * f->point[2][i]);
                incidence += n * (centre - p[k]);
                range += (centre - p[k]) * (centre - p[k]);
            }
            incidence /= sqrtf(range);
            camera_project(&v->cam, p, uv);
            int32_t const at_half = (i - 2 * v->patch[l].turn + LIKE_SAMPLES) % LIKE_SAMPLES;
            int8_t const have = at_half < LIKE_HALF ? v->patch[l].value[at_half] : TEXTURE_HIDDEN;
            int32_t const id = ids[(int32_t)(uv[1] + 0.5f) * SCENE_W + (int32_t)(uv[0] + 0.5f)];
            if (incidence < 0.15f) {
                back++;
                wrong += have != TEXTURE_HIDDEN;
            } else if (have != TEXTURE_HIDDEN) {
                float const x = (uv[0] - v->f.map.u0) * v->f.map.scale,
                            y = (uv[1] - v->f.map.v0) * v->f.map.scale;
                int32_t const at = (int32_t)y * VIEW_SIZE + (int32_t)x;
                int32_t lo = 127, hi = -127;
                for (int k = 0; k < 4; k++) {
                    lo = i_min(lo, v->scratch.surface[at + k % 2 + k / 2 * VIEW_SIZE]);
                    hi = i_max(hi, v->scratch.surface[at + k % 2 + k / 2 * VIEW_SIZE]);
                }
                seen++;
                far += have < lo || have > hi;
                covered += id > 0 && id != l + 1;
            }
        }
    CHECK(seen > SAMPLES / 5 && back > SAMPLES / 3);
    CHECK(wrong == 0);
    CHECK(far == 0);
    CHECK(covered < seen / 20); /* a grid cell is coarser than a pixel */
}

/* ---- the settings reach the terms ---- */
static void test_setup(void)
{
    gait_tracker_config cfg = toy_body_new(0, GAIT_MODE_DEFAULT)->cfg;
    static like_setup s;
    cfg.terms = 0x5;
    cfg.girth = 1.5f;
    cfg.missed_weight = 0.3f;
    cfg.texture_weight = 1.0f;
    cfg.silhouette_weight = 2.0f;
    cfg.edges_weight = 3.0f;
    cfg.template_weight = 4.0f;
    like_setup_init(&s, toy_model(), &cfg, kernels_choose(~0u));
    CHECK(s.limbs == TOY_LIMBS && s.terms == 0x5 && s.missed_weight == 0.3f && !s.paper);
    CHECK(s.weight[0] == 1.0f && s.weight[1] == 2.0f && s.weight[2] == 3.0f && s.weight[3] == 4.0f);
    CHECK_NEAR(s.geometry[0].a0, 1.5f * 0.084f, 1e-6);
    cfg.mode = GAIT_MODE_PAPER;
    like_setup_init(&s, toy_model(), &cfg, kernels_choose(~0u));
    CHECK(s.paper);
}

/* ---- costs ---- */
static void test_costs(void)
{
    const like_setup *const s = &toy_body_new(0, GAIT_MODE_DEFAULT)->setup;
    int32_t wrong = 0;
    for (int d = 0; d < LIKE_COST_NONE;
         d++) { /* Student-t, 4 degrees of freedom, scale half a local standard deviation */
        double const r = d / 16.0;
        wrong += fabs(s->robust.one[d] - LIKE_COUNT_ONE - 2.5 * log(1.0 + r * r / 4.0) * LIKE_COST_ONE) > 0.6;
        wrong += s->square.one[d] != LIKE_COUNT_ONE + d * d;
        wrong += s->square.low[d] != (d * d & 255) || s->square.high[d] != d * d >> 8;
    }
    CHECK(wrong == 0 && s->robust.one[LIKE_COST_NONE] == 0 && s->square.one[LIKE_COST_NONE] == 0);
    /* The sum over a limb, and over all limbs of robust ones, leaves the count alone. */
    CHECK(LIKE_HALF * (s->square.one[LIKE_COSTS - 2] - LIKE_COUNT_ONE) < LIKE_COUNT_ONE);
    CHECK(MODEL_MAX_LIMBS * LIKE_HALF * (s->robust.one[LIKE_COSTS - 2] - LIKE_COUNT_ONE) < LIKE_COUNT_ONE);
}

/* ---- all terms together ---- */

enum { SHAPES = 11, FRAMES = 6 };

static const struct {
    const char *name;
    float amount;
} shift[SHAPES] = {{"phase", 0.1f},   {"across", 0.05f}, {"up", 0.05f},  {"away", 0.5f},
                   {"heading", 0.6f}, {"pitch", 0.2f},   {"roll", 0.2f}, {"stature", 0.1f},
                   {"coef 1", 2.5f},  {"coef 2", 2.5f},  {"torso", 0.2f}};

static void displace(const gait_camera *cam, int k, float d, gait_state *s)
{
    float *const number[SHAPES] = {&s->phase,
                                   NULL,
                                   NULL,
                                   NULL,
                                   &s->heading,
                                   &s->pitch,
                                   &s->roll,
                                   &s->stature,
                                   &s->coef[0],
                                   &s->coef[1],
                                   &s->offset[TOY_TORSO + 1]};
    if (number[k])
        *number[k] += d;
    else
        for (int i = 0; i < 3; i++)
            s->pelvis[i] += (k == 2 ? -d : d) * cam->R[3 * (k - 1) + i];
}

static gait_state displaced(const toy_body *v, int frame, int k, int sign)
{
    gait_state s = toy_walk((float)frame / 30.0f);
    displace(&v->cam, k, (float)sign * shift[k].amount, &s);
    return s;
}

/* Bodies displaced alike in both frames; the template is the true body's in the frame before. */
static void score(toy_body *v, int frame, float sum[SHAPES][3][IMAGE_TERMS])
{
    static like_patch ancestor[SHAPES][3][TOY_LIMBS];
    gait_state const true_now = toy_walk((float)frame / 30.0f),
                     true_before = toy_walk((float)(frame - 1) / 30.0f);
    int16_t template[SAMPLES];
    int8_t known[TOY_LIMBS * LIKE_RING];
    toy_body_aim(v, &true_now);
    toy_body_at(v, before, wall);
    toy_body_body(v, &true_before);
    template_clear(template, TOY_LIMBS);
    template_update(template, TOY_LIMBS, v->patch);
    template_ring(template, TOY_LIMBS, known);
    for (int k = 0; k < SHAPES; k++)
        for (int sign = -1; sign <= 1; sign++) {
            gait_state const s = displaced(v, frame - 1, k, sign);
            toy_body_body(v, &s);
            memcpy(ancestor[k][sign + 1], v->patch, sizeof v->patch);
        }
    toy_body_at(v, now, wall);
    for (int k = 0; k < SHAPES; k++)
        for (int sign = -1; sign <= 1; sign++) {
            gait_state const s = displaced(v, frame, k, sign);
            like_body b = toy_body_body(v, &s);
            b.ancestor = ancestor[k][sign + 1];
            b.known = known;
            for (int i = 0; i < IMAGE_TERMS; i++)
                sum[k][sign + 1][i] += terms[i]->log_likelihood(&b) / FRAMES;
        }
}

static void check_camera(int camera)
{
    toy_body *const v = toy_body_new(camera, GAIT_MODE_DEFAULT);
    float sum[SHAPES][3][IMAGE_TERMS] = {{{0}}};
    toy_wall(camera, wall);
    for (int n = 0; n < FRAMES; n++) {
        toy_shot(camera, 5 + 9 * n, now);
        toy_shot(camera, 4 + 9 * n, before);
        score(v, 5 + 9 * n, sum);
    }
    for (int i = 0; i < IMAGE_TERMS; i++)
        for (int k = 0; k < SHAPES; k++) {
            /* Texture alone hardly determines the posture, because both frames have the same error. */
            float const margin = i == 0 ? (k > 8 ? -0.4f : 0.1f) : i == 1 ? 0.03f : 0.06f;
            float const nearer = f_max(sum[k][0][i], sum[k][2][i]);
            if (!(sum[k][1][i] > nearer + margin))
                fprintf(stderr, "camera %d, term %#x: %s displaced scores %g, true %g\n", camera,
                        terms[i]->flag, shift[k].name, (double)nearer, (double)sum[k][1][i]);
            CHECK(sum[k][1][i] > nearer + margin);
        }
}

/* Weights and selection of the terms; there is more support where a person is than where no person is. */
static void test_sum(void)
{
    toy_body *const v = toy_body_new(0, GAIT_MODE_DEFAULT);
    gait_state s = toy_walk(0.6f);
    toy_wall(0, wall);
    toy_shot(0, 18, now);
    toy_body_aim(v, &s);
    toy_body_at(v, now, wall);
    like_body b = toy_body_body(v, &s);
    b.ancestor = v->patch;
    for (uint32_t set = 0; set < 16; set++) {
        double want = 0.0, support = 0.0;
        v->setup.terms = set;
        for (int k = 0; k < IMAGE_TERMS; k++) {
            v->setup.weight[k] = 0.5f + 3.0f * (float)k;
            if (set >> k & 1) {
                want += (double)(v->setup.weight[k] * terms[k]->log_likelihood(&b));
                support += terms[k]->support ? (double)(v->setup.weight[k] * terms[k]->support(&b)) : 0.0;
            }
        }
        CHECK_NEAR(toy_likelihood(&b), want, 1e-4);
        CHECK_NEAR(like_support(&b), support, 1e-4);
    }
    CHECK(like_support(&b) > 0.5f);
    toy_body_at(v, wall, wall); /* no person there */
    b = toy_body_body(v, &s);
    CHECK(like_support(&b) < -0.5f);
}

int main(void)
{
    test_surface();
    test_sample();
    test_setup();
    test_costs();
    for (int camera = 0; camera < SCENE_CAMERAS; camera++)
        check_camera(camera);
    test_sum();
    return CHECK_DONE();
}
