/* A segment prior of a blob: its views, and an error that names the section at fault. */
#include "gait_lift.h"
#include "model/segment_prior.h"

#include "check.h"
#include "toy_model.h"
#include "toy_segment.h"

static _Alignas(GAIT_ALIGN) unsigned char buf[TOY_BYTES];
static toy_segments toy;

static gait_result open_prior(size_t bytes, segment_prior *p, gait_error *err)
{
    blob b;
    gait_result const s = blob_open(buf, bytes, &b, err);
    return s == GAIT_OK ? segment_open(&b, p, err) : s;
}

static void test_views(void)
{
    segment_prior p;
    toy_segments_fill(&toy, 2, 8);
    size_t const bytes = toy_segments_write(buf, &toy);
    CHECK(open_prior(bytes, &p, NULL) == GAIT_OK);
    CHECK(p.markers == TOY_MARKERS && p.frames == TOY_SEGMENT_FRAMES && p.hop == TOY_HOP && p.headings == 8);
    CHECK(p.components == 2 && p.modes == TOY_MODES && p.fps == TOY_FPS && p.gamma == TOY_GAMMA);
    CHECK(p.stature == TOY_STATURE && strcmp(p.name[1], "l_hip") == 0 && p.weight[1] == 0.3f);
    CHECK(segment_mean(&p, 1, 2)[3 * 4 + 1] == toy.mean[1][2 * TOY_MARKERS + 4][1]);
    CHECK(segment_mode(&p, 1, 3, 5)[3 * 8 + 2] == toy.mode[1][3][5 * TOY_MARKERS + 8][2]);
    CHECK(p.sd[TOY_MODES] == toy.sd[1][0] && p.residual[TOY_MARKERS] == toy.residual[1][0]);
}

/* One number of the blob made wrong. */
typedef struct patch {
    const char *tag;
    void *at;
    int as_int;
    double value;
} patch;

static void test_refused(void)
{
    const patch patches[] = {
        {"SGIN", &toy.count[1], 1, 0},
        {"SGIN", &toy.count[1], 1, TOY_SEGMENT_FRAMES + 1},
        {"SGIN", &toy.count[2], 1, 3},
        {"SGIN", &toy.count[0], 1, -1},
        {"SGIN", &toy.count[3], 1, 0},
        {"SGIN", &toy.count[4], 1, 0},
        {"SGRT", &toy.rate[0], 0, 1e9},
        {"SGRT", &toy.rate[2], 0, 100},
        {"SGRT", &toy.rate[2], 0, 0},
        {"SGRT", &toy.rate[0], 0, 1e-6},
        {"SGRT", &toy.rate[1], 0, -1},
        {"SGRT", &toy.rate[2], 0, NAN},
        {"SGRT", &toy.rate[0], 0, 2000},
        {"SGWT", &toy.weight[0], 0, 0},
        {"SGWT", &toy.weight[0], 0, 0.9},
        {"SGMN", &toy.mean[0][5][1], 0, HUGE_VAL},
        {"SGMD", &toy.mode[0][4][9][2], 0, NAN},
        {"SGSD", &toy.sd[0][2], 0, -0.1},
        {"SGPS", &toy.residual[0][3], 0, 0},
        {"SGNM", &toy.name[2][0], 1, 0},
    };
    for (size_t i = 0; i < sizeof patches / sizeof *patches; i++) {
        int32_t const n = patches[i].as_int ? (int32_t)patches[i].value : 0;
        float const x = (float)patches[i].value;
        segment_prior p = {.markers = -7};
        gait_error err = {0};
        toy_segments_fill(&toy, 1, 0);
        memcpy(patches[i].at, patches[i].as_int ? (const void *)&n : (const void *)&x, 4);
        size_t const bytes = toy_segments_write(buf, &toy);
        gait_result const s = open_prior(bytes, &p, &err);
        if (s != GAIT_ERR_CORRUPT || !strstr(err.text, patches[i].tag))
            fprintf(stderr, "patch %zu of %s: %s, %s\n", i, patches[i].tag, gait_result_name(s), err.text);
        CHECK(s == GAIT_ERR_CORRUPT && strstr(err.text, patches[i].tag) && p.markers == -7);
    }
}

