/* Options of the command line and of the configuration file: every kind of value, and what is refused with which words. */
#define _XOPEN_SOURCE 700 /* P_tmpdir */
#include "../../tools/trackd/options.h"

#include "check.h"

#include <stdlib.h>
#include <unistd.h>

static struct values {
    bool flag, version;
    char text[OPTION_TEXT], config[OPTION_TEXT];
    int32_t whole;
    uint64_t seed;
    float share;
    double seconds;
} v;

static const option TABLE[] = {
    {"flag", 0, "", "a flag", OPTION_FLAG, &v.flag, 0, 0},
    {"text", 't', "FILE", "a text", OPTION_TEXTUAL, v.text, 0, 0},
    {"config", 0, "FILE", "the file", OPTION_TEXTUAL, v.config, 0, 0},
    {"whole", 0, "N", "a whole number", OPTION_INT, &v.whole, -5, 100},
    {"seed", 0, "N", "any whole number", OPTION_U64, &v.seed, 0, 0},
    {"share", 0, "X", "a float", OPTION_FLOAT, &v.share, 0, 1},
    {"version", 0, "", "only on the command line", OPTION_FLAG, &v.version, 0, 0},
    {"seconds", 0, "S", "a double", OPTION_DOUBLE, &v.seconds, -1, 1e9},
};
enum { COUNT = sizeof TABLE / sizeof *TABLE };

static message why;

static option_result parse(const char *a, const char *b)
{
    char one[OPTION_TEXT + 64], two[OPTION_TEXT + 64], name[] = "program", *argv[] = {name, one, two};
    snprintf(one, sizeof one, "%s", a);
    snprintf(two, sizeof two, "%s", b ? b : "");
    v = (struct values){0};
    why.text[0] = '\0';
    return options_parse(TABLE, COUNT, b ? 3 : 2, argv, &why);
}

static bool refused(const char *a, const char *b, const char *reason)
{
    return parse(a, b) == OPTION_BAD && strstr(why.text, reason);
}

static void test_values(void)
{
    CHECK(parse("--flag", NULL) == OPTION_OK && v.flag);
    CHECK(parse("--flag=no", NULL) == OPTION_OK && !v.flag);
    CHECK(parse("--flag=yes", "-t=x") == OPTION_BAD && v.flag); /* a letter has its value apart */
    CHECK(parse("-t", "x") == OPTION_OK && strcmp(v.text, "x") == 0);
    CHECK(parse("--text=", NULL) == OPTION_BAD && parse("--text=a=b", NULL) == OPTION_OK);
    CHECK(strcmp(v.text, "a=b") == 0);
    CHECK(parse("--whole", "-5") == OPTION_OK && v.whole == -5);
    CHECK(parse("--seed", "18446744073709551615") == OPTION_OK && v.seed == UINT64_MAX);
    CHECK(parse("--share", "0.5") == OPTION_OK && v.share == 0.5f);
    CHECK(parse("--seconds=1e-9", NULL) == OPTION_OK && v.seconds == 1e-9);
    CHECK(parse("--flag", "--help") == OPTION_HELP && parse("-h", NULL) == OPTION_HELP);
}

static void test_refused(void)
{
    char longest[OPTION_TEXT + 1];
    static const char *const numbers[] = {"", "x", "1x", "-6", "101", "1.5", "nan"};
    static const char *const seeds[] = {"", "x", "1x", "-1", "18446744073709551616"};
    static const char *const unknown[] = {"--other", "-x", "-", "--", "word", "-tx", "--tex", "--text2=x"};
    for (size_t i = 0; i < sizeof numbers / sizeof *numbers; i++)
        CHECK(refused("--whole", numbers[i], "give a whole number from -5 to 100"));
    for (size_t i = 0; i < sizeof seeds / sizeof *seeds; i++)
        CHECK(refused("--seed", seeds[i], "give a whole number from 0 to 18446744073709551615"));
    for (size_t i = 0; i < sizeof unknown / sizeof *unknown; i++)
        CHECK(refused(unknown[i], NULL, "unknown argument"));
    CHECK(refused("--share", "1.5", "give a number from 0 to 1"));
    CHECK(refused("--seconds", "inf", "give a number from -1 to 1e+09"));
    CHECK(refused("--flag=maybe", NULL, "give true or false"));
    CHECK(refused("--whole", NULL, "needs a value N"));
    memset(longest, 'x', OPTION_TEXT);
    longest[OPTION_TEXT] = '\0';
    CHECK(refused("--text", longest, "give a value of 1 to 1023 characters"));
    longest[OPTION_TEXT - 1] = '\0';
    CHECK(parse("--text", longest) == OPTION_OK && strcmp(v.text, longest) == 0);
}

