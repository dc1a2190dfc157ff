/* Scan conversion against a point-in-polygon twin in 64-bit integers, and tilings that cover every pixel once. */
#include "raster/rast.h"

#include "base/rng.h"

#include "check.h"

enum { N = RAST_MAX_VERTICES, SIMD_F64 = 300, SUB = 256 };

typedef struct polygon {
    float x[N], y[N];
    int32_t n;
} polygon;

static float uniform(uint32_t index, uint32_t draw)
{
    float u[4];
    rng_uniform4(77, 1, 0, index, draw, u);
    return u[0];
}

/* A convex polygon inscribed in a turned ellipse, either way round, corners at multiples of 1/256 pixel. */
static polygon random_polygon(uint32_t i)
{
    polygon p = {.n = 3 + (int32_t)(6.0f * uniform(i, 0))};
    double const middle = 40.0 + 90.0 * (double)uniform(i, 1), tilt = 6.3 * (double)uniform(i, 2);
    double const a = pow(2.0, 7.0 * (double)uniform(i, 3)), b = a * pow(0.02, (double)uniform(i, 4));
    int32_t const way = i % 2 ? -1 : 1;
    for (int32_t k = 0; k < p.n; k++) {
        double const at = way * 6.2831853 * (k + 0.9 * (double)uniform(i, 10 + (uint32_t)k)) / p.n;
        double const u = a * cos(at), v = b * sin(at);
        p.x[k] = (float)floor((middle + u * cos(tilt) - v * sin(tilt)) * SUB + 0.5) / SUB;
        p.y[k] = (float)floor((middle + u * sin(tilt) + v * cos(tilt)) * SUB + 0.5) / SUB;
    }
    return p;
}

static bool covers(const rast_spans *s, int32_t top, int32_t x, int32_t y)
{
    return y >= s->first && y < s->last && x >= s->begin[y - top] && x < s->end[y - top];
}

/* Number of edges left of the pixel's centre, parity; *close: an edge passes within 1/64 of a pixel. */
static bool twin_covers(const polygon *p, int32_t x, int32_t y, bool *close)
{
    int64_t const X = (int64_t)x * SUB, Y = (int64_t)y * SUB;
    bool in = false;
    *close = false;
    for (int32_t i = 0, j = p->n - 1; i < p->n; j = i++) {
        int64_t const xi = (int64_t)(p->x[i] * SUB), yi = (int64_t)(p->y[i] * SUB);
        int64_t const xj = (int64_t)(p->x[j] * SUB), yj = (int64_t)(p->y[j] * SUB);
        bool const up = yi < yj;
        int64_t const x0 = up ? xi : xj, y0 = up ? yi : yj, dx = up ? xj - xi : xi - xj,
                      dy = up ? yj - yi : yi - yj;
        if (Y < y0 || Y >= y0 + dy)
            continue;
        int64_t const side = (X - x0) * dy - dx * (Y - y0); /* >= 0: at or right of the edge */
        in ^= side >= 0;
        *close |= side > -4 * dy && side < 4 * dy;
    }
    return in;
}

static void test_against_twin(void)
{
    int32_t wrong = 0, close_wrong = 0, covered = 0;
    for (uint32_t i = 0; i < 400; i++) {
        polygon const p = random_polygon(i);
        rast_spans s;
        rast_convex(p.x, p.y, p.n, 0, SIMD_F64, &s);
        for (int32_t y = 0; y < GRID_SIZE; y++)
            for (int32_t x = 0; x < SIMD_F64; x++) {
                bool close;
                bool const in = twin_covers(&p, x, y, &close), have = covers(&s, 0, x, y);
                covered += in;
                wrong += have != in && !close;
                close_wrong += have != in && close;
            }
    }
    CHECK(covered > 100000);
    CHECK(wrong == 0);
    CHECK(close_wrong < 20); /* a slope is rounded to 2^-16 */
}

