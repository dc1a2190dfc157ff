/* Configurations and starts that make no sense are refused, each with an error that names what is wrong. */
#include "toy_film.h"

#include "check.h"

static void refuse(const gait_tracker_config *cfg, gait_result want, int32_t index, const char *word)
{
    size_t bytes = 5;
    gait_error err = {.index = -7};
    gait_tracker *t = NULL;
    static _Alignas(GAIT_ALIGN) unsigned char memory[64];
    CHECK(gait_tracker_bytes(toy_model(), cfg, &bytes, &err) == want);
    CHECK(bytes == 5 && err.result == want && (index == -2 || err.index == index));
    if (!strstr(err.text, word))
        fprintf(stderr, "\"%s\" does not name \"%s\"\n", err.text, word);
    CHECK(strstr(err.text, word) != NULL);
    CHECK(gait_tracker_init(memory, sizeof memory, toy_model(), cfg, &t, NULL) == want && !t);
}

static void test_integers(void)
{
    static const struct {
        size_t offset;
        int32_t value;
        gait_result want;
        const char *word;
    } bad[] = {
        {offsetof(gait_tracker_config, struct_size), 0, GAIT_ERR_STRUCT, "gait_tracker_default"},
        {offsetof(gait_tracker_config, struct_size), (int32_t)sizeof(gait_tracker_config) + 8,
         GAIT_ERR_STRUCT, "build with its headers"},
        {offsetof(gait_tracker_config, mode), 2, GAIT_ERR_ARG, "mode"},
        {offsetof(gait_tracker_config, mode), -1, GAIT_ERR_ARG, "mode"},
        {offsetof(gait_tracker_config, particles), 15, GAIT_ERR_LIMIT, "particles"},
        {offsetof(gait_tracker_config, particles), (1 << 20) + 1, GAIT_ERR_LIMIT, "particles"},
        {offsetof(gait_tracker_config, particles), INT32_MIN, GAIT_ERR_LIMIT, "particles"},
        {offsetof(gait_tracker_config, acquisition_particles), -1, GAIT_ERR_LIMIT, "acquisition_particles"},
        {offsetof(gait_tracker_config, acquisition_particles), (1 << 20) + 1, GAIT_ERR_LIMIT,
         "acquisition_particles"},
        {offsetof(gait_tracker_config, components), -2, GAIT_ERR_LIMIT, "components"},
        {offsetof(gait_tracker_config, components), TOY_COMPONENTS + 1, GAIT_ERR_LIMIT, "components"},
        {offsetof(gait_tracker_config, proportions), GAIT_MAX_PROPORTIONS, GAIT_ERR_LIMIT, "proportions"},
        {offsetof(gait_tracker_config, tasks), 0, GAIT_ERR_LIMIT, "tasks"},
        {offsetof(gait_tracker_config, tasks), 257, GAIT_ERR_LIMIT, "tasks"},
        {offsetof(gait_tracker_config, cameras), 0, GAIT_ERR_LIMIT, "cameras"},
        {offsetof(gait_tracker_config, cameras), GAIT_MAX_CAMERAS + 1, GAIT_ERR_LIMIT, "cameras"},
        {offsetof(gait_tracker_config, lag), -1, GAIT_ERR_LIMIT, "lag"},
        {offsetof(gait_tracker_config, lag), 65, GAIT_ERR_LIMIT, "lag"},
        {offsetof(gait_tracker_config, terms), 0, GAIT_ERR_ARG, "terms"},
        {offsetof(gait_tracker_config, terms), 0x21, GAIT_ERR_ARG, "terms"},
        {offsetof(gait_tracker_config, cpu_mask), 16, GAIT_ERR_ARG, "cpu_mask"},
        {offsetof(gait_tracker_config, cpu_mask), INT32_MAX, GAIT_ERR_ARG, "cpu_mask"},
    };
    for (size_t k = 0; k < sizeof bad / sizeof *bad; k++) {
        gait_tracker_config cfg = toy_config(2);
        memcpy((char *)&cfg + bad[k].offset, &bad[k].value, sizeof bad[k].value);
        refuse(&cfg, bad[k].want, -1, bad[k].word);
    }
}

