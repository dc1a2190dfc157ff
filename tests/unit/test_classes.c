/* Classes of motion: the blob, poses, ranges of particles, and a person who stops, stands and walks on or backwards. */
#include "api/kernels.h"
#include "filter/class_change.h"
#include "golden.h"
#include "sanitized.h"
#include "toy_classes.h"
#include "toy_film.h"
#include "tracker/class_strata.h"
#include "tracker/fit_check.h"
#include "tracker/tracker.h"

#include "check.h"

static _Alignas(GAIT_ALIGN) unsigned char buf[TOY_BYTES];

/* ---- the blob ---- */
static void test_views(void)
{
    const gait_model *const m = toy_classes_model();
    gait_model_info info;
    CHECK(gait_model_get_info(m, &info, NULL) == GAIT_OK && info.classes == TOY_CLASSES &&
          info.direction == 1);
    CHECK(strcmp(gait_model_class_name(m, TOY_BACK), "backwards") == 0);
    CHECK(!gait_model_class_name(m, TOY_CLASSES) && !gait_model_class_name(m, -1));
    CHECK(!gait_model_of_class(m, TOY_CLASSES) && !gait_model_of_class(NULL, 0));
    CHECK(gait_model_of_class(m, 0) == m);
    CHECK(gait_model_get_info(gait_model_of_class(m, TOY_STAND), &info, NULL) == GAIT_OK);
    CHECK(info.direction == 0 && info.phases == TOY_STILL_PHASES && info.components == 1 &&
          info.stride_length == 0.0f);
    CHECK(m->of_class[TOY_BACK]->curves == m->curves && m->of_class[TOY_BACK]->direction == -1);
    CHECK(m->of_class[TOY_STAND]->of_class[TOY_BACK] == m->of_class[TOY_BACK]);
    CHECK(strcmp(gait_model_class_name(toy_model(), 0), "walk") == 0 && toy_model()->classes == 1);
}

/* Standing has one pose at all phases, backwards that of walking; a class that the model lacks is refused. */
static void test_poses(void)
{
    const gait_model *const m = toy_classes_model();
    gait_state s = toy_state(0.3f), still = s;
    gait_pose walk, back, a, b;
    s.motion_class = TOY_WALK;
    CHECK(gait_model_pose(m, &s, &walk, NULL) == GAIT_OK);
    s.motion_class = TOY_BACK;
    CHECK(gait_model_pose(m, &s, &back, NULL) == GAIT_OK && memcmp(&walk, &back, sizeof walk) == 0);
    still.motion_class = TOY_STAND;
    CHECK(gait_model_pose(m, &still, &a, NULL) == GAIT_OK);
    still.phase = 0.8f;
    CHECK(gait_model_pose(m, &still, &b, NULL) == GAIT_OK && memcmp(&a, &b, sizeof a) == 0);
    CHECK(memcmp(&a, &walk, sizeof a) != 0 && a.angle[TOY_KNEE] == 0.0f);
    s.motion_class = TOY_CLASSES;
    CHECK(gait_model_pose(m, &s, &a, NULL) == GAIT_ERR_ARG);
    s.motion_class = -1;
    CHECK(gait_model_pose(m, &s, &a, NULL) == GAIT_ERR_ARG);
    s.motion_class = 1;
    CHECK(gait_model_pose(toy_model(), &s, &a, NULL) == GAIT_ERR_ARG);
}

static gait_result open_spec(const toy_classes_spec *s, const char *tag)
{
    gait_model m[GAIT_MAX_CLASSES];
    gait_error err = {0};
    gait_result const result = model_open(buf, toy_classes_write(buf, s), m, &err);
    CHECK(result == GAIT_OK || strstr(err.text, tag));
    return result;
}

