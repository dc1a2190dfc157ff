/* Every particle's log-likelihood of a frame against one computed separately. */
#include "tracker/likelihood_step.h"

#include "toy_body.h"
#include "toy_tracker.h"

#include "check.h"

enum { N = 40 };

static uint8_t wall[SCENE_CAMERAS][SCENE_PIXELS], shot[SCENE_CAMERAS][2][SCENE_PIXELS];

static gait_tracker *tracker(int32_t cameras, int first_camera, uint32_t terms)
{
    gait_tracker_config cfg = toy_config(cameras);
    cfg.particles = N;
    cfg.terms = terms;
    cfg.resample_ess = 0.0f; /* never: particle i stays particle i */
    if (first_camera)
        cfg.camera[0] = toy_camera(first_camera);
    gait_tracker *const t = toy_tracker_new(&cfg);
    for (int k = 0; k < cameras; k++) {
        gait_image const plate = toy_image(wall[k + first_camera]);
        CHECK(gait_tracker_set_background(t, k, &plate, NULL) == GAIT_OK);
    }
    toy_tracker_start(t, 20, 1.0f);
    return t;
}

/* Log-likelihoods of two cameras are the sums of each alone, term by term; a camera that missed adds nothing. */
static void test_cameras_add(void)
{
    for (uint32_t terms = 1; terms < 16; terms++) {
        gait_tracker *const both = tracker(2, 0, terms), *const first = tracker(1, 0, terms);
        gait_tracker *const second = tracker(1, 1, terms);
        gait_estimate e;
        int32_t wrong = 0, alike = 0;
        for (int n = 0; n < 2; n++) {
            const uint8_t *const two[] = {shot[0][n], shot[1][n]}, *const one[] = {shot[0][n], NULL};
            const uint8_t *const other[] = {shot[1][n], NULL};
            toy_tracker_step(both, 20 + n, two, &e);
            toy_tracker_step(first, 20 + n, one, &e);
            toy_tracker_step(second, 20 + n, other, &e);
            if (n == 1 && terms & GAIT_TERM_TEMPLATE)
                break; /* each template was learnt from its own estimate */
            for (int32_t i = 0; i < N; i++) {
                wrong += both->loglik_raw[i] != first->loglik_raw[i] + second->loglik_raw[i];
                alike += first->loglik_raw[i] == first->loglik_raw[0];
            }
        }
        CHECK(wrong == 0);
        CHECK(alike < N || terms == GAIT_TERM_TEXTURE || terms & GAIT_TERM_TEMPLATE);
        toy_tracker_free(both);
        toy_tracker_free(first);
        toy_tracker_free(second);
    }
    gait_tracker *const both = tracker(2, 0, 0xf), *const first = tracker(1, 0, 0xf);
    const uint8_t *const half[] = {shot[0][0], NULL};
    gait_estimate e;
    toy_tracker_step(both, 20, half, &e);
    toy_tracker_step(first, 20, half, &e);
    CHECK(memcmp(both->loglik_raw, first->loglik_raw, N * sizeof *both->loglik_raw) == 0 &&
          !(e.flags & GAIT_EST_NO_IMAGE));
    toy_tracker_free(both);
    toy_tracker_free(first);
}

/* Each particle's number is the likelihood of its own body; its joints are also its own. */
static void test_particles(void)
{
    toy_body *const v = toy_body_new(1, GAIT_MODE_DEFAULT);
    gait_tracker *const t = tracker(1, 1, GAIT_TERM_SILHOUETTE | GAIT_TERM_EDGES);
    const uint8_t *const see[] = {shot[1][0], NULL};
    gait_state s[N];
    float weight[N];
    gait_estimate e;
    toy_tracker_step(t, 20, see, &e);
    CHECK(gait_tracker_particles(t, s, weight, N, NULL) == N);
    v->f.map = t->core->map[0];
    toy_body_at(v, shot[1][0], wall[1]);
    memcpy(&v->setup, t->like, /* it ends after the last limb */
           offsetof(like_setup, surface) + (size_t)t->like->limbs * sizeof(like_surface));
    double worst = 0.0, place = 0.0;
    for (int32_t i = 0; i < N; i++) {
        like_body const b = toy_body_body(v, &s[i]);
        gait_pose pose;
        CHECK(gait_model_pose(toy_model(), &s[i], &pose, NULL) == GAIT_OK);
        worst = fmax(worst, fabs((double)(t->loglik_raw[i] - toy_likelihood(&b))));
        for (int32_t p = 0; p < 3 * TOY_POINTS; p++)
            place = fmax(place, fabs((double)(t->joints.value[p * N + i] - pose.joint[p / 3][p % 3])));
    }
    CHECK_NEAR(worst, 0.0,
               0.3); /* a body from its state differs by rounding: a cell or an edge point flips */
    CHECK_NEAR(place, 0.0, 1e-5);
    toy_tracker_free(t);
}

/* Outline of one particle in lane 0. */
static const outline_block *outline_of(const gait_tracker *t, int32_t i)
{
    static kin_body body;
    static outline_block out;
    particle_state const w = particle_get(&t->particles, i);
    particle_body(&t->layout, &w, &body);
    toy_project(t->like->geometry, TOY_LIMBS, &body, &t->cfg.camera[0], &t->camera[0].features.map, &out);
    return &out;
}

