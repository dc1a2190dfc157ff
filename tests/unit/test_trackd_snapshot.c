/* The daemon's snapshot on a disk that fails: every call of the file system in turn, in every way that it can; the order of
 * calls that a loss of power tests; files that are torn. */
#define _XOPEN_SOURCE 700 /* P_tmpdir */
#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <unistd.h>

#include "../../tools/trackd/common.h"
#define log_line(...) ((void)snprintf(NULL, 0, __VA_ARGS__)) /* a line for each damaged file */

/* The layer under snapshot_file.c: a letter for each call, and one of them fails. */
static char calls[4096]; /* o: open, w: write, s: fsync, c: close, r: rename, D: a folder is opened */
static size_t called, fail_at;
static int fail_with; /* an errno, 0: a write that takes nothing, or -1: a short write */

static bool fails(char call)
{
    if (called + 1 < sizeof calls)
        calls[called] = call;
    called++;
    if (called != fail_at || fail_with < 0)
        return false;
    errno = fail_with;
    return true;
}

static int layer_open(const char *path, int flags, ...)
{
    va_list args;
    va_start(args, flags);
    int const mode = flags & O_CREAT ? va_arg(args, int) : 0;
    va_end(args);
    return fails(flags & O_CREAT ? 'o' : 'D') ? -1 : open(path, flags, mode);
}

static ssize_t layer_write(int file, const void *data, size_t bytes)
{
    if (fails('w'))
        return fail_with ? -1 : 0;
    return write(file, data, called == fail_at && bytes > 1 ? bytes / 2 : bytes);
}

static int layer_fsync(int file)
{
    return fails('s') ? -1 : fsync(file);
}

static int layer_close(int file)
{
    close(file); /* also when it reports a fault */
    return fails('c') ? -1 : 0;
}

static int layer_rename(const char *from, const char *to)
{
    return fails('r') ? -1 : rename(from, to);
}

static bool no_memory;

static void *layer_malloc(size_t bytes)
{
    return no_memory ? NULL : malloc(bytes);
}

#define malloc layer_malloc
#define open   layer_open
#define write  layer_write
#define fsync  layer_fsync
#define close  layer_close
#define rename layer_rename
#include "../../tools/trackd/snapshot_file.c"
#undef malloc
#undef open
#undef write
#undef fsync
#undef close
#undef rename

#include "check.h"
#include "toy_model.h"

static char folder[] = P_tmpdir "/gait_snapshot_XXXXXX", path[64], model[64];
static service_shared shared;
static service s = {.shared = &shared};

static void write_file(const char *name, const void *data, size_t bytes)
{
    FILE *const f = fopen(name, "wb");
    if (!f || fwrite(data, 1, bytes, f) != bytes || fclose(f) != 0)
        abort();
}

/* A service that follows a person, in memory of its own. */
static void start(void)
{
    static sink out;
    gait_tracker_config config;
    gait_camera const camera = {48, 32, 50, 50, 24, 16, {1, 0, 0, 0, 0, -1, 0, 1, 0}, {0, 1, 5}, {0}};
    gait_state mean, sd;
    size_t bytes;
    message why;
    if (!mkdtemp(folder))
        abort();
    snprintf(path, sizeof path, "%s/state", folder);
    snprintf(model, sizeof model, "%s/model", folder);
    const void *const toy = toy_model_blob(&bytes);
    write_file(model, toy, bytes);
    gait_tracker_default(&config, GAIT_MODE_DEFAULT);
    config.particles = config.acquisition_particles = 16;
    shared.out = &out;
    shared.max_pixels = 48 * 32;
    gait_tracker_prior(toy_model(), &mean, &sd, NULL);
    camera_use(&shared.slot, &camera);
    if (!tracking_open(&s.track, model, &config, &why) || !service_open(&s, NULL, false, &why) ||
        !service_make_trackers(&s, &why) || !tracking_start(&s.track, &mean, &sd, 0, &why))
        abort();
    s.state = GAITMSG_STATUS_T_RUNNING;
    s.last_utime = 33333;
}

/* Number of files beside the model. */
static int files(void)
{
    int count = -3; /* ., .., model */
    DIR *const list = opendir(folder);
    while (readdir(list))
        count++;
    closedir(list);
    return count;
}

static file_bytes content(void)
{
    file_bytes file;
    message why;
    CHECK(file_read(path, "snapshot", SNAPSHOT_MOST, &file, &why));
    return file;
}

static bool save(size_t at, int with)
{
    snapshot_file f = {.path = path};
    called = 0;
    fail_at = at;
    fail_with = with;
    snapshot_file_write(&f, &s, true);
    return !f.failed;
}