/* A polygon cut along a diagonal: the halves together cover exactly the whole. */
static void test_cut(void)
{
    int32_t twice = 0, differ = 0;
    for (uint32_t i = 1000; i < 2000; i++) {
        polygon const p = random_polygon(i);
        if (p.n < 4)
            continue;
        int32_t const cut = 2 + (int32_t)(i % (uint32_t)(p.n - 3 + (p.n == 3)));
        rast_spans whole, first, second;
        polygon rest = {.n = p.n - cut + 1};
        for (int32_t k = 0; k < rest.n; k++) {
            rest.x[k] = p.x[(cut + k) % p.n];
            rest.y[k] = p.y[(cut + k) % p.n];
        }
        rast_convex(p.x, p.y, p.n, 0, GRID_SIZE, &whole);
        rast_convex(p.x, p.y, cut + 1, 0, GRID_SIZE, &first);
        rast_convex(rest.x, rest.y, rest.n, 0, GRID_SIZE, &second);
        for (int32_t y = 0; y < GRID_SIZE; y++)
            for (int32_t x = 0; x < GRID_SIZE; x++) {
                int32_t const have = covers(&first, 0, x, y) + covers(&second, 0, x, y);
                twice += have == 2;
                differ += have != covers(&whole, 0, x, y);
            }
    }
    CHECK(twice == 0);
    CHECK(differ == 0);
}

/* A shaken grid of quadrilaterals, two triangles each, that reaches over all borders: every pixel exactly once. */
static void test_tiling(void)
{
    enum { CELLS = 13, STEP = 12 };
    static uint8_t count[GRID_SIZE][GRID_SIZE];
    float gx[CELLS + 1][CELLS + 1], gy[CELLS + 1][CELLS + 1];
    for (uint32_t round = 0; round < 10; round++) {
        memset(count, 0, sizeof count);
        for (uint32_t r = 0; r <= CELLS; r++)
            for (uint32_t c = 0; c <= CELLS; c++) {
                float const shake = round ? 5.0f : 0.0f; /* the first round meets pixel centres */
                gx[r][c] = STEP * (float)c - 10.0f + shake * (uniform(r * 64 + c, 20 + round) - 0.5f);
                gy[r][c] = STEP * (float)r - 10.0f + shake * (uniform(r * 64 + c, 40 + round) - 0.5f);
            }
        for (int32_t r = 0; r < CELLS; r++)
            for (int32_t c = 0; c < CELLS; c++)
                for (int32_t half = 0; half < 2; half++) {
                    int32_t const k = 1 - half;
                    const float x[3] = {gx[r][c], gx[r + half][c + k], gx[r + 1][c + 1]};
                    const float y[3] = {gy[r][c], gy[r + half][c + k], gy[r + 1][c + 1]};
                    rast_spans s;
                    rast_convex(x, y, 3, 0, GRID_SIZE, &s);
                    for (int32_t row = s.first; row < s.last; row++)
                        for (int32_t col = s.begin[row]; col < s.end[row]; col++)
                            count[row][col]++;
                }
        int32_t wrong = 0;
        for (int32_t row = 0; row < GRID_SIZE; row++)
            for (int32_t col = 0; col < GRID_SIZE; col++)
                wrong += count[row][col] != 1;
        CHECK(wrong == 0);
    }
}

static bool empty(const rast_spans *s)
{
    for (int32_t row = s->first; row < s->last; row++)
        if (s->begin[row] < s->end[row])
            return false;
    return true;
}

