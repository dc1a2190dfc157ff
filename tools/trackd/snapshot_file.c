#include "snapshot_file.h"

#include "folder.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/random.h>
#include <sys/stat.h>
#include <unistd.h>

/* The file: this header, then for each person who is tracked a record and the snapshot of the tracker.  Only a daemon on
 * the same machine and with the same version of the library reads it. */
typedef struct head {
    char magic[8];
    uint64_t checksum; /* of all that follows */
    int32_t people, cameras;
    int32_t stream[GAIT_MAX_CAMERAS]; /* their numbers */
    gait_camera camera[GAIT_MAX_CAMERAS];
} head;

typedef struct record {
    int64_t person;       /* number, 0: people are not distinguished */
    int64_t utime, frame; /* of the last frame tracked */
    int64_t steps;        /* frames tracked since START */
    uint64_t bytes;       /* of the tracker's snapshot */
} record;

enum { FAMILY = 7 }; /* letters of all versions */
static const char MAGIC[8] = "GAITTRD3";

static int count_cameras(const service *s)
{
    return 1 + (s->shared->further ? s->shared->further->count : 0);
}

/* Number of a camera. */
static int stream_of(const service *s, int camera)
{
    return camera ? s->shared->further->camera[camera - 1].stream : s->shared->stream;
}

/* FNV-1a of a file but for magic and checksum: another byte anywhere changes it. */
static uint64_t checksum_of(const unsigned char *file, size_t bytes)
{
    uint64_t hash = UINT64_C(0xcbf29ce484222325);
    for (size_t i = offsetof(head, people); i < bytes; i++)
        hash = (hash ^ file[i]) * UINT64_C(0x100000001b3);
    return hash;
}

/* ---- writing ---- */
static bool is_tracked(const service *s)
{
    return s->state == GAITMSG_STATUS_T_RUNNING;
}

static bool anyone(const service *s)
{
    while (s && !is_tracked(s))
        s = s->next;
    return s;
}

/* Size of the file; 0: it cannot be written. */
static size_t file_bytes_of(const service *s, head *h)
{
    size_t all = sizeof *h, state;
    for (const service *each = s; each; each = each->next) {
        if (!is_tracked(each))
            continue;
        if (gait_tracker_save(each->track.tracker, NULL, 0, &state, NULL) != GAIT_OK)
            return 0;
        all += sizeof(record) + state;
        h->people++;
    }
    return all;
}

/* The whole file in allocated memory; NULL: there is not enough. */
static unsigned char *encode(const service *s, size_t *bytes)
{
    head h = {.cameras = s->track.config.cameras};
    memcpy(h.magic, MAGIC, sizeof MAGIC);
    for (int i = 0; i < h.cameras; i++) {
        h.stream[i] = stream_of(s, i);
        h.camera[i] = s->track.config.camera[i];
    }
    *bytes = file_bytes_of(s, &h);
    unsigned char *const out = *bytes ? malloc(*bytes) : NULL;
    if (!out)
        return NULL;
    memcpy(out, &h, sizeof h);
    unsigned char *at = out + sizeof h;
    for (const service *each = s; each; each = each->next) {
        record r = {each->person, each->last_utime, each->last_frame, each->steps, 0};
        unsigned char *const state = at + sizeof r;
        size_t taken = 0;
        if (!is_tracked(each))
            continue;
        if (gait_tracker_save(each->track.tracker, state, (size_t)(out + *bytes - state), &taken, NULL) !=
            GAIT_OK) {
            free(out);
            return NULL;
        }
        r.bytes = taken;
        memcpy(at, &r, sizeof r);
        at = state + taken;
    }
    h.checksum = checksum_of(out, *bytes);
    memcpy(out, &h, sizeof h);
    return out;
}

static bool write_all(int file, const unsigned char *data, size_t bytes)
{
    while (bytes > 0) {
        ssize_t const done = write(file, data, bytes);
        if (done < 0 && errno == EINTR)
            continue;
        if (done == 0)
            errno = EIO;
        if (done <= 0)
            return false;
        data += done;
        bytes -= (size_t)done;
    }
    return true;
}

/* What a file PATH is written to first: PATH.PROCESS.RANDOM. */
enum { RANDOM_DIGITS = 8 };

/* Create that file, with the mode of the old one; -1: it cannot be created. */
static int create_beside(const char *path, char *beside, size_t capacity)
{
    uint32_t number = 0;
    struct stat old;
    bool const known = stat(path, &old) == 0;
    if (getrandom(&number, sizeof number, GRND_NONBLOCK) < 0)
        number = (uint32_t)clock_monotonic();
    snprintf(beside, capacity, "%s.%d.%0*" PRIx32, path, (int)getpid(), RANDOM_DIGITS, number);
    int const file = open(beside, O_WRONLY | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC, 0600);
    if (file >= 0 && known && fchmod(file, old.st_mode & 0777) != 0)
        log_line("--snapshot %.160s: keeps no permissions: %s", path, strerror(errno));
    return file;
}