/* A new file can be read by its owner alone; a file that is there keeps its mode. */
static void test_mode(void)
{
    struct stat now;
    CHECK(save(0, 0) && stat(path, &now) == 0 && (now.st_mode & 0777) == 0600);
    CHECK(chmod(path, 0640) == 0 && save(0, 0) && stat(path, &now) == 0 && (now.st_mode & 0777) == 0640);
}

/* The data are on the disk before the file gets its name, and the name before anything is reported as written. */
static void test_order(void)
{
    CHECK(save(0, 0) && files() == 1);
    calls[called] = '\0';
    CHECK(strcmp(calls, "owscrDsc") == 0);
}

/* Whichever call fails: the file is the old one or the new one, nothing is left beside it, and only success is reported as
 * such. */
static void test_every_call(void)
{
    static const int faults[] = {ENOSPC, EIO, EROFS};
    CHECK(save(0, 0));
    size_t const count = called;
    CHECK(!save(2, 0) && files() == 1); /* a write that takes nothing */
    for (size_t k = 0; k < sizeof faults / sizeof *faults; k++)
        for (size_t at = 1; at <= count; at++) {
            write_file(path, "old", 3);
            bool const ok = save(at, faults[k]);
            bool const renamed = strchr(calls, 'r') < calls + at - 1, last = at == count;
            file_bytes const now = content();
            CHECK(ok == last); /* closing the folder loses nothing */
            CHECK(renamed == (now.size != 3) && files() == 1);
            free(now.data);
        }
}

static void test_no_memory(void)
{
    write_file(path, "old", 3);
    no_memory = true;
    CHECK(!save(0, 0) && called == 0);
    no_memory = false;
    file_bytes const now = content();
    CHECK(now.size == 3 && files() == 1);
    free(now.data);
}

static void test_interrupted_and_short_writes(void)
{
    CHECK(save(0, 0));
    file_bytes const whole = content();
    for (int with = -1; with <= EINTR; with += EINTR + 1) {
        write_file(path, "old", 3);
        CHECK(save(2, with) && files() == 1);
        file_bytes const now = content();
        CHECK(now.size == whole.size && memcmp(now.data, whole.data, whole.size) == 0);
        free(now.data);
    }
    free(whole.data);
}

/* A file that ends anywhere, or has another byte anywhere, is not used and changes nothing. */
static void test_torn(void)
{
    snapshot_file f = {.path = path};
    CHECK(save(0, 0));
    file_bytes const whole = content();
    uint64_t const digest = service_digest(&s);
    s.last_utime = 5; /* resuming would set it */
    for (size_t n = 0; n < whole.size; n++) {
        write_file(path, whole.data, n);
        snapshot_file_resume(&f, &s);
        whole.data[n] ^= 1;
        write_file(path, whole.data, whole.size);
        whole.data[n] ^= 1;
        snapshot_file_resume(&f, &s);
        CHECK(service_digest(&s) == digest && s.last_utime == 5);
    }
    write_file(path, whole.data, whole.size);
    snapshot_file_resume(&f, &s);
    CHECK(service_digest(&s) == digest && s.last_utime == 33333);
    free(whole.data);
}

/* ---- files with a correct checksum that do not fit ---- */
static file_bytes fitting;

static void seal(void)
{
    uint64_t const checksum = checksum_of(fitting.data, fitting.size);
    memcpy(fitting.data + offsetof(head, checksum), &checksum, sizeof checksum);
}

/* The same file with these bytes of it replaced, is refused for this reason. */
static void refused(size_t at, const void *bytes, size_t n, const char *reason)
{
    unsigned char kept[64];
    message why = {.text = ""};
    memcpy(kept, fitting.data + at, n);
    memcpy(fitting.data + at, bytes, n);
    seal();
    s.last_utime = 5; /* resuming would set it */
    bool const used = resume(path, &s, &fitting, &why);
    CHECK(s.last_utime == 5 && strstr(why.text, reason));
    CHECK(used == (at >= sizeof(head))); /* of several people the others are still used */
    memcpy(fitting.data + at, kept, n);
    seal();
}

#define REFUSED(at, type, value, reason)                                                                     \
    do {                                                                                                     \
        type const bad = value;                                                                              \
        refused(at, &bad, sizeof bad, reason);                                                               \
    } while (0)

