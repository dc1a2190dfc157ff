/* The sections of a model: a valid blob gives the views, every broken one an error that names its section. */
#include "model/model.h"

#include "toy_model.h"

#include "check.h"

static _Alignas(GAIT_ALIGN) unsigned char buf[TOY_BYTES];

/* Where a section's data lies in buf. */
static unsigned char *section(const char *tag)
{
    for (unsigned char *e = buf + 64; e < buf + 64 + 48 * TOY_SECTIONS; e += 48)
        if (memcmp(e, tag, 4) == 0)
            return buf + ((size_t)e[32] | (size_t)e[33] << 8 | (size_t)e[34] << 16);
    abort();
}

static void test_views(void)
{
    size_t bytes;
    const void *const data = toy_model_blob(&bytes);
    gait_model m;
    CHECK(model_open(data, bytes, &m, NULL) == GAIT_OK);
    CHECK(m.frames == TOY_FRAMES && m.points == TOY_POINTS && m.limbs == TOY_LIMBS && m.angles == TOY_ANGLES);
    CHECK(m.channels == TOY_CHANNELS && m.phases == TOY_PHASES && m.components == TOY_COMPONENTS);
    CHECK(m.root_channel == TOY_ROOT && strcmp(m.channel_name[m.root_channel + ROOT_YAW], "root_yaw") == 0);
    CHECK(m.stride_hz == 0.92f && m.stride_hz_sd == 0.07f && m.stride_cv == 0.02f);
    CHECK(m.stride_length == 0.80f && m.stride_length_sd == 0.06f);
    CHECK(m.stature_mean == 1.72f && m.stature_sd == 0.09f);
    CHECK(strcmp(m.frame_name[12], "r_foot") == 0 && m.frame_info[12 * FRAME_INFO] == 11);
    CHECK(strcmp(m.limb_name[12], "r_foot") == 0 && m.limb_info[12 * LIMB_INFO] == 12);
    CHECK(m.limb_info[2 * LIMB_INFO + 1] == LIMB_ELLIPSOID && m.limb_shape[6] == 0.084f);
    CHECK(m.frame_origin[3 * 8 + 1] == -0.107f && m.point_offset[3 * 2 + 2] == TOY_HEAD);
    CHECK(m.channel_stat[4 * TOY_ROOT] == 0.005f && m.score_stat[3] == 0.8f);
    CHECK(toy_find_point(&m, "r_heel") == 18 && toy_find_point(&m, "pelvis") == 0);
    CHECK(toy_find_point(&m, "tail") == -1);
    CHECK(m.proportions == TOY_PROPORTIONS && m.proportion[TOY_FRAMES] == 0.025f);
    CHECK(m.curves[TOY_KNEE + 1] == toy_round(toy_interpolate(toy_curve[3].at, 0)));
}

/* The digest depends on every byte. */
static void test_digest(void)
{
    gait_model a, b;
    size_t const bytes = toy_write(buf, 16, 1);
    CHECK(model_open(buf, bytes, &a, NULL) == GAIT_OK);
    section("META")[3] ^= 1;
    toy_seal(buf, bytes);
    CHECK(model_open(buf, bytes, &b, NULL) == GAIT_OK && a.digest != b.digest);
}

static void test_sizes(void)
{
    gait_model m;
    for (int phases = 8; phases <= TOY_PHASES; phases += 12)
        for (int q = 0; q <= TOY_COMPONENTS; q++) {
            size_t const bytes = toy_write(buf, phases, q);
            CHECK(model_open(buf, bytes, &m, NULL) == GAIT_OK && m.phases == phases && m.components == q);
        }
    size_t const bytes = toy_write(buf, 7, 0);
    gait_error err = {0};
    CHECK(model_open(buf, bytes, &m, &err) == GAIT_ERR_CORRUPT && strstr(err.text, "CURV"));
}

/* A change of one 32-bit word or byte of a section. */
typedef struct patch {
    const char *tag;
    size_t word;
    int as_int; /* value is an int32, else a float */
    double value;
} patch;