/* Write beside the file, then rename; returns 0 or an errno.  After a loss of power the old or the new file is there,
 * complete.  `written` becomes that of the new file, if it has its name. */
static int replace(const char *path, const unsigned char *data, size_t bytes, struct stat *written)
{
    char beside[OPTION_TEXT + 32];
    int const file = create_beside(path, beside, sizeof beside);
    if (file < 0)
        return errno;
    int fault = write_all(file, data, bytes) && fsync(file) == 0 ? 0 : errno;
    if (close(file) != 0 && !fault)
        fault = errno;
    if (!fault && rename(beside, path) != 0)
        fault = errno;
    if (fault) {
        unlink(beside);
        return fault;
    }
    if (lstat(path, written) != 0)
        written->st_ino = 0;
    return folder_flush(path);
}

/* Whether a daemon that wrote a file has ended.  One with our own number has: in a container all have the same. */
static bool is_gone(pid_t writer)
{
    return writer == getpid() || (kill(writer, 0) != 0 && errno == ESRCH);
}

/* Remove what daemons that were killed while they wrote left beside the file. */
static void sweep(const char *path)
{
    const char *const slash = strrchr(path, '/'), *const name = slash ? slash + 1 : path;
    size_t const n = strlen(name);
    int const folder = folder_open(path);
    DIR *const list = folder < 0 ? NULL : fdopendir(folder);
    for (struct dirent *e; list && (e = readdir(list));) {
        char *end = e->d_name;
        long const writer =
            strncmp(e->d_name, name, n) == 0 && e->d_name[n] == '.' ? strtol(e->d_name + n + 1, &end, 10) : 0;
        if (writer > 0 && *end == '.' && strspn(end + 1, "0123456789abcdef") == RANDOM_DIGITS &&
            end[1 + RANDOM_DIGITS] == '\0' && is_gone((pid_t)writer))
            unlinkat(folder, e->d_name, 0);
    }
    if (list)
        closedir(list);
    else if (folder >= 0)
        close(folder);
}

/* Whether a file may be replaced: it is not there, or a snapshot of whichever version, however much of it. */
static bool is_replaceable(const char *path)
{
    char begin[FAMILY];
    struct stat is;
    if (lstat(path, &is) != 0)
        return errno == ENOENT;
    if (!S_ISREG(is.st_mode))
        return false;
    FILE *const f = fopen(path, "rb");
    if (!f)
        return false;
    size_t const bytes = fread(begin, 1, sizeof begin, f);
    fclose(f);
    return memcmp(begin, MAGIC, bytes) == 0;
}

bool snapshot_file_check(const snapshot_file *f, message *why)
{
    char beside[OPTION_TEXT + 32];
    if (!f->path)
        return true;
    if (!is_replaceable(f->path))
        return message_set(why, "--snapshot %.160s: is not a snapshot; give another name", f->path);
    sweep(f->path);
    int const file = create_beside(f->path, beside, sizeof beside);
    if (file < 0)
        return message_set(why, "--snapshot %.160s: cannot be written: %s", f->path, strerror(errno));
    close(file);
    unlink(beside);
    return true;
}

/* Whether another program has replaced the file since the last look: neither a new time alone shows it nor, as some file
 * systems make one for every look, a new number. */
static bool is_replaced(snapshot_file *f)
{
    struct stat const before = f->last;
    return before.st_ino && lstat(f->path, &f->last) == 0 && f->last.st_ino != before.st_ino &&
           (f->last.st_mtim.tv_sec != before.st_mtim.tv_sec ||
            f->last.st_mtim.tv_nsec != before.st_mtim.tv_nsec);
}

/* Whether the file is left to another program, until it has stayed as it is for some periods and is a snapshot. */
static bool is_left(snapshot_file *f, service *s)
{
    if (is_replaced(f)) {
        service_complain(s, "--snapshot %.160s: another program writes it, too; give each its own", f->path);
        f->left = SNAPSHOT_LEFT;
        f->own = false;
    } else if (f->left > 0 && is_replaceable(f->path))
        f->left--;
    return f->left > 0;
}

void snapshot_file_write(snapshot_file *f, service *s, bool at_once)
{
    int64_t const now = clock_monotonic();
    if (!f->path || (!at_once && now < f->due))
        return;
    f->due = now + f->period;
    if (is_left(f, s))
        return;
    if (!anyone(s)) {
        if (f->own && unlink(f->path) == 0)
            f->last.st_ino = 0;
        f->own = false;
        return;
    }
    size_t bytes = 0;
    unsigned char *const data = encode(s, &bytes);
    int const fault = data ? replace(f->path, data, bytes, &f->last) : ENOMEM;
    free(data);
    if (fault && !f->failed)
        log_line("--snapshot %.160s: cannot be written: %s", f->path, strerror(fault));
    f->failed = fault != 0;
    f->own = f->own || !fault;
}

