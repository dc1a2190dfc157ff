/* Connections and outputs: which URL is meant, the remedy when LCM cannot be opened, and outputs that fail. */
#define _XOPEN_SOURCE 700 /* setenv */
#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "../../tools/trackd/lcm_link.h"

/* The layer under lcm_link.c: LCM without a network, and files that fail. */
static struct layer {
    bool no_lcm, no_subscription, no_dup, no_null; /* which call fails */
    int publish, fsync;                            /* result; errno */
    const char *denied;                            /* cannot be opened */
    const char *swapped;                           /* is a link to this file when LCM opens a log */
    int subscribed, destroyed, capacity;           /* number of calls; last capacity */
} layer;

static lcm_t *const LCM = (lcm_t *)&layer; /* is only handed on */
static lcm_subscription_t *const SUBSCRIPTION = (lcm_subscription_t *)&layer;

static lcm_t *layer_create(const char *url)
{
    fputs("pages about a missing route\n", stderr);
    return layer.no_lcm || !*url ? NULL : LCM;
}

static int layer_publish(lcm_t *lcm, const char *channel, const void *data, unsigned size)
{
    return lcm == LCM && *channel && data && size ? layer.publish : 0;
}

static lcm_subscription_t *layer_subscribe(lcm_t *lcm, const char *channel, lcm_msg_handler_t fn, void *user)
{
    layer.subscribed += lcm == LCM && *channel && fn && user;
    return layer.no_subscription ? NULL : SUBSCRIPTION;
}

static int layer_capacity(lcm_subscription_t *s, int capacity)
{
    layer.capacity = s == SUBSCRIPTION ? capacity : -1;
    return 0;
}

static void layer_destroy(lcm_t *lcm)
{
    layer.destroyed += lcm == LCM;
}

static int layer_dup(int file)
{
    return layer.no_dup ? -1 : dup(file);
}

static int layer_open(const char *path, int flags, ...)
{
    errno = EACCES;
    return layer.no_null || (layer.denied && strcmp(path, layer.denied) == 0) ? -1 : open(path, flags, 0600);
}

static int layer_fsync(int file)
{
    errno = layer.fsync;
    return layer.fsync ? -1 : fsync(file);
}

static lcm_eventlog_t *layer_eventlog(const char *path, const char *mode)
{
    if (layer.swapped && (unlink(path) != 0 || symlink(layer.swapped, path) != 0))
        return NULL;
    return lcm_eventlog_create(path, mode);
}

#undef lcm_create
#undef lcm_publish
#undef lcm_subscribe
#undef lcm_subscription_set_queue_capacity
#undef lcm_destroy
#undef lcm_eventlog_create
#define lcm_create                          layer_create
#define lcm_publish                         layer_publish
#define lcm_subscribe                       layer_subscribe
#define lcm_subscription_set_queue_capacity layer_capacity
#define lcm_destroy                         layer_destroy
#define lcm_eventlog_create                 layer_eventlog
#define dup                                 layer_dup
#define open                                layer_open
#define fsync                               layer_fsync
#include "../../tools/trackd/lcm_link.c"
#undef dup
#undef open
#undef fsync

#include "check.h"

static message why;

static void test_url(void)
{
    CHECK(unsetenv("LCM_DEFAULT_URL") == 0 && strcmp(link_url(""), LINK_DEFAULT_URL) == 0);
    CHECK(strcmp(link_url("udpm://a"), "udpm://a") == 0 && strcmp(link_url(NULL), LINK_DEFAULT_URL) == 0);
    CHECK(setenv("LCM_DEFAULT_URL", "", 1) == 0 && strcmp(link_url(""), LINK_DEFAULT_URL) == 0);
    CHECK(setenv("LCM_DEFAULT_URL", "udpm://b", 1) == 0 && strcmp(link_url(""), "udpm://b") == 0);
    CHECK(strcmp(link_url("udpm://a"), "udpm://a") == 0);
}

static void test_log_names(void)
{
    static const struct {
        const char *url, *path;
        char mode;
    } logs[] = {
        {"file:///a/b", "/a/b", 'r'},
        {"file:///a?speed=0", "/a", 'r'},
        {"file:///a?mode=w", "/a", 'w'},
        {"file:///a?mode=a&speed=0", "/a", 'a'},
        {"file:///a?speed=0&mode=w", "/a", 'w'},
        {"file:///a?mode=", "/a", 0},
        {"file:///a?mode=x", "/a", 0},
        {"file:///a?mode=ww", "/a", 0},
        {"/a", "/a", 'r'},
    };
    char path[LINK_PATH];
    for (size_t i = 0; i < sizeof logs / sizeof *logs; i++)
        CHECK(link_log(logs[i].url, path) == logs[i].mode && strcmp(path, logs[i].path) == 0);
}

