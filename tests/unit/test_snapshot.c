/* Saving and restoring: the tracker continues identically, and only an undamaged snapshot is accepted. */
#include "tracker/tracker.h"

#include "toy_classes.h"
#include "toy_film.h"

#include "check.h"

enum { SHOTS = 24, SAVE_AT = 10 };

static gait_tracker_config small(int32_t cameras)
{
    gait_tracker_config cfg = toy_config(cameras);
    cfg.particles = 16;
    return cfg;
}

static unsigned char *save(const gait_tracker *t, size_t *bytes)
{
    CHECK(gait_tracker_save(t, NULL, 0, bytes, NULL) == GAIT_OK);
    unsigned char *const mem = malloc(*bytes);
    size_t again = 0;
    if (!mem)
        abort();
    CHECK(gait_tracker_save(t, mem, *bytes - 1, &again, NULL) == GAIT_ERR_MEMORY && again == 0);
    CHECK(gait_tracker_save(t, mem, *bytes, &again, NULL) == GAIT_OK && again == *bytes);
    return mem;
}

/* An executor that runs all tasks in the calling thread, like the library itself. */
static void run_here(void *user, gait_task_fn *fn, void *ctx, int32_t count)
{
    (void)user;
    for (int32_t i = 0; i < count; i++)
        fn(ctx, i);
}

/* Saved in the middle, restored into the same tracker, into a new one, or at another address: all end alike. */
static void test_continue(void)
{
    gait_tracker_config cfg = toy_config(2);
    cfg.particles = 100;
    gait_tracker *const t = film_tracker(&cfg, 0, 1.0f);
    gait_estimate e, last;
    size_t bytes = 0;
    unsigned char *kept = NULL;
    for (int n = 0; n < SHOTS; n++) {
        if (n == SAVE_AT)
            kept = save(t, &bytes);
        film_step(t, 2, n, n == SAVE_AT - 1 ? 2u : 0u, &last); /* a camera has just missed a frame */
    }
    uint64_t const digest = gait_tracker_digest(t);
    for (int k = 0; k < 3; k++) {
        gait_tracker_config other = cfg;
        other.tasks = 1 + 7 * k; /* neither of these matters */
        other.exec.run = k ? run_here : NULL;
        memset(&other.camera[3], 0x77, sizeof other.camera[3]); /* not in use */
        gait_tracker *const u = k ? film_tracker(&other, 5, 0.2f) : t;
        unsigned char *const shifted = malloc(bytes + 1);
        if (!shifted)
            abort();
        memcpy(shifted + 1, kept, bytes);
        CHECK(gait_tracker_restore(u, k == 2 ? shifted + 1 : kept, bytes, NULL) == GAIT_OK);
        size_t again;
        unsigned char *const copy = save(u, &again);
        CHECK(again == bytes && memcmp(copy, kept, bytes) == 0);
        for (int n = SAVE_AT; n < SHOTS; n++)
            film_step(u, 2, n, 0, &e);
        CHECK(gait_tracker_digest(u) == digest && memcmp(&e, &last, sizeof e) == 0);
        free(shifted);
        free(copy);
        if (k)
            toy_tracker_free(u);
    }
    free(kept);
    toy_tracker_free(t);
}

/* Every state has its own digest, and reading it changes nothing. */
static void test_digest(void)
{
    gait_tracker_config cfg = small(1);
    gait_tracker *const t = film_tracker(&cfg, 0, 1.0f);
    uint64_t digest[8];
    for (int n = 0; n < 8; n++) {
        gait_estimate e;
        film_step(t, 1, n, 0, &e);
        digest[n] = gait_tracker_digest(t);
        CHECK(gait_tracker_digest(t) == digest[n]);
        for (int k = 0; k < n; k++)
            CHECK(digest[k] != digest[n]);
    }
    toy_tracker_free(t);
}

static gait_tracker *target;
static uint64_t target_digest;