/* Counts that do not fit the other sections, or this build. */
static void test_counts(void)
{
    segment_prior p;
    gait_error err = {0};
    toy_segments_fill(&toy, 1, 0);
    toy.count[4] = TOY_MODES + 1;
    CHECK(open_prior(toy_segments_write(buf, &toy), &p, &err) == GAIT_ERR_CORRUPT);
    CHECK(strstr(err.text, "SGMD") != NULL);
    toy_segments_fill(&toy, 1, 0);
    toy.count[0] = GAIT_MAX_SEGMENT_FRAMES + 1;
    CHECK(open_prior(toy_segments_write(buf, &toy), &p, &err) == GAIT_ERR_LIMIT);
}

/* A blob may contain only segments: it can be used for lifting, and calls that need the cyclic model report that. */
static void test_no_cyclic_model(void)
{
    static _Alignas(GAIT_ALIGN) unsigned char memory[1024];
    gait_error err = {0};
    gait_model *m = NULL;
    gait_model_info info;
    gait_lift_info lift;
    gait_tracker_config cfg;
    gait_pose pose;
    gait_state state = {.stature = 1.8f}, sd;
    gait_camera const camera = {4, 4, 5, 5, 2, 2, {1, 0, 0, 0, 0, -1, 0, 1, 0}, {0, 1, 5}, {0}};
    uint8_t ids[16];
    float height;
    size_t need = 0;
    toy_segments_fill(&toy, 1, 0);
    size_t const bytes = toy_segments_write(buf, &toy);
    CHECK(gait_model_init(memory, sizeof memory, buf, bytes, &m, &err) == GAIT_OK);
    CHECK(gait_model_get_info(m, &info, &err) == GAIT_OK && !info.cyclic && info.joints == 0);
    CHECK(gait_lift_get_info(m, &lift, &err) == GAIT_OK && lift.markers == TOY_MARKERS);
    CHECK(lift.digest == info.digest);
    CHECK(!gait_model_joint_name(m, 0) && !gait_model_angle_name(m, 0));
    gait_tracker_default(&cfg, GAIT_MODE_DEFAULT);
    CHECK(gait_tracker_bytes(m, &cfg, &need, &err) == GAIT_ERR_ARG);
    CHECK(strstr(err.text, "without `--segments only`") != NULL);
    CHECK(gait_model_pose(m, &state, &pose, &err) == GAIT_ERR_ARG && strstr(err.text, "no cyclic part"));
    CHECK(gait_tracker_prior(m, &state, &sd, NULL) == GAIT_ERR_ARG);
    CHECK(gait_model_pelvis_height(m, &state, &height, &err) == GAIT_ERR_ARG && !gait_model_class_name(m, 0));
    CHECK(gait_render(m, &camera, &state, ids, 4, &err) == GAIT_ERR_ARG &&
          strstr(err.text, "no cyclic part"));
    toy_file f = toy_begin(buf, 0);
    CHECK(gait_model_bytes(buf, toy_finish(&f), &need, &err) == GAIT_ERR_CORRUPT && strstr(err.text, "CHNM"));
}

/* The error for a model without segments names the remedy. */
static void test_no_segments(void)
{
    gait_error err = {0};
    gait_lift_info info;
    gait_lift_config cfg;
    size_t need = 0;
    gait_lift_default(&cfg);
    CHECK(gait_lift_get_info(toy_model(), &info, &err) == GAIT_ERR_ARG && strstr(err.text, "gait learn"));
    CHECK(gait_lift_bytes(toy_model(), &cfg, &need, &err) == GAIT_ERR_ARG && strstr(err.text, "--segments"));
}

int main(void)
{
    test_views();
    test_refused();
    test_counts();
    test_no_cyclic_model();
    test_no_segments();
    return CHECK_DONE();
}
