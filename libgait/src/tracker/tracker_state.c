#include "tracker/tracker_state.h"
#include "filter/rejuvenation.h"
#include "likelihood/likelihood.h"
#include <stddef.h>
#include <string.h>

/* ---- layout ---- */
static void layout_history(particle_history *h, arena *a, int32_t lag, int32_t n, int32_t fields,
                           bool classes)
{
    h->depth = lag + 1;
    h->capacity = n;
    h->fields = fields;
    h->record = TAKE(a, generation_record, h->depth);
    h->count = TAKE(a, int32_t, h->depth);
    h->value = TAKE(a, float, (size_t)h->depth *(size_t)fields *(size_t)n);
    h->parent = TAKE(a, int32_t, (size_t)h->depth *(size_t)n);
    h->strata = classes ? TAKE(a, strata, h->depth) : NULL;
}

/* In paper mode the first class is the only one. */
static bool several_classes(const gait_model *m, const gait_tracker_config *cfg)
{
    return m->classes > 1 && cfg->mode != GAIT_MODE_PAPER;
}

/* The mutable state, first and without gaps: it is saved, restored and hashed as one block. */
static void layout_state(arena *a, gait_tracker *t)
{
    int32_t const n = t->cfg.particles, cameras = t->cfg.cameras;
    size_t const samples = (size_t)t->model->limbs * LIKE_SAMPLES;
    t->core = TAKE(a, tracker_core, 1);
    t->filter = pf_layout(a, n);
    if (uses_texture(&t->cfg))
        t->texture = TAKE(a, like_patch, (size_t)n * (size_t)(cameras * t->model->limbs));
    for (int32_t c = 0; c < 2 * cameras && uses_texture(&t->cfg); c++)
        t->template[c / cameras][c % cameras] = TAKE(a, int16_t, samples);
    bool const classes = several_classes(t->model, &t->cfg);
    layout_history(&t->history, a, t->cfg.lag, n, state_layout_fields(&t->layout), classes);
    t->classes = classes ? TAKE(a, class_state, 1) : NULL;
    if (t->cfg.mode == GAIT_MODE_PAPER && uses_texture(&t->cfg)) {
        t->walk_check = TAKE(a, walk_check, 1);
        t->walk_check_patch = TAKE(a, like_patch, (size_t)cameras * (size_t)t->model->limbs);
    }
    t->state_end = TAKE(a, unsigned char, 1);
}

static const arena COUNT = {.cap = SIZE_MAX, .solid = true};

/* Arenas that have counted: place them all in the same memory. */
static void share(arena *a, arena *const *all, int32_t n)
{
    size_t bytes = 0;
    for (int32_t k = 0; k < n; k++)
        bytes = all[k]->used > bytes ? all[k]->used : bytes;
    unsigned char *const memory = TAKE(a, unsigned char, bytes);
    for (int32_t k = 0; k < n; k++)
        *all[k] = (arena){.base = memory, .cap = bytes, .solid = true};
}

/* Place one task's arrays; w NULL: only count. */
static void layout_likelihood_scratch(arena *a, const gait_model *m, likelihood_scratch *w)
{
    size_t const limbs = (size_t)m->limbs;
    void *const outline = arena_take(a, sizeof(outline_lanes), limbs);
    void *const lines = arena_take(a, offsetof(layers_block, limb) + limbs * sizeof(layers_limb), 1);
    void *const sides = arena_take(a, sizeof(like_sides), limbs);
    void *const pose = arena_take(a, sizeof(like_pose_limb), limbs);
    void *const drawn = arena_take(a, offsetof(layers, visible) + limbs * sizeof(grid_mask), 1);
    void *const points = arena_take(a, sizeof *w->points, (size_t)m->points);
    void *const home = arena_take(a, sizeof *w->home, (size_t)(m->frames + m->points));
    if (!w)
        return;
    w->outline = outline;
    w->lines = lines;
    w->sides = sides;
    w->pose = pose;
    w->layers = drawn;
    w->points = points;
    w->home = home;
}

static void layout_lag(arena *a, gait_tracker *t)
{
    if (t->cfg.lag == 0)
        return;
    t->lag.ancestor = TAKE(a, int32_t, t->capacity);
    t->lag.weight = TAKE(a, double, t->capacity);
}