static bool refused(const char *url, const char *reason)
{
    why.text[0] = '\0';
    return !link_open(url, &why) && strstr(why.text, reason);
}

static void test_open(void)
{
    layer = (struct layer){0};
    CHECK(link_open("udpm://239.1.1.1:7667", &why) == LCM);
    layer.no_lcm = true;
    CHECK(refused("udpm://239.1.1.1:7667?ttl=0", "ip route add"));
    CHECK(refused("mpudpm://239.1.1.1:7667", "ip route add"));
    CHECK(refused("udpm://", "ip route add"));
    CHECK(refused("udpm://239.1.1.1", "ip route add") && refused("udpm://:7667?ttl=0", "ip route add"));
    CHECK(refused("udpm://a.name.longer.than.an.address:7667", "is not a multicast address"));
    CHECK(refused("udpm://x", "udpm://x: x is not a multicast address"));
    CHECK(refused("udpm://239.1.1.1:65536", "LCM has no such port; give one from 1 to 65535"));
    CHECK(refused("udpm://239.1.1.1:99999?ttl=0", "LCM has no such port"));
    CHECK(refused("udpm://239.1.1.1:", "LCM has no such port"));
    CHECK(refused("file:///dev/null?speed=0", "/dev/null: cannot open this log: it is not a regular file"));
    CHECK(refused("file:///dev?speed=0", "/dev: cannot open this log: it is not a regular file"));
    CHECK(refused("udpm://10.0.0.7:7667", "10.0.0.7 is not a multicast address"));
    CHECK(refused("other://", "give udpm://ADDRESS:PORT"));
    CHECK(refused("file:///absent?speed=0", "/absent: cannot open this log: No such file or directory"));
    CHECK(refused("file:///absent?mode=w", "/absent: liblcm cannot read this log"));
}

/* What LCM prints while it connects is not seen, also if that takes a file too many; what follows is. */
static void test_muted(void)
{
    char name[] = P_tmpdir "/gait_link_XXXXXX", text[256];
    int const file = mkstemp(name), own = dup(STDERR_FILENO);
    for (int fault = 0; fault < 3; fault++) {
        layer = (struct layer){.no_lcm = true, .no_dup = fault == 1, .no_null = fault == 2};
        fflush(stderr);
        dup2(file, STDERR_FILENO);
        CHECK(refused("other://", "cannot open LCM"));
        fputs("seen\n", stderr);
        fflush(stderr);
        dup2(own, STDERR_FILENO);
        lseek(file, 0, SEEK_SET);
        ssize_t const n = read(file, text, sizeof text - 1);
        text[n < 0 ? 0 : n] = '\0';
        CHECK(strcmp(text, fault ? "pages about a missing route\nseen\n" : "seen\n") == 0);
        CHECK(ftruncate(file, 0) == 0 && lseek(file, 0, SEEK_SET) == 0);
    }
    close(file);
    close(own);
    unlink(name);
}

static void none(const lcm_recv_buf_t *buf, const char *channel, void *user)
{
    (void)buf, (void)channel, (void)user;
}

static void test_subscribe(void)
{
    layer = (struct layer){0};
    CHECK(link_subscribe(LCM, "GAIT_IMAGE_0", none, &layer, 7, &why) == SUBSCRIPTION);
    CHECK(layer.subscribed == 1 && layer.capacity == 7);
    layer.no_subscription = true;
    CHECK(!link_subscribe(LCM, "GAIT_IMAGE_0", none, &layer, 7, &why));
    CHECK(strstr(why.text, "cannot receive GAIT_IMAGE_0; ") != NULL);
}

/* ---- output ---- */
static const uint8_t data[4096];

/* Losses are counted; the first is reported, and again at the end. */
static void test_lost_messages(void)
{
    sink s;
    layer = (struct layer){0};
    CHECK(sink_open(&s, "udpm://239.1.1.1:7667", &why));
    sink_publish(&s, "A", 0, data, 0);
    sink_publish(&s, "A", 2, data, 9);
    CHECK(s.failed == 0);
    layer.publish = -1;
    sink_publish(&s, "A", 0, data, 9);
    sink_publish(&s, "A", 0, data, 9);
    CHECK(s.failed == 2 && !sink_ended(&s, &why)); /* later ones may go out */
    CHECK(!sink_close(&s, true, &why) &&
          strcmp(why.text, "--out: messages were lost: LCM could not send them") == 0);
    CHECK(layer.destroyed == 1 && !s.lcm);
    layer.publish = 0;
    CHECK(sink_open(&s, "udpm://239.1.1.1:7667", &why) && sink_close(&s, true, &why) && layer.destroyed == 2);
}

