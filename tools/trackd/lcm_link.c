#include "lcm_link.h"

#include "folder.h"

#include <arpa/inet.h>
#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <netinet/in.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

/* ---- logs ---- */
enum {
    HEAD = 28,                       /* bytes before the channel's name */
    SYNC = 0xEDA1DA01 - (1LL << 32), /* the first four of them */
    LONGEST = 1000                   /* bytes of a name, LCM's limit */
};

static int64_t big_endian(const unsigned char *at)
{
    return (int32_t)((uint32_t)at[0] << 24 | (uint32_t)at[1] << 16 | (uint32_t)at[2] << 8 | at[3]);
}

/* Bytes of the event at the file's position; 0 if there is none. */
static int64_t event_bytes(FILE *f)
{
    unsigned char head[HEAD];
    if (fread(head, 1, HEAD, f) != HEAD || big_endian(head) != SYNC)
        return 0;
    int64_t const name = big_endian(head + 20), data = big_endian(head + 24);
    return name <= 0 || name >= LONGEST || data < 0 ? 0 : HEAD + name + data;
}

/* Number of complete messages; `safe`: liblcm can read it without taking more memory than the file has. */
static int64_t scan(const char *path, bool *safe, message *why)
{
    struct stat is;
    int64_t at = 0, events = 0, size = 0;
    bool const there = stat(path, &is) == 0, regular = there && S_ISREG(is.st_mode); /* a pipe would wait */
    FILE *const f = regular ? fopen(path, "rb") : NULL;
    *safe = false;
    if (!f) {
        message_set(why, "%.200s: cannot open this log: %s", path,
                    there && !regular ? "it is not a regular file" : strerror(errno));
        return -1;
    }
    why->text[0] = '\0';
    while (at < is.st_size && (size = event_bytes(f)) > 0 && at + size <= is.st_size) {
        at += size;
        events++;
        fseeko(f, (off_t)at, SEEK_SET);
    }
    fclose(f);
    /* liblcm searches for the first event, and allocates what an event states */
    *safe = events > 0 && size <= is.st_size;
    if (is.st_size == 0)
        message_set(why, "%.200s: this log is empty", path);
    else if (at != is.st_size)
        message_set(
            why, "%.200s: this log is damaged or truncated at byte %" PRId64 ", after %" PRId64 " messages",
            path, at, events);
    return events;
}

int64_t log_scan(const char *path, message *why)
{
    bool safe;
    return scan(path, &safe, why);
}

/* ---- connections ---- */
#define ROUTE_REMEDY "if this machine has no multicast route: ip route add 224.0.0.0/4 dev lo (as root)"

/* While liblcm connects, its pages about a missing route are not printed: the daemon reports that in one line.  Without
 * memory it and GLib end the program by one of these signals; then the line is printed here. */
static const int ENDS[] = {SIGSEGV, SIGABRT, SIGTRAP};
enum { ENDINGS = sizeof ENDS / sizeof *ENDS };
static struct sigaction before[ENDINGS];
static int saved; /* stderr */

static void on_end(int number)
{
    static const char line[] = "gait-trackd: LCM cannot connect: not enough memory\n";
    (void)!write(saved, line, sizeof line - 1);
    (void)number;
    _exit(1);
}

static void mute(void)
{
    struct sigaction const action = {.sa_handler = on_end};
    fflush(stderr);
    saved = dup(STDERR_FILENO);
    int const null = open("/dev/null", O_WRONLY);
    if (saved >= 0 && null >= 0)
        dup2(null, STDERR_FILENO);
    if (null >= 0)
        close(null);
    for (int i = 0; i < ENDINGS; i++)
        sigaction(ENDS[i], &action, &before[i]);
}

static void unmute(void)
{
    for (int i = 0; i < ENDINGS; i++)
        sigaction(ENDS[i], &before[i], NULL);
    if (saved < 0)
        return;
    fflush(stderr);
    dup2(saved, STDERR_FILENO);
    close(saved);
}