static void test_refused(void)
{
    static const patch patches[] = {
        {"CURV", 17, 0, NAN},
        {"CURV", 900, 0, HUGE_VAL},
        {"CURV", 2, 0, -1e6},
        {"CHST", 0, 0, -1.0},  /* negative residual */
        {"CHST", 1, 0, 100.0}, /* smallest above largest */
        {"CHST", 3, 0, -0.1},
        {"SCST", 4, 0, -0.1},
        {"GAIT", 0, 0, 0.0}, /* no stride rate */
        {"GAIT", 1, 0, -0.1},
        {"GAIT", 6, 0, -1.7},
        {"FRMI", 0, 1, 0},         /* the root with a parent */
        {"FRMI", 3, 1, TOY_ROOT},  /* the root turned by another channel */
        {"FRMI", 8, 1, 1},         /* its own parent */
        {"FRMI", 8 * 4, 1, 5},     /* a parent that comes later */
        {"FRMI", 8 * 4, 1, -1},    /* a second root */
        {"FRMI", 8 * 2 + 1, 1, 4}, /* four rotations */
        {"FRMI", 8 * 2 + 1, 1, -1},
        {"FRMI", 8 * 2 + 1, 1, 2}, /* a pair beyond the count */
        {"FRMI", 8 * 2 + 2, 1, 4}, /* axes are 1..3 */
        {"FRMI", 8 * 2 + 2, 1, 0},
        {"FRMI", 8 * 2 + 2, 1, INT32_MIN},
        {"FRMI", 8 * 2 + 3, 1, TOY_CHANNELS},
        {"FRMI", 8 * 2 + 3, 1, -1},
        {"FRMF", 1, 0, 0.1}, /* the root off its joint */
        {"FRMF", 7, 0, NAN},
        {"PROP", 3, 0, 0.101}, /* a length changed by more than a tenth */
        {"PROP", TOY_FRAMES, 0, -0.101},
        {"PROP", 0, 0, NAN},
        {"PTNI", 5, 1, TOY_FRAMES},
        {"PTNI", 5, 1, -1},
        {"PTNF", 5, 0, NAN},
        {"LIMI", 0, 1, TOY_FRAMES},
        {"LIMI", 0, 1, -1},
        {"LIMI", 1, 1, 2}, /* a third shape */
        {"LIMF", 6, 0, 0.0},
        {"LIMF", 9, 0, -0.1},
        {"LIMF", 5, 0, 0.06},        /* end = start */
        {"LIMF", 14, 0, 50.0},       /* axis along y */
        {"CHNM", 0, 1, 0},           /* a name without letters */
        {"FRNM", 15, 1, 0x41414141}, /* and one without an end */
    };
    for (size_t i = 0; i < sizeof patches / sizeof *patches; i++) {
        const patch *const p = &patches[i];
        size_t const bytes = toy_write(buf, 12, 2);
        int32_t const n = p->as_int ? (int32_t)p->value : 0;
        float const x = (float)p->value;
        memcpy(section(p->tag) + 4 * p->word, p->as_int ? (const void *)&n : (const void *)&x, 4);
        toy_seal(buf, bytes);
        gait_model m = {.frames = -7};
        gait_error err = {0};
        gait_result const s = model_open(buf, bytes, &m, &err);
        if (s != GAIT_ERR_CORRUPT || !strstr(err.text, p->tag))
            fprintf(stderr, "patch %zu of %s: %s, %s\n", i, p->tag, gait_result_name(s), err.text);
        CHECK(s == GAIT_ERR_CORRUPT && strstr(err.text, p->tag) && err.result == s);
        CHECK(m.frames == -7); /* outputs left alone */
    }
}

static void test_names(void)
{
    static const char *const tags[] = {"CHNM", "FRNM", "PTNM", "LBNM"};
    gait_model m;
    for (int i = 0; i < 4; i++) {
        gait_error err = {0};
        size_t const bytes = toy_write(buf, 12, 2);
        memcpy(section(tags[i]) + 32, section(tags[i]), 32); /* twice the same */
        toy_seal(buf, bytes);
        CHECK(model_open(buf, bytes, &m, &err) == GAIT_ERR_CORRUPT && strstr(err.text, tags[i]));
    }
    size_t const bytes = toy_write(buf, 12, 2);
    section("CHNM")[32 * TOY_ROOT + 5] = 'F';
    toy_seal(buf, bytes);
    CHECK(model_open(buf, bytes, &m, NULL) == GAIT_ERR_CORRUPT);
}