static void test_refused(void)
{
    toy_classes_spec const good = toy_classes_usual();
    CHECK(open_spec(&good, "") == GAIT_OK);
    static const struct {
        int row, column, value;
    } info[] = {
        {1, 0, 2}, {1, 0, -2}, /* directions */
        {2, 1, 3}, {2, 1, -1}, /* sources that are no class, */
        {2, 1, 2},             /* without curves, */
        {1, 1, 0},             /* and of another although it has curves */
        {0, 0, 0}, {0, 0, -1}, /* the first is cyclic */
        {0, 1, 1}, {1, 2, -1}, {2, 3, -5},
    };
    for (size_t k = 0; k < sizeof info / sizeof *info; k++) {
        toy_classes_spec s = good;
        s.info[info[k].row][info[k].column] = info[k].value;
        CHECK(open_spec(&s, "CLIN") == GAIT_ERR_CORRUPT);
    }
    static const struct {
        int from, to, column;
        float value;
    } change[] = {{0, 1, 0, -0.1f}, {0, 1, 0, 101.0f}, {1, 1, 0, 0.1f},  {0, 1, 0, NAN},  {0, 1, 1, -1.0f},
                  {0, 1, 1, 51.0f}, {0, 1, 2, 1.0f},   {0, 1, 2, -0.1f}, {0, 1, 3, 51.0f}};
    for (size_t k = 0; k < sizeof change / sizeof *change; k++) {
        toy_classes_spec s = good;
        s.change[change[k].from][change[k].to][change[k].column] = change[k].value;
        CHECK(open_spec(&s, "CLSW") == GAIT_ERR_CORRUPT);
    }
    toy_classes_spec s = good;
    s.info_rows = 2;
    CHECK(open_spec(&s, "CLIN") == GAIT_ERR_CORRUPT);
    s = good;
    s.change_rows = 2;
    CHECK(open_spec(&s, "CLSW") == GAIT_ERR_CORRUPT);
    s = good;
    memcpy(s.name[1], "walk", 5);
    CHECK(open_spec(&s, "CLNM") == GAIT_ERR_CORRUPT);
    s = good;
    s.partial = 1;
    CHECK(open_spec(&s, "SCS1") == GAIT_ERR_CORRUPT);
    s = good;
    s.curves = 0; /* a class that names itself as source, but has no curves */
    CHECK(open_spec(&s, "CLIN") == GAIT_ERR_CORRUPT);
}

/* The same classes in another order: walking, walking backwards, standing. */
static const gait_model *reordered_model(void)
{
    static _Alignas(GAIT_ALIGN) unsigned char data[TOY_BYTES], mem[4096];
    toy_classes_spec s = toy_classes_usual();
    toy_classes_spec const usual = s;
    memcpy(s.name[1], usual.name[2], 32);
    memcpy(s.name[2], usual.name[1], 32);
    memcpy(s.info[1], usual.info[2], sizeof s.info[1]);
    memcpy(s.info[2], usual.info[1], sizeof s.info[2]);
    s.info[2][1] = 2;
    s.of = 2;
    return toy_classes_make(&s, data, mem, sizeof mem);
}

/* After the first the classes may be in any order, and a class may be learnt from one cycle. */
static void test_another_order(void)
{
    const gait_model *const m = reordered_model();
    CHECK(m->of_class[1]->direction == -1 && m->of_class[2]->direction == 0 && m->of_class[2]->phases == 8);
}

/* ---- changes ---- */
static void test_rates(void)
{
    const gait_model *const m = toy_classes_model(), *const still = m->of_class[TOY_STAND];
    CHECK_NEAR(class_change_rate(m, TOY_STAND, 0.05f, 0.92f), 1.0, 1e-6);
    CHECK_NEAR(class_change_rate(m, TOY_STAND, 0.55f, 0.92f), 1.0, 1e-5);
    CHECK(class_change_rate(m, TOY_STAND, 0.3f, 0.92f) < 1e-4f); /* people do not stop in mid-swing */
    CHECK(class_change_rate(still, TOY_WALK, 0.77f, 0.92f) == 0.7f);
    CHECK(class_change_rate(m, TOY_WALK, 0.05f, 0.92f) == 0.0f);
}

/* ---- films ---- */
enum { STOP = 30, GO = 75, END = 120, HIDDEN = 5 };

static const gait_model *model(void)
{
    return toy_classes_model();
}

/* A person who walks until frame STOP, stands until frame GO and walks on, forwards or backwards. */
static gait_state truth(int n, int onwards)
{
    float const before = (float)(n < STOP ? n : STOP) / 30.0f, after = (float)(n > GO ? n - GO : 0) / 30.0f;
    gait_state s = toy_walk(before + (float)onwards * after);
    s.motion_class = n >= STOP && n <= GO ? TOY_STAND : onwards < 0 && n > GO ? TOY_BACK : TOY_WALK;
    if (s.motion_class == TOY_STAND && gait_model_pelvis_height(model(), &s, &s.pelvis[2], NULL) != GAIT_OK)
        abort();
    return s;
}

