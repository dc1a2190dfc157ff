/* Files of the command line: backgrounds and starts, good ones and every way in which they can be wrong. */
#define _XOPEN_SOURCE 700 /* P_tmpdir */
#include "../../tools/trackd/input_files.h"

#include "check.h"
#include "toy_model.h"

#include <stdlib.h>
#include <unistd.h>

static char path[] = P_tmpdir "/gait_input_XXXXXX";
static message why;

static void write_file(const void *data, size_t bytes)
{
    FILE *const f = fopen(path, "wb");
    if (!f || fwrite(data, 1, bytes, f) != bytes || fclose(f) != 0)
        abort();
}

/* ---- backgrounds ---- */
static bool pnm(const char *head, size_t pixels, file_bytes *bytes, gait_image *out)
{
    char all[256];
    size_t const n = strlen(head);
    memcpy(all, head, n);
    for (size_t i = 0; i < pixels; i++)
        all[n + i] = (char)(i + 1);
    write_file(all, n + pixels);
    why.text[0] = '\0';
    return pnm_read(path, bytes, out, &why);
}

static void test_pnm(void)
{
    file_bytes bytes;
    gait_image out;
    CHECK(pnm("P5\n3 2\n255\n", 6, &bytes, &out));
    CHECK(out.width == 3 && out.height == 2 && out.stride == 3 && out.format == GAIT_GREY8);
    CHECK(out.data[0] == 1 && out.data[5] == 6);
    free(bytes.data);
    CHECK(pnm("P6 # made\r\n\t# by hand\n3#\n 2\n255\n", 18, &bytes, &out));
    CHECK(out.width == 3 && out.height == 2 && out.stride == 9 && out.format == GAIT_RGB8 &&
          out.data[17] == 18);
    free(bytes.data);
}

static void test_bad_pnm(void)
{
    static const struct {
        const char *head;
        size_t pixels;
        const char *reason;
    } bad[] = {
        {"", 0, "not a binary PGM or PPM"},
        {"P5", 0, "not a binary PGM or PPM"},
        {"P2\n3 2\n255\n", 6, "not a binary PGM or PPM"},
        {"Q5\n3 2\n255\n", 6, "not a binary PGM or PPM"},
        {"P5\n3 2\n65535\n", 12, "damaged header"},
        {"P5\n0 2\n255\n", 6, "damaged header"},
        {"P5\n3 0\n255\n", 6, "damaged header"},
        {"P5\n-3 2\n255\n", 6, "damaged header"},
        {"P5\n99999999999999999999 2\n255\n", 6, "damaged header"},
        {"P5\n2 99999999999999999999\n255\n", 6, "damaged header"},
        {"P5\n3 2\n255\n", 5, "shorter than its header states"},
        {"P5\n3 2 # without an end", 0, "damaged header"},
    };
    file_bytes bytes;
    gait_image out;
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++)
        CHECK(!pnm(bad[i].head, bad[i].pixels, &bytes, &out) && strstr(why.text, bad[i].reason) &&
              !bytes.data);
    CHECK(!pnm_read("/absent/plate.ppm", &bytes, &out, &why) &&
          strstr(why.text, "cannot open the background"));
}

/* ---- starts ---- */
static bool init(const char *text, init_state *out)
{
    write_file(text, strlen(text));
    why.text[0] = '\0';
    return init_file_read(path, toy_model(), out, &why);
}

static void test_init(void)
{
    init_state s;
    gait_state mean, sd;
    float height;
    CHECK(gait_tracker_prior(toy_model(), &mean, &sd, NULL) == GAIT_OK);
    CHECK(init("{}", &s) && s.frame == -1);
    CHECK(s.mean.stature == mean.stature && s.sd.stature == sd.stature);
    CHECK(init("{\"frame\": 12, \"pelvis\": [1, 2], \"phase\": 1, \"stride_hz\": 0.8, \"heading_rad\": 0.5,"
               "\"stature_m\": 1.8, \"sd\": {\"phase\": 0.25, \"pelvis\": 0.125}}",
               &s));
    CHECK(s.frame == 12 && s.mean.pelvis[0] == 1.0f && s.mean.pelvis[1] == 2.0f);
    CHECK(gait_model_pelvis_height(toy_model(), &s.mean, &height, NULL) == GAIT_OK);
    CHECK(s.mean.pelvis[2] == height); /* that of this person */
    CHECK(s.mean.phase == 0.0f && s.sd.phase == 0.25f && s.sd.heading == 0.1f && s.sd.stature == 0.03f);
    for (int i = 0; i < 3; i++)
        CHECK(s.sd.pelvis[i] == 0.125f);
    CHECK(init("{\"pelvis\": [1, 2, 0.5], \"sd\": {\"pelvis\": [1, 2, 3], \"stature_m\": 0}}", &s));
    CHECK(s.mean.pelvis[2] == 0.5f && s.sd.pelvis[0] == 1.0f && s.sd.pelvis[2] == 3.0f &&
          s.sd.stature == 0.0f);
}

static void test_bad_init(void)
{
    static const struct {
        const char *text, *reason;
    } bad[] = {
        {"{\"pelvis\": [1]}", "pelvis has 1 numbers, not 2"},
        {"{\"pelvis\": [1, 2, 3, 4]}", "pelvis has 4 numbers, not 2"},
        {"{\"pelvis\": \"here\"}", "pelvis is not numeric"},
        {"{\"pelvis\": [1e9, 0]}", "outside"},
        {"{\"phase\": \"half\"}", "phase is not numeric; give the phase of the stride"},
        {"{\"stature_m\": 9}", "stature_m is 9, outside"},
        {"{\"frame\": -1}", "frame is -1, outside"},
        {"{\"frame\": 1.5}", "not a whole number"},
        {"{\"sd\": 1}", "sd is not an object"},
        {"{\"sd\": {\"frame\": 1}}", "frame is not a known key"},
        {"{\"sd\": {\"phase\": -1}}", "sd.phase is -1, outside [0, 10]"},
        {"{\"sd\": {\"phase\": [1, 2]}}", "sd.phase has 2 numbers, not 1; give a standard deviation"},
        {"{\"sd\": {\"pelvis\": [1, 2]}}", "sd.pelvis has 2 numbers, not 1; give one number or three"},
        {"{\"sd\": {\"pelvis\": [1, 2, 11]}}", "sd.pelvis is 11, outside [0, 10]"},
        {"{\"place\": 1}", "place is not a known key"},
        {"[]", "not a JSON object"},
    };
    init_state s = {.frame = 77};
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++)
        CHECK(!init(bad[i].text, &s) && strstr(why.text, bad[i].reason) && s.frame == 77);
    write_file("{}\0{}", 5);
    CHECK(!init_file_read(path, toy_model(), &s, &why) && strstr(why.text, "contains a zero byte"));
}

int main(void)
{
    int const made = mkstemp(path);
    if (made < 0)
        abort();
    close(made);
    test_pnm();
    test_bad_pnm();
    test_init();
    test_bad_init();
    unlink(path);
    return CHECK_DONE();
}