/* With so many particles at once an estimate computes their joints anew, which makes a step some per cent longer; but all
 * joints of a tracker of many particles, for which there is memory, are kept from the likelihood step. */
enum { JOINTS_AT_ONCE = 512, MANY_PARTICLES = 4096 }; /* multiples of SUM_LANES */

static void layout_joints(arena *a, gait_tracker *t)
{
    t->joints.most = t->capacity > MANY_PARTICLES ? t->capacity : i_min(t->capacity, JOINTS_AT_ONCE);
    size_t const numbers = 3 * (size_t)t->model->points;
    t->joints.sum = (double (*)[3][SUM_LANES])arena_take(a, sizeof *t->joints.sum, numbers);
    t->joints.value = TAKE(a, float, numbers *(size_t)t->joints.most);
}

/* Without threads there is one task.  The lagged estimate runs between steps, in the scratch of the tasks but the first. */
static void layout_tasks(arena *a, gait_tracker *t, int32_t tasks)
{
    arena lag = COUNT, others = COUNT;
    layout_lag(&lag, t);
    for (int32_t k = 1; k < tasks; k++)
        layout_likelihood_scratch(&others, t->model, NULL);
    layout_joints(a, t);
    layout_likelihood_scratch(a, t->model, t->work);
    share(a, (arena *[]){&lag, &others}, 2);
    layout_lag(&lag, t);
    for (int32_t k = 1; k < tasks; k++)
        layout_likelihood_scratch(&others, t->model, t->work ? t->work + k : NULL);
}

static float *layout_rows(arena *a, const gait_tracker *t)
{
    int32_t const stride = rejuvenation_stride(state_layout_fields(&t->layout));
    return TAKE(a, float, (size_t)t->cfg.particles *(size_t)stride);
}

/* One block of memory serves in turn the rows for rejuvenation, the resampled planes of a frame, and the tasks. */
static void layout_scratch(arena *a, gait_tracker *t)
{
    int32_t const n = t->cfg.exec.run ? t->cfg.tasks : 1;
    arena rows = COUNT, planes = COUNT, tasks = COUNT;
    t->work = NULL;
    layout_rows(&rows, t);
    features_scratch_layout(&planes);
    layout_tasks(&tasks, t, n);
    t->work = TAKE(a, likelihood_scratch, n);
    share(a, (arena *[]){&rows, &planes, &tasks}, 3);
    t->rows = layout_rows(&rows, t);
    t->planes = features_scratch_layout(&planes);
    layout_tasks(&tasks, t, n);
}

static void layout_logliks(arena *a, gait_tracker *t)
{
    int32_t const n = t->cfg.particles;
    t->loglik_raw = t->lag.column[0] = TAKE(a, float, n);
    t->loglik = t->lag.column[1] = TAKE(a, float, n);
    t->loglik_without_silhouette = t->lag.column[2] = TAKE(a, float, n);
}

static void layout_work(arena *a, gait_tracker *t)
{
    int32_t const cameras = t->cfg.cameras;
    size_t const limbs = (size_t)t->model->limbs;
    for (int32_t c = 0; c < cameras; c++) {
        t->camera[c].features = features_layout(a);
        if (t->cfg.terms & GAIT_TERM_SILHOUETTE)
            t->camera[c].plate = view_planes_layout(a, 3);
    }
    t->like = arena_take(a, offsetof(like_setup, surface) + limbs * sizeof(like_surface), 1);
    layout_logliks(a, t);
    t->layouts = TAKE(a, state_layout, t->model->classes);
    t->mirror = TAKE(a, mirror, t->model->classes);
    t->next = TAKE(a, strata, 1);
    t->dominant = TAKE(a, uint8_t, t->cfg.particles);
    if (uses_texture(&t->cfg))
        t->estimate_patch = TAKE(a, like_patch, (size_t)cameras * limbs);
    for (int32_t c = 0; c < 2 * cameras && uses_texture(&t->cfg); c++)
        t->template_ring[c / cameras][c % cameras] = TAKE(a, int8_t, LIKE_RING *limbs);
    layout_scratch(a, t);
}