typedef struct outcome {
    int right[3], frames[3]; /* by true class: frames with status `tracking`, and those of the right class */
    bool last[3];            /* the last frame of a true class has the right class */
    float far;               /* of the pelvis, metres */
    uint64_t hash;
} outcome;

static bool ranges_sound(const gait_tracker *t)
{
    const strata *const s = &t->history.strata[t->core->generation];
    bool const two = s->count == 2 * TOY_CLASSES; /* left and right; kept until particles are resampled */
    bool ok = two || (s->count == TOY_CLASSES && t->core->hypotheses.stage != HYPOTHESES_TWO);
    ok &= s->first[0] == 0 && s->first[s->count] == t->filter.n;
    double sum = 0.0;
    for (int32_t k = 0; k < s->count; k++)
        ok &= s->first[k] % BLOCK == 0 && s->first[k + 1] - s->first[k] >= BLOCK;
    for (int32_t i = 0; i < t->filter.n; i++)
        sum += t->filter.weight[i];
    return ok && sum > 0.999 && sum < 1.001;
}

static gait_tracker *begin(const gait_model *m, const gait_tracker_config *cfg, const uint8_t *wall)
{
    gait_tracker *const t = toy_tracker_of(m, cfg);
    gait_image const plate = toy_image(wall);
    CHECK(gait_tracker_set_background(t, 0, &plate, NULL) == GAIT_OK);
    toy_tracker_start(t, 0, 1.0f);
    return t;
}

/* Follow the film with this model.  hidden: the person is occluded while stopping.  At frame `save`, if there is one, another tracker
 * continues from a snapshot. */
static outcome follow(const gait_model *m, const gait_tracker_config *cfg, int onwards, bool hidden, int save,
                      int end)
{
    static uint8_t wall[SCENE_PIXELS], shot[SCENE_PIXELS];
    gait_camera const cam = toy_camera(0);
    outcome result = {.hash = 0};
    toy_wall(0, wall);
    gait_tracker *t = begin(m, cfg, wall);
    for (int n = 0; n < end; n++) {
        gait_state const true_state = truth(n, onwards);
        gait_estimate e;
        memcpy(shot, wall, sizeof shot);
        if (!hidden || n < STOP - HIDDEN || n >= STOP + HIDDEN)
            toy_paint_of(model(), &cam, &true_state, shot);
        toy_noise((uint32_t)n, shot);
        const uint8_t *const shots[SCENE_CAMERAS] = {shot};
        if (n == save && n > 0) {
            size_t bytes = 0;
            CHECK(gait_tracker_save(t, NULL, 0, &bytes, NULL) == GAIT_OK);
            unsigned char *const mem = malloc(bytes);
            CHECK(mem && gait_tracker_save(t, mem, bytes, &bytes, NULL) == GAIT_OK);
            toy_tracker_free(t);
            t = begin(m, cfg, wall);
            CHECK(gait_tracker_restore(t, mem, bytes, NULL) == GAIT_OK);
            free(mem);
        }
        toy_tracker_step(t, n, shots, &e);
        float sum = 0.0f;
        for (int c = 0; c < GAIT_MAX_CLASSES; c++)
            sum += e.class_probability[c];
        CHECK(sum > 0.999f && sum < 1.001f && e.mean.motion_class == e.motion_class);
        CHECK(ranges_sound(t));
        float const dx = e.mean.pelvis[0] - true_state.pelvis[0];
        int const c = true_state.motion_class;
        result.last[c] =
            strcmp(gait_model_class_name(m, e.motion_class), gait_model_class_name(model(), c)) == 0;
        if (e.status == GAIT_TRACK_TRACKING) {
            result.frames[c]++;
            result.right[c] += result.last[c];
            result.far = f_max(result.far, fabsf(dx));
        }
    }
    gait_estimate old;
    CHECK(cfg->lag == 0 || gait_tracker_lagged(t, cfg->lag, &old, NULL) == GAIT_OK);
    result.hash = gait_tracker_digest(t);
    toy_tracker_free(t);
    return result;
}

static gait_tracker_config settings(void)
{
    gait_tracker_config cfg = toy_config(1);
    cfg.particles = 600;
    return cfg;
}

/* Nearly all frames of a class are right, and the last one is. */
static bool noticed(const outcome *s, int c)
{
    return s->last[c] && 2 * s->right[c] >= s->frames[c] && s->frames[c] - s->right[c] <= 12;
}