/* Every number of the configuration that has a range: not a number, infinite, below and above it; named in the message. */
static void test_ranges(void)
{
    gait_field f;
    int32_t floats = 0;
    for (uint32_t i = 0; gait_field_at(i, &f) == GAIT_OK; i++) {
        if (strcmp(f.of, "gait_tracker_config") != 0 || strcmp(f.type, "float") != 0)
            continue;
        CHECK(f.low < f.high && !*f.array);
        floats++;
        float const below = (float)(f.low - 1e-3), above = (float)(f.high * 1.01);
        const float value[] = {below, above, NAN, INFINITY, -INFINITY};
        for (size_t v = 0; v < sizeof value / sizeof *value; v++) {
            gait_tracker_config cfg = toy_config(1);
            memcpy((char *)&cfg + f.offset, &value[v], sizeof value[v]);
            refuse(&cfg, GAIT_ERR_ARG, -1, f.name);
        }
        const float end[] = {(float)f.low, (float)f.high};
        for (size_t v = 0; v < 2; v++) {
            gait_tracker_config cfg = toy_config(1);
            size_t bytes;
            memcpy((char *)&cfg + f.offset, &end[v], sizeof end[v]);
            CHECK(gait_tracker_bytes(toy_model(), &cfg, &bytes, NULL) == GAIT_OK);
        }
    }
    CHECK(floats == 35);
}

/* A program compiled with an older header, whose config ends before the last settings: they get their defaults. */
static void test_an_older_config(void)
{
    size_t const older = offsetof(gait_tracker_config, offset_noise);
    static _Alignas(GAIT_ALIGN) unsigned char memory[2][1 << 23];
    gait_tracker_config whole = toy_config(1), cut;
    gait_tracker *t[2] = {NULL, NULL};
    gait_estimate e[2];
    gait_tracker_default(&cut, GAIT_MODE_DEFAULT);
    whole.offset_noise = cut.offset_noise;
    whole.proportion_noise = cut.proportion_noise;
    memset(&cut, 0xff, sizeof cut);
    gait_tracker_fill(&cut, older, GAIT_MODE_DEFAULT);
    CHECK(cut.struct_size == older && isnan(cut.offset_noise)); /* nothing is written past its end */
    memcpy(&cut, &whole, older);
    cut.struct_size = older;
    CHECK(gait_tracker_init(memory[0], sizeof memory[0], toy_model(), &whole, &t[0], NULL) == GAIT_OK);
    CHECK(gait_tracker_init(memory[1], sizeof memory[1], toy_model(), &cut, &t[1], NULL) == GAIT_OK);
    for (int k = 0; k < 2; k++) {
        gait_state const mean = toy_walk(0.0f), sd = {.phase = 0.1f, .heading = 0.1f};
        gait_frame const frame = {.utime = 33333};
        CHECK(gait_tracker_start(t[k], &mean, &sd, 0, NULL) == GAIT_OK);
        CHECK(gait_tracker_step(t[k], &frame, &e[k], NULL) == GAIT_OK);
    }
    CHECK(gait_tracker_digest(t[0]) == gait_tracker_digest(t[1]) && memcmp(&e[0], &e[1], sizeof e[0]) == 0);
    cut.struct_size = older - 2;
    refuse(&cut, GAIT_ERR_STRUCT, -1, "not filled by gait_tracker_default()");
    cut.struct_size = 8;
    refuse(&cut, GAIT_ERR_STRUCT, -1, "not filled by gait_tracker_default()");
}

/* Memory that is not aligned, or too small: each has its own error. */
static void test_memory(void)
{
    static _Alignas(GAIT_ALIGN) unsigned char memory[2 * GAIT_ALIGN];
    gait_tracker_config const cfg = toy_config(1);
    gait_tracker *t = NULL;
    gait_error err;
    CHECK(gait_tracker_init(memory + 1, sizeof memory - 1, toy_model(), &cfg, &t, &err) == GAIT_ERR_MEMORY);
    CHECK(strcmp(err.text, "memory not aligned to 64 bytes") == 0 && !t);
    CHECK(gait_tracker_init(memory, sizeof memory, toy_model(), &cfg, &t, &err) == GAIT_ERR_MEMORY);
    CHECK(strstr(err.text, "bytes, got 128") && !strstr(err.text, "aligned") && !t);
}

