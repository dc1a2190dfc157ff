/* toy_classes.h - the toy person walks, stands and walks backwards: a blob with three classes of motion.
 *
 *   const gait_model *m = toy_classes_model();
 *   size_t bytes = toy_classes_write(buf, &spec);     a blob by this specification */
#ifndef TOY_CLASSES_H
#define TOY_CLASSES_H
#include "toy_model.h"

enum { TOY_WALK, TOY_STAND, TOY_BACK, TOY_CLASSES, TOY_STILL_PHASES = 8 };

typedef struct toy_classes_spec {
    uint32_t classes, info_rows, change_rows;
    char name[TOY_CLASSES][32];
    int32_t info[TOY_CLASSES][4];
    float change[TOY_CLASSES][TOY_CLASSES][4];
    int curves;  /* 1: there is a section CUR1 */
    int of;      /* number in its tags */
    int partial; /* 1: section SCS1 is missing */
} toy_classes_spec;

static inline toy_classes_spec toy_classes_usual(void)
{
    return (toy_classes_spec){
        .classes = TOY_CLASSES,
        .info_rows = TOY_CLASSES,
        .change_rows = TOY_CLASSES,
        .name = {"walk", "stand", "backwards"},
        .info = {{1, 0, 20, 5}, {0, 1, 1, 1}, {-1, 0, 0, 0}},
        .change = {{{0}, {1.0f, 6.0f, 0.05f, 0}, {0.05f, 0, 0, 0}},
                   {{0.7f, 6.0f, 0.0f, 0}, {0}, {0.3f, 6.0f, 0.0f, 0}},
                   {{0.05f, 0, 0, 0}, {1.0f, 6.0f, 0.05f, 0}, {0}}},
        .curves = 1,
        .of = 1,
    };
}

/* Standing: the average walk on straight legs; a component bends the elbows. */
static inline void toy_put_standing(toy_file *f, int of, int partial)
{
    static float curve[2][TOY_STILL_PHASES][TOY_CHANNELS], stat[TOY_CHANNELS][4];
    static const float score[1][3] = {{1.0f, 1.0f, 0.0f}};
    static const float gait[8] = {0.92f, 0.07f, 0.0f, 0.0f, 0.0f, 120.0f, 1.72f, 0.09f};
    float average[TOY_CHANNELS] = {0}, v[TOY_CHANNELS];
    for (int j = 0; j < 32; j++) {
        toy_mean(j / 32.0, v);
        for (int i = 0; i < TOY_CHANNELS; i++)
            average[i] += v[i] / 32.0f;
    }
    for (int i = TOY_HIP; i < TOY_TORSO; i++)
        average[i] = 0.0f;
    average[TOY_ANKLE] = average[TOY_ANKLE + 1] = average[TOY_ROOT] = 0.0f;
    average[TOY_ROOT + 2] = (float)toy_leg_height(average, 0);
    for (int j = 0; j < TOY_STILL_PHASES; j++)
        for (int i = 0; i < TOY_CHANNELS; i++) {
            curve[0][j][i] = toy_round(average[i]);
            curve[1][j][i] = i == TOY_ELBOW || i == TOY_ELBOW + 1 ? 0.25f : 0.0f;
            stat[i][1] = stat[i][2] = curve[0][j][i];
            stat[i][3] = 0.1f;
        }
    char tag[4][5] = {"CUR0", "CHS0", "SCS0", "GAI0"};
    for (int k = 0; k < 4; k++)
        tag[k][3] = (char)('0' + of);
    toy_section(f, tag[0], 3, 3, 2, TOY_STILL_PHASES, TOY_CHANNELS, curve);
    toy_section(f, tag[1], 3, 2, TOY_CHANNELS, 4, 1, stat);
    if (!partial)
        toy_section(f, tag[2], 3, 2, 1, 3, 1, score);
    toy_section(f, tag[3], 3, 1, 8, 1, 1, gait);
}

static inline size_t toy_classes_write(unsigned char *buf, const toy_classes_spec *s)
{
    static float change[TOY_CLASSES * TOY_CLASSES][4];
    for (uint32_t i = 0; i < s->change_rows * s->change_rows; i++)
        memcpy(change[i], s->change[i / s->change_rows][i % s->change_rows], sizeof change[i]);
    toy_file f =
        toy_begin(buf, (uint32_t)(TOY_SECTIONS - 1 + 3 + (s->curves ? 4 : 0) - (s->curves && s->partial)));
    toy_put_curves(&f, TOY_PHASES, TOY_COMPONENTS);
    toy_put_skeleton(&f);
    toy_put_points(&f);
    toy_put_limbs(&f);
    toy_section(&f, "CLNM", 1, 2, s->classes, 32, 1, s->name);
    toy_section(&f, "CLIN", 2, 2, s->info_rows, 4, 1, s->info);
    toy_section(&f, "CLSW", 3, 3, s->change_rows, s->change_rows, 4, change);
    if (s->curves)
        toy_put_standing(&f, s->of, s->partial);
    return toy_finish(&f);
}

/* The model of a specification, in the given memory. */
static inline const gait_model *toy_classes_make(const toy_classes_spec *s, unsigned char *data, void *mem,
                                                 size_t mem_bytes)
{
    gait_model *model = NULL;
    gait_error err = {0};
    if (gait_model_init(mem, mem_bytes, data, toy_classes_write(data, s), &model, &err) != GAIT_OK) {
        fprintf(stderr, "toy classes refused: %s\n", err.text);
        abort();
    }
    return model;
}

static inline const gait_model *toy_classes_model(void)
{
    static _Alignas(GAIT_ALIGN) unsigned char data[TOY_BYTES], mem[4096];
    static const gait_model *model;
    toy_classes_spec const usual = toy_classes_usual();
    if (!model)
        model = toy_classes_make(&usual, data, mem, sizeof mem);
    return model;
}
#endif