/* Left and top edges belong to the polygon, right and bottom ones do not. */
static void test_edges(void)
{
    const float x[4] = {10, 20, 20, 10}, y[4] = {5, 5, 9, 9};
    const float back[4] = {9, 9, 5, 5};
    for (int way = 0; way < 2; way++) {
        rast_spans s;
        rast_convex(x, way ? back : y, 4, 0, GRID_SIZE, &s);
        CHECK(s.first == 5 && s.last == 9);
        for (int32_t row = 5; row < 9; row++)
            CHECK(s.begin[row] == 10 && s.end[row] == 20);
    }
    const float half[4] = {10.5f, 20.5f, 20.5f, 10.5f};
    rast_spans s;
    rast_convex(half, half, 4, 0, GRID_SIZE, &s); /* degenerate: all on one line */
    CHECK(empty(&s));
    rast_convex(half, y, 4, 0, GRID_SIZE, &s);
    CHECK(s.begin[5] == 11 && s.end[5] == 21);
    const float near[4] = {10.003f, 20.001f, 20.001f, 10.003f}; /* nearest 1/256: 10 + 1/256 and 20 */
    rast_convex(near, y, 4, 0, GRID_SIZE, &s);
    CHECK(s.begin[5] == 11 && s.end[5] == 20);
}

/* Pixels of row y that a polygon covers, [begin, end) or 0 0. */
static void row_of(const rast_spans *s, int32_t top, int32_t width, int32_t y, int32_t span[2])
{
    bool const in = y >= s->first && y < s->last;
    span[0] = in ? i_min(s->begin[y - top], width) : 0;
    span[1] = in ? i_min(s->end[y - top], width) : 0;
    if (span[0] >= span[1])
        span[0] = span[1] = 0;
}

/* The same picture through any window: rows from top, columns [0, width). */
static void test_windows(void)
{
    static const int32_t tops[] = {0, 37, 100, 128, 190, 1000}, widths[] = {1, 64, 128, 200, RAST_LIMIT};
    int32_t wrong = 0, filled = 0;
    for (uint32_t i = 3000; i < 3040; i++) {
        polygon const p = random_polygon(i);
        for (size_t k = 0; k < 30; k++) {
            int32_t const top = tops[k / 5], width = widths[k % 5];
            rast_spans s, page = {.first = -1};
            rast_convex(p.x, p.y, p.n, top, width, &s);
            for (int32_t y = top; y < top + GRID_SIZE; y++) {
                int32_t have[2], want[2];
                if (page.first < 0 || y % GRID_SIZE == 0)
                    rast_convex(p.x, p.y, p.n, y / GRID_SIZE * GRID_SIZE, RAST_LIMIT, &page);
                row_of(&s, top, width, y, have);
                row_of(&page, y / GRID_SIZE * GRID_SIZE, width, y, want);
                wrong += have[0] != want[0] || have[1] != want[1];
                filled += want[1] > want[0];
            }
        }
    }
    CHECK(wrong == 0 && filled > 5000);
}

/* Far outside on each side: nothing is left.  Around the window: all of it. */
static void test_outside(void)
{
    static const float far[4][2] = {{-500, 50}, {500, 50}, {50, -500}, {50, 500}};
    const float dx[4] = {-30, 30, 30, -30}, dy[4] = {-30, -30, 30, 30};
    for (int k = 0; k < 5; k++) {
        float x[4], y[4];
        rast_spans s;
        int64_t area = 0;
        for (int v = 0; v < 4; v++) {
            x[v] = k < 4 ? far[k][0] + dx[v] : 100.0f * dx[v];
            y[v] = k < 4 ? far[k][1] + dy[v] : 100.0f * dy[v];
        }
        rast_convex(x, y, 4, 0, GRID_SIZE, &s);
        for (int32_t row = s.first; row < s.last; row++)
            area += s.end[row] - s.begin[row];
        CHECK(area == (k < 4 ? 0 : GRID_SIZE * GRID_SIZE));
    }
}

