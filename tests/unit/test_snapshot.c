/* Saving and restoring: the same continuation, and nothing but an exact snapshot is taken. */
#include "tracker/tracker.h"

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

/* Does the pieces at once, like the library itself. */
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

/* Refused with a reason, and the tracker goes on as if nothing had been. */
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
    CHECK(gait_tracker_restore(target, kept, bytes, NULL) == GAIT_OK); /* undamaged it is taken */
    CHECK(gait_tracker_digest(target) == gait_tracker_digest(t));
    toy_tracker_free(target);
    toy_tracker_free(t);
    free(kept);
}

/* Numbers that no tracker gets to, with a checksum that is right. */
static void test_implausible(void)
{
    const float bad_sd[] = {NAN, INFINITY, -0.1f};
    gait_tracker_config cfg = small(1);
    gait_tracker *const t = film_tracker(&cfg, 0, 1.0f);
    size_t bytes = 0;
    target = film_tracker(&cfg, 7, 0.3f);
    target_digest = gait_tracker_digest(target);
    for (int k = 0; k < 3; k++) {
        t->core->stature_sd_ratio = bad_sd[k];
        unsigned char *const kept = save(t, &bytes);
        refuse(kept, bytes, GAIT_ERR_CORRUPT);
        free(kept);
    }
    toy_tracker_free(target);
    toy_tracker_free(t);
}

/* Times and counts whose differences would overflow, in the right order. */
static void test_far_times(void)
{
    gait_tracker_config const cfg = small(1);
    size_t bytes = 0;
    target = film_tracker(&cfg, 7, 0.3f);
    target_digest = gait_tracker_digest(target);
    for (int k = 0; k < 7; k++) {
        gait_tracker *const t = film_tracker(&cfg, 0, 1.0f);
        gait_estimate e;
        film_step(t, 1, 1, 0, &e);
        generation_record *const record = &t->history.record[t->core->generation];
        switch (k) {
        case 0:
            t->core->start_utime = INT64_MIN;
            break;
        case 1:
            t->core->start_utime = INT64_MIN;
            t->core->utime = INT64_MAX;
            break;
        case 2:
            t->core->hypotheses.since = INT64_MIN;
            break;
        case 3:
            record->age = INT64_MAX;
            break;
        case 4:
            record->age = INT64_MIN;
            break;
        case 5:
            record->status = 77;
            break;
        default:
            t->core->frame = UINT64_MAX;
        }
        unsigned char *const kept = save(t, &bytes);
        refuse(kept, bytes, GAIT_ERR_CORRUPT);
        free(kept);
        toy_tracker_free(t);
    }
    toy_tracker_free(target);
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
    test_implausible();
    test_far_times();
    test_other();
    return CHECK_DONE();
}
