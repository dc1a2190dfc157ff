/* standalone.c - run a fuzz target without clang: fuzz_NAME [-runs=N] [-seed=S] [CORPUS...]
 * Runs every file of the folders once, by default of tests/fuzz/corpus/NAME, then N damaged copies of them.  libFuzzer,
 * which also records branches, takes the same arguments. */
#include "fuzz.h"

#include <dirent.h>
#include <stdio.h>

enum { CAP = 1 << 14, FILES = 1024 };

static struct input {
    size_t size;
    uint8_t *data;
} input[FILES];

/* xorshift64*: the same damage on every machine. */
static uint64_t draw(uint64_t *s)
{
    *s ^= *s >> 12;
    *s ^= *s << 25;
    *s ^= *s >> 27;
    return *s * UINT64_C(0x2545f4914f6cdd1d);
}

static int by_name(const struct dirent **a, const struct dirent **b)
{
    return strcmp((*a)->d_name, (*b)->d_name);
}

/* Add the files of a folder; returns how many there are now. */
static int read_folder(const char *folder, int count)
{
    struct dirent **entry;
    static uint8_t data[CAP];
    int const n = scandir(folder, &entry, NULL, by_name);
    for (int i = 0; i < n; i++) {
        char path[4096];
        snprintf(path, sizeof path, "%s/%s", folder, entry[i]->d_name);
        FILE *const f = entry[i]->d_name[0] != '.' && count < FILES ? fopen(path, "rb") : NULL;
        size_t const size = f ? fread(data, 1, CAP, f) : 0;
        if (f) {
            input[count++] = (struct input){size, memcpy(malloc(size + 1), data, size)};
            fclose(f);
        }
        free(entry[i]);
    }
    if (n >= 0)
        free(entry);
    return count;
}

/* One fault: a flipped bit, a random byte, an extreme word, a piece of another input, an extra byte, or a shorter input. */
static size_t damage(uint8_t *data, size_t size, const struct input *other, uint64_t *s)
{
    static const uint32_t nasty[] = {0,          1,          0x7fffffff, 0x80000000, 0xffffffff, 0x7f800000,
                                     0xff800000, 0x7fc00000, 0x7f7fffff, 0x00000001, 64,         0x10000};
    size_t const at = (size_t)(draw(s) % (size + 1));
    uint32_t const word = nasty[draw(s) % (sizeof nasty / sizeof *nasty)];
    size_t const piece = other->size ? (size_t)(draw(s) % other->size) : 0;
    switch (draw(s) % 8) {
    case 0:
    case 1:
        if (at < size)
            data[at] = (uint8_t)(data[at] ^ 1u << draw(s) % 8);
        return size;
    case 2:
    case 3:
        if (at < size)
            data[at] = (uint8_t)draw(s);
        return size;
    case 4:
        if (at + piece <= CAP)
            memcpy(data + at, other->data, piece);
        return at + piece > size && at + piece <= CAP ? at + piece : size;
    case 5:
        if (at < CAP)
            data[at] = (uint8_t)draw(s);
        return at == size && at < CAP ? size + 1 : size;
    case 6:
        return draw(s) % 8 ? size : at;
    default:
        if (at + 4 <= size)
            memcpy(data + at, &word, 4);
        return size;
    }
}

int main(int argc, char **argv)
{
    static uint8_t work[CAP];
    const char *const name = strrchr(argv[0], '/');
    long runs = 0;
    int count = 0;
    uint64_t state = 1;
    for (int i = 1; i < argc; i++)
        if (strncmp(argv[i], "-runs=", 6) == 0)
            runs = strtol(argv[i] + 6, NULL, 10);
        else if (strncmp(argv[i], "-seed=", 6) == 0)
            state = strtoull(argv[i] + 6, NULL, 10) * 2 + 1;
        else if (argv[i][0] != '-')
            count = read_folder(argv[i], count);
    if (count == 0) {
        char folder[4096];
        snprintf(folder, sizeof folder, "tests/fuzz/corpus/%s", name + sizeof "/fuzz_" - 1);
        count = read_folder(folder, 0);
    }
    for (int i = 0; i < count; i++)
        LLVMFuzzerTestOneInput(input[i].data, input[i].size);
    for (long i = 0; i < runs && count > 0; i++) {
        const struct input *const from = &input[draw(&state) % (uint64_t)count];
        size_t left = from->size;
        memcpy(work, from->data, left);
        for (uint64_t k = 1 + draw(&state) % 4; k > 0; k--)
            left = damage(work, left, &input[draw(&state) % (uint64_t)count], &state);
        uint8_t *const exact = fuzz_copy(work, left);
        LLVMFuzzerTestOneInput(exact, left);
        free(exact);
    }
    printf("%-28s %6ld passed, %d failed\n", name + 1, count + runs, count == 0);
    for (int i = 0; i < count; i++)
        free(input[i].data);
    return count == 0;
}