/* Check that a snapshot is refused with a reason, and that the tracker is unchanged. */
static void refuse(const unsigned char *mem, size_t bytes, gait_result want)
{
    gait_error err = {0};
    gait_result const s = gait_tracker_restore(target, mem, bytes, &err);
    CHECK((want == GAIT_OK ? s < 0 : s == want) && err.result == s && err.text[0]);
    CHECK(gait_tracker_digest(target) == target_digest);
}

/* Every byte flipped, every length: none is accepted.  Each copy ends where it ends, for the sanitizer. */
static void test_damage(void)
{
    gait_tracker_config cfg = small(1);
    gait_tracker *const t = film_tracker(&cfg, 0, 1.0f);
    gait_estimate e;
    size_t bytes = 0;
    for (int n = 0; n < 3; n++)
        film_step(t, 1, n, 0, &e);
    unsigned char *const kept = save(t, &bytes);
    target = film_tracker(&cfg, 7, 0.3f);
    target_digest = gait_tracker_digest(target);
    size_t const step = bytes > 8192 ? bytes / 2048 : 1;
    for (size_t i = 0; i < bytes; i += i < 512 ? 1 : step) { /* all of the header, samples of the state */
        kept[i] ^= (unsigned char)(1u << i % 8);
        refuse(kept, bytes, GAIT_OK);
        kept[i] ^= (unsigned char)(1u << i % 8);
    }
    for (size_t length = 0; length < bytes; length += length < 512 ? 1 : step) {
        unsigned char *const cut = malloc(length ? length : 1);
        if (!cut)
            abort();
        memcpy(cut, kept, length);
        refuse(cut, length, GAIT_OK);
        free(cut);
    }
    unsigned char *const longer = malloc(bytes + 64);
    if (!longer)
        abort();
    memcpy(longer, kept, bytes);
    memset(longer + bytes, 0, 64);
    refuse(longer, bytes + 64, GAIT_ERR_CORRUPT);
    free(longer);
    kept[0] ^= 1;
    refuse(kept, bytes, GAIT_ERR_MAGIC);
    kept[0] ^= 1;
    kept[7]--; /* an older format of the same length, from a build with the same version */
    refuse(kept, bytes, GAIT_ERR_VERSION);
    kept[7]++;
    CHECK(gait_tracker_restore(target, kept, bytes, NULL) == GAIT_OK); /* undamaged it is taken */
    CHECK(gait_tracker_digest(target) == gait_tracker_digest(t));
    toy_tracker_free(target);
    toy_tracker_free(t);
    free(kept);
}

/* Set one number to a value that no tracker reaches, with a correct checksum, check that it is refused, and restore it. */
static void spoil(gait_tracker *t, void *field, const void *bad, size_t size)
{
    unsigned char good[8];
    size_t bytes = 0;
    memcpy(good, field, size);
    memcpy(field, bad, size);
    unsigned char *const kept = save(t, &bytes);
    refuse(kept, bytes, GAIT_ERR_CORRUPT);
    free(kept);
    memcpy(field, good, size);
}

#define SPOIL(field, type, ...)                                                                              \
    do {                                                                                                     \
        type const bad[] = {__VA_ARGS__};                                                                    \
        for (size_t b = 0; b < sizeof bad / sizeof *bad; b++)                                                \
            spoil(t, &(field), &bad[b], sizeof bad[b]);                                                      \
    } while (0)
#define NOT_FINITE NAN, INFINITY, -INFINITY
#define TOO_LARGE  NOT_FINITE, 1.1e6f, -3.4e38f