static void test_cameras(void)
{
    for (int k = 0; k < 2; k++) {
        gait_tracker_config cfg = toy_config(2);
        cfg.camera[k].width = 0;
        refuse(&cfg, GAIT_ERR_ARG, k, k ? "camera 1" : "camera 0");
        cfg = toy_config(2);
        cfg.camera[k].R[4] = 0.5f;
        refuse(&cfg, GAIT_ERR_ARG, k, k ? "camera 1" : "camera 0");
        cfg = toy_config(2);
        cfg.camera[k].fy = NAN;
        refuse(&cfg, GAIT_ERR_ARG, k, k ? "camera 1" : "camera 0");
        cfg = toy_config(2);
        cfg.camera[k].cx = 3e38f;
        refuse(&cfg, GAIT_ERR_ARG, k, "cx, cy in [-1e6, 1e6]");
        cfg = toy_config(2);
        cfg.camera[k].fx = 1e-30f;
        refuse(&cfg, GAIT_ERR_ARG, k, "fx, fy in [1e-3, 1e9]");
        cfg = toy_config(2);
        cfg.camera[k].t[2] = 3e38f;
        refuse(&cfg, GAIT_ERR_ARG, k, "t in [-1e4, 1e4] metres");
        cfg = toy_config(2);
        cfg.camera[k].height = 1 << 20;
        refuse(&cfg, GAIT_ERR_LIMIT, k, k ? "camera 1" : "camera 0");
    }
    gait_tracker_config cfg = toy_config(1);
    size_t bytes;
    memset(&cfg.camera[1], 0xff, sizeof cfg.camera[1]); /* not in use */
    CHECK(gait_tracker_bytes(toy_model(), &cfg, &bytes, NULL) == GAIT_OK);
}

/* The defaults of both modes are accepted as they are. */
static void test_defaults(void)
{
    for (int k = 0; k < 2; k++) {
        gait_mode const mode = k ? GAIT_MODE_PAPER : GAIT_MODE_DEFAULT;
        gait_tracker_config cfg;
        size_t bytes;
        memset(&cfg, 0xff, sizeof cfg);
        gait_tracker_default(&cfg, mode);
        CHECK(cfg.struct_size == sizeof cfg && cfg.mode == mode && cfg.seed == 1 && cfg.exec.run == NULL);
        CHECK(cfg.components == -1 && cfg.cameras == 1);
        CHECK((cfg.terms == GAIT_TERM_TEXTURE) == (mode == GAIT_MODE_PAPER));
        cfg.camera[0] = toy_camera(0);
        CHECK(gait_tracker_bytes(toy_model(), &cfg, &bytes, NULL) == GAIT_OK);
    }
    gait_tracker_default(NULL, GAIT_MODE_DEFAULT);
}