static void test_names_beside(void)
{
    static const char *const names[][2] = {{"/a.b/c", "/a.b/c.unfinished"},
                                           {"/a/b.log", "/a/b.unfinished.log"},
                                           {"b.c.log", "b.c.unfinished.log"},
                                           {"a/.log", "a/.log.unfinished"}};
    char beside[LINK_PATH];
    for (size_t i = 0; i < sizeof names / sizeof *names; i++) {
        name_beside(names[i][0], 1, beside);
        CHECK(strcmp(beside, names[i][1]) == 0);
    }
    name_beside("/a/b.log", 3, beside);
    CHECK(strcmp(beside, "/a/b.unfinished-3.log") == 0);
}

static void test_log(void)
{
    char name[] = P_tmpdir "/gait_link_XXXXXX", url[64], beside[64];
    sink s = {0};
    close(mkstemp(name));
    snprintf(url, sizeof url, "file://%s?mode=w", name);
    layer = (struct layer){0};
    CHECK(!sink_open(&s, "file:///absent/log?mode=w", &why) && strstr(why.text, "No such file"));
    CHECK(sink_close(&s, true, &why)); /* no output */
    CHECK(sink_open(&s, url, &why));
    sink_publish(&s, "A", 0, data, 9);
    CHECK(!sink_ended(&s, &why));
    sink another;
    CHECK(!sink_open(&another, url, &why) && strstr(why.text, "another program is writing this log"));
    CHECK(sink_close(&s, true, &why) && log_scan(name, &why) == 1);
    static const struct {
        int fault;
        bool fine;
    } fsyncs[] = {{EINVAL, true}, {EROFS, true}, {EIO, false}};
    snprintf(beside, sizeof beside, "%s.unfinished", name);
    for (size_t i = 0; i < sizeof fsyncs / sizeof *fsyncs; i++) {
        layer.fsync = fsyncs[i].fault;
        CHECK(sink_open(&s, url, &why) && access(beside, F_OK) == 0);
        CHECK(!sink_check(url, &(sink){0}, &why) && strstr(why.text, "another program"));
        CHECK(sink_check(url, &s, &why));
        sink_publish(&s, "A", 0, data, 9);
        CHECK(sink_close(&s, true, &why) == fsyncs[i].fine &&
              (fsyncs[i].fine || strstr(why.text, strerror(EIO))));
        CHECK((access(beside, F_OK) == 0) == !fsyncs[i].fine && log_scan(name, &why) == 1);
    }
    layer.fsync = 0;
    CHECK(unlink(beside) == 0 && sink_open(&s, url, &why));
    sink_publish(&s, "A", 0, data, 9);
    sink_publish(&s, "A", 0, data, 9);
    message_set(&why, "%0200d: the program failed", 0); /* after a long path */
    CHECK(!sink_close(&s, false, &why) &&
          strstr(why.text, "the program failed; what was written is in gait_link"));
    CHECK(log_scan(name, &why) == 1 && log_scan(beside, &why) == 2);
    CHECK(sink_check(url, &s, &why) && access(beside, F_OK) == 0);
    unlink(beside);
    unlink(name);
    CHECK(sink_check(url, &s, &why) && access(name, F_OK) != 0 && access(beside, F_OK) != 0);
}

/* ---- files beside a log, in a folder of the test */
static char folder[] = P_tmpdir "/gait_link_XXXXXX";
enum { BUFFERS = 64 };

/* The path of a name in the folder, in one of more buffers than a test needs. */
static const char *in_folder(const char *name)
{
    static char paths[BUFFERS][96];
    static int next;
    char *const path = paths[next++ % BUFFERS];
    snprintf(path, sizeof *paths, "%s/%s", folder, name);
    return path;
}

static const char *log_url(const char *path, char mode)
{
    static char urls[BUFFERS][112];
    static int next;
    char *const url = urls[next++ % BUFFERS];
    snprintf(url, sizeof *urls, "file://%s?mode=%c", path, mode);
    return url;
}