/* With texture, the ancestor's samples count: those of the particle each one came from. */
static void test_ancestor(void)
{
    static like_patch then[N * TOY_LIMBS];
    gait_tracker *const t = tracker(1, 0, GAIT_TERM_TEXTURE);
    const uint8_t *see[] = {shot[0][0], NULL};
    gait_estimate e;
    toy_tracker_step(t, 20, see, &e);
    for (int32_t i = 0; i < N; i++)
        CHECK(t->loglik_raw[i] == 0.0f); /* the first frame has nothing before it */
    CHECK(e.log_evidence == 0.0);
    see[0] = shot[0][1];
    memcpy(then, t->texture, sizeof then);
    t->cfg.resample_ess = 1.0f;
    t->core->ess = 1.0;
    for (int32_t i = 0; i < N; i++)
        t->filter.weight[i] = i == 5 || i == 9 ? 0.5 : 0.0;
    toy_tracker_step(t, 21, see, &e);
    CHECK(e.flags & GAIT_EST_RESAMPLED);
    for (int32_t i = 0; i < N; i++) {
        int32_t const parent = i < N / 2 ? 5 : 9;
        int32_t shared = 0;
        CHECK(t->filter.parent[i] == parent);
        for (int32_t l = 0; l < TOY_LIMBS; l++) {
            const like_patch *const a = &t->texture[i * TOY_LIMBS + l];
            const like_patch *const b = &then[parent * TOY_LIMBS + l];
            for (int32_t k = 0; k < LIKE_HALF && a->turn == b->turn; k++)
                shared += a->value[k] != TEXTURE_HIDDEN && b->value[k] != TEXTURE_HIDDEN;
        }
        CHECK(shared > 60);      /* the same person a frame later */
        if (i == 5 || i == 25) { /* computed again from the samples */
            like_body const b = {.setup = t->like,
                                 .features = &t->camera[0].features,
                                 .outline = outline_of(t, i),
                                 .samples = t->texture + i * TOY_LIMBS,
                                 .terms = &t->work[0].terms,
                                 .ancestor = then + parent * TOY_LIMBS};
            CHECK_NEAR(t->loglik_raw[i], toy_likelihood(&b), 1e-5);
        }
    }
    toy_tracker_free(t);
}

/* Make every sample that camera 1 took for the current particles a constant. */
static void spoil(gait_tracker *t, int value)
{
    for (size_t i = 0; i < N; i++)
        memset(t->texture + (2 * i + 1) * TOY_LIMBS, value, TOY_LIMBS * sizeof(like_patch));
}

/* What a camera saw before it missed a frame does not count when it is back; what it sees then does. */
static void test_missed_texture(void)
{
    const uint8_t *const both[] = {shot[0][0], shot[1][0]}, *const one[] = {shot[0][1], NULL};
    float ll[3][2][N]; /* undisturbed, spoilt while missing, spoilt when back; frames 22 and 23 */
    for (int k = 0; k < 3; k++) {
        gait_tracker *const t = tracker(2, 0, GAIT_TERM_TEXTURE);
        gait_estimate e;
        toy_tracker_step(t, 20, both, &e);
        toy_tracker_step(t, 21, one, &e);
        if (k == 1)
            spoil(t, 99);
        toy_tracker_step(t, 22, both, &e);
        memcpy(ll[k][0], t->loglik_raw, sizeof ll[k][0]);
        if (k == 2)
            spoil(t, 99);
        toy_tracker_step(t, 23, both, &e);
        memcpy(ll[k][1], t->loglik_raw, sizeof ll[k][1]);
        toy_tracker_free(t);
    }
    CHECK(memcmp(ll[0], ll[1], sizeof ll[0]) == 0);
    CHECK(memcmp(ll[0][0], ll[2][0], sizeof ll[0][0]) == 0 &&
          memcmp(ll[0][1], ll[2][1], sizeof ll[0][1]) != 0);
}

/* The body of the person is supported, one in front of the empty wall is not. */
static void test_support(void)
{
    gait_tracker *const t = tracker(2, 0, 0xf);
    gait_state s = toy_walk(20.0f / 30.0f);
    const uint8_t *const see[] = {shot[0][0], shot[1][0]};
    gait_estimate e;
    toy_tracker_step(t, 20, see, &e);
    particle_state w = particle_from_state(&t->layout, &s);
    float const there = likelihood_of_particle(t, &t->layout, &w).support;
    w.f[F_X] += 0.5f;
    CHECK(there > 1.0f && likelihood_of_particle(t, &t->layout, &w).support < -1.0f);
    toy_tracker_free(t);
}

/* The last block's lanes without a particle hold nothing of other blocks, nor of what was in the memory. */
static void test_empty_lanes(void)
{
    gait_tracker *const t = tracker(1, 0, 0xf);
    const uint8_t *const one[] = {shot[0][0], NULL};
    gait_estimate e;
    int32_t full = 0, empty = 0;
    memset(&t->work[0].terms, 0xff, sizeof t->work[0].terms);
    toy_tracker_step(t, 20, one, &e);
    for (int32_t lane = 0; lane < BLOCK; lane++)
        for (int32_t k = LIKE_TEXTURE + 1; k < LIKE_TERMS; k++)
            *(lane < N % BLOCK ? &full : &empty) += t->work[0].terms.nats[k][lane] != 0.0f;
    CHECK(full > 0 && empty == 0);
    toy_tracker_free(t);
}

int main(void)
{
    for (int k = 0; k < SCENE_CAMERAS; k++) {
        toy_wall(k, wall[k]);
        for (int n = 0; n < 2; n++)
            toy_shot(k, 20 + n, shot[k][n]);
    }
    test_cameras_add();
    test_particles();
    test_ancestor();
    test_missed_texture();
    test_support();
    test_empty_lanes();
    return CHECK_DONE();
}