const char *link_url(const char *url)
{
    const char *const environment = getenv("LCM_DEFAULT_URL");
    if (url && *url)
        return url;
    return environment && *environment ? environment : LINK_DEFAULT_URL;
}

bool link_is_log(const char *url)
{
    return strncmp(url, "file://", 7) == 0;
}

char link_log(const char *url, char path[LINK_PATH])
{
    const char *const name = url + (link_is_log(url) ? 7 : 0), *at = strchr(name, '?');
    char mode = 'r';
    snprintf(path, LINK_PATH, "%.*s", at ? (int)(at - name) : LINK_PATH - 1, name);
    for (; at; at = strchr(at + 1, '&'))
        if (strncmp(at + 1, "mode=", 5) == 0)
            mode = at[6] && strchr("rwa", at[6]) && (at[7] == '\0' || at[7] == '&') ? at[6] : 0;
    return mode;
}

/* Whether udpm://ADDRESS:PORT has an address or a port that LCM cannot send to. */
static bool is_unreachable(const char *url, message *why)
{
    enum { LAST_PORT = 65535 };
    struct in_addr in;
    char address[INET_ADDRSTRLEN + 1], *end;
    if (strncmp(url, "udpm://", 7) != 0)
        return false;
    const char *const place = url + 7, *const after = place + strcspn(place, ":?");
    snprintf(address, sizeof address, "%.*s", (int)(after - place), place);
    if (after > place && (inet_pton(AF_INET, address, &in) != 1 || !IN_MULTICAST(ntohl(in.s_addr))))
        return !message_set(
            why, "%.100s: %.60s is not a multicast address; give one from 224.0.0.0 to 239.255.255.255", url,
            address);
    long const port = *after == ':' ? strtol(after + 1, &end, 10) : 1;
    return (port < 1 || port > LAST_PORT) &&
           !message_set(why, "%.100s: LCM has no such port; give one from 1 to %d", url, LAST_PORT);
}

lcm_t *link_open(const char *url, message *why)
{
    char path[LINK_PATH];
    bool safe = true;
    if (link_is_log(url) && link_log(url, path) == 'r' && (scan(path, &safe, why) < 0 || !safe))
        return NULL;
    mute();
    lcm_t *const lcm = lcm_create(url);
    unmute();
    if (!lcm && link_is_log(url))
        message_set(why, "%.200s: liblcm cannot read this log", path);
    else if (!lcm && is_unreachable(url, why))
        return NULL;
    else if (!lcm && strstr(url, "udpm://")) /* or mpudpm:// */
        message_set(why, "%.120s: cannot open LCM; " ROUTE_REMEDY, url);
    else if (!lcm)
        message_set(
            why,
            "%.120s: cannot open LCM; give udpm://ADDRESS:PORT or file:///PATH?speed=0 (?mode=w to write)",
            url);
    return lcm;
}

lcm_subscription_t *link_subscribe(lcm_t *lcm, const char *channel, lcm_msg_handler_t fn, void *user,
                                   int capacity, message *why)
{
    mute();
    lcm_subscription_t *const s = lcm_subscribe(lcm, channel, fn, user);
    unmute();
    if (s)
        lcm_subscription_set_queue_capacity(s, capacity);
    else
        message_set(why, "cannot receive %s; " ROUTE_REMEDY, channel);
    return s;
}

const char *link_channel(const char *channel, int person, char name[LINK_CHANNEL])
{
    snprintf(name, LINK_CHANNEL, person ? "%s_%d" : "%s", channel, person);
    return name;
}

/* ---- output ---- */
#define TAKEN "--out %.200s: another program is writing this log; give another name"

/* Where a log is: what a chain of links points to, whether it is there or not.  A device or a pipe keeps its name, as links
 * of /proc to a pipe lead to no name.  Returns whether it is one of these, or a folder. */
