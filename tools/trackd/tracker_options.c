#include "tracker_options.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

typedef struct setting { /* a row of the table, and its words as an option */
    const char *name, *type, *unit, *meaning;
    size_t offset;
    double usual, paper, low, high;
} setting;

#define ROW(name, type, unit, meaning, usual, paper, low, high)                                              \
    {#name, #type, unit, meaning, offsetof(gait_tracker_config, name), (double)(usual), (double)(paper), low, high},
#define SETTING(meaning, type, name, array, unit, usual, low, high)                                          \
    ROW(name, type, unit, meaning, usual, usual, low, high)
#define PAPER(meaning, type, name, array, unit, usual, paper, low, high)                                     \
    ROW(name, type, unit, meaning, usual, paper, low, high)
#define FIELD(...)

static const setting SETTINGS[] = {GAIT_TRACKER_CONFIG_FIELDS(SETTING, PAPER, FIELD)};
enum { COUNT = sizeof SETTINGS / sizeof *SETTINGS };

static bool kind_of(const setting *s, option_kind *kind)
{
    if (strcmp(s->name, "seed") == 0)
        *kind = OPTION_U64;
    else if (strcmp(s->type, "float") == 0)
        *kind = OPTION_FLOAT;
    else if (strcmp(s->type, "int32_t") == 0 && strcmp(s->name, "cameras") != 0)
        *kind = OPTION_INT;
    else
        return false;
    return true;
}

/* "rejuvenation-time" */
static const char *option_name(const setting *s)
{
    static char names[COUNT][32];
    char *const name = names[s - SETTINGS];
    snprintf(name, sizeof names[0], "%s", s->name);
    for (char *c = name; *c; c++)
        *c = *c == '_' ? '-' : *c;
    return name;
}

/* Meaning, unit, default. */
static const char *option_help(const setting *s)
{
    static char helps[COUNT][256];
    char *const help = helps[s - SETTINGS];
    char paper[40] = "";
    if (s->paper != s->usual)
        snprintf(paper, sizeof paper, ", paper mode %g", s->paper);
    snprintf(help, sizeof helps[0], "%s\n        %s%sdefault %g%s", s->meaning, s->unit, *s->unit ? "; " : "", s->usual,
             paper);
    return help;
}

int tracker_options_table(gait_tracker_config *config, option *table)
{
    int count = 0;
    for (int i = 0; i < COUNT; i++) {
        const setting *const s = &SETTINGS[i];
        option_kind kind;
        if (kind_of(s, &kind))
            table[count++] = (option){.name = option_name(s),
                                      .letter = strcmp(s->name, "particles") == 0 ? 'n' : 0,
                                      .metavar = kind == OPTION_FLOAT ? "X" : "N",
                                      .help = option_help(s),
                                      .kind = kind,
                                      .value = (char *)config + s->offset,
                                      .low = s->low,
                                      .high = s->high};
    }
    return count;
}
