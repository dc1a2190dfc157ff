#include "snapshot_file.h"

#include "options.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

/* Header of the file; the tracker's snapshot follows.  Only a daemon on the same machine and with the same version
 * of the library reads it. */
typedef struct head {
    char magic[8];
    gait_camera camera;
    int32_t stream;
    int64_t utime, frame; /* of the last frame tracked */
} head;

static const char MAGIC[8] = "GAITTRD1";

/* ---- writing ---- */
/* The whole file in allocated memory; NULL: there is not enough. */
static unsigned char *encode(const service *s, size_t *bytes)
{
    head h = {.stream = s->stream, .utime = s->last_utime, .frame = s->last_frame};
    size_t state = 0;
    if (gait_tracker_save(s->track.tracker, NULL, 0, &state, NULL) != GAIT_OK)
        return NULL;
    unsigned char *const out = malloc(sizeof h + state);
    memcpy(h.magic, MAGIC, sizeof MAGIC);
    h.camera = s->track.config.camera[0];
    *bytes = sizeof h + state;
    if (!out || gait_tracker_save(s->track.tracker, out + sizeof h, state, &state, NULL) != GAIT_OK) {
        free(out);
        return NULL;
    }
    memcpy(out, &h, sizeof h);
    return out;
}

static bool write_all(int file, const unsigned char *data, size_t bytes)
{
    while (bytes > 0) {
        ssize_t const done = write(file, data, bytes);
        if (done < 0 && errno == EINTR)
            continue;
        if (done <= 0)
            return false;
        data += done;
        bytes -= (size_t)done;
    }
    return true;
}

/* Open the folder of a file; -1: it cannot be opened. */
static int open_folder(const char *path)
{
    char folder[OPTION_TEXT];
    const char *const slash = strrchr(path, '/');
    snprintf(folder, sizeof folder, "%.*s", slash ? (int)(slash - path + 1) : 1, slash ? path : ".");
    return open(folder, O_RDONLY | O_DIRECTORY | O_CLOEXEC);
}

/* Write beside the file, then rename; returns 0 or an errno.  After a loss of power the old or the new file is there,
 * complete. */
static int replace(const char *path, const unsigned char *data, size_t bytes)
{
    char beside[OPTION_TEXT + 16];
    snprintf(beside, sizeof beside, "%s.%d", path, (int)getpid());
    unlink(beside); /* left by a process that was killed and had this number */
    int const file = open(beside, O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0600);
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
    int const folder = open_folder(path);
    if (folder < 0 || (fsync(folder) != 0 && errno != EINVAL))
        fault = errno;
    if (folder >= 0)
        close(folder);
    return fault;
}

/* Remove what daemons that were killed while they wrote left beside the file. */
static void sweep(const char *path)
{
    const char *const slash = strrchr(path, '/'), *const name = slash ? slash + 1 : path;
    size_t const n = strlen(name);
    int const folder = open_folder(path);
    DIR *const list = folder < 0 ? NULL : fdopendir(folder);
    for (struct dirent *e; list && (e = readdir(list));) {
        char *end = e->d_name;
        long const writer =
            strncmp(e->d_name, name, n) == 0 && e->d_name[n] == '.' ? strtol(e->d_name + n + 1, &end, 10) : 0;
        if (writer > 0 && *end == '\0' && kill((pid_t)writer, 0) != 0 && errno == ESRCH)
            unlinkat(folder, e->d_name, 0);
    }
    if (list)
        closedir(list);
    else if (folder >= 0)
        close(folder);
}

void snapshot_file_write(snapshot_file *f, const service *s, bool at_once)
{
    int64_t const now = clock_monotonic();
    if (!f->path || (!at_once && now < f->due))
        return;
    f->due = now + f->period;
    if (s->state != GAITMSG_STATUS_T_RUNNING) {
        unlink(f->path);
        return;
    }
    size_t bytes = 0;
    unsigned char *const data = encode(s, &bytes);
    int const fault = data ? replace(f->path, data, bytes) : ENOMEM;
    free(data);
    if (fault && !f->failed)
        log_line("--snapshot %.160s: cannot be written: %s", f->path, strerror(fault));
    f->failed = fault != 0;
}

/* ---- reading ---- */
/* Whether the file may be used by this service as it is configured. */
static bool fits(const service *s, const file_bytes *file, head *h, message *why)
{
    if (file->size < sizeof *h)
        return message_set(why, "too short for a snapshot");
    memcpy(h, file->data, sizeof *h);
    if (memcmp(h->magic, MAGIC, sizeof MAGIC) != 0)
        return message_set(why, "not a snapshot of gait-trackd");
    if (h->stream != s->stream)
        return message_set(why, "for --stream %d", (int)h->stream);
    if (s->camera_fixed && !camera_same(&h->camera, &s->track.config.camera[0]))
        return message_set(why, "for a camera other than --camera");
    return camera_check(&h->camera, s->max_pixels, why);
}

static bool resume(service *s, const file_bytes *file, message *why)
{
    head h;
    gait_error err = {.text = ""};
    if (!fits(s, file, &h, why) || (!s->track.tracker && !service_set_camera(s, &h.camera, why)))
        return false;
    if (gait_tracker_restore(s->track.tracker, file->data + sizeof h, file->size - sizeof h, &err) != GAIT_OK)
        return message_set(why, "%s", err.text);
    service_resume(s, h.utime, h.frame);
    return true;
}

void snapshot_file_resume(const snapshot_file *f, service *s)
{
    file_bytes file;
    message why;
    if (!f->path)
        return;
    sweep(f->path);
    if (access(f->path, F_OK) != 0)
        return;
    if (!file_read(f->path, "snapshot", &file, &why)) {
        log_line("%s", why.text);
        return;
    }
    if (resume(s, &file, &why))
        log_line("--snapshot %.160s: following the person of frame %" PRId64, f->path, s->last_frame);
    else
        log_line("--snapshot %.120s is not used: %.110s", f->path, why.text);
    free(file.data);
}
