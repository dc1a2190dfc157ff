/* Phase alone, moved by the library's dynamics and observed ambiguously, against a filter on a grid. */
#include "toy_crowd.h"

enum { CELLS = 4096, BINS = 32, FRAMES = 50, SEEDS = 3 };

static const double DT = 1.0 / 30.0, NOISE = 0.03,
                    RATE = 0.95; /* strides per sqrt(second), strides per second */
static const double FULL = 6.28318530717958648;

/* Nearly as likely with the legs mirrored. */
static double log_likelihood(double phase, double observed)
{
    double const a = FULL * (phase - observed);
    return 0.02 * cos(a) + 0.8 * cos(2.0 * a);
}

/* ---- exact: the density on a grid of cells ---- */
typedef struct grid {
    int cells;
    double p[CELLS];
} grid;

/* Convolve with N(RATE DT, NOISE^2 DT), which a cell's width resolves well. */
static void grid_predict(grid *g)
{
    static double twice[2 * CELLS], kernel[CELLS]; /* twice round, so that no index wraps */
    double const n = g->cells, sd = NOISE * sqrt(DT), shift = RATE * DT;
    int const first = (int)((shift - 5.0 * sd) * n), last = (int)((shift + 5.0 * sd) * n) + 1;
    double total = 0.0;
    memcpy(twice, g->p, (size_t)g->cells * sizeof *twice);
    memcpy(twice + g->cells, g->p, (size_t)g->cells * sizeof *twice);
    for (int k = first; k <= last; k++) {
        double const z = (k / n - shift) / sd;
        kernel[k - first] = exp(-0.5 * z * z);
        total += kernel[k - first];
    }
    for (int i = 0; i < g->cells; i++) {
        const double *const from = twice + i + (i < last ? g->cells : 0);
        g->p[i] = 0.0;
        for (int k = first; k <= last; k++)
            g->p[i] += kernel[k - first] / total * from[-k];
    }
}

static void grid_update(grid *g, double observed)
{
    double total = 0.0;
    for (int i = 0; i < g->cells; i++) {
        g->p[i] *= exp(log_likelihood((i + 0.5) / g->cells, observed));
        total += g->p[i];
    }
    for (int i = 0; i < g->cells; i++)
        g->p[i] /= total;
}

static grid grid_even(int cells)
{
    grid g = {.cells = cells};
    for (int i = 0; i < cells; i++)
        g.p[i] = 1.0 / cells;
    return g;
}

/* ---- how far apart ---- */
static void grid_bins(const grid *g, double bin[BINS])
{
    memset(bin, 0, BINS * sizeof *bin);
    for (int i = 0; i < g->cells; i++)
        bin[i * BINS / g->cells] += g->p[i];
}

static void crowd_bins(const crowd *c, double bin[BINS])
{
    memset(bin, 0, BINS * sizeof *bin);
    for (int32_t i = 0; i < c->p.n; i++)
        bin[(int)(c->now[i].f[F_PHASE] * (float)BINS)] += c->p.weight[i];
}

/* Total variation: the largest difference in the probability of any set of bins. */
static double distance(const double a[BINS], const double b[BINS])
{
    double sum = 0.0;
    for (int k = 0; k < BINS; k++)
        sum += 0.5 * fabs(a[k] - b[k]);
    return sum;
}

/* Observations of a walk. */
static double observed_phase(uint64_t seed, int frame)
{
    float n[4];
    rng_normal4(seed, 9, (uint32_t)frame, 0, 0, n);
    return 0.3 + RATE * DT * frame + 0.08 * (double)n[0];
}

/* The exact answer in every frame. */
static void grid_run(int cells, uint64_t seed, double bin[FRAMES][BINS])
{
    static grid g;
    g = grid_even(cells);
    for (int t = 0; t < FRAMES; t++) {
        grid_predict(&g);
        grid_update(&g, observed_phase(seed, t));
        grid_bins(&g, bin[t]);
    }
}

/* Total variation between n particles and the exact answer, mean over the frames. */
static double particles_off(int32_t n, uint64_t seed, double exact[FRAMES][BINS])
{
    static float ll[TOY_MOST];
    dynamics const d = quiet(GAIT_MODE_DEFAULT, seed);
    crowd c = crowd_new(&d, n);
    double sum = 0.0, bin[BINS];
    cfg.phase_noise = (float)NOISE;
    cfg.rate_time = 0.0f;
    for (int32_t i = 0; i < n; i++)
        c.now[i] = (particle_state){
            .f = {[F_PHASE] = ((float)i + 0.5f) / (float)n, [F_RATE] = (float)RATE, [F_STATURE] = 1.7f}};
    for (int t = 0; t < FRAMES; t++) {
        crowd_predict(&c, (float)DT, 1.0f, (uint32_t)t);
        for (int32_t i = 0; i < n; i++)
            ll[i] = (float)log_likelihood((double)c.now[i].f[F_PHASE], observed_phase(seed, t));
        crowd_update(&c, ll);
        crowd_bins(&c, bin);
        sum += distance(bin, exact[t]) / FRAMES;
    }
    return sum;
}

/* Half as many cells give the same: the grid is exact. */
static void test_grid(void)
{
    static double fine[FRAMES][BINS], coarse[FRAMES][BINS];
    double worst = 0.0;
    grid_run(CELLS, 1, fine);
    grid_run(CELLS / 2, 1, coarse);
    for (int t = 0; t < FRAMES; t++)
        worst = fmax(worst, distance(fine[t], coarse[t]));
    FIGURE("K5: grid %.1e\n", worst);
    CHECK(worst < 1e-3);
}

/* Probability of the half turn that does not lie about the phase observed last. */
static double other_hypothesis(const double bin[BINS], double observed)
{
    double sum = 0.0;
    for (int k = 0; k < BINS / 2; k++)
        sum += bin[(int)(BINS * (observed + 0.25) + k) % BINS];
    return sum;
}

/* Close at 10^4 particles, and four times as far with a sixteenth of them; both sides matter to the end. */
static void test_particles(void)
{
    static double exact[FRAMES][BINS];
    double few = 0.0, many = 0.0;
    for (uint64_t seed = 1; seed <= SEEDS; seed++) {
        grid_run(CELLS, seed, exact);
        double const off = particles_off(TOY_MOST, seed, exact);
        double const other = other_hypothesis(exact[FRAMES - 1], observed_phase(seed, FRAMES - 1));
        CHECK(other > 0.05 && other < 0.95);
        CHECK(off <= 0.03);
        FIGURE("K5: total variation %.4f, other side %.3f\n", off, other);
        many += off / SEEDS;
        few += particles_off(TOY_MOST / 16, seed, exact) / SEEDS;
    }
    FIGURE("K5: N = %d: %.4f, N = %d: %.4f\n", TOY_MOST / 16, few, TOY_MOST, many);
    CHECK_NEAR(few / many, 4.0, 1.2);
}

int main(void)
{
    test_grid();
    test_particles();
    return CHECK_DONE();
}
