/* Public functions of the library and of models: their argument checks and their memory contract. */
#include "toy_model.h"

#include "check.h"

static void test_library(void)
{
    CHECK(gait_version() == GAIT_VERSION && gait_abi() == GAIT_ABI);
    CHECK(strcmp(gait_result_name(GAIT_OK), "GAIT_OK") == 0);
    CHECK(strcmp(gait_result_name(GAIT_ERR_CORRUPT), "GAIT_ERR_CORRUPT") == 0);
    for (int s = GAIT_ERR_NUMERIC; s < GAIT_OK; s++) {
        CHECK(strncmp(gait_result_name((gait_result)s), "GAIT_ERR_", 9) == 0);
        for (int t = s + 1; t < GAIT_OK; t++)
            CHECK(strcmp(gait_result_name((gait_result)s), gait_result_name((gait_result)t)) != 0);
    }
    CHECK(strcmp(gait_result_name((gait_result)-77), "unknown gait_result") == 0);
}

static void test_memory(void)
{
    enum { CANARY = 64 };
    size_t blob_bytes, need = 0;
    const void *const data = toy_model_blob(&blob_bytes);
    CHECK(gait_model_bytes(data, blob_bytes, &need, NULL) == GAIT_OK && need > 0 && need < 4096);
    void *block;
    if (posix_memalign(&block, GAIT_ALIGN, need + CANARY + GAIT_ALIGN))
        abort();
    unsigned char *const mem = block;
    memset(mem, 0xa5, need + CANARY + GAIT_ALIGN);
    gait_model *m = NULL;
    gait_error err = {0};
    CHECK(gait_model_init(mem, need - 1, data, blob_bytes, &m, &err) == GAIT_ERR_MEMORY && !m && err.text[0]);
    CHECK(gait_model_init(mem + 8, need, data, blob_bytes, &m, &err) == GAIT_ERR_MEMORY && !m);
    CHECK(gait_model_init(mem, need, data, blob_bytes - 64, &m, &err) == GAIT_ERR_CORRUPT && !m);
    CHECK(gait_model_init(mem, need, data, blob_bytes, &m, &err) == GAIT_OK && m);
    int intact = 1;
    for (size_t i = need; i < need + CANARY; i++)
        intact &= mem[i] == 0xa5;
    CHECK(intact);
    gait_model_info info;
    CHECK(gait_model_get_info(m, &info, NULL) == GAIT_OK && info.joints == TOY_POINTS);
    free(block);
}

static void test_null(void)
{
    size_t n = 5, bytes;
    const void *const data = toy_model_blob(&bytes);
    gait_model *m = NULL;
    gait_model_info info;
    gait_pose pose;
    gait_error err = {0};
    gait_state s = toy_state(0.0f);
    float height;
    static _Alignas(GAIT_ALIGN) unsigned char mem[1024];
    CHECK(gait_model_bytes(NULL, bytes, &n, &err) == GAIT_ERR_ARG && n == 5 && err.result == GAIT_ERR_ARG);
    CHECK(gait_model_bytes(data, bytes, NULL, NULL) == GAIT_ERR_ARG);
    CHECK(gait_model_bytes(data, 3, &n, NULL) == GAIT_ERR_MAGIC && n == 5);
    CHECK(gait_model_init(NULL, sizeof mem, data, bytes, &m, NULL) == GAIT_ERR_ARG);
    CHECK(gait_model_init(mem, sizeof mem, NULL, bytes, &m, NULL) == GAIT_ERR_ARG);
    CHECK(gait_model_init(mem, sizeof mem, data, bytes, NULL, NULL) == GAIT_ERR_ARG && !m);
    CHECK(gait_model_get_info(NULL, &info, NULL) == GAIT_ERR_ARG);
    CHECK(gait_model_get_info(toy_model(), NULL, NULL) == GAIT_ERR_ARG);
    CHECK(gait_model_pose(NULL, &s, &pose, NULL) == GAIT_ERR_ARG);
    CHECK(gait_model_pose(toy_model(), NULL, &pose, NULL) == GAIT_ERR_ARG);
    CHECK(gait_model_pose(toy_model(), &s, NULL, NULL) == GAIT_ERR_ARG);
    CHECK(gait_model_pelvis_height(NULL, &s, &height, NULL) == GAIT_ERR_ARG);
    CHECK(gait_model_pelvis_height(toy_model(), NULL, &height, NULL) == GAIT_ERR_ARG);
    CHECK(gait_model_pelvis_height(toy_model(), &s, NULL, NULL) == GAIT_ERR_ARG);
    CHECK(!gait_model_joint_name(NULL, 0) && !gait_model_angle_name(NULL, 0));
    CHECK(!gait_model_limb_name(NULL, 0));
}

