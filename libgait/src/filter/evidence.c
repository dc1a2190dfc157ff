#include "filter/evidence.h"
#include "base/fmath.h"

enum { CHUNK = 64 };                    /* particles whose exponentials are computed at once */
static const double NONE = -1e300;      /* log of 0 */
static const float LEAST_POWER = 0.05f; /* smallest power */

double evidence_of(const pf *p, const float *loglik)
{
    double top = NONE, sum = 0.0, total = 0.0;
    for (int32_t i = 0; i < p->n; i++) {
        top = (double)loglik[i] > top ? (double)loglik[i] : top;
        total += p->weight[i];
    }
    for (int32_t begin = 0; begin < p->n; begin += CHUNK) {
        double l[CHUNK], e[CHUNK];
        int32_t const count = i_min(CHUNK, p->n - begin);
        for (int32_t i = 0; i < count; i++)
            l[i] = loglik[begin + i] > -1e30f ? (double)loglik[begin + i] - top : NONE;
        m_exp64_all(l, count, e);
        for (int32_t i = 0; i < count; i++)
            sum += p->weight[begin + i] * e[i];
    }
    return sum > 0.0 ? top + m_log64(sum / total) : NONE;
}

/* Log weight of a particle after multiplication by the likelihood to a power. */
static double log_after(const pf *p, const float *loglik, float power, int32_t i)
{
    return p->log_weight[i] + (double)(power * loglik[i]);
}

/* Effective sample size after multiplication by the likelihood to a power. */
static double ess_after(const pf *p, const float *loglik, float power)
{
    double top = NONE, sum = 0.0, square = 0.0;
    for (int32_t i = 0; i < p->n; i++) {
        double const l = log_after(p, loglik, power, i);
        top = l > top && l < -NONE ? l : top;
    }
    for (int32_t begin = 0; begin < p->n; begin += CHUNK) {
        double l[CHUNK], w[CHUNK];
        int32_t const count = i_min(CHUNK, p->n - begin);
        for (int32_t i = 0; i < count; i++)
            l[i] = log_after(p, loglik, power, begin + i) - top;
        m_exp64_all(l, count, w);
        for (int32_t i = 0; i < count; i++) {
            sum += w[i];
            square += w[i] * w[i];
        }
    }
    return square > 0.0 ? sum * sum / square : 0.0;
}

void evidence_temper(float *loglik, int32_t n, float power)
{
    for (int32_t i = 0; i < n; i++)
        loglik[i] *= power;
}

void evidence_anneal(const pf *p, float *loglik, double share)
{
    float power = 1.0f;
    while (power > LEAST_POWER && ess_after(p, loglik, power) < share * (double)p->n)
        power *= 0.5f;
    evidence_temper(loglik, p->n, power);
}