static void put(const char *path, const char *text)
{
    FILE *const f = fopen(path, "wb");
    CHECK(f && fputs(text, f) >= 0 && fclose(f) == 0);
}

static bool contains(const char *path, const char *text)
{
    char found[64] = {0};
    FILE *const f = fopen(path, "rb");
    bool const same = f && fread(found, 1, sizeof found - 1, f) == strlen(text) && strcmp(found, text) == 0;
    if (f)
        fclose(f);
    return same;
}

static bool opens(const char *url)
{
    sink s;
    why.text[0] = '\0';
    return sink_open(&s, url, &why) && sink_close(&s, true, &why);
}

/* What was left unfinished is kept under the first free name, unless it is empty. */
static void test_unfinished_is_kept(void)
{
    const char *const log = in_folder("a.log"), *const beside = in_folder("a.unfinished.log");
    layer = (struct layer){0};
    put(beside, "first");
    CHECK(opens(log_url(log, 'w')) && contains(in_folder("a.unfinished-2.log"), "first"));
    put(beside, "second");
    CHECK(symlink("absent", in_folder("a.unfinished-3.log")) == 0);
    CHECK(sink_check(log_url(log, 'w'), &(sink){0}, &why) && contains(beside, "second"));
    CHECK(opens(log_url(log, 'a')) && contains(beside, "second"));
    CHECK(opens(log_url(log, 'w')) && contains(in_folder("a.unfinished-4.log"), "second"));
    CHECK(contains(in_folder("a.unfinished-2.log"), "first") && access(beside, F_OK) != 0);
    put(beside, "");
    CHECK(opens(log_url(log, 'w')) && access(beside, F_OK) != 0);
    CHECK(access(in_folder("a.unfinished-5.log"), F_OK) != 0);
    for (int i = 2; i < 5; i++) {
        char name[32];
        snprintf(name, sizeof name, "a.unfinished-%d.log", i);
        unlink(in_folder(name));
    }
    unlink(log);
}

/* Nothing is written through a link, or to a pipe, with the name of the unfinished file. */
static void test_unfinished_is_a_file(void)
{
    const char *const log = in_folder("a.log"), *const beside = in_folder("a.unfinished.log");
    const char *const precious = in_folder("precious");
    layer = (struct layer){0};
    put(precious, "keep");
    for (int kind = 0; kind < 4; kind++) {
        if (kind == 0)
            CHECK(symlink(precious, beside) == 0);
        else if (kind == 1)
            CHECK(symlink(in_folder("absent"), beside) == 0);
        else
            CHECK((kind == 2 ? mkfifo(beside, 0600) : mkdir(beside, 0700)) == 0);
        for (const char *mode = "wa"; *mode; mode++) {
            CHECK(!opens(log_url(log, *mode)) &&
                  strstr(why.text, "a.unfinished.log is not a regular file; remove it"));
            CHECK(!sink_check(log_url(log, *mode), &(sink){0}, &why) &&
                  strstr(why.text, "is not a regular file"));
        }
        CHECK(access(log, F_OK) != 0 && access(in_folder("absent"), F_OK) != 0);
        CHECK(kind == 3 ? rmdir(beside) == 0 : unlink(beside) == 0);
    }
    CHECK(contains(precious, "keep"));
    layer.swapped = precious;
    CHECK(!opens(log_url(log, 'w')) && strstr(why.text, "was replaced while it was opened"));
    layer.swapped = NULL;
    CHECK(unlink(beside) == 0 && unlink(precious) == 0);
}

/* A log that may not be written is not replaced. */
static void test_read_only(void)
{
    const char *const log = in_folder("a.log"), *const beside = in_folder("a.unfinished.log");
    layer = (struct layer){.denied = log};
    put(log, "old");
    for (const char *mode = "wa"; *mode; mode++) {
        CHECK(!opens(log_url(log, *mode)) && strstr(why.text, "a.log: is read-only; give another name"));
        CHECK(!sink_check(log_url(log, *mode), &(sink){0}, &why) && strstr(why.text, "a.log: is read-only"));
    }
    CHECK(contains(log, "old") && access(beside, F_OK) != 0);
    char words[128];
    layer.denied = beside; /* cannot be made */
    snprintf(words, sizeof words, "folder %s cannot be written; give another place", folder);
    CHECK(!opens(log_url(log, 'w')) && strstr(why.text, words) && contains(log, "old"));
    unlink(log);
}