/* Any bits as coordinates: no trap, and the spans stay inside the window. */
static void test_garbage(void)
{
    static const float extreme[] = {NAN,      INFINITY,  -INFINITY, 1e30f, -1e30f, FLT_MAX,
                                    16000.0f, -16000.0f, 0.0f,      -0.0f, 127.5f, 1e-40f};
    int32_t wrong = 0, huge = 0;
    for (uint32_t i = 0; i < 20000; i++) {
        float x[N], y[N];
        int32_t const n = 3 + (int32_t)(i % 6), top = i % 5 ? 0 : 15000,
                      width = i % 3 ? GRID_SIZE : RAST_LIMIT;
        rast_spans s;
        for (int32_t k = 0; k < n; k++) {
            uint32_t r[4];
            rng_bits(5, 0, 0, i, (uint32_t)k, r);
            memcpy(&x[k], &r[0], sizeof *x);
            x[k] = r[2] % 4 ? extreme[r[2] / 4 % (sizeof extreme / sizeof *extreme)] : x[k];
            y[k] = r[3] % 4 ? extreme[r[3] / 4 % (sizeof extreme / sizeof *extreme)] : (float)(r[1] % 200);
        }
        rast_convex(x, y, n, top, width, &s);
        wrong += s.first < top || s.last > top + GRID_SIZE || s.first > s.last;
        for (int32_t row = s.first; row < s.last; row++) {
            int32_t const b = s.begin[row - top], e = s.end[row - top];
            wrong += b < 0 || b > width || e < 0 || e > width;
            huge += e - b > 100;
        }
    }
    CHECK(wrong == 0 && huge > 0);
    /* A huge triangle about the window still covers it. */
    const float x[3] = {-1e30f, 1e30f, 0.0f}, y[3] = {-1e30f, -1e30f, 1e30f};
    rast_spans s;
    rast_convex(x, y, 3, 0, GRID_SIZE, &s);
    CHECK(s.first == 0 && s.last == GRID_SIZE && s.begin[64] == 0 && s.end[64] == GRID_SIZE);
}

static void test_slivers(void)
{
    const float x[4] = {3.2f, 120.7f, 120.7f, 3.2f}, thin[4] = {50.4f, 50.4f, 50.6f, 50.6f};
    const float y[4] = {3.2f, 120.7f, 120.7f, 3.2f}, on[4] = {49.9f, 49.9f, 50.1f, 50.1f};
    rast_spans s;
    rast_convex(x, thin, 4, 0, GRID_SIZE, &s); /* between two rows of centres */
    CHECK(s.first == s.last);
    rast_convex(x, on, 4, 0, GRID_SIZE, &s); /* about one row */
    CHECK(s.first == 50 && s.last == 51 && s.begin[50] == 4 && s.end[50] == 121);
    rast_convex(x, y, 4, 0, GRID_SIZE, &s); /* a line has no inside */
    CHECK(empty(&s));
    const float dot[3] = {7.0f, 7.0f, 7.0f};
    rast_convex(dot, dot, 3, 0, GRID_SIZE, &s);
    CHECK(s.first == s.last);
}

/* The bits of every span of a word, one by one. */
static void test_bits(void)
{
    int32_t wrong = 0;
    for (int32_t begin = 0; begin <= 64; begin++)
        for (int32_t end = 0; end <= 64; end++) {
            uint64_t const have = grid_from[begin] & ~grid_from[end];
            for (int32_t x = 0; x < 64; x++)
                wrong += (have >> x & 1) != (uint64_t)(x >= begin && x < end);
        }
    CHECK(wrong == 0);
}

static void test_popcount(void)
{
    CHECK(grid_popcount(0) == 0 && grid_popcount(~UINT64_C(0)) == 64);
    for (int32_t k = 0; k < 64; k++)
        CHECK(grid_popcount(UINT64_C(1) << k) == 1);
    int32_t wrong = 0;
    for (uint32_t i = 0; i < 10000; i++) {
        uint32_t r[4];
        rng_bits(3, 0, 0, i, 0, r);
        uint64_t const v = (uint64_t)r[0] << 32 | r[1];
        int32_t bits = 0;
        for (int32_t k = 0; k < 64; k++)
            bits += (int32_t)(v >> k & 1);
        wrong += grid_popcount(v) != bits;
    }
    CHECK(wrong == 0);
}

int main(void)
{
    test_against_twin();
    test_cut();
    test_tiling();
    test_edges();
    test_windows();
    test_outside();
    test_garbage();
    test_slivers();
    test_bits();
    test_popcount();
    return CHECK_DONE();
}