static void test_stops_and_walks_on(void)
{
    gait_tracker_config const cfg = settings();
    const gait_model *const of[] = {model(), model(), reordered_model()};
    static const int onwards[] = {1, -1, -1};
    for (int k = 0; k < 3; k++) {
        outcome const s = follow(of[k], &cfg, onwards[k], false, 0, END);
        int const last = onwards[k] > 0 ? TOY_WALK : TOY_BACK;
        CHECK(s.frames[TOY_WALK] > 20 && s.frames[TOY_STAND] > 20 && s.frames[last] > 5);
        CHECK(noticed(&s, TOY_WALK) && noticed(&s, TOY_STAND) && noticed(&s, last));
        CHECK(s.far < 0.25f);
    }
}

/* Standing estimates that drift make standing less likely, for a while also after the estimate walks on. */
static void test_drift(void)
{
    static uint8_t wall[SCENE_PIXELS];
    gait_tracker_config const cfg = settings();
    toy_wall(0, wall);
    gait_tracker *const t = begin(model(), &cfg, wall);
    particle_state at = t->core->last_supported;
    float const speed = 0.4f, step = 1.0f / 30.0f;
    t->core->support_utime = t->core->utime;
    class_strata_support(t, TOY_STAND, &at); /* as if in the same frame: nothing is known of the drift */
    CHECK(t->classes->drift[0] == 0.0f && t->classes->supported == TOY_STAND);
    for (int n = 0; n < 60; n++) {
        bool const walks = n >= 30;
        t->core->last_supported = at;
        t->core->support_utime = t->core->utime;
        t->core->utime += 33333;
        at.f[F_X] += speed * step;
        class_strata_support(t, walks ? TOY_WALK : TOY_STAND, &at);
        float const drift = t->classes->drift[0];
        CHECK(fabsf(t->classes->drift[1]) < 1e-6f);
        if (n == 29)
            CHECK(drift > 0.9f * speed && drift < 1.01f * speed);
        if (n == 59)
            CHECK(drift > 0.3f * speed && drift < 0.4f * speed);
    }
    t->classes->drift[0] = 0.3f;
    t->classes->drift[1] = 0.4f;
    for (int32_t i = 0; i < t->filter.n; i++)
        t->loglik[i] = -1.0f;
    class_strata_penalise_drift(t);
    for (int32_t i = 0; i < t->filter.n; i++)
        CHECK(fabsf(t->loglik[i] - (class_at(t, i) == TOY_STAND ? -13.5f : -1.0f)) < 1e-4f);
    toy_tracker_free(t);
}

/* A standing person has no phase that fits as well; turned, the same body fits less. */
static void test_fit_of_a_standing_person(void)
{
    static uint8_t wall[SCENE_PIXELS], shot[SCENE_PIXELS];
    gait_tracker_config const cfg = settings();
    gait_camera const cam = toy_camera(0);
    gait_estimate e;
    toy_wall(0, wall);
    gait_tracker *const t = begin(model(), &cfg, wall);
    for (int n = 0; n < GO; n++) {
        gait_state const true_state = truth(n, 1);
        memcpy(shot, wall, sizeof shot);
        toy_paint_of(model(), &cam, &true_state, shot);
        toy_noise((uint32_t)n, shot);
        const uint8_t *const shots[SCENE_CAMERAS] = {shot};
        toy_tracker_step(t, n, shots, &e);
    }
    const state_layout *const of = &t->layouts[TOY_STAND];
    particle_state const right = particle_from_state(of, &e.mean);
    particle_state turned = right;
    turned.f[F_HEADING] = m_wrap_pi(right.f[F_HEADING] + PI_F / 2.0f);
    CHECK(e.motion_class == TOY_STAND && t->core->fit_margin > 0.0f);
    CHECK(fit_check_score(t, of, &right) > 0.0f && fit_check_score(t, of, &turned) < 0.0f);
    toy_tracker_free(t);
}

/* A person who stops while hidden is found standing there. */
static void test_stops_while_hidden(void)
{
    gait_tracker_config const cfg = settings();
    outcome const s = follow(model(), &cfg, 1, true, 0, GO);
    CHECK(s.frames[TOY_STAND] > 20 && noticed(&s, TOY_STAND));
    CHECK(s.far < 0.25f);
}

/* The same bits from every instruction set and number of tasks, and after a snapshot. */
static uint64_t digest(uint32_t mask)
{
    gait_tracker_config cfg = settings();
    cfg.particles = 150;
    cfg.cpu_mask = mask;
    return follow(model(), &cfg, -1, false, 0, END).hash;
}