/* n different names. */
static const void *names(int n)
{
    static char name[64][32];
    memset(name, 0, sizeof name);
    for (int i = 0; i < n; i++)
        snprintf(name[i], sizeof name[i], "name %d", i);
    return name;
}

/* More of something than this build allows has its own status. */
static void test_limits(void)
{
    static const float zero[20 * 8 * TOY_CHANNELS];
    gait_model m;
    gait_error err = {0};
    toy_file f = toy_begin(buf, 1);
    toy_section(&f, "CHNM", 1, 2, MODEL_MAX_CHANNELS + 1, 32, 1, names(MODEL_MAX_CHANNELS + 1));
    CHECK(model_open(buf, toy_finish(&f), &m, &err) == GAIT_ERR_LIMIT && strstr(err.text, "CHNM"));

    (void)toy_write(buf, 8, 0);
    static unsigned char channel[TOY_CHANNELS][32];
    memcpy(channel, section("CHNM"), sizeof channel);
    f = toy_begin(buf, 2);
    toy_section(&f, "CHNM", 1, 2, TOY_CHANNELS, 32, 1, channel);
    toy_section(&f, "CURV", 3, 3, GAIT_MAX_COMPONENTS + 2, 8, TOY_CHANNELS, zero);
    CHECK(model_open(buf, toy_finish(&f), &m, &err) == GAIT_ERR_LIMIT && strstr(err.text, "CURV"));

    f = toy_begin(buf, 6);
    toy_put_curves(&f, 8, 0);
    toy_section(&f, "FRNM", 1, 2, MODEL_MAX_FRAMES + 1, 32, 1, names(MODEL_MAX_FRAMES + 1));
    CHECK(model_open(buf, toy_finish(&f), &m, &err) == GAIT_ERR_LIMIT && strstr(err.text, "FRNM"));

    f = toy_begin(buf, 10);
    toy_put_curves(&f, 8, 0);
    toy_put_skeleton(&f);
    toy_section(&f, "PTNM", 1, 2, GAIT_MAX_JOINTS + 1, 32, 1, names(GAIT_MAX_JOINTS + 1));
    CHECK(model_open(buf, toy_finish(&f), &m, &err) == GAIT_ERR_LIMIT && strstr(err.text, "PTNM"));

    f = toy_begin(buf, 13);
    toy_put_curves(&f, 8, 0);
    toy_put_skeleton(&f);
    toy_put_points(&f);
    toy_section(&f, "LBNM", 1, 2, MODEL_MAX_LIMBS + 1, 32, 1, names(MODEL_MAX_LIMBS + 1));
    CHECK(model_open(buf, toy_finish(&f), &m, &err) == GAIT_ERR_LIMIT && strstr(err.text, "LBNM"));
}

/* PROP of `rows` by `columns` zeros, and SHFT of `shifts` rows if it is given, in an otherwise sound model. */
static gait_result open_shifted(uint32_t rows, uint32_t columns, uint32_t shifts,
                                float (*shift)[TOY_FRAMES][3], gait_model *m, gait_error *err)
{
    static unsigned char name[TOY_FRAMES][32], info[TOY_FRAMES][32], origin[TOY_FRAMES][12];
    static const float zero[(GAIT_MAX_PROPORTIONS + 1) * (TOY_FRAMES + 2)];
    (void)toy_write(buf, 8, 1);
    memcpy(name, section("FRNM"), sizeof name);
    memcpy(info, section("FRMI"), sizeof info);
    memcpy(origin, section("FRMF"), sizeof origin);
    toy_file f = toy_begin(buf, (uint32_t)TOY_SECTIONS - (rows ? 1u : 2u) + (shift ? 1u : 0u));
    toy_put_curves(&f, 8, 1);
    if (rows)
        toy_section(&f, "PROP", 3, 2, rows, columns, 1, zero);
    if (shift)
        toy_section(&f, "SHFT", 3, 3, shifts, TOY_FRAMES, 3, shift);
    toy_section(&f, "FRNM", 1, 2, TOY_FRAMES, 32, 1, name);
    toy_section(&f, "FRMI", 2, 2, TOY_FRAMES, 8, 1, info);
    toy_section(&f, "FRMF", 3, 2, TOY_FRAMES, 3, 1, origin);
    toy_put_points(&f);
    toy_put_limbs(&f);
    return model_open(buf, toy_finish(&f), m, err);
}