/* Two hypotheses need twice the particles of one, and so does an open phase. */
static int32_t acquisition_count(const gait_tracker *t)
{
    int32_t const target = t->target_particles, twice = target > INT32_MAX / 2 ? target : 2 * target;
    return i_max(target, i_min(twice, t->cfg.acquisition_particles));
}

/* Particles of all classes together if one class needs `one`: whole blocks of each class in each of two hypotheses. */
static int32_t of_all_classes(const gait_tracker *t, int32_t one)
{
    int32_t const classes = t->model->classes, unit = 2 * BLOCK;
    if (!several_classes(t->model, &t->cfg))
        return one;
    return i_max((one + (classes - 1) * (one / CLASS_SHARE) + unit - 1) / unit, classes) * unit;
}

gait_tracker *tracker_layout(arena *a, const gait_model *m, const gait_tracker_config *cfg,
                             const kernels *run)
{
    gait_tracker *const self = TAKE(a, gait_tracker, 1);
    gait_tracker t = {
        .model = m, .cfg = *cfg, .config_particles = cfg->particles, .target_particles = cfg->particles};
    t.cfg.particles = t.capacity = of_all_classes(&t, acquisition_count(&t));
    t.layout = state_layout_init(m, &t.cfg, run);
    t.cfg.components = t.layout.components;
    t.cfg.proportions = t.layout.proportions;
    memcpy(t.home, cfg->camera, sizeof t.home);
    a->solid = true;
    layout_state(a, &t);
    a->solid = false;
    layout_work(a, &t);
    if (!self)
        return NULL;
    like_setup_init(t.like, m, &t.cfg, run);
    for (int32_t c = 0; c < m->classes; c++) {
        t.layouts[c] = c ? state_layout_of_class(&t.layout, c) : t.layout;
        mirror_init(&t.mirror[c], &t.layouts[c]);
    }
    *self = t;
    return self;
}

/* ---- particles in use ---- */
int32_t stratum_at(const strata *s, int32_t particle)
{
    int32_t k = 0;
    while (particle >= s->first[k + 1])
        k++;
    return k;
}

int32_t class_at(const gait_tracker *t, int32_t particle)
{
    return t->classes ? tracker_strata(t)->motion_class[stratum_at(tracker_strata(t), particle)] : 0;
}

const state_layout *layout_at(const gait_tracker *t, int32_t particle)
{
    return &t->layouts[class_at(t, particle)];
}

particle_set history_particles(const particle_history *h, int32_t slot)
{
    return (particle_set){.n = h->count[slot],
                          .fields = h->fields,
                          .value = h->value + (size_t)slot * (size_t)h->fields * (size_t)h->capacity};
}

int32_t tracker_count(const gait_tracker *t)
{
    bool const more = t->core->hypotheses.stage == HYPOTHESES_ACQUISITION;
    return of_all_classes(t, more ? acquisition_count(t) : t->target_particles);
}

void tracker_set_count(gait_tracker *t, int32_t particles)
{
    t->cfg.particles = t->filter.n = particles;
    t->history.count[t->core->generation] = particles;
    t->particles = history_particles(&t->history, t->core->generation);
    t->core->below_capacity = t->capacity - particles;
}

void tracker_set_target(gait_tracker *t, int32_t particles)
{
    t->target_particles = particles;
    t->core->below_config = t->config_particles - particles;
}

void tracker_even_weights(gait_tracker *t)
{
    pf_uniform(&t->filter);
    pf_keep(&t->filter);
    t->core->ess = (double)t->filter.n;
}

void tracker_clear(gait_tracker *t)
{
    memset(t->core, 0, (size_t)(t->state_end - (unsigned char *)t->core));
    tracker_set_target(t, t->target_particles);
    tracker_set_count(t, tracker_count(t));
    for (int32_t c = 0; c < t->cfg.cameras; c++) {
        t->camera[c].plate_stale = true;
        for (int32_t h = 0; h < 2 && t->template[h][c]; h++)
            template_clear(t->template[h][c], t->model->limbs);
    }
    tracker_even_weights(t);
}

dynamics tracker_dynamics(const gait_tracker *t, int32_t motion_class)
{
    return (dynamics){.cfg = &t->cfg,
                      .rule = t->layouts[motion_class],
                      .seed = t->cfg.seed,
                      .stature_sd_ratio = t->core->stature_sd_ratio};
}
