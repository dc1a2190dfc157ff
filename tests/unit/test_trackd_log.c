/* A log that ends anywhere: the complete messages are counted, a cut is reported, and liblcm reads what may be read. */
#define _XOPEN_SOURCE 700 /* P_tmpdir */
#include "../../tools/trackd/lcm_link.c"

#include "check.h"

enum { EVENTS = 4, TEXT = 20 };

static char path[] = P_tmpdir "/gait_log_XXXXXX";
static unsigned char whole[4096];
static size_t size, ends[EVENTS];

/* Events of different lengths, the last without data. */
static void make(void)
{
    static char const *const channel[EVENTS] = {"A", "GAIT_IMAGE_0", "GAIT_ESTIMATE", "B"};
    static unsigned char data[TEXT * EVENTS];
    lcm_eventlog_t *const log = lcm_eventlog_create(path, "w");
    FILE *f;
    for (int i = 0; i < EVENTS; i++) {
        lcm_eventlog_event_t e = {.timestamp = i,
                                  .channellen = (int32_t)strlen(channel[i]),
                                  .datalen = TEXT * (EVENTS - 1 - i),
                                  .channel = (char *)(uintptr_t)channel[i],
                                  .data = data};
        CHECK(lcm_eventlog_write_event(log, &e) == 0);
        ends[i] = (i ? ends[i - 1] : 0) + HEAD + (size_t)e.channellen + (size_t)e.datalen;
    }
    lcm_eventlog_destroy(log);
    f = fopen(path, "rb");
    if (!f)
        abort();
    size = fread(whole, 1, sizeof whole, f);
    fclose(f);
    CHECK(size == ends[EVENTS - 1]);
}

static void test_every_length(void)
{
    message why;
    for (size_t n = 0; n <= size; n++) {
        int64_t events = 0, read = 0;
        size_t boundary = 0;
        FILE *const f = fopen(path, "wb");
        if (!f || fwrite(whole, 1, n, f) != n || fclose(f) != 0)
            abort();
        while (events < EVENTS && ends[events] <= n)
            boundary = ends[events++];
        CHECK(log_scan(path, &why) == events);
        CHECK((why.text[0] == '\0') == (n > 0 && n == boundary));
        char url[64];
        snprintf(url, sizeof url, "file://%s?speed=0", path);
        lcm_t *const link = link_open(url, &why);
        CHECK(!link == (events == 0)); /* nothing to read is refused, with the reason */
        CHECK(link || strstr(why.text, path));
        if (!link)
            continue;
        lcm_destroy(link);
        lcm_eventlog_t *const log = lcm_eventlog_create(path, "r");
        for (lcm_eventlog_event_t *e; (e = lcm_eventlog_read_next_event(log)); read++)
            lcm_eventlog_free_event(e);
        lcm_eventlog_destroy(log);
        CHECK(read == events);
    }
}

int main(void)
{
    int const file = mkstemp(path);
    if (file < 0)
        abort();
    close(file);
    make();
    test_every_length();
    unlink(path);
    return CHECK_DONE();
}