static void test_info(void)
{
    const gait_model *const m = toy_model();
    gait_model_info info;
    memset(&info, 0xff, sizeof info);
    CHECK(gait_model_get_info(m, &info, NULL) == GAIT_OK);
    CHECK(info.joints == TOY_POINTS && info.angles == TOY_ANGLES && info.limbs == TOY_LIMBS);
    CHECK(info.proportions == TOY_PROPORTIONS);
    CHECK(info.components == TOY_COMPONENTS && info.phases == TOY_PHASES && info.digest != 0);
    uint32_t mask = 7;
    CHECK(info.cyclic && info.posture_angles == (1u << 3 | 1u << 6 | 1u << 9 | 1u << 10 | TOY_TRUNK));
    CHECK(gait_model_angle_mask(m, " torso_x  torso_y ", &mask, NULL) == GAIT_OK && mask == TOY_TRUNK);
    CHECK(gait_model_angle_mask(m, "", &mask, NULL) == GAIT_OK && mask == 0);
    gait_error err = {0};
    CHECK(gait_model_angle_mask(m, "torso_x torso", &mask, &err) == GAIT_ERR_ARG && mask == 0);
    CHECK(strstr(err.text, "no angle torso") != NULL);
    CHECK(info.stride_hz == 0.92f && info.stride_hz_sd == 0.07f);
    CHECK(info.stride_length == 0.80f && info.stride_length_sd == 0.06f);
    CHECK(strcmp(gait_model_joint_name(m, 0), "pelvis") == 0);
    CHECK(strcmp(gait_model_joint_name(m, 18), "r_heel") == 0);
    CHECK(strcmp(gait_model_angle_name(m, 23), "r_ankle_flexion") == 0);
    CHECK(strcmp(gait_model_limb_name(m, 2), "head") == 0);
    CHECK(!gait_model_joint_name(m, -1) && !gait_model_joint_name(m, TOY_POINTS));
    CHECK(!gait_model_angle_name(m, -1) && !gait_model_angle_name(m, TOY_ANGLES)); /* no root channels */
    CHECK(!gait_model_limb_name(m, -1) && !gait_model_limb_name(m, TOY_LIMBS));
}

/* An invalid state is refused, and the outputs stay as they were. */
static void test_state(void)
{
    const gait_model *const m = toy_model();
    gait_state s = toy_state(0.4f);
    float *const number[] = {&s.phase, &s.stride_hz, &s.stature,   &s.heading,
                             &s.pitch, &s.roll,      &s.pelvis[1], &s.coef[15]};
    gait_pose pose, before;
    memset(&pose, 0x5a, sizeof pose);
    before = pose;
    for (size_t i = 0; i < sizeof number / sizeof *number; i++) {
        float const kept = *number[i];
        float height = -3.0f;
        *number[i] = i % 2 ? nanf("") : HUGE_VALF;
        CHECK(gait_model_pose(m, &s, &pose, NULL) == GAIT_ERR_ARG &&
              memcmp(&pose, &before, sizeof pose) == 0);
        CHECK(gait_model_pelvis_height(m, &s, &height, NULL) == GAIT_ERR_ARG && height == -3.0f);
        *number[i] = kept;
    }
    s.stature = 0.0f;
    CHECK(gait_model_pose(m, &s, &pose, NULL) == GAIT_ERR_ARG);
    s.stature = 1.8f;
    CHECK(gait_model_pose(m, &s, &pose, NULL) == GAIT_OK && pose.joint[0][2] == s.pelvis[2]);
}

