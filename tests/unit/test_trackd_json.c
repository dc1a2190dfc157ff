/* The JSON reader of the tools: grammar, limits, and access by key.  Built with its sources, which need no library. */
#include "../../tools/trackd/json.c"
#include "../../tools/trackd/common.c"
#include "check.h"

static json_node nodes[32];
static json_doc doc;
static message why;

static bool parse(const char *text)
{
    return json_parse(&doc, nodes, 32, text, &why);
}

static void test_accepts_what_json_is(void)
{
    static const char *const good[] = {"0",
                                       "-0.5e+3",
                                       "[]",
                                       "{}",
                                       " [ 1 , 2 ] ",
                                       "\"\\u00e9\\n\"",
                                       "null",
                                       "true",
                                       "[[[1]]]",
                                       "{\"a\":{}}\n",
                                       "1E5",
                                       "[\"\", false]",
                                       "NaN",
                                       "-Infinity",
                                       "\t[\r\n1\t]\r",
                                       "1e-5",
                                       "1.5e+5",
                                       "\"\\uABEF\\u09af\\/\\\\\""}; /* NaN and Infinity are refused by key */
    for (size_t i = 0; i < sizeof good / sizeof *good; i++)
        CHECK(parse(good[i]));
}

static void test_refuses_what_it_is_not(void)
{
    static const char *const bad[] = {
        "",          " ",           "01",          "1.",          ".5",          "+1",          "1e",
        "[1,]",      "[1 2]",       "{1:2}",       "nul",         "\"a",         "\"\t\"",      "{\"a\"}",
        "[",         "]",           "1 1",         "0x10",        "NaNs",        "1e400",       "\"\\u12\"",
        "'a'",       "{\"a\":}",    "{\"a\":1,}",  "--1",         "-",           "1e+",         "\"\\",
        "\"\\x\"",   "\"\\uG000\"", "\"\\u0g00\"", "\"\\u00:0\"", "\"\\u000@\"", "\"\\u000`\"", "\"\\u/000\"",
        "{\"a\" 1}", "[1}",         "{\"a\":1]"};
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        why.text[0] = '\0';
        CHECK(!parse(bad[i]));
        CHECK(strncmp(why.text, "line 1: ", 8) == 0);
    }
}

static void test_every_prefix_is_refused(void)
{
    static const char whole[] = "{\"a\": [1, -2.5e3, \"x\\n\", true], \"b\": {\"c\": null}}";
    char part[sizeof whole];
    CHECK(parse(whole));
    for (size_t n = 0; n + 1 < sizeof whole; n++) {
        memcpy(part, whole, n);
        part[n] = '\0';
        CHECK(!parse(part));
    }
}

static void test_values_by_key(void)
{
    double v[4] = {0};
    CHECK(parse("{\"x\": {\"a\": 1}, \"a\": [[1, 2], [3, 4.5]], \"s\": \"1\", \"ab\": 7, \"a\": 9}"));
    int const a = json_find(&doc, 0, "a");
    CHECK(a > 0 && doc.node[a].type == JSON_ARRAY); /* the first of that name, and not the one inside x */
    CHECK(json_numbers(&doc, a, v, 4) == 4 && v[0] == 1 && v[1] == 2 && v[2] == 3 && v[3] == 4.5);
    CHECK(json_numbers(&doc, a, v, 1) == 4);
    CHECK(json_numbers(&doc, json_find(&doc, 0, "s"), v, 4) == -1);
    CHECK(json_numbers(&doc, json_find(&doc, 0, "x"), v, 4) == -1);
    CHECK(json_numbers(&doc, json_find(&doc, 0, "ab"), v, 4) == 1 && v[0] == 7);
    CHECK(json_find(&doc, 0, "b") == -1 && json_find(&doc, 0, "") == -1);
    CHECK(json_numbers(&doc, json_find(&doc, json_find(&doc, 0, "x"), "a"), v, 4) == 1 && v[0] == 1);
}

/* Whatever kind of value has no space. */
static void test_space(void)
{
    static const char kinds[] = "{\"a\": [1, true, \"x\", {}, []]}";
    int const all = 8; /* values and keys */
    for (int cap = 0; cap < all; cap++)
        CHECK(!json_parse(&doc, nodes, cap, kinds, &why) && strstr(why.text, "more values"));
    CHECK(json_parse(&doc, nodes, all, kinds, &why) && doc.used == all);
}

static void test_limits(void)
{
    char text[200] = "[";
    for (int i = 0; i < 40; i++)
        strcat(text, i ? ",1" : "1");
    CHECK(!parse(strcat(text, "]")) && strstr(why.text, "more values"));
    text[0] = '\0';
    for (int i = 0; i < 20; i++)
        strcat(text, "[");
    CHECK(!parse(text) && strstr(why.text, "nested"));
    CHECK(!parse("{\n\"a\": 1\n\"b\"}") && strncmp(why.text, "line 3: ", 8) == 0);
}

int main(void)
{
    test_accepts_what_json_is();
    test_refuses_what_it_is_not();
    test_every_prefix_is_refused();
    test_values_by_key();
    test_space();
    test_limits();
    return CHECK_DONE();
}