static void test_same_bits(void)
{
    gait_tracker_config cfg = settings();
    cfg.particles = 150;
    uint64_t const one = follow(model(), &cfg, -1, false, 0, END).hash;
    for (int save = 10; save < END; save += 40)
        CHECK(follow(model(), &cfg, -1, false, save, END).hash == one);
    cfg.tasks = 3;
    CHECK(follow(model(), &cfg, -1, false, 0, END).hash == one);
}

/* A blob whose only class has a name is tracked with the bits of one without classes. */
static void test_one_class(void)
{
    static _Alignas(GAIT_ALIGN) unsigned char data[TOY_BYTES], mem[2048];
    toy_classes_spec s = toy_classes_usual();
    s.classes = s.info_rows = s.change_rows = 1;
    s.curves = 0;
    gait_tracker_config const cfg = toy_config(1);
    film_make(1, 20);
    gait_tracker *const a = toy_tracker_new(&cfg);
    gait_tracker *const b = toy_tracker_of(toy_classes_make(&s, data, mem, sizeof mem), &cfg);
    toy_tracker_start(a, 0, 1.0f);
    toy_tracker_start(b, 0, 1.0f);
    for (int n = 0; n < 20; n++) {
        gait_estimate e, f;
        film_step(a, 1, n, 0, &e);
        film_step(b, 1, n, 0, &f);
        CHECK(memcmp(&e, &f, sizeof e) == 0);
    }
    CHECK(gait_tracker_digest(a) == gait_tracker_digest(b));
    toy_tracker_free(a);
    toy_tracker_free(b);
}

/* A start of a class that the model lacks is refused; paper mode has one class. */
static void test_starts(void)
{
    gait_tracker_config cfg = toy_config(1);
    gait_tracker *t = toy_tracker_of(model(), &cfg);
    gait_state mean = toy_walk(0.0f);
    gait_state const sd = toy_start_sd(1.0f);
    gait_error err = {0};
    mean.motion_class = TOY_CLASSES;
    CHECK(gait_tracker_start(t, &mean, &sd, 0, &err) == GAIT_ERR_ARG && strstr(err.text, "motion_class"));
    mean.motion_class = TOY_STAND;
    CHECK(gait_tracker_start(t, &mean, &sd, 0, &err) == GAIT_OK);
    static gait_state state[4096];
    static float weight[4096];
    int32_t const n = gait_tracker_particles(t, state, weight, 4096, NULL);
    int32_t count[TOY_CLASSES] = {0};
    for (int32_t i = 0; i < n; i++)
        count[state[i].motion_class]++;
    CHECK(count[TOY_STAND] > count[TOY_WALK] && count[TOY_WALK] >= cfg.particles / 16 && count[TOY_BACK] > 0);
    CHECK(gait_tracker_predict(t, state, n, 0.1, NULL) == GAIT_OK && state[n - 1].motion_class == TOY_BACK);
    toy_tracker_free(t);
    gait_tracker_default(&cfg, GAIT_MODE_PAPER);
    cfg.camera[0] = toy_camera(0);
    cfg.particles = 50;
    t = toy_tracker_of(model(), &cfg);
    CHECK(!t->classes);
    toy_tracker_free(t);
}

/* With several classes the rate returns to the mean of people ten times more slowly. */
static void test_pace_lasts(void)
{
    gait_tracker_config const cfg = settings();
    dynamics const d = {.cfg = &cfg, .rule = state_layout_init(model(), &cfg, kernels_choose(~0u))};
    dynamics const of_one = {.cfg = &cfg, .rule = state_layout_init(toy_model(), &cfg, kernels_choose(~0u))};
    CHECK_NEAR(dynamics_step_init(&d, 0.1f, 2.0f, 0).rate.keep, exp(-0.1 / (10.0 * (double)cfg.rate_time)),
               1e-6);
    CHECK_NEAR(dynamics_step_init(&of_one, 0.1f, 2.0f, 0).rate.keep, exp(-0.1 / (double)cfg.rate_time), 1e-6);
}