static bool follow(const char *path, char to[LINK_PATH])
{
    enum { LINKS = 40 };
    char link[LINK_PATH], from[LINK_PATH];
    struct stat is;
    ssize_t n;
    snprintf(to, LINK_PATH, "%s", path);
    if (stat(path, &is) == 0 && !S_ISREG(is.st_mode))
        return true;
    for (int i = 0; i < LINKS && (n = readlink(to, link, sizeof link - 1)) > 0; i++) {
        link[n] = '\0';
        memcpy(from, to, sizeof from);
        const char *const slash = strrchr(from, '/');
        int const folder = link[0] != '/' && slash ? (int)(slash - from + 1) : 0;
        snprintf(to, LINK_PATH, "%.*s%.*s", folder, from, LINK_PATH - 1 - folder, link);
    }
    return false;
}

/* NAME.unfinished.SUFFIX, from number 2 on NAME.unfinished-2.SUFFIX, as the commands call their files. */
static void name_beside(const char *path, int number, char beside[LINK_PATH])
{
    const char *const slash = strrchr(path, '/'), *const name = slash ? slash + 1 : path;
    const char *const dot = strrchr(name, '.'), *const suffix = dot && dot > name ? dot : name + strlen(name);
    char added[24];
    int const more = snprintf(added, sizeof added, number > 1 ? ".unfinished-%d" : ".unfinished", number);
    int const most = LINK_PATH - 1 - more, stem = suffix - path < most ? (int)(suffix - path) : most;
    snprintf(beside, LINK_PATH, "%.*s%s%.*s", stem, path, added, most - stem, suffix);
}

void link_unfinished(const char *path, char beside[LINK_PATH])
{
    char target[LINK_PATH];
    (void)follow(path, target);
    name_beside(target, 1, beside);
}

/* Set the names of the log of this URL, and return its mode. */
static char set_names(sink *s, const char *url, char path[LINK_PATH])
{
    char const mode = link_log(url, path);
    bool const special = follow(path, s->path);
    if (!special)
        name_beside(s->path, 1, s->beside);
    s->fresh = mode == 'w' && !special;
    return mode;
}

static bool is_same(const struct stat *a, const struct stat *b)
{
    return a->st_dev == b->st_dev && a->st_ino == b->st_ino;
}

static bool is_file(int file, const struct stat *is)
{
    struct stat open;
    return file >= 0 && fstat(file, &open) == 0 && is_same(&open, is);
}

/* Open a log and lock it, before it is emptied; a kill releases the lock.  Devices and pipes are not locked, nor is what `own`
 * has locked.  Returns 0 or an errno; EWOULDBLOCK: another program is writing it. */
static int lock(int *file, const char *path, int flags, const sink *own)
{
    struct stat is, named;
    int fault = 0;
    *file = open(path, O_WRONLY | O_CLOEXEC | O_NONBLOCK | flags, 0666);
    if (*file < 0)
        return errno == EEXIST ? EWOULDBLOCK : errno; /* it was made meanwhile */
    if (fstat(*file, &is) != 0 || !S_ISREG(is.st_mode))
        fault = flags & O_NOFOLLOW ? ELOOP : 0;
    else if (own && own->log && (is_file(own->lock, &is) || is_file(own->other, &is)))
        return 0;
    else if ((flock(*file, LOCK_EX | LOCK_NB) != 0 && errno == EWOULDBLOCK) || lstat(path, &named) != 0 ||
             !is_same(&is, &named)) /* it was replaced or removed meanwhile */
        fault = EWOULDBLOCK;
    if (fault) {
        close(*file);
        *file = -1;
    }
    return fault;
}

static void unlock(const sink *s)
{
    if (s->lock >= 0)
        close(s->lock);
    if (s->other >= 0)
        close(s->other);
}