/* ---- reading ---- */
/* The record at *at, which then is that of the next one; NULL: the file ends too early.  Otherwise the tracker's snapshot. */
static const unsigned char *next_record(const file_bytes *file, size_t *at, record *r)
{
    if (file->size - *at < sizeof *r)
        return NULL;
    memcpy(r, file->data + *at, sizeof *r);
    size_t const begin = *at + sizeof *r;
    if (r->bytes > file->size - begin)
        return NULL;
    *at = begin + (size_t)r->bytes;
    return file->data + begin;
}

/* Whether all records are there, and nothing else. */
static bool is_whole(const file_bytes *file, const head *h)
{
    size_t at = sizeof *h;
    record r;
    for (int32_t i = 0; i < h->people; i++)
        if (!next_record(file, &at, &r))
            return false;
    return at == file->size;
}

/* Whether the file may be used by this service as it is configured. */
static bool fits(const service *s, const file_bytes *file, head *h, message *why)
{
    if (file->size < sizeof *h)
        return message_set(why, "too short for a snapshot");
    memcpy(h, file->data, sizeof *h);
    if (memcmp(h->magic, MAGIC, sizeof MAGIC) != 0)
        return message_set(why, "not a snapshot of this version of gait-trackd");
    if (h->checksum != checksum_of(file->data, file->size))
        return message_set(why, "damaged, its checksum differs");
    if (!is_whole(file, h))
        return message_set(why, "shorter or longer than its lengths state");
    if (h->cameras != count_cameras(s))
        return message_set(why, "for another number of cameras");
    int64_t left = s->shared->max_pixels;
    for (int i = 0; i < h->cameras; i++) {
        if (h->stream[i] != stream_of(s, i))
            return message_set(why, "for --%s %d", i ? "further-streams" : "stream", (int)h->stream[i]);
        if (!camera_check(&h->camera[i], i || !s->shared->slot.fixed ? left : INT64_MAX, why))
            return false;
        left -= camera_pixels(&h->camera[i]);
    }
    return !s->shared->slot.known || camera_same(&h->camera[0], &s->shared->slot.camera) ||
           message_set(why, "for a camera other than --camera");
}

/* Make the trackers, unless --camera has done so.  Cameras of the file are those in use until others are announced. */
static bool set_cameras(service *s, const head *h, message *why)
{
    for (int i = 0; i < h->cameras; i++) {
        further_camera *const c = i ? &s->shared->further->camera[i - 1] : NULL;
        camera_slot *const slot = c ? &c->slot : &s->shared->slot;
        if (slot->known)
            continue;
        camera_use(slot, &h->camera[i]);
        slot->provisional = true;
        if (c && !further_allocate(c, why))
            return false;
        s->track.memory_bytes += c ? c->bytes : 0;
    }
    return s->track.tracker || service_make_trackers(s, why);
}

/* Continue with one person. */
static bool resume_person(service *s, const record *r, const unsigned char *state, message *why)
{
    gait_error err = {.text = ""};
    while (s && s->person != r->person)
        s = s->next;
    if (!s)
        return message_set(why, r->person ? "--people is less" : "it has no number, but people have");
    if (!clock_check(r->utime, why))
        return false;
    if (r->frame < -1 || r->steps < 0 || r->steps > INT64_MAX / 2)
        return message_set(why, "damaged record");
    if (gait_tracker_restore(s->track.tracker, state, (size_t)r->bytes, &err) != GAIT_OK)
        return message_set(why, "%s", err.text);
    service_resume(s, r->utime, r->frame, r->steps);
    return true;
}

/* Continue with the people of the file, and report each of them. */
static bool resume(const char *path, service *s, const file_bytes *file, message *why)
{
    head h;
    record r;
    size_t at = sizeof h;
    if (!fits(s, file, &h, why) || !set_cameras(s, &h, why))
        return false;
    for (int32_t i = 0; i < h.people; i++) {
        const unsigned char *const state = next_record(file, &at, &r);
        char who[32] = "the person";
        if (r.person)
            snprintf(who, sizeof who, "person %d", (int)r.person);
        if (resume_person(s, &r, state, why))
            log_line("--snapshot %.120s: %s of frame %" PRId64
                     ", captured %.1f s ago, is followed if the next "
                     "frame was captured at most %g s later; otherwise the search begins again",
                     path, who, r.frame, 1e-6 * (double)(clock_wall() - r.utime), s->shared->max_gap);
        else
            log_line("--snapshot %.120s: %s is not used: %.90s", path, who, why->text);
    }
    return true;
}

void snapshot_file_resume(snapshot_file *f, service *s)
{
    file_bytes file;
    message why;
    if (!f->path)
        return;
    f->due = clock_monotonic() + f->period; /* do not delay the first frame */
    if (lstat(f->path, &f->last) != 0) {
        f->last.st_ino = 0;
        return;
    }
    if (!file_read(f->path, "snapshot", SNAPSHOT_MOST, &file, &why)) {
        log_line("%s", why.text);
        return;
    }
    bool const used = resume(f->path, s, &file, &why);
    f->own = used && anyone(s);
    if (!used)
        log_line("--snapshot %.120s is not used: %.110s", f->path, why.text);
    free(file.data);
}
