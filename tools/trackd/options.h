/* options.h - one table serves the command line, the configuration file and --help. */
#ifndef TRACKD_OPTIONS_H
#define TRACKD_OPTIONS_H
#include "common.h"

#include <stddef.h>

enum { OPTION_TEXT = 1024, OPTIONS_MOST = 128 };

typedef enum option_kind {
    OPTION_FLAG,    /* bool */
    OPTION_TEXTUAL, /* char[OPTION_TEXT] */
    OPTION_INT,     /* int32_t in [low, high] */
    OPTION_U64,     /* uint64_t */
    OPTION_FLOAT,   /* float in [low, high] */
    OPTION_DOUBLE   /* double in [low, high] */
} option_kind;

typedef struct option {
    const char *name; /* "seed": --seed N, --seed=N, or a line seed = N of the file */
    char letter;      /* 'm': -m FILE; 0: none */
    const char *metavar, *help;
    option_kind kind;
    void *value;
    double low, high;
} option;

typedef enum option_result { OPTION_OK, OPTION_HELP, OPTION_BAD } option_result;

/* Set values from argv[1..]. */
option_result options_parse(const option *table, int count, int argc, char **argv, message *why);
/* Set values from lines `name = value` of TOML, each name once: a string in plain quotes without escapes, true or false, a
 * decimal number without underscores; # starts a comment.  The file may not set `config` and `version`. */
bool options_file(const option *table, int count, const char *path, message *why);
/* One paragraph per option to stdout. */
void options_help(const option *table, int count);
#endif