/* Keep what a program that was killed has written, under the first free name.  Returns 0 or an errno. */
static int set_aside(const sink *s)
{
    enum { MOST = 1000 };
    char kept[LINK_PATH];
    struct stat is;
    int file, number = 2;
    int fault = lock(&file, s->beside, O_NOFOLLOW, NULL);
    if (fault)
        return fault == ENOENT ? 0 : fault;
    do
        name_beside(s->path, number, kept);
    while (lstat(kept, &is) == 0 && ++number < MOST);
    const char *const slash = strrchr(kept, '/');
    if (fstat(file, &is) == 0 && is.st_size == 0)
        fault = unlink(s->beside) != 0 ? errno : 0;
    else if (number == MOST)
        fault = EEXIST;
    else if (rename(s->beside, kept) != 0)
        fault = errno;
    else
        log_line("--out %.200s: an earlier log was not finished; it is now in %.100s", s->path,
                 slash ? slash + 1 : kept);
    close(file);
    return fault;
}

/* Lock both names, and make the file to write if `make`; `at` is the name to which the result applies: 0 or an errno. */
static int lock_both(sink *s, bool make, const sink *own, const char **at)
{
    int const only = s->beside[0] ? O_NOFOLLOW : 0; /* regular files, not links to them */
    int fault = 0;
    s->lock = s->other = -1;
    *at = s->fresh ? s->path : s->beside;
    if (only && (fault = lock(&s->other, *at, only, own)) == ENOENT)
        fault = 0;
    if (fault)
        return fault;
    *at = s->fresh ? s->beside : s->path;
    if (make && s->fresh)
        fault = set_aside(s);
    if (!fault)
        fault = lock(&s->lock, *at, only | (make ? O_CREAT | (s->fresh ? O_EXCL : 0) : 0), own);
    if (fault)
        unlock(s);
    return fault;
}

/* Why the file `at` of the log `path` cannot be written. */
static bool refuse(const char *path, const char *at, const sink *s, int fault, message *why)
{
    enum { LONGEST_SHOWN = 200 };
    struct stat is;
    const char *const slash = strrchr(at, '/');
    int const length = slash > at ? (int)(slash - at) : 1; /* of the folder's name */
    bool const there = lstat(at, &is) == 0;
    if (fault == EWOULDBLOCK)
        return message_set(why, TAKEN, path);
    if (there && !S_ISREG(is.st_mode) && s->beside[0])
        return message_set(why, "--out %.200s: %.200s is not a regular file; remove it", path, at);
    if (there && fault == EACCES)
        return message_set(why, "--out %.200s: is read-only; give another name, or change its permissions",
                           at);
    if (fault == EACCES)
        return message_set(why, "--out %.200s: folder %.*s cannot be written; give another place", path,
                           length < LONGEST_SHOWN ? length : LONGEST_SHOWN, slash ? at : ".");
    return message_set(why, "%.200s: this log cannot be written: %s", path, strerror(fault));
}

/* A new log has the mode of the file that it will replace. */
static void keep_mode(const sink *s)
{
    struct stat old;
    if (s->fresh && s->other >= 0 && fstat(s->other, &old) == 0 && fchmod(s->lock, old.st_mode & 0777) != 0)
        log_line("--out %.200s: keeps no permissions: %s", s->path, strerror(errno));
}

bool sink_open(sink *s, const char *url, message *why)
{
    char path[LINK_PATH];
    const char *at;
    struct stat is;
    *s = (sink){0};
    if (!link_is_log(url))
        return (s->lcm = link_open(url, why)) != NULL;
    char const mode[2] = {set_names(s, url, path)};
    int const fault = lock_both(s, true, NULL, &at);
    if (fault && !(fault == ENXIO && !s->beside[0])) /* not a pipe that no one reads yet */
        return refuse(path, at, s, fault, why);
    keep_mode(s);
    s->log = lcm_eventlog_create(at, mode); /* LCM takes only a name */
    bool const same =
        s->log && (s->lock < 0 || (fstat(s->lock, &is) == 0 && is_file(fileno(s->log->f), &is)));
    if (same)
        return true;
    if (s->log) {
        lcm_eventlog_destroy(s->log);
        s->log = NULL;
        message_set(why, "--out %.200s: its file was replaced while it was opened; start again", path);
    } else
        message_set(why, "%.200s: this log cannot be written: %s", path, strerror(errno));
    unlock(s);
    return false;
}