/* PACE of `terms` by `channels` numbers and a given standard deviation of the stride rate in an otherwise sound model. */
static gait_result open_paced(uint32_t terms, uint32_t channels, const float *series, float rate_sd,
                              gait_model *m, gait_error *err)
{
    toy_file f = toy_begin(buf, TOY_SECTIONS); /* PACE in place of META */
    toy_put_curves(&f, 8, 1);
    toy_section(&f, "PACE", 3, 2, terms, channels, 1, series);
    toy_put_skeleton(&f);
    toy_put_points(&f);
    toy_put_limbs(&f);
    size_t const bytes = toy_finish(&f);
    memcpy(section("GAIT") + 4, &rate_sd, sizeof rate_sd);
    toy_seal(buf, bytes);
    return model_open(buf, bytes, m, err);
}

static bool pace_refused(uint32_t terms, uint32_t channels, const float *series, float rate_sd)
{
    gait_model m;
    gait_error err = {0};
    return open_paced(terms, channels, series, rate_sd, &m, &err) == GAIT_ERR_CORRUPT &&
           strstr(err.text, "PACE");
}

/* A Fourier series that the phases can show, of moderate numbers, and a standard deviation of the rate as its unit. */
static void test_pace(void)
{
    static float series[9 * (TOY_CHANNELS + 1)];
    gait_model m;
    series[7 * TOY_CHANNELS - 1] = -1.0f;
    CHECK(open_paced(7, TOY_CHANNELS, series, 0.07f, &m, NULL) == GAIT_OK);
    CHECK(m.pace_terms == 7 && m.pace_series[7 * TOY_CHANNELS - 1] == -1.0f && !m.pace_curve);
    CHECK(open_paced(1, TOY_CHANNELS, series, 0.07f, &m, NULL) == GAIT_OK && m.pace_terms == 1);
    CHECK(model_open(buf, toy_write(buf, 8, 1), &m, NULL) == GAIT_OK && !m.pace_terms);
    CHECK(pace_refused(7, TOY_CHANNELS, series, 0.0f));
    CHECK(pace_refused(6, TOY_CHANNELS, series, 0.07f));
    CHECK(pace_refused(8, TOY_CHANNELS, series, 0.07f)); /* the curve itself, as models once had it */
    CHECK(pace_refused(9, TOY_CHANNELS, series, 0.07f));
    CHECK(pace_refused(7, TOY_CHANNELS + 1, series, 0.07f));
    series[TOY_CHANNELS - 1] = 0.01f; /* of the same channel: the sum counts */
    CHECK(pace_refused(7, TOY_CHANNELS, series, 0.07f));
    series[TOY_CHANNELS - 1] = NAN;
    CHECK(pace_refused(7, TOY_CHANNELS, series, 0.07f));
}

/* The model's own memory holds the series at the phases of the mean; too little of it is refused. */
static void test_pace_unfolds(void)
{
    static _Alignas(GAIT_ALIGN) unsigned char place[8192];
    static float series[5 * TOY_CHANNELS];
    int const channel = TOY_KNEE;
    float const a[5] = {0.1f, -0.2f, 0.3f, 0.05f, -0.15f};
    gait_model m;
    for (int i = 0; i < 5; i++)
        series[i * TOY_CHANNELS + channel] = a[i];
    CHECK(open_paced(5, TOY_CHANNELS, series, 0.07f, &m, NULL) == GAIT_OK);
    arena count = {.base = NULL}, small = {.base = place, .cap = sizeof m},
          own_memory = {.base = place, .cap = sizeof place};
    CHECK(!model_layout(&count, &m) && !model_layout(&small, &m) && small.overflow);
    const gait_model *const own = model_layout(&own_memory, &m);
    CHECK(own && own->pace_curve && own_memory.used == count.used);
    for (int j = 0; own && j < m.phases; j++) {
        double const turn = 2.0 * TOY_PI * j / m.phases;
        double const want =
            a[0] + a[1] * cos(turn) + a[2] * sin(turn) + a[3] * cos(2 * turn) + a[4] * sin(2 * turn);
        CHECK_NEAR(own->pace_curve[j * TOY_CHANNELS + channel], want, 1e-6);
        CHECK(own->pace_curve[j * TOY_CHANNELS + channel + 1] == 0.0f);
    }
}