/* A log is compared by what it is: a reload may name that in use in another way. */
static void test_log_in_use(void)
{
    const char *const log = in_folder("a.log"), *const link = in_folder("link.log");
    sink s;
    layer = (struct layer){0};
    CHECK(symlink("a.log", link) == 0);
    for (int old = 0; old < 2; old++)
        for (const char *mode = "wa"; *mode; mode++) {
            if (old)
                put(log, "");
            CHECK(sink_open(&s, log_url(log, *mode), &why));
            for (const char *next = "wa"; *next; next++) {
                CHECK(sink_check(log_url(log, *next), &s, &why));
                CHECK(sink_check(log_url(in_folder("./a.log"), *next), &s, &why));
                CHECK(sink_check(log_url(link, *next), &s, &why));
                CHECK(!sink_check(log_url(in_folder("./a.log"), *next), &(sink){0}, &why));
            }
            sink other;
            CHECK(sink_open(&other, log_url(in_folder("b.log"), *mode), &why));
            CHECK(!sink_check(log_url(in_folder("b.log"), 'w'), &s, &why) &&
                  strstr(why.text, "another program"));
            CHECK(sink_close(&other, true, &why) && sink_close(&s, true, &why));
            CHECK(unlink(log) == 0 && unlink(in_folder("b.log")) == 0);
        }
    unlink(link);
}

/* A pipe takes a log by any name, and a check is not its reader's end. */
static void test_pipe(void)
{
    const char *const fifo = in_folder("fifo");
    char number[64], byte[256];
    int ends[2];
    layer = (struct layer){0};
    for (const char *mode = "wa"; *mode; mode++) {
        CHECK(pipe(ends) == 0);
        snprintf(number, sizeof number, "/dev/fd/%d", ends[1]);
        sink s;
        CHECK(sink_check(log_url(number, *mode), &(sink){0}, &why));
        CHECK(sink_open(&s, log_url(number, *mode), &why));
        sink_publish(&s, "A", 0, data, 9);
        CHECK(sink_close(&s, true, &why));
        close(ends[1]);
        CHECK(read(ends[0], byte, sizeof byte) == HEAD + 1 + 9 && read(ends[0], byte, 1) == 0);
        close(ends[0]);
    }
    CHECK(mkfifo(fifo, 0600) == 0);
    CHECK(sink_check(log_url(fifo, 'w'), &(sink){0}, &why)); /* without a reader */
    int const reader = open(fifo, O_RDONLY | O_NONBLOCK);
    struct pollfd ended = {.fd = reader, .events = POLLIN};
    CHECK(sink_check(log_url(fifo, 'w'), &(sink){0}, &why));
    CHECK(poll(&ended, 1, 0) == 0); /* no end of file */
    close(reader);
    unlink(fifo);
}

/* A full disk is noticed when a buffer is written, or at the end; after it nothing more is written. */
static void test_full_disk(void)
{
    sink s;
    layer = (struct layer){0};
    CHECK(sink_open(&s, "file:///dev/full?mode=w", &why));
    sink_publish(&s, "A", 0, data, 9); /* is buffered */
    CHECK(!sink_ended(&s, &why) && !sink_close(&s, true, &why) && strstr(why.text, strerror(ENOSPC)));
    CHECK(sink_open(&s, "file:///dev/full?mode=w", &why));
    for (int i = 0; i < 3; i++)
        sink_publish(&s, "A", 0, data, sizeof data);
    CHECK(sink_ended(&s, &why) && strstr(why.text, strerror(ENOSPC)));
    int64_t const failed = s.failed;
    sink_publish(&s, "A", 0, data, 9);
    CHECK(s.failed == failed + 1);
    CHECK(!sink_close(&s, true, &why) && strstr(why.text, "the log cannot be written: "));
    CHECK(sink_open(&s, "file:///dev/full?mode=w", &why));
    sink_publish(&s, "A", 0, data, 9);
    CHECK(fflush(s.log->f) != 0);
    sink_publish(&s, "A", 0, data, 9); /* is buffered, but those before it are lost */
    CHECK(sink_ended(&s, &why) && !sink_close(&s, true, &why));
}

int main(void)
{
    test_url();
    test_log_names();
    test_open();
    test_muted();
    test_subscribe();
    test_lost_messages();
    test_names_beside();
    test_log();
    CHECK(mkdtemp(folder) != NULL);
    test_unfinished_is_kept();
    test_unfinished_is_a_file();
    test_read_only();
    test_log_in_use();
    test_pipe();
    CHECK(rmdir(folder) == 0);
    test_full_disk();
    return CHECK_DONE();
}