/* Of people who seemed to stand for a moment nine in ten walk on as if they had not stood, at their own rate. */
static void test_resumes(void)
{
    gait_tracker_config const cfg = settings();
    gait_model const *const still = model()->of_class[TOY_STAND];
    state_layout const walk = state_layout_init(model(), &cfg, kernels_choose(~0u));
    float const score[GAIT_MAX_COMPONENTS] = {0.0f}, rate = 1.05f;
    for (int brief = 0; brief < 2; brief++) {
        class_entry const e = {.layout = &walk,
                               .seed = 1,
                               .score = score,
                               .score_sd = 1.0f,
                               .resumes = brief,
                               .phase = 0.9f,
                               .seconds = 0.2f};
        int32_t resumed = 0;
        for (int32_t i = 0; i < 2000; i++) {
            particle_state p = {.f = {[F_RATE] = rate, [F_STATURE] = 1.7f}};
            class_change_enter(&e, still->motion_class, i, &p);
            float const off = m_wrap_pi(TWO_PI_F * (p.f[F_PHASE] - 0.11f)) / TWO_PI_F;
            resumed += p.f[F_RATE] == rate && fabsf(off) < 0.15f;
        }
        CHECK(brief ? resumed > 1740 && resumed < 1860 : resumed == 0);
    }
}

static gait_estimate of_class(int32_t motion_class)
{
    return (gait_estimate){.motion_class = motion_class, .mean = {.phase = 0.25f}};
}

/* People who have moved in class `moved` and seem to stand for a tenth of a second: share of the particles entering class `to`
 * from standing that resume the phase. */
static float share_resumed(const gait_model *m, int32_t moved, int32_t stand, int32_t to)
{
    static uint8_t wall[SCENE_PIXELS];
    gait_tracker_config const cfg = settings();
    toy_wall(0, wall);
    gait_tracker *const t = begin(m, &cfg, wall);
    particle_state const mean = t->core->last_supported;
    float const expected = 0.25f + 0.1f * 1.05f * (float)m->of_class[to]->direction;
    gait_estimate e = of_class(moved);
    t->core->hypotheses.stage = HYPOTHESES_ONE;
    t->core->reported_phase = e.mean.phase;
    class_strata_report(t, &mean, &e);
    t->core->utime += 100000;
    e = of_class(stand);
    class_strata_report(t, &mean, &e);
    const strata *const s = tracker_strata(t);
    int32_t resumed = 0, entered = 0;
    for (int32_t first = s->first[to]; first < s->first[to + 1]; first += BLOCK) {
        particle_block p;
        int32_t index[BLOCK];
        for (int32_t lane = 0; lane < BLOCK; lane++)
            index[lane] = first + lane;
        particle_block_get(&t->particles, index, BLOCK, &p);
        for (int32_t lane = 0; lane < BLOCK; lane++) {
            t->origin[first + lane] = (uint8_t)stand;
            p.f[F_RATE][lane] = 1.05f;
        }
        class_strata_enter(t, 1, 0.0f, first, BLOCK, &p);
        for (int32_t lane = 0; lane < BLOCK; lane++) {
            float const off = m_wrap_pi(TWO_PI_F * (p.f[F_PHASE][lane] - expected)) / TWO_PI_F;
            resumed += p.f[F_RATE][lane] == 1.05f && fabsf(off) < 0.09f;
            entered++;
        }
    }
    toy_tracker_free(t);
    return (float)resumed / (float)entered;
}

/* A pause ends in the class before it, forwards or backwards, whatever the order of the classes. */
static void test_resumes_the_class_before(void)
{
    const gait_model *const m[] = {model(), reordered_model()};
    static const int32_t stand[] = {TOY_STAND, 2}, moves[2][2] = {{TOY_WALK, TOY_BACK}, {TOY_WALK, 1}};
    for (int k = 0; k < 2; k++)
        for (int moved = 0; moved < 2; moved++)
            for (int to = 0; to < 2; to++) {
                float const share = share_resumed(m[k], moves[k][moved], stand[k], moves[k][to]);
                CHECK(to == moved ? share > 0.75f : share == 0.0f);
            }
}

#define GOLDEN UINT64_C(0x05dfa794ed305026)

static void all(void)
{
    test_views();
    test_poses();
    test_refused();
    test_another_order();
    test_rates();
    test_pace_lasts();
    test_resumes();
    test_resumes_the_class_before();
    test_starts();
    test_one_class();
    test_fit_of_a_standing_person();
    test_drift();
    if (!SANITIZED) {
        test_stops_and_walks_on();
        test_stops_while_hidden();
    }
    test_same_bits();
}

int main(int argc, char **argv)
{
    return golden_main(argc, argv, all, digest, GOLDEN, "classes");
}
