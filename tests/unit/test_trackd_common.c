/* Text from outside in messages: nothing of it reaches a terminal, or begins a line of the log. */
#define _XOPEN_SOURCE 700 /* P_tmpdir */
#include "../../tools/trackd/common.h"

#include "check.h"

#include <stdio.h>
#include <stdlib.h>
#include <unistd.h>

static const struct {
    const char *text, *shown;
} CASES[] = {
    {"x\ngait-trackd: FAKE\x1b[31m\xe9", "x\\x0agait-trackd: FAKE\\x1b[31m\\xe9"},
    {"plain \\x0a", "plain \\x0a"},
    {"\t\r\x7f", "\\x09\\x0d\\x7f"},
    {"\u00e9 \u20ac \U0001f6b6", "\u00e9 \u20ac \U0001f6b6"},
    {"\xc2\x9b"
     "31m",
     "\\xc2\\x9b31m"},                   /* a control character of two bytes */
    {"\xc0\x8a", "\\xc0\\x8a"},          /* a longer form of a new line */
    {"\xe0\x80\x8a", "\\xe0\\x80\\x8a"}, /* another */
    {"\xf0\x80\x80\x8a", "\\xf0\\x80\\x80\\x8a"},
    {"\xed\xa0\x80", "\\xed\\xa0\\x80"}, /* half of a pair */
    {"\xf4\x90\x80\x80", "\\xf4\\x90\\x80\\x80"},
    {"\xf5", "\\xf5"},
    {"\xe2\x82", "\\xe2\\x82"}, /* cut off */
    {"\xe2(\xac", "\\xe2(\\xac"},
};
enum { COUNT = sizeof CASES / sizeof *CASES };

static void test_message(void)
{
    message m, again;
    char longest[sizeof m.text + 1];
    for (int i = 0; i < COUNT; i++) {
        CHECK(!message_set(&m, "%s", CASES[i].text) && strcmp(m.text, CASES[i].shown) == 0);
        CHECK(!message_set(&again, "%s", m.text) && strcmp(again.text, m.text) == 0);
    }
    memset(longest, 1, sizeof longest - 1);
    longest[sizeof longest - 1] = '\0';
    CHECK(!message_set(&m, "%s", longest) && strlen(m.text) == (sizeof m.text - 1) / 4 * 4);
}

static void test_lines(void)
{
    char name[] = P_tmpdir "/gait_common_XXXXXX", line[256];
    int const file = mkstemp(name), own = dup(STDERR_FILENO);
    fflush(stderr);
    dup2(file, STDERR_FILENO);
    for (int i = 0; i < COUNT; i++)
        (i % 2 ? log_line : log_event)("%s", CASES[i].text);
    fflush(stderr);
    dup2(own, STDERR_FILENO);
    FILE *const f = fopen(name, "r");
    for (int i = 0; i < COUNT; i++) {
        CHECK(fgets(line, sizeof line, f) != NULL);
        line[strcspn(line, "\n")] = '\0';
        CHECK(strncmp(line, "gait-trackd: ", 13) == 0 && strcmp(line + 13, CASES[i].shown) == 0);
    }
    CHECK(!fgets(line, sizeof line, f));
    fclose(f);
    close(file);
    close(own);
    unlink(name);
}

int main(void)
{
    test_message();
    test_lines();
    return CHECK_DONE();
}
