/* fault_layer.c - loaded under a program by LD_PRELOAD: lets call number GAIT_FAULT_AT of GAIT_FAULT (malloc, fwrite or
 * fsync) fail once, and then makes the file GAIT_FAULT_DONE; or, by GAIT_FAULT=clock, lets the wall clock jump to and fro by
 * a day; or, by GAIT_FAULT=order, writes there a letter for each call on a file: w: fwrite, s: fsync of all that was
 * written, ! of less, D: fsync of a folder.  Memory: only calls of the program itself count, not those of its libraries. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <link.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

static uintptr_t first, last; /* of the program's own code */
static int fault_at, called;
static const char *fault;

static int find_program(struct dl_phdr_info *info, size_t size, void *unused)
{
    (void)size, (void)unused;
    for (int i = 0; i < info->dlpi_phnum; i++)
        if (info->dlpi_phdr[i].p_type == PT_LOAD && info->dlpi_phdr[i].p_flags & PF_X) {
            first = info->dlpi_addr + info->dlpi_phdr[i].p_vaddr;
            last = first + info->dlpi_phdr[i].p_memsz;
        }
    return 1; /* the program comes first */
}

__attribute__((constructor)) static void start(void)
{
    const char *const at = getenv("GAIT_FAULT_AT");
    dl_iterate_phdr(find_program, NULL);
    fault_at = at ? atoi(at) : 0;
    fault = getenv("GAIT_FAULT");
}

static int fails(const char *what, int number)
{
    if (!fault || strcmp(fault, what) != 0 || ++called != fault_at)
        return 0;
    close(open(getenv("GAIT_FAULT_DONE"), O_WRONLY | O_CREAT, 0600));
    errno = number;
    return 1;
}

static size_t written; /* bytes */

static void record(char call)
{
    if (!fault || strcmp(fault, "order") != 0)
        return;
    int const done = open(getenv("GAIT_FAULT_DONE"), O_WRONLY | O_CREAT | O_APPEND, 0600);
    if (write(done, &call, 1) != 1)
        abort();
    close(done);
}

static char kind_of_fsync(int file)
{
    struct stat is;
    return fstat(file, &is) != 0 ? '?' : S_ISDIR(is.st_mode) ? 'D' : (size_t)is.st_size < written ? '!' : 's';
}

static int is_own(const void *caller)
{
    return (uintptr_t)caller >= first && (uintptr_t)caller < last;
}

#define NEXT(name) (*(void **)&next = dlsym(RTLD_NEXT, name))

void *malloc(size_t bytes)
{
    static void *(*next)(size_t);
    if (!next)
        NEXT("malloc");
    return is_own(__builtin_return_address(0)) && fails("malloc", ENOMEM) ? NULL : next(bytes);
}

void *aligned_alloc(size_t align, size_t bytes)
{
    static void *(*next)(size_t, size_t);
    if (!next)
        NEXT("aligned_alloc");
    return is_own(__builtin_return_address(0)) && fails("malloc", ENOMEM) ? NULL : next(align, bytes);
}

size_t fwrite(const void *data, size_t size, size_t count, FILE *f)
{
    static size_t (*next)(const void *, size_t, size_t, FILE *);
    if (!next)
        NEXT("fwrite");
    if (f == stdout || f == stderr)
        return next(data, size, count, f);
    written += size * count;
    record('w');
    return fails("fwrite", EIO) ? 0 : next(data, size, count, f);
}

int fsync(int file)
{
    static int (*next)(int);
    if (!next)
        NEXT("fsync");
    record(kind_of_fsync(file));
    return fails("fsync", EIO) ? -1 : next(file);
}

int clock_gettime(clockid_t clock, struct timespec *t)
{
    static int (*next)(clockid_t, struct timespec *);
    static int back;
    if (!next)
        NEXT("clock_gettime");
    int const answer = next(clock, t);
    if (clock == CLOCK_REALTIME && fault && strcmp(fault, "clock") == 0)
        t->tv_sec += (back = !back) ? -86400 : 86400;
    return answer;
}