static gait_result open_proportions(uint32_t rows, uint32_t columns, gait_model *m, gait_error *err)
{
    return open_shifted(rows, columns, 0, NULL, m, err);
}

/* One row to each of PROP; frame 0 stays where it is; a tenth of the stature at most. */
static void test_shifts(void)
{
    enum { ROWS = 2, COLUMNS = TOY_FRAMES + 1 };
    float shift[ROWS + 1][TOY_FRAMES][3] = {{{0.0f}}};
    gait_model m;
    gait_error err = {0};
    shift[1][4][2] = -0.1f;
    CHECK(open_shifted(ROWS, COLUMNS, ROWS, shift, &m, &err) == GAIT_OK);
    CHECK(m.proportions == ROWS && m.shift[3 * (TOY_FRAMES + 4) + 2] == -0.1f);
    for (uint32_t rows = 0; rows <= ROWS + 1; rows++)
        CHECK(rows == ROWS || (open_shifted(rows, COLUMNS, ROWS, shift, &m, &err) == GAIT_ERR_CORRUPT &&
                               strstr(err.text, "SHFT")));
    static const struct {
        int row, frame, axis;
        float by;
    } bad[] = {{0, 4, 0, 0.101f}, {1, 12, 2, -0.101f}, {1, 3, 1, NAN}, {0, 0, 0, 0.01f}, {1, 0, 2, -0.01f}};
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        float *const at = &shift[bad[i].row][bad[i].frame][bad[i].axis], was = *at;
        *at = bad[i].by;
        CHECK(open_shifted(ROWS, COLUMNS, ROWS, shift, &m, &err) == GAIT_ERR_CORRUPT &&
              strstr(err.text, "SHFT"));
        *at = was;
    }
}

static void test_proportions(void)
{
    gait_model m;
    gait_error err = {0};
    for (uint32_t rows = 1; rows <= GAIT_MAX_PROPORTIONS; rows++)
        CHECK(open_proportions(rows, TOY_FRAMES + 1, &m, &err) == GAIT_OK && m.proportions == (int32_t)rows);
    CHECK(open_proportions(GAIT_MAX_PROPORTIONS + 1, TOY_FRAMES + 1, &m, &err) == GAIT_ERR_LIMIT &&
          strstr(err.text, "PROP"));
    for (uint32_t columns = TOY_FRAMES; columns <= TOY_FRAMES + 2; columns += 2)
        CHECK(open_proportions(1, columns, &m, &err) == GAIT_ERR_CORRUPT && strstr(err.text, "PROP"));
}

/* Every section but META is needed; without PROP all people have the same proportions. */
static void test_missing(void)
{
    for (size_t i = 1; i < TOY_SECTIONS; i++) {
        size_t const bytes = toy_write(buf, 8, 1);
        char tag[5] = {0};
        memcpy(tag, buf + 64 + 48 * i, 4);
        memcpy(buf + 64 + 48 * i, "GONE", 4);
        toy_seal(buf, bytes);
        gait_model m;
        gait_error err = {0};
        if (strcmp(tag, "PROP") == 0)
            CHECK(model_open(buf, bytes, &m, &err) == GAIT_OK && m.proportions == 0);
        else
            CHECK(model_open(buf, bytes, &m, &err) == GAIT_ERR_CORRUPT && strstr(err.text, tag));
    }
}

int main(void)
{
    test_views();
    test_digest();
    test_sizes();
    test_refused();
    test_names();
    test_limits();
    test_proportions();
    test_shifts();
    test_pace();
    test_pace_unfolds();
    test_missing();
    return CHECK_DONE();
}