/* Every number of the state in turn; of times and counts also those whose differences would overflow. */
static void test_implausible(gait_tracker *t)
{
    tracker_core *const c = t->core;
    hypotheses_state *const h = &c->hypotheses;
    generation_record *const record = &t->history.record[c->generation];
    int64_t const now = c->utime;
    SPOIL(c->generation, int32_t, -1, t->history.depth);
    SPOIL(c->started, int32_t, -1, 2);
    SPOIL(c->ess, double, NAN, -1.0, 1e9);
    SPOIL(c->below_capacity, int32_t, -1, t->capacity);
    SPOIL(c->below_config, int32_t, -1, t->config_particles);
    SPOIL(h->stage, int32_t, HYPOTHESES_ONE - 1, HYPOTHESES_TWO + 1);
    SPOIL(h->left_right_known, int32_t, -1, 2);
    SPOIL(h->phase_known, int32_t, -1, 2);
    SPOIL(h->agreed, int32_t, -1, 2);
    SPOIL(h->since, int64_t, INT64_MIN, now + 1);
    SPOIL(h->log_odds, double, NOT_FINITE);
    SPOIL(h->recent_log_ratio, double, NOT_FINITE);
    SPOIL(c->start_utime, int64_t, INT64_MIN, now + 1);
    SPOIL(c->utime, int64_t, INT64_MAX, c->start_utime - 1);
    SPOIL(c->frame, uint64_t, UINT64_MAX);
    SPOIL(c->support_utime, int64_t, INT64_MIN, now + 1);
    SPOIL(c->rejuvenation_utime, int64_t, INT64_MIN, now + 1);
    SPOIL(c->usual_unexplained, float, NAN, -1.0f, 2e9f);
    SPOIL(c->stature_sd_ratio, float, NAN, INFINITY, -0.1f);
    SPOIL(c->front_back_margin, float, NOT_FINITE);
    SPOIL(c->left_right_margin, float, NOT_FINITE, 4.6f, -4.6f);
    SPOIL(c->fit_margin, float, NOT_FINITE);
    SPOIL(c->map[0].scale, float, NAN, -1.0f, 3.0f);
    SPOIL(c->map[0].u0, float, TOO_LARGE);
    SPOIL(c->map[0].v0, float, TOO_LARGE);
    SPOIL(t->filter.weight[3], double, NAN, -1.0, 0.9, 2.0);
    SPOIL(t->filter.log_weight[3], double, NAN, 2.0, -3e300);
    SPOIL(t->filter.parent[3], int32_t, -1, t->capacity);
    SPOIL(record->age, int64_t, INT64_MIN, INT64_MAX);
    SPOIL(record->frame, uint64_t, c->frame + 1);
    SPOIL(record->log_evidence, double, NOT_FINITE);
    SPOIL(record->status, int32_t, -1, 77);
    SPOIL(t->history.count[1], int32_t, -1, t->capacity + 1);
    SPOIL(t->history.parent[5], int32_t, -1, t->capacity);
    SPOIL(t->history.value[5], float, TOO_LARGE);
    if (t->template[0][0])
        SPOIL(t->template[0][0][7], int16_t, -127 * TEMPLATE_ONE - 1, INT16_MAX);
    if (t->classes) {
        class_state *const s = t->classes;
        strata *const of = &t->history.strata[c->generation];
        SPOIL(s->reported, int32_t, -1, TOY_CLASSES);
        SPOIL(s->supported, int32_t, -1, TOY_CLASSES);
        SPOIL(s->moved_class, int32_t, -1, TOY_CLASSES);
        SPOIL(s->resampled, int64_t, -1, INT64_MAX);
        SPOIL(s->moved, int64_t, INT64_MIN, INT64_MAX);
        SPOIL(s->score[1][0], float, TOO_LARGE);
        SPOIL(of->count, int32_t, 0, MAX_STRATA + 1, 1);
        SPOIL(of->first[0], int32_t, BLOCK);
        SPOIL(of->first[1], int32_t, 0, 1, t->capacity);
        SPOIL(of->motion_class[0], int32_t, 1);
        SPOIL(of->first[of->count], int32_t, 1 << 20);
    }
    if (t->walk_check) {
        SPOIL(t->walk_check->age, int64_t, -1, INT64_MAX);
        SPOIL(t->walk_check->cameras, uint32_t, 2);
        SPOIL(t->walk_check->nats, float, NOT_FINITE);
        SPOIL(t->walk_check->body.f[0], float, TOO_LARGE);
    }
}