/* A picture that cannot be drawn is refused, and no pixel of it is written. */
static void test_render(void)
{
    enum { WIDTH = 16, HEIGHT = 8 };
    const gait_model *const m = toy_model();
    gait_camera const good = {WIDTH, HEIGHT, 20, 20, 8, 4, {1, 0, 0, 0, 0, -1, 0, 1, 0}, {0, 1, 5}, {0}};
    gait_camera wrong = good, large = good;
    gait_state const s = toy_state(0.1f);
    gait_state bad = s;
    gait_error err = {0};
    uint8_t ids[WIDTH * HEIGHT], before[WIDTH * HEIGHT];
    memset(ids, 0x5a, sizeof ids);
    memcpy(before, ids, sizeof ids);
    wrong.R[0] = 0.5f;
    large.width = GAIT_MAX_PIXELS + 1;
    bad.stature = -1.0f;
    CHECK(gait_render(NULL, &good, &s, ids, WIDTH, NULL) == GAIT_ERR_ARG);
    CHECK(gait_render(m, NULL, &s, ids, WIDTH, NULL) == GAIT_ERR_ARG);
    CHECK(gait_render(m, &good, NULL, ids, WIDTH, NULL) == GAIT_ERR_ARG);
    CHECK(gait_render(m, &good, &s, NULL, WIDTH, NULL) == GAIT_ERR_ARG);
    CHECK(gait_render(m, &wrong, &s, ids, WIDTH, &err) == GAIT_ERR_ARG && strstr(err.text, "camera"));
    CHECK(gait_render(m, &large, &s, ids, WIDTH, NULL) == GAIT_ERR_LIMIT);
    large = good;
    large.height = GAIT_MAX_PIXELS + 1;
    CHECK(gait_render(m, &large, &s, ids, WIDTH, NULL) == GAIT_ERR_LIMIT);
    CHECK(gait_render(m, &good, &s, ids, WIDTH - 1, &err) == GAIT_ERR_ARG && strstr(err.text, "ids_stride"));
    CHECK(gait_render(m, &good, &bad, ids, WIDTH, &err) == GAIT_ERR_ARG && strstr(err.text, "gait_render"));
    CHECK(memcmp(ids, before, sizeof ids) == 0);
    CHECK(gait_render(m, &good, &s, ids, WIDTH, NULL) == GAIT_OK && memcmp(ids, before, sizeof ids) != 0);
}

static void test_classes(void)
{
    const gait_model *const m = toy_model();
    uint32_t mask = 7;
    CHECK(!gait_model_class_name(NULL, 0) && !gait_model_class_name(m, -1) && !gait_model_class_name(m, 1));
    CHECK(strcmp(gait_model_class_name(m, 0), "walk") == 0);
    CHECK(!gait_model_of_class(NULL, 0) && !gait_model_of_class(m, -1) && !gait_model_of_class(m, 1));
    CHECK(gait_model_of_class(m, 0) == m);
    CHECK(gait_model_angle_mask(NULL, "", &mask, NULL) == GAIT_ERR_ARG);
    CHECK(gait_model_angle_mask(m, NULL, &mask, NULL) == GAIT_ERR_ARG);
    CHECK(gait_model_angle_mask(m, "", NULL, NULL) == GAIT_ERR_ARG && mask == 7);
}

int main(void)
{
    test_library();
    test_memory();
    test_null();
    test_info();
    test_state();
    test_render();
    test_classes();
    return CHECK_DONE();
}