bool sink_check(const char *url, const sink *own, message *why)
{
    char path[LINK_PATH];
    const char *at;
    struct stat is;
    sink s = {0};
    if (!link_is_log(url)) {
        lcm_t *const lcm = link_open(url, why);
        if (lcm)
            lcm_destroy(lcm);
        return lcm != NULL;
    }
    (void)set_names(&s, url, path);
    if (stat(s.path, &is) == 0 && S_ISFIFO(is.st_mode)) /* its reader would take the close for the end */
        return access(s.path, W_OK) == 0 || refuse(path, s.path, &s, errno, why);
    int fault = lock_both(&s, false, own, &at);
    if (!fault)
        unlock(&s);
    if (fault == ENOENT)
        fault = folder_fault(s.path);
    return !fault || refuse(path, at, &s, fault, why);
}

static void lost(sink *s, const char *what)
{
    if (s->failed++ == 0)
        message_set(&s->fault, "%s", what);
}

/* As LCM's log provider writes it, with the current time. */
static bool write_event(lcm_eventlog_t *log, const char *channel, const uint8_t *bytes, int size)
{
    lcm_eventlog_event_t e = {.timestamp = clock_wall(),
                              .channellen = (int32_t)strlen(channel),
                              .datalen = size,
                              .channel = (char *)channel, /* LCM lacks const; read only */
                              .data = (void *)bytes};
    return lcm_eventlog_write_event(log, &e) == 0 && !ferror(log->f);
}

void sink_publish(sink *s, const char *base, int person, const uint8_t *bytes, int size)
{
    char name[LINK_CHANNEL];
    const char *const channel = link_channel(base, person, name);
    if (size <= 0)
        return;
    if (s->lcm && lcm_publish(s->lcm, channel, bytes, (unsigned)size) != 0) {
        lost(s, "LCM could not send them");
        if (s->failed == 1)
            log_line("LCM could not send a message of %d bytes on %s", size, channel);
    }
    errno = 0;
    if (s->log && (s->failed || !write_event(s->log, channel, bytes, size)))
        lost(s, strerror(errno));
}

bool sink_ended(const sink *s, message *why)
{
    return s->log && s->failed &&
           !message_set(why, "--out: the log cannot be written: %.180s", s->fault.text);
}

/* Write all that is buffered to the disk, give a new log its name, and write that; devices and pipes, and their folders, may
 * have none. */
static bool finish(const sink *s, bool ok)
{
    FILE *const f = s->log->f;
    if (fflush(f) != 0 || (fsync(fileno(f)) != 0 && errno != EINVAL && errno != EROFS))
        return false;
    if (ok && s->fresh && rename(s->beside, s->path) != 0)
        return false;
    errno = folder_flush(s->path);
    return errno == 0 || errno == EROFS;
}

/* A new log without its name: remove it if there is nothing in it. */
static void leave(const sink *s, message *why)
{
    struct stat is;
    const char *const slash = strrchr(s->beside, '/');
    message const reason = *why;
    if (stat(s->beside, &is) != 0)
        return;
    if (is.st_size == 0)
        unlink(s->beside);
    else
        message_set(why, "%.500s; what was written is in %.100s", reason.text, slash ? slash + 1 : s->beside);
}

bool sink_close(sink *s, bool ok, message *why)
{
    if (s->lcm)
        lcm_destroy(s->lcm);
    if (s->log && !finish(s, ok && !s->failed) && !s->failed)
        lost(s, strerror(errno));
    if (ok && s->failed)
        ok = message_set(why, "--out: %s %.180s",
                         s->log ? "the log cannot be written:" : "messages were lost:", s->fault.text);
    if (s->log) {
        lcm_eventlog_destroy(s->log);
        if (!ok && s->fresh)
            leave(s, why);
        unlock(s);
    }
    *s = (sink){0};
    return ok;
}