static void test_implausible_states(void)
{
    for (int k = 0; k < 3; k++) { /* plain, with classes of motion, in paper mode */
        gait_tracker_config cfg = small(1);
        cfg.mode = k == 2 ? GAIT_MODE_PAPER : GAIT_MODE_DEFAULT;
        const gait_model *const model = k == 1 ? toy_classes_model() : toy_model();
        gait_tracker *const t = toy_tracker_of(model, &cfg);
        gait_estimate e;
        target = toy_tracker_of(model, &cfg);
        toy_tracker_start(target, 7, 0.3f);
        target_digest = gait_tracker_digest(target);
        toy_tracker_start(t, 0, 1.0f);
        for (int n = 0; n < 3; n++)
            film_step(t, 1, n, 0, &e);
        test_implausible(t);
        size_t bytes = 0;
        unsigned char *const kept = save(t, &bytes); /* unspoilt it is taken */
        CHECK(gait_tracker_restore(target, kept, bytes, NULL) == GAIT_OK);
        free(kept);
        toy_tracker_free(target);
        toy_tracker_free(t);
    }
}

/* A snapshot of another configuration or model is refused. */
static void test_other(void)
{
    gait_tracker_config const cfg = small(1);
    gait_tracker *const t = film_tracker(&cfg, 0, 1.0f);
    size_t bytes = 0;
    unsigned char *const kept = save(t, &bytes);
    for (int k = 0; k < 8; k++) {
        gait_tracker_config other = cfg;
        switch (k) {
        case 0:
            other.seed++;
            break;
        case 1:
            other.particles = 17;
            break;
        case 2:
            other.phase_noise *= 1.01f;
            break;
        case 3:
            other.terms &= ~GAIT_TERM_EDGES;
            break;
        case 4:
            other.camera[0].cx += 1.0f;
            break;
        case 5:
            other.cameras = 2;
            break;
        case 6:
            other.components = 1;
            break;
        default:
            other.offset_angles = 1;
        }
        target = film_tracker(&other, 0, 1.0f);
        target_digest = gait_tracker_digest(target);
        refuse(kept, bytes, GAIT_ERR_VERSION);
        toy_tracker_free(target);
    }
    static _Alignas(GAIT_ALIGN) unsigned char file[TOY_BYTES], place[1024], memory[1 << 23];
    gait_model *model = NULL;
    size_t const file_bytes = toy_write(file, TOY_PHASES, TOY_COMPONENTS);
    file[file_bytes - 64] ^= 1; /* a model that differs by a bit of its limbs */
    toy_seal(file, file_bytes);
    CHECK(gait_model_init(place, sizeof place, file, file_bytes, &model, NULL) == GAIT_OK);
    CHECK(gait_tracker_init(memory, sizeof memory, model, &cfg, &target, NULL) == GAIT_OK);
    target_digest = gait_tracker_digest(target);
    refuse(kept, bytes, GAIT_ERR_VERSION);
    CHECK(gait_tracker_restore(NULL, kept, bytes, NULL) == GAIT_ERR_ARG);
    CHECK(gait_tracker_restore(t, NULL, bytes, NULL) == GAIT_ERR_ARG);
    CHECK(gait_tracker_save(NULL, kept, bytes, &bytes, NULL) == GAIT_ERR_ARG);
    CHECK(gait_tracker_save(t, kept, bytes, NULL, NULL) == GAIT_ERR_ARG);
    toy_tracker_free(t);
    free(kept);
}

int main(void)
{
    film_make(SCENE_CAMERAS, SHOTS);
    test_continue();
    test_digest();
    test_damage();
    test_implausible_states();
    test_other();
    return CHECK_DONE();
}