static void test_start(void)
{
    gait_tracker_config const cfg = toy_config(1);
    gait_tracker *const t = toy_tracker_new(&cfg);
    gait_state const good = toy_walk(0.2f), uncertain = toy_start_sd(1.0f);
    uint64_t const digest = gait_tracker_digest(t);
    static gait_state particle[4];
    static float weight[4];
    gait_error err = {0};
    CHECK(gait_tracker_particles(t, particle, weight, 4, NULL) == GAIT_ERR_STATE);
    CHECK(gait_tracker_start(NULL, &good, &uncertain, 0, &err) == GAIT_ERR_ARG);
    CHECK(gait_tracker_start(t, NULL, &uncertain, 0, &err) == GAIT_ERR_ARG);
    CHECK(gait_tracker_start(t, &good, NULL, 0, &err) == GAIT_ERR_ARG);
    for (size_t k = 0; k < sizeof good / sizeof(float); k++)
        for (int which = 0; which < 3; which++) {
            gait_state mean = good, sd = uncertain;
            float const bad = which == 2 ? -0.1f : k % 2 ? NAN : INFINITY;
            memcpy((char *)(which ? &sd : &mean) + k * sizeof bad, &bad, sizeof bad);
            gait_result const whole =
                k * sizeof bad == offsetof(gait_state, motion_class) ? GAIT_ERR_LIMIT : GAIT_ERR_ARG;
            CHECK(gait_tracker_start(t, &mean, &sd, 0, &err) == whole && err.text[0]);
        }
    static const float stature[] = {0.0f, -1.0f, 3.5f};
    for (size_t k = 0; k < 3; k++) {
        gait_state mean = good;
        mean.stature = stature[k];
        CHECK(gait_tracker_start(t, &mean, &uncertain, 0, &err) == GAIT_ERR_ARG &&
              strstr(err.text, "stature"));
    }
    gait_state still = good;
    still.stride_hz = 0.0f;
    CHECK(gait_tracker_start(t, &still, &uncertain, 0, &err) == GAIT_ERR_ARG &&
          strstr(err.text, "stride_hz"));
    CHECK(gait_tracker_digest(t) == digest);
    CHECK(gait_tracker_start(t, &good, &uncertain, 0, NULL) == GAIT_OK && gait_tracker_digest(t) != digest);
    toy_tracker_free(t);
}

/* A number of a state by its place. */
static void set_number(gait_state *s, size_t k, float value)
{
    memcpy((char *)s + k * sizeof value, &value, sizeof value);
}

/* A finite but absurd start used to give estimates that were NaN. */
static void test_absurd_starts(void)
{
    static const struct {
        size_t member;
        float mean, sd;
        const char *text;
    } starts[] = {
        {offsetof(gait_state, stature), 0.0f, 1e6f, "start sd.stature = 1e+06 is outside [0, 10]"},
        {offsetof(gait_state, pelvis), 0.0f, 3e38f, "start sd.pelvis = 3e+38 is outside [0, 10]"},
        {offsetof(gait_state, coef), 0.0f, 1e38f, "start sd.coef = 1e+38 is outside [0, 10]"},
        {offsetof(gait_state, pelvis), 1e30f, 0.0f, "start mean.pelvis = 1e+30 is outside [-10000, 10000]"},
        {offsetof(gait_state, stride_hz), 1e9f, 0.0f, "start mean.stride_hz = 1e+09 is outside [0.1, 4]"},
        {offsetof(gait_state, phase), 2.0f, 0.0f, "start mean.phase = 2 is outside [0, 1]"},
    };
    gait_tracker_config const cfg = toy_config(1);
    gait_tracker *const t = toy_tracker_new(&cfg);
    gait_error err;
    for (size_t k = 0; k < sizeof starts / sizeof *starts; k++) {
        gait_state mean = toy_walk(0.2f), sd = toy_start_sd(1.0f);
        if (starts[k].mean != 0.0f)
            set_number(&mean, starts[k].member / sizeof(float), starts[k].mean);
        else
            set_number(&sd, starts[k].member / sizeof(float), starts[k].sd);
        CHECK(gait_tracker_start(t, &mean, &sd, 0, &err) == GAIT_ERR_ARG &&
              strcmp(err.text, starts[k].text) == 0);
    }
    toy_tracker_free(t);
}

static bool estimate_finite(const gait_estimate *e)
{
    bool finite = isfinite(e->log_evidence) && isfinite(e->ess) && isfinite(e->speed);
    const gait_state *const states[] = {&e->mean, &e->sd, &e->best};
    for (size_t k = 0; k < sizeof e->mean / sizeof(float); k++)
        for (int i = 0; i < 3; i++) {
            float v;
            memcpy(&v, (const char *)states[i] + k * sizeof v, sizeof v);
            finite = finite && isfinite(v);
        }
    for (int j = 0; j < TOY_POINTS; j++)
        for (int i = 0; i < 3; i++)
            finite = finite && isfinite(e->pose.joint[j][i]) && isfinite(e->joint_sd[j][i]);
    return finite;
}

