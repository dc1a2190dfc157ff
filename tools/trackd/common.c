#include "common.h"

#include "gait.h"

#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

/* ---- messages and clocks ---- */
/* Bytes of the visible character that begins here, in UTF-8; 0: it is a control character, or none. */
static int visible(const char *text)
{
    const unsigned char *const c = (const unsigned char *)text;
    int const bytes = c[0] < 0x80   ? 1
                      : c[0] < 0xc2 ? 0
                      : c[0] < 0xe0 ? 2
                      : c[0] < 0xf0 ? 3
                      : c[0] < 0xf5 ? 4
                                    : 0;
    for (int i = 1; i < bytes; i++)
        if ((c[i] & 0xc0) != 0x80)
            return 0;
    bool const control = c[0] < ' ' || c[0] == 0x7f || (c[0] == 0xc2 && c[1] < 0xa0);
    bool const wrong = (c[0] == 0xe0 && c[1] < 0xa0) || (c[0] == 0xed && c[1] >= 0xa0) ||
                       (c[0] == 0xf0 && c[1] < 0x90) || (c[0] == 0xf4 && c[1] >= 0x90);
    return control || wrong ? 0 : bytes;
}

/* Copy `text` with everything else as \xNN, as much of it as fits. */
static void make_visible(char *out, size_t capacity, const char *text)
{
    size_t n = 0;
    while (*text) {
        int const bytes = visible(text);
        if (n + (bytes ? (size_t)bytes : 4) >= capacity)
            break;
        if (bytes)
            memcpy(out + n, text, (size_t)bytes);
        else
            snprintf(out + n, capacity - n, "\\x%02x", (unsigned char)*text);
        n += bytes ? (size_t)bytes : 4;
        text += bytes ? bytes : 1;
    }
    out[n] = '\0';
}

void message_format(message *m, const char *format, va_list args)
{
    message raw;
    vsnprintf(raw.text, sizeof raw.text, format, args);
    make_visible(m->text, sizeof m->text, raw.text);
}

bool message_set(message *m, const char *format, ...)
{
    va_list args;
    va_start(args, format);
    message_format(m, format, args);
    va_end(args);
    return false;
}

void log_line(const char *format, ...)
{
    char raw[1024], line[sizeof raw];
    va_list args;
    va_start(args, format);
    vsnprintf(raw, sizeof raw, format, args);
    va_end(args);
    make_visible(line, sizeof line, raw);
    fprintf(stderr, "gait-trackd: %s\n", line);
}

void log_event(const char *format, ...)
{
    enum { LINES_A_SECOND = 10, SECOND = 1000000 };
    static int64_t since = -SECOND;
    static int lines, suppressed;
    int64_t const now = clock_monotonic();
    message line;
    va_list args;
    if (now - since >= SECOND) {
        if (suppressed > 0)
            log_line("%d more lines suppressed", suppressed);
        since = now;
        lines = suppressed = 0;
    }
    if (lines == LINES_A_SECOND) {
        suppressed++;
        return;
    }
    lines++;
    va_start(args, format);
    message_format(&line, format, args);
    va_end(args);
    log_line("%s", line.text);
}

static int64_t clock_us(clockid_t clock)
{
    struct timespec t;
    clock_gettime(clock, &t);
    return (int64_t)t.tv_sec * 1000000 + t.tv_nsec / 1000;
}

int64_t clock_wall(void)
{
    return clock_us(CLOCK_REALTIME);
}

int64_t clock_monotonic(void)
{
    return clock_us(CLOCK_MONOTONIC);
}

bool clock_check(int64_t utime, message *why)
{
    return (utime >= 0 && utime <= INT64_MAX / 2) ||
           message_set(why, "time %" PRId64 " is out of range; send microseconds since 1970", utime);
}

/* ---- memory ---- */
void *aligned_memory(size_t bytes, const char *what, message *why)
{
    void *const memory = aligned_alloc(GAIT_ALIGN, (bytes + GAIT_ALIGN - 1) / GAIT_ALIGN * GAIT_ALIGN);
    if (!memory)
        message_set(why, "%.160s: not enough memory for %zu bytes", what, bytes);
    return memory;
}

/* ---- files ---- */
static bool read_stream(FILE *f, const char *path, const char *what, file_most most, file_bytes *out,
                        message *why)
{
    struct stat is;
    if (fstat(fileno(f), &is) != 0 || !S_ISREG(is.st_mode) || is.st_size > most)
        return message_set(why, "%s: not a regular file, or larger than %d MiB; give the name of a %s file",
                           path, most >> 20, what);
    size_t const size = (size_t)is.st_size;
    out->data = aligned_memory(size + 1, path, why);
    if (!out->data)
        return false;
    out->size = fread(out->data, 1, size, f);
    out->data[out->size] = '\0';
    if (out->size == size)
        return true;
    free(out->data);
    *out = (file_bytes){0};
    return message_set(why, "%s: cannot be read completely", path);
}

bool file_read(const char *path, const char *what, file_most most, file_bytes *out, message *why)
{
    *out = (file_bytes){0};
    int const file = open(path, O_RDONLY | O_NONBLOCK | O_CLOEXEC); /* a pipe would wait for its writer */
    FILE *const f = file >= 0 ? fdopen(file, "rb") : NULL;
    if (!f) {
        message_set(why, "%s: cannot open the %s file: %s", path, what, strerror(errno));
        if (file >= 0)
            close(file);
        return false;
    }
    bool const ok = read_stream(f, path, what, most, out, why);
    fclose(f);
    return ok;
}

/* ---- models ---- */
bool model_file_open(model_file *m, const char *path, message *why)
{
    gait_error err = {.text = ""};
    size_t bytes = 0;
    *m = (model_file){0};
    if (!file_read(path, "model", FILE_MOST, &m->blob, why))
        return false;
    gait_result status = gait_model_bytes(m->blob.data, m->blob.size, &bytes, &err);
    if (status == GAIT_OK) {
        m->memory = aligned_memory(bytes, path, why);
        if (!m->memory)
            return false;
        status = gait_model_init(m->memory, bytes, m->blob.data, m->blob.size, &m->model, &err);
    }
    m->bytes = m->blob.size + bytes;
    return status == GAIT_OK ||
           message_set(why, "%.100s: not a usable model: %s (%s); learn it again or give another", path,
                       err.text, gait_result_name(status));
}

void model_file_close(model_file *m)
{
    free(m->memory);
    free(m->blob.data);
    *m = (model_file){0};
}

/* ---- threads ---- */
bool workers_start(workers *w, int32_t threads, message *why)
{
    gait_error err = {.text = ""};
    *w = (workers){0};
    if (gait_pool_bytes(threads, &w->bytes, &err) != GAIT_OK)
        return message_set(why, "--threads %d: %s", (int)threads, err.text);
    w->memory = aligned_memory(w->bytes, "--threads", why);
    if (!w->memory)
        return false;
    if (gait_pool_init(w->memory, w->bytes, threads, &w->pool, &err) == GAIT_OK)
        return true;
    workers_stop(w);
    return message_set(why, "--threads %d: %s", (int)threads, err.text);
}

void workers_stop(workers *w)
{
    gait_pool_stop(w->pool);
    free(w->memory);
    *w = (workers){0};
}
