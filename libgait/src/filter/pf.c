#include "filter/pf.h"
#include "base/fmath.h"
#include "base/rng.h"
#include <string.h>

COLD pf pf_layout(arena *a, int32_t n)
{
    pf p = {.n = n};
    p.log_weight = TAKE(a, double, n);
    p.weight = TAKE(a, double, n);
    p.parent = TAKE(a, int32_t, n);
    p.cumulative = TAKE(a, uint64_t, n);
    return p;
}

void pf_uniform(pf *p)
{
    double const w = 1.0 / (double)p->n, lw = -m_log64((double)p->n);
    for (int32_t i = 0; i < p->n; i++) {
        p->weight[i] = w;
        p->log_weight[i] = lw;
    }
}

void pf_keep(pf *p)
{
    for (int32_t i = 0; i < p->n; i++)
        p->parent[i] = i;
}

int32_t pf_heaviest(const pf *p)
{
    int32_t best = 0;
    for (int32_t i = 1; i < p->n; i++)
        best = p->weight[i] > p->weight[best] ? i : best;
    return best;
}

double pf_ess(const pf *p)
{
    double sum = 0.0;
    for (int32_t i = 0; i < p->n; i++)
        sum += p->weight[i] * p->weight[i];
    return 1.0 / sum;
}

pf_summary pf_update(pf *p, const float *loglik)
{
    double const none = -1e300;
    pf_summary s = {.best = 0};
    double top = none, sum = 0.0;
    for (int32_t i = 0; i < p->n; i++) {
        double const l = p->log_weight[i] + (double)loglik[i];
        /* The comparison is false for NaN and for infinities of either sign. */
        bool const finite = l > none && l < -none;
        p->cumulative[i] = finite;
        if (finite && l > top) {
            top = l;
            s.best = i;
        }
    }
    if (!(top > none)) {
        s.degenerate = true;
        s.best = pf_heaviest(p);
        s.ess = pf_ess(p);
        return s;
    }
    for (int32_t i = 0; i < p->n; i++) {
        double const l = p->log_weight[i] + (double)loglik[i] - top;
        p->log_weight[i] = p->cumulative[i] ? l : none;
    }
    m_exp64_all(p->log_weight, p->n, p->weight); /* exp(none) is 0 */
    for (int32_t i = 0; i < p->n; i++)
        sum += p->weight[i];
    double const log_sum = m_log64(sum);
    double squares = 0.0;
    for (int32_t i = 0; i < p->n; i++) {
        p->weight[i] /= sum;
        p->log_weight[i] -= log_sum;
        squares += p->weight[i] * p->weight[i];
    }
    s.log_evidence = top + log_sum;
    s.ess = 1.0 / squares;
    return s;
}

/* Cumulative weights in integers, so that sums are exact in any order. Returns their total. */
static uint64_t make_cumulative(const double *weight, int32_t n, uint64_t *cumulative)
{
    double top = 0.0;
    uint64_t total = 0;
    for (int32_t i = 0; i < n; i++)
        top = weight[i] > top ? weight[i] : top;
    for (int32_t i = 0; i < n; i++) {
        total += (uint64_t)(int64_t)(weight[i] / top * 2147483648.0);
        cumulative[i] = total;
    }
    return total;
}

void pf_draw(const double *weight, int32_t n, uint64_t *cumulative, int32_t count, uint32_t u,
             int32_t *parent)
{
    uint64_t const draws = (uint64_t)count, total = make_cumulative(weight, n, cumulative);
    uint64_t const step = total / draws, rest = total % draws;
    uint64_t at = (uint64_t)u * step >> 32, over = 0; /* offset + floor(i total / draws), in 64 bits */
    int32_t from = 0;
    for (uint64_t i = 0; i < draws; i++) {
        while (from < n - 1 && cumulative[from] <= at)
            from++;
        parent[i] = from;
        over += rest;
        at += step + (over >= draws);
        over -= over >= draws ? draws : 0;
    }
}

COLD void pf_resize(pf *p, int32_t count, uint32_t u)
{
    pf_draw(p->weight, p->n, p->cumulative, count, u, p->parent);
    p->n = count;
    pf_uniform(p);
}

void pf_resample_systematic(pf *p, uint32_t u)
{
    pf_resize(p, p->n, u);
}

COLD void pf_resample_multinomial(pf *p, uint64_t seed, uint32_t stream, uint32_t frame)
{
    uint64_t const total = make_cumulative(p->weight, p->n, p->cumulative);
    for (int32_t i = 0; i < p->n; i++) {
        uint32_t r[4];
        rng_bits(seed, stream, frame, (uint32_t)i, 0, r);
        /* total < 2^52 and r < 2^64: the bias of the remainder is below 2^-12 of one unit. */
        uint64_t const at = ((uint64_t)r[0] << 32 | r[1]) % total;
        int32_t low = 0, high = p->n - 1;
        while (low < high) {
            int32_t const mid = low + (high - low) / 2;
            if (p->cumulative[mid] > at)
                high = mid;
            else
                low = mid + 1;
        }
        p->parent[i] = low;
    }
    pf_uniform(p);
}

static void swap(unsigned char *a, unsigned char *b, size_t bytes)
{
    for (size_t k = 0; k < bytes; k++) {
        unsigned char const was = a[k];
        a[k] = b[k];
        b[k] = was;
    }
}

COLD void pf_inherit(pf *p, int32_t before, void *array, size_t bytes)
{
    unsigned char *const part = array;
    uint64_t *const waiting = p->cumulative,
                    done = UINT64_MAX; /* number of particles that have yet to copy this part */
    for (int32_t i = 0; i < i_max(p->n, before); i++)
        waiting[i] = 0;
    for (int32_t i = 0; i < p->n; i++)
        waiting[p->parent[i]] += p->parent[i] != i;
    for (int32_t first = 0; first < p->n; first++)
        for (int32_t i = first; i < p->n && p->parent[i] != i && waiting[i] == 0;) {
            int32_t const from = p->parent[i];
            memcpy(part + (size_t)i * bytes, part + (size_t)from * bytes, bytes);
            waiting[i] = done;
            waiting[from]--;
            i = from;
        }
    /* The remaining particles form cycles. */
    for (int32_t first = 0; first < p->n; first++)
        for (int32_t i = first; p->parent[i] != i && waiting[i] != done; i = p->parent[i]) {
            waiting[i] = done;
            if (p->parent[i] != first)
                swap(part + (size_t)i * bytes, part + (size_t)p->parent[i] * bytes, bytes);
        }
}