/* Set number k of the mean to the limit of its range, upper or lower. */
static void set_far(gait_tracker *t, gait_state *mean, const gait_state *sd, size_t k, float sign)
{
    static const float far[] = {1e4f, 10.0f, 7.0f, 4.0f, 2.5f, 1.0f, 0.5f, 0.1f, 0.0f};
    int const most = sizeof far / sizeof *far;
    for (int i = 0; i < most; i++) {
        set_number(mean, k,
                   sign > 0.0f ? far[i]
                   : k < 3     ? far[most - 1 - i]
                               : -far[i]); /* three are positive */
        if (gait_tracker_start(t, mean, sd, toy_frame(0).utime, NULL) == GAIT_OK)
            return;
    }
    check_that(0, "a number has no range", __FILE__, __LINE__);
}

/* Every accepted start gives finite estimates, with each number at the limit of its range. */
static void test_the_widest_starts_stay_finite(void)
{
    gait_tracker_config cfg = toy_config(1);
    cfg.offset_angles = ~0u;
    film_make(1, 3);
    gait_tracker *const t = film_tracker(&cfg, 0, 1.0f);
    for (int way = 0; way < 4; way++) { /* each alone or all together, up or down */
        gait_state mean = toy_walk(0.0f), sd = toy_start_sd(1.0f);
        for (size_t k = 0; k < offsetof(gait_state, motion_class) / sizeof(float); k++) {
            gait_estimate e;
            if (way < 2) {
                mean = toy_walk(0.0f);
                sd = toy_start_sd(1.0f);
            }
            set_number(&sd, k, 10.0f);
            set_far(t, &mean, &sd, k, way % 2 ? 1.0f : -1.0f);
            for (int n = 0; n < 3; n++) {
                film_step(t, 1, n, 0, &e);
                CHECK(estimate_finite(&e));
            }
        }
    }
    toy_tracker_free(t);
}

/* The broad prior is a start that works: no phase, no heading, the mean rate and stature of people. */
static void test_prior(void)
{
    gait_state mean, sd;
    gait_tracker_config const cfg = toy_config(1);
    gait_tracker *const t = toy_tracker_new(&cfg);
    CHECK(gait_tracker_prior(toy_model(), &mean, &sd, NULL) == GAIT_OK);
    CHECK(mean.stride_hz == 0.92f && sd.stride_hz == 0.07f && mean.stature == 1.72f && sd.stature == 0.09f);
    CHECK(sd.phase >= 0.5f && sd.heading >= 3.1415f && sd.coef[0] == 1.0f && sd.coef[1] == 1.0f &&
          sd.coef[2] == 0.0f);
    CHECK(sd.offset[0] == 0.05f && sd.offset[TOY_ANGLES - 1] == 0.05f && sd.offset[TOY_ANGLES] == 0.0f);
    CHECK_NEAR(mean.pelvis[2], 0.53 * 1.72, 0.05);
    CHECK(gait_tracker_start(t, &mean, &sd, 0, NULL) == GAIT_OK);
    CHECK(gait_tracker_prior(NULL, &mean, &sd, NULL) == GAIT_ERR_ARG);
    CHECK(gait_tracker_prior(toy_model(), NULL, &sd, NULL) == GAIT_ERR_ARG);
    CHECK(gait_tracker_prior(toy_model(), &mean, NULL, NULL) == GAIT_ERR_ARG);
    toy_tracker_free(t);
}

static void test_background(void)
{
    static uint8_t grey[SCENE_PIXELS];
    gait_tracker_config const cfg = toy_config(2);
    gait_tracker *const t = toy_tracker_new(&cfg);
    gait_image const good = toy_image(grey);
    for (int k = 0; k < 4; k++) {
        gait_image bad = good;
        int32_t *const number[] = {&bad.width, &bad.height, &bad.stride, (int32_t *)(void *)&bad.format};
        *number[k] -= 1;
        CHECK(gait_tracker_set_background(t, 0, &bad, NULL) == GAIT_ERR_ARG);
    }
    CHECK(gait_tracker_set_background(NULL, 0, &good, NULL) == GAIT_ERR_ARG);
    CHECK(gait_tracker_set_background(t, -1, &good, NULL) == GAIT_ERR_ARG);
    CHECK(gait_tracker_set_background(t, 2, &good, NULL) == GAIT_ERR_ARG);
    CHECK(gait_tracker_set_background(t, 1, &good, NULL) == GAIT_OK);
    CHECK(gait_tracker_set_background(t, 1, NULL, NULL) == GAIT_OK);
    toy_tracker_free(t);
}