static void test_fit(void)
{
    enum { RECORD = sizeof(head) };
    message why;
    CHECK(save(0, 0));
    fitting = content();
    REFUSED(offsetof(head, magic), char, 'g', "not a snapshot of this version");
    REFUSED(offsetof(head, cameras), int32_t, 2, "another number of cameras");
    REFUSED(offsetof(head, stream), int32_t, 7, "for --stream 7");
    REFUSED(offsetof(head, camera) + offsetof(gait_camera, width), int32_t, 0, "size of 0x32");
    REFUSED(offsetof(head, camera) + offsetof(gait_camera, height), int32_t, 33, "--max-pixels leaves");
    REFUSED(offsetof(head, camera) + offsetof(gait_camera, fx), float, 51, "other than --camera");
    REFUSED(offsetof(head, people), int32_t, 2, "shorter or longer");
    REFUSED(offsetof(head, people), int32_t, 0, "shorter or longer");
    REFUSED(RECORD + offsetof(record, person), int64_t, 2, "--people is less");
    REFUSED(RECORD + offsetof(record, utime), int64_t, -1, "time -1 is out of range");
    REFUSED(RECORD + offsetof(record, frame), int64_t, -2, "damaged record");
    REFUSED(RECORD + offsetof(record, steps), int64_t, -1, "damaged record");
    REFUSED(RECORD + offsetof(record, steps), int64_t, INT64_MAX, "damaged record");
    REFUSED(RECORD + sizeof(record), char, 'g', "not a tracker snapshot");
    s.person = 1; /* people have numbers now, that of the file has none */
    REFUSED(RECORD + offsetof(record, person), int64_t, 0, "it has no number, but people have");
    s.person = 0;
    file_bytes part = {fitting.data, RECORD - 1};
    CHECK(!resume(path, &s, &part, &why) && strstr(why.text, "too short"));
    shared.slot.fixed = true; /* that of --camera may be larger than announced ones */
    shared.max_pixels = 1;
    s.last_utime = 5;
    CHECK(resume(path, &s, &fitting, &why) && s.last_utime == 33333);
    shared.slot.fixed = false;
    shared.max_pixels = 48 * 32;
    free(fitting.data);
}

/* Lengths are checked before anything is read; a file that is longer states its lengths, too. */
static void test_lengths(void)
{
    CHECK(save(0, 0));
    file_bytes const whole = content();
    for (size_t n = 0; n < 4; n++) {
        static const uint64_t bad[] = {0, UINT64_MAX, 1 << 20, 7};
        fitting = (file_bytes){malloc(whole.size), whole.size};
        memcpy(fitting.data, whole.data, whole.size);
        refused(offsetof(head, people), &(int32_t){3}, sizeof(int32_t), "shorter or longer");
        memcpy(fitting.data + sizeof(head) + offsetof(record, bytes), &bad[n], sizeof bad[n]);
        refused(0, MAGIC, sizeof MAGIC, "shorter or longer");
        free(fitting.data);
    }
    free(whole.data);
}

/* A snapshot without a folder in its name is beside the others of the working folder. */
static void test_working_folder(void)
{
    snapshot_file f = {.path = "state"};
    char before[1024];
    message why;
    if (!getcwd(before, sizeof before) || chdir(folder) != 0)
        abort();
    write_file("state.2147483646.0123abcd", "x", 1);
    called = fail_at = 0;
    CHECK(snapshot_file_check(&f, &why) && access("state.2147483646.0123abcd", F_OK) != 0);
    snapshot_file_write(&f, &s, true);
    CHECK(!f.failed && access("state", F_OK) == 0);
    if (chdir(before) != 0)
        abort();
}

/* Leftovers of killed daemons are removed; those of running ones and other files stay. */
static void test_leftovers(void)
{
    char own[32]; /* in a container an earlier daemon had the same number */
    snprintf(own, sizeof own, "%d.0123abcd", (int)getpid());
    const char *const names[] = {own, "2147483646.0123abcd", "1.0123abcd", "2147483646", "2147483646.bak"};
    snapshot_file f = {.path = path};
    char name[96];
    CHECK(save(0, 0));
    for (size_t i = 0; i < sizeof names / sizeof *names; i++) {
        snprintf(name, sizeof name, "%s.%s", path, names[i]);
        write_file(name, "x", 1);
    }
    message why;
    CHECK(snapshot_file_check(&f, &why) && files() == 4);
    for (size_t i = 0; i < sizeof names / sizeof *names; i++) {
        snprintf(name, sizeof name, "%s.%s", path, names[i]);
        CHECK((access(name, F_OK) == 0) == (i > 1));
        unlink(name);
    }
}

/* That of eight people with 10,000 particles each has 62 MB. */
static void test_large(void)
{
    snapshot_file f = {.path = path};
    file_bytes file;
    message why;
    CHECK(save(0, 0) && truncate(path, (off_t)FILE_MOST + 1) == 0);
    CHECK(!file_read(path, "model", FILE_MOST, &file, &why) && strstr(why.text, "larger than 32 MiB"));
    file = content();
    CHECK(file.size == (size_t)FILE_MOST + 1 && !resume(f.path, &s, &file, &why));
    CHECK(strstr(why.text, "checksum") != NULL);
    free(file.data);
    unlink(path);
}

