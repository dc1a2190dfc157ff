/* Nothing is allocated during the life of a tracker or a lifter: a malloc in between aborts.
 *
 * The program's own malloc takes the C library's place, so that calls from anywhere in the process are seen. */
#include "sanitized.h"

#include "check.h"

#if SANITIZED
int main(void)
{
    return CHECK_DONE(); /* the sanitizer has its own malloc */
}
#else
#include "gait_pool.h"
#include "toy_films.h"
#include "toy_passer.h"
#include "tracker/tracker.h"

#include <errno.h>
#include <signal.h>
#include <stdatomic.h>
#include <sys/wait.h>
#include <unistd.h>

/* ---- the guard ---- */
enum { HEAP = 32 << 20, HEAD = 64 };
static _Alignas(64) unsigned char heap[HEAP];
static atomic_size_t used;
static atomic_bool armed;

/* Blocks are taken from the front and never returned; each is preceded by its size. */
static void *take(size_t align, size_t bytes)
{
    if (armed) {
        static const char text[] = "malloc between start and end\n";
        ssize_t const written = write(2, text, sizeof text - 1);
        (void)written;
        abort();
    }
    size_t const step = align > HEAD ? align : HEAD, taken = (bytes + step - 1) / step * step + step;
    size_t const at = atomic_fetch_add(&used, taken + step);
    if (bytes > HEAP || at + taken + step > HEAP) {
        errno = ENOMEM;
        return NULL;
    }
    unsigned char *const block = heap + (at + step - 1) / step * step + step;
    memcpy(block - sizeof bytes, &bytes, sizeof bytes);
    return block;
}

void *malloc(size_t bytes)
{
    return take(HEAD, bytes);
}

void *calloc(size_t count, size_t bytes)
{
    return take(HEAD, count * bytes); /* never used before: zero */
}

void *realloc(void *old, size_t bytes)
{
    void *const p = take(HEAD, bytes);
    size_t had = 0;
    if (old && p) {
        memcpy(&had, (unsigned char *)old - sizeof had, sizeof had);
        memcpy(p, old, had < bytes ? had : bytes);
    }
    return p;
}

void free(void *p)
{
    if (armed && p)
        abort();
}

void *aligned_alloc(size_t align, size_t bytes)
{
    return take(align, bytes);
}

int posix_memalign(void **out, size_t align, size_t bytes)
{
    *out = take(align, bytes);
    return *out ? 0 : ENOMEM;
}

/* ---- what is guarded ---- */
/* After 50 frames of the walk 30 of the empty scene. */
enum { THREADS = 3, SHOTS = 50, GONE = 30, STEPS = 100 };
static _Alignas(GAIT_ALIGN) unsigned char pool_memory[4096], memory[8 << 20], snapshot[8 << 20];
static gait_state state[400];
static float weight[400];
static uint8_t ids[SCENE_PIXELS];

static gait_frame frame_of(const gait_tracker_config *cfg, int n)
{
    bool const gone = n >= SHOTS && n < SHOTS + GONE;
    gait_frame f = films_frame(cfg, n % SHOTS, 0);
    for (int k = 0; k < cfg->cameras && gone; k++)
        f.image[k] = films_wall(cfg, k);
    f.utime = toy_frame(n).utime;
    return f;
}

/* Call everything that a tracker has, while the person is found, lost and found again; returns the stages of the left/right
 * hypotheses that occurred (bits), 0 if a call failed. */
static uint32_t work(gait_tracker *t, const gait_tracker_config *cfg)
{
    gait_pose pose;
    size_t bytes = 0;
    uint32_t stages = 0;
    bool ok = true;
    films_start(t, cfg, 0, 1.0f);
    for (int n = 0; n < STEPS; n++) {
        gait_frame const f = frame_of(cfg, n);
        gait_estimate e;
        ok &= gait_tracker_step(t, &f, &e, NULL) == GAIT_OK;
        stages |= 1u << t->core->hypotheses.stage;
        ok &= gait_tracker_lagged(t, n < 5 ? n : 5, &e, NULL) == GAIT_OK;
        ok &= gait_tracker_particles(t, state, weight, 400, NULL) == t->cfg.particles;
        ok &= gait_model_pose(toy_model(), &e.mean, &pose, NULL) == GAIT_OK;
        ok &= gait_render(toy_model(), &cfg->camera[0], &e.mean, ids, cfg->camera[0].width, NULL) == GAIT_OK;
        if (n % 10 == 3) {
            ok &= gait_tracker_save(t, snapshot, sizeof snapshot, &bytes, NULL) == GAIT_OK;
            ok &= gait_tracker_restore(t, snapshot, bytes, NULL) == GAIT_OK;
        }
    }
    films_start(t, cfg, 0, 1.0f);
    return ok && gait_tracker_digest(t) != 0 ? stages : 0;
}

static void test_no_allocation(int film_kind)
{
    gait_tracker_config cfg = films_config(film_kind);
    gait_tracker *t = NULL;
    gait_pool *pool = NULL;
    CHECK(gait_pool_init(pool_memory, sizeof pool_memory, THREADS, &pool, NULL) == GAIT_OK);
    cfg.exec = gait_pool_tasks(pool);
    toy_model();
    armed = true;
    bool const made = gait_tracker_init(memory, sizeof memory, toy_model(), &cfg, &t, NULL) == GAIT_OK;
    uint32_t const stages = made ? work(t, &cfg) : 0;
    armed = false;
    CHECK(stages >> HYPOTHESES_ONE & 1u);
    CHECK((stages >> HYPOTHESES_TWO & 1u) == (film_kind == FILMS_SEARCH));
    gait_pool_stop(pool);
}

/* A lifter: segments alone and a stream that is followed, lost and found. */
static void test_lifting_allocates_nothing(void)
{
    toy_lift_learn(2, 0);
    gait_lift_config c = toy_lift_config(GAIT_LIFT_PERSPECTIVE);
    c.sd = 1.0;
    gait_lift *l = NULL;
    armed = true;
    bool ok =
        gait_lift_init(toy_lift_memory, sizeof toy_lift_memory, toy_lift_model, &c, &l, NULL) == GAIT_OK;
    ok = ok && passer_segment(l, &c) && passer_stream(l, &c, 3 * PASSER_WAY);
    armed = false;
    CHECK(ok);
}

static void fall(int kind)
{
    void *volatile p = malloc(8);
    close(2); /* its message is expected */
    armed = true;
    if (kind == 0)
        p = malloc(8);
    else if (kind == 1)
        p = calloc(2, 8);
    else
        free(p);
    _exit(0);
}

/* The guard detects a malloc. */
static void test_the_guard(void)
{
    for (int kind = 0; kind < 3; kind++) {
        int status = 0;
        pid_t const child = fork();
        if (child == 0)
            fall(kind);
        CHECK(child > 0 && waitpid(child, &status, 0) == child);
        CHECK(WIFSIGNALED(status) && WTERMSIG(status) == SIGABRT);
    }
}

int main(void)
{
    test_the_guard();
    film_make(SCENE_CAMERAS, SHOTS);
    for (int film_kind = 0; film_kind < FILMS; film_kind++)
        test_no_allocation(film_kind);
    test_lifting_allocates_nothing();
    return CHECK_DONE();
}
#endif