/* A prediction depends only on its index in the call, not on the number of states; invalid states are refused. */
static void test_predict(void)
{
    gait_tracker_config const cfg = toy_config(1);
    gait_tracker *const t = toy_tracker_new(&cfg);
    gait_state mean, sd, some[20], more[40];
    gait_error err;
    gait_tracker_prior(toy_model(), &mean, &sd, NULL);
    toy_tracker_start(t, 0, 1.0f);
    for (int32_t i = 0; i < 40; i++)
        more[i] = mean;
    memcpy(some, more, sizeof some);
    CHECK(gait_tracker_predict(t, more, 40, 0.05, NULL) == GAIT_OK);
    CHECK(gait_tracker_predict(t, some, 20, 0.05, NULL) == GAIT_OK);
    CHECK(memcmp(some, more, sizeof some) == 0 && some[0].phase != some[19].phase);
    CHECK_NEAR(some[0].phase, 0.05f * mean.stride_hz, 0.05);
    CHECK(gait_tracker_predict(t, some, 20, 0.0, NULL) == GAIT_OK && memcmp(some, more, sizeof some) == 0);
    some[7].stature = 0.0f;
    CHECK(gait_tracker_predict(t, some, 20, 0.05, &err) == GAIT_ERR_ARG && strstr(err.text, "stature"));
    CHECK(memcmp(some, more, 7 * sizeof *some) == 0); /* none has moved */
    CHECK(gait_tracker_predict(t, more, 40, -0.01, &err) == GAIT_ERR_ARG && strstr(err.text, "dt = -0.01"));
    CHECK(gait_tracker_predict(t, more, 40, 1e3, NULL) == GAIT_ERR_ARG);
    CHECK(gait_tracker_predict(t, NULL, 40, 0.05, NULL) == GAIT_ERR_ARG);
    CHECK(gait_tracker_predict(t, NULL, 0, 0.05, NULL) == GAIT_OK);
    CHECK(gait_tracker_predict(NULL, more, 40, 0.05, NULL) == GAIT_ERR_ARG);
    toy_tracker_free(t);
}

/* No more particles than the capacity; the number of particles is always returned. */
static void test_particles(void)
{
    gait_tracker_config const cfg = toy_config(1);
    gait_tracker *const t = toy_tracker_new(&cfg);
    gait_state s[3];
    float weight[3] = {-1.0f, -1.0f, -1.0f};
    toy_tracker_start(t, 0, 1.0f);
    CHECK(gait_tracker_particles(t, NULL, NULL, 0, NULL) == 300);
    CHECK(gait_tracker_particles(t, s, weight, 2, NULL) == 300);
    CHECK(weight[0] == 1.0f / 300.0f && weight[1] == weight[0] && weight[2] == -1.0f);
    CHECK_NEAR(s[0].pelvis[0], -1.3, 0.3);
    CHECK(s[0].pelvis[0] != s[1].pelvis[0]);
    CHECK(gait_tracker_particles(NULL, s, weight, 2, NULL) == GAIT_ERR_ARG);
    CHECK(gait_tracker_particles(t, NULL, weight, 2, NULL) == GAIT_ERR_ARG);
    CHECK(gait_tracker_particles(t, s, NULL, 2, NULL) == GAIT_ERR_ARG);
    CHECK(gait_tracker_particles(t, s, weight, -1, NULL) == GAIT_ERR_ARG);
    CHECK(gait_tracker_digest(NULL) == 0);
    toy_tracker_free(t);
}