/* While no person is tracked the file is removed, if it is our own; what is none of ours is neither removed nor replaced. */
static void test_own(void)
{
    snapshot_file f = {.path = path}, other = {.path = path};
    message why;
    snapshot_file_write(&f, &s, true);
    s.state = GAITMSG_STATUS_T_READY;
    snapshot_file_write(&other, &s, true);
    CHECK(snapshot_file_check(&other, &why) && access(path, F_OK) == 0);
    snapshot_file_write(&f, &s, true);
    CHECK(access(path, F_OK) != 0);
    write_file(path, "of a summer", 11);
    snapshot_file_write(&f, &s, true);
    CHECK(access(path, F_OK) == 0 && !snapshot_file_check(&other, &why));
    s.state = GAITMSG_STATUS_T_RUNNING;
}

/* What another program that writes the file leaves at a time, in seconds. */
static void write_other(snapshot_file *other, time_t time)
{
    struct timespec const times[2] = {{.tv_sec = time}, {.tv_sec = time}};
    snapshot_file_write(other, &s, true);
    CHECK(utimensat(AT_FDCWD, path, times, 0) == 0);
}

/* Of two daemons with one file the first to notice leaves it to the other, and reports it, until that one has ended. */
static void test_two_writers(void)
{
    snapshot_file f = {.path = path}, other = {.path = path};
    struct timespec const long_ago[2] = {{0}};
    char moved[96];
    snprintf(moved, sizeof moved, "%s.moved", path);
    for (int i = 0; i < 2; i++) { /* the time of a file alone shows nothing */
        snapshot_file_write(&f, &s, true);
        CHECK(utimensat(AT_FDCWD, path, long_ago, 0) == 0 && f.own && !s.complaint.text[0]);
    }
    for (int i = 1; i < 6; i++) {
        write_other(&other, i);
        for (int k = 0; k < SNAPSHOT_LEFT; k++) /* also without a person */
            s.state = k ? GAITMSG_STATUS_T_READY : GAITMSG_STATUS_T_RUNNING,
            snapshot_file_write(&f, &s, true);
        s.state = GAITMSG_STATUS_T_RUNNING;
        CHECK(!f.own && other.own && strstr(s.complaint.text, "another program writes it, too"));
    }
    snapshot_file_write(&f, &s, true);
    CHECK(f.own);
    write_file(moved, "of a summer", 11);
    CHECK(rename(moved, path) == 0 && utimensat(AT_FDCWD, path, long_ago, 0) == 0);
    for (int k = 0; k <= 2 * SNAPSHOT_LEFT; k++)
        snapshot_file_write(&f, &s, true);
    CHECK(!f.own && !is_replaceable(path)); /* what is not a snapshot is left as it is for good */
    s.complaint.text[0] = '\0';
    unlink(path);
}

/* A file that was resumed or could not be written is as much looked after as one that was written. */
static void test_two_readers(void)
{
    snapshot_file f = {.path = path}, other = {.path = path};
    CHECK(save(0, 0));
    snapshot_file_resume(&f, &s);
    CHECK(f.own);
    write_other(&other, 1);
    s.state = GAITMSG_STATUS_T_READY;
    snapshot_file_write(&f, &s, true);
    CHECK(!f.own && access(path, F_OK) == 0);
    s.state = GAITMSG_STATUS_T_RUNNING;
    f = (snapshot_file){.path = path};
    snapshot_file_write(&f, &s, true);
    no_memory = true;
    snapshot_file_write(&f, &s, true);
    no_memory = false;
    CHECK(f.failed && f.own);
    other = (snapshot_file){.path = path};
    write_other(&other, 2);
    snapshot_file_write(&f, &s, true);
    CHECK(!f.own && f.left == SNAPSHOT_LEFT);
    f = (snapshot_file){.path = path};
    snapshot_file_write(&f, &s, true);
    called = 0, fail_at = 7,
    fail_with = EIO; /* the new file has its name, but the folder is not on the disk */
    snapshot_file_write(&f, &s, true);
    CHECK(f.failed);
    fail_at = 0;
    snapshot_file_write(&f, &s, true);
    CHECK(!f.failed && f.own && f.left == 0);
    unlink(path);
}

int main(void)
{
    start();
    test_mode();
    test_order();
    test_every_call();
    test_no_memory();
    test_interrupted_and_short_writes();
    test_torn();
    test_fit();
    test_lengths();
    test_working_folder();
    test_leftovers();
    test_own();
    test_two_writers();
    test_two_readers();
    test_large();
    unlink(path);
    unlink(model);
    rmdir(folder);
    service_close(&s);
    service_shared_close(&shared);
    return CHECK_DONE();
}