/* ---- files ---- */
static bool file(const char *text)
{
    FILE *const f = fopen(v.config, "wb");
    if (!f || fputs(text, f) < 0 || fclose(f) != 0)
        abort();
    why.text[0] = '\0';
    return options_file(TABLE, COUNT, v.config, &why);
}

static void test_file(void)
{
    struct values const none = {0};
    char name[OPTION_TEXT];
    strcpy(name, v.config);
    v = none;
    strcpy(v.config, name);
    CHECK(file("# all of them\n\n flag = true # on\r\n\ttext = \"a # b\"\nwhole=7\nseed = 9\nshare=0.25\n"
               "seconds = 3"));
    CHECK(v.flag && strcmp(v.text, "a # b") == 0 && v.whole == 7 && v.seed == 9 && v.share == 0.25f);
    CHECK(v.seconds == 3 && file("text = 'it \"is\"'\n") && strcmp(v.text, "it \"is\"") == 0);
    CHECK(file("\xef\xbb\xbfwhole = 3\nshare = +1.0e-1\nseconds = -0.5E0\nseed = 0\nflag = false") &&
          v.whole == 3);
    CHECK(v.share == 0.1f && v.seconds == -0.5 && v.seed == 0 && !v.flag);
}

static void test_bad_files(void)
{
    static const struct {
        const char *text, *reason;
    } bad[] = {
        {"flag\n", "line 1: 'flag' is not of the form name = value"},
        {"\nother = 1\n", "line 2: unknown option other"},
        {"whole = 1\nwhole = 2\n", "line 2: whole is already given in line 1"},
        {"version = true\n", "version is allowed on the command line only"},
        {"config = x\n", "config is allowed on the command line only"},
        {"text = \"\n", "give a string in plain quotes"},
        {"text = \"a\n", "give a string in plain quotes"},
        {"text = 'a'b'\n", "give a string in plain quotes"},
        {"text = \"a\\n\"\n", "give a string in plain quotes"},
        {"text = \"\"\n", "give a value of 1 to"},
        {"text = plain words\n", "text: give a string in plain quotes"},
        {"text = /path\n", "text: give a string in plain quotes"},
        {"flag = yes\n", "--flag yes: give true or false"},
        {"flag = no\n", "--flag no: give true or false"},
        {"flag = \"true\"\n", "flag: give the value without quotes"},
        {"whole = \"2\"\n", "whole: give the value without quotes"},
        {"whole =\n", "give a whole number"},
        {"whole = 0x10\n", "--whole 0x10: give a number such as 12"},
        {"whole = 07\n", "--whole 07: give a number such as 12"},
        {"share = .5\n", "--share .5: give a number such as 12"},
        {"share = 1.\n", "--share 1.: give a number such as 12"},
        {"seed = +\n", "give a whole number"},
        {"\xef\xbb\xbf\xef\xbb\xbfwhole = 3\n", "unknown option"},
        {"whole = seven\n", "line 1: --whole seven: give a whole number"},
        {"text = a\001b\n", "not a text file"},
        {"text = a\177b\n", "not a text file"},
    };
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++)
        CHECK(!file(bad[i].text) && strstr(why.text, bad[i].reason));
    CHECK(!options_file(TABLE, COUNT, "/absent/file", &why) && strstr(why.text, "cannot open"));
    CHECK(!options_file(TABLE, COUNT, "/dev/null", &why) && strstr(why.text, "not a regular file"));
}

int main(void)
{
    test_values();
    test_refused();
    strcpy(v.config, P_tmpdir "/gait_options_XXXXXX");
    int const made = mkstemp(v.config);
    if (made < 0)
        abort();
    close(made);
    test_file();
    test_bad_files();
    unlink(v.config);
    return CHECK_DONE();
}