/* Steps, lagged estimates, snapshots and numbers of particles that are refused change nothing. */
static void test_calls(void)
{
    gait_tracker_config cfg = toy_config(1);
    cfg.lag = 2;
    gait_tracker *const t = toy_tracker_new(&cfg);
    gait_frame frame = {.utime = 5}, late = {.utime = 5 + INT64_C(3600000000)};
    gait_estimate out;
    gait_state mean, sd;
    gait_error err = {0};
    unsigned char little[8];
    size_t bytes = 7;
    CHECK(gait_tracker_step(t, &frame, &out, &err) == GAIT_ERR_STATE && strstr(err.text, "not started"));
    CHECK(gait_tracker_lagged(t, 1, &out, &err) == GAIT_ERR_STATE);
    CHECK(gait_tracker_particles(t, NULL, NULL, 0, &err) == GAIT_ERR_STATE);
    gait_tracker_prior(toy_model(), &mean, &sd, NULL);
    CHECK(gait_tracker_start(t, &mean, &sd, 5, NULL) == GAIT_OK);
    uint64_t const digest = gait_tracker_digest(t);
    CHECK(gait_tracker_step(NULL, &frame, &out, NULL) == GAIT_ERR_ARG);
    CHECK(gait_tracker_step(t, NULL, &out, NULL) == GAIT_ERR_ARG);
    CHECK(gait_tracker_step(t, &frame, NULL, NULL) == GAIT_ERR_ARG);
    CHECK(gait_tracker_step(t, &late, &out, &err) == GAIT_ERR_STATE && strstr(err.text, "start again"));
    frame.utime = 4;
    CHECK(gait_tracker_step(t, &frame, &out, &err) == GAIT_ERR_STATE && strstr(err.text, "is not after 5"));
    CHECK(gait_tracker_lagged(NULL, 0, &out, NULL) == GAIT_ERR_ARG);
    CHECK(gait_tracker_lagged(t, 0, NULL, NULL) == GAIT_ERR_ARG);
    CHECK(gait_tracker_lagged(t, -1, &out, NULL) == GAIT_ERR_ARG);
    CHECK(gait_tracker_lagged(t, 3, &out, &err) == GAIT_ERR_ARG && strstr(err.text, "lag of 2"));
    CHECK(gait_tracker_lagged(t, 2, &out, &err) == GAIT_ERR_STATE && strstr(err.text, "fewer steps"));
    CHECK(gait_tracker_set_particles(NULL, 100, NULL) == GAIT_ERR_ARG);
    CHECK(gait_tracker_set_particles(t, 15, &err) == GAIT_ERR_LIMIT && strstr(err.text, "[16, "));
    CHECK(gait_tracker_set_particles(t, cfg.particles + 1, NULL) == GAIT_ERR_LIMIT);
    CHECK(gait_tracker_save(NULL, NULL, 0, &bytes, NULL) == GAIT_ERR_ARG);
    CHECK(gait_tracker_save(t, NULL, 0, NULL, NULL) == GAIT_ERR_ARG);
    CHECK(gait_tracker_save(t, little, sizeof little, &bytes, NULL) == GAIT_ERR_MEMORY && bytes == 7);
    CHECK(gait_tracker_restore(NULL, little, sizeof little, NULL) == GAIT_ERR_ARG);
    CHECK(gait_tracker_restore(t, NULL, sizeof little, NULL) == GAIT_ERR_ARG);
    CHECK(gait_tracker_restore(t, little, sizeof little, NULL) != GAIT_OK);
    CHECK(gait_tracker_digest(t) == digest);
    frame.utime = 6;
    CHECK(gait_tracker_step(t, &frame, &out, NULL) == GAIT_OK);
    CHECK(gait_tracker_step(t, &frame, &out, NULL) == GAIT_ERR_STATE); /* the same time again */
    toy_tracker_free(t);
}

int main(void)
{
    test_integers();
    test_ranges();
    test_an_older_config();
    test_memory();
    test_cameras();
    test_defaults();
    test_start();
    test_absurd_starts();
    test_the_widest_starts_stay_finite();
    test_prior();
    test_background();
    test_predict();
    test_particles();
    test_calls();
    return CHECK_DONE();
}
