/* Kernels of surface and edges: every instruction set against the scalar one, and that one against single points. */
#include "kernel_check.h"
#include "base/rng.h"
#include "toy_body.h"
#include "toy_visible.h"

#include "check.h"

enum { LIMBS = MODEL_MAX_LIMBS };

static toy_body *v;

static uint32_t draw(uint32_t index, uint32_t what)
{
    uint32_t r[4];
    rng_bits(5, 0, 0, index, what, r);
    return r[0];
}

/* In [-1, 1). */
static float uniform(uint32_t index, uint32_t what)
{
    return (float)(int32_t)draw(index, what) / 2147483648.0f;
}

/* ---- points of a limb ---- */

/* Bodies of a block: around the toy person, rotated at random, some near the camera or behind it. */
static void bodies(uint32_t round)
{
    gait_state s = toy_walk(0.5f);
    toy_body_aim(v, &s);
    for (int32_t lane = 0; lane < BLOCK; lane++) {
        static kin_body one;
        uint32_t const at = round * BLOCK + (uint32_t)lane;
        float const near = at % 7 == 3    ? -5.2f
                           : at % 11 == 5 ? -7.0f
                                          : 0.0f; /* the camera stands 5.5 m off */
        s = toy_walk(0.5f + 0.5f * uniform(at, 0));
        s.heading = PI_F * uniform(at, 1);
        s.pitch = at % 3 ? 0.2f * uniform(at, 2) : PI_F * uniform(at, 2);
        s.roll = 0.5f * uniform(at, 3);
        s.pelvis[0] += (at % 5 ? 0.1f : 1.5f) * uniform(at, 4);
        s.pelvis[1] += near;
        particle_state const w = particle_from_state(&v->rule, &s);
        particle_body(&v->rule, &w, &one);
        for (int32_t f = 0; f < KIN_MAX_FRAMES; f++) {
            for (int32_t k = 0; k < 9; k++)
                v->body.R[f][k][lane] = one.R[f][k][0];
            for (int32_t k = 0; k < 3; k++)
                v->body.o[f][k][lane] = one.o[f][k][0];
            v->body.scale[f][lane] = one.scale[f][0];
        }
    }
}

/* One surface point of one lane in the simplest form, without leaving out half of the points. */
static int8_t sample(int32_t l, int32_t i, int32_t lane)
{
    const like_surface *const s = &v->setup.surface[l];
    int32_t const f = v->setup.geometry[l].frame;
    float M[9], t[3], p[3], n[3], at[3], dot = 0.0f;
    for (int32_t r = 0; r < 3; r++) {
        const float *const c = v->cam.R + 3 * r;
        for (int32_t k = 0; k < 3; k++)
            M[3 * r + k] = c[0] * v->body.R[f][k][lane] + c[1] * v->body.R[f][3 + k][lane] +
                           c[2] * v->body.R[f][6 + k][lane];
        t[r] = c[0] * v->body.o[f][0][lane] + c[1] * v->body.o[f][1][lane] + c[2] * v->body.o[f][2][lane] +
               v->cam.t[r];
    }
    for (int32_t k = 0; k < 3; k++) {
        p[k] = v->body.scale[f][lane] * s->point[k][i];
        n[k] = s->normal[k][i];
    }
    for (int32_t r = 0; r < 3; r++)
        at[r] = M[3 * r] * p[0] + M[3 * r + 1] * p[1] + M[3 * r + 2] * p[2] + t[r];
    at[2] = f_max(at[2], CAMERA_NEAR);
    for (int32_t r = 0; r < 3; r++)
        dot += (M[3 * r] * n[0] + M[3 * r + 1] * n[1] + M[3 * r + 2] * n[2]) * at[r];
    float const inv = 1.0f / at[2];
    float const x = (v->cam.fx * (at[0] * inv) + v->cam.cx - v->f.map.u0) * v->f.map.scale;
    float const y = (v->cam.fy * (at[1] * inv) + v->cam.cy - v->f.map.v0) * v->f.map.scale;
    float const range = __builtin_sqrtf(at[0] * at[0] + at[1] * at[1] + at[2] * at[2]);
    if (!(-dot - 0.2f * range > 0.0f) || !toy_visible(&v->drawn.visible[l], x, y))
        return TEXTURE_HIDDEN;
    int32_t const a = i_min((int32_t)(x * 256.0f), 255 * 256 - 1),
                  b = i_min((int32_t)(y * 256.0f), 255 * 256 - 1);
    const int8_t *const m = v->scratch.surface + (b >> 8) * VIEW_SIZE + (a >> 8);
    int32_t const top = m[0] * (256 - (a & 255)) + m[1] * (a & 255);
    int32_t const low = m[VIEW_SIZE] * (256 - (a & 255)) + m[VIEW_SIZE + 1] * (a & 255);
    return (int8_t)((top * (256 - (b & 255)) + low * (b & 255)) / 65536);
}

/* The region turned so that the person leaves it on one side, or is small in it. */
static void shift_region(uint32_t round)
{
    static const float scale[] = {1.4f, 0.4f, 2.0f};
    v->f.map.u0 += round % 4 == 1 ? 90.0f : round % 4 == 2 ? -120.0f : 0.0f;
    v->f.map.v0 += round % 5 == 1 ? 60.0f : 0.0f;
    v->f.map.scale = scale[round % 3];
}

static void test_sample(void)
{
    static uint8_t frame[SCENE_PIXELS];
    static _Alignas(GAIT_ALIGN) unsigned char memory[sizeof(like_pose) + 2 * GUARD];
    static like_patch want[LIMBS];
    int32_t seen = 0, hidden = 0, flipped = 0, rounded = 0, worst = 0, wrong = 0, missing = 0, differ = 0,
            broken = 0;
    toy_shot(0, 15, frame);
    for (uint32_t round = 0; round < 24; round++) {
        bodies(round);
        shift_region(round);
        toy_body_at(v, frame, NULL);
        for (int32_t i = 0; i < VIEW_PIXELS && round % 6 == 5; i++) { /* the extremes */
            v->scratch.surface[i] = (int8_t)(draw((uint32_t)i, round) & 1 ? 127 : -127);
            v->f.pairs[i] = 0;
        }
        for (int32_t i = 0; i < VIEW_PIXELS - VIEW_SIZE; i++)
            for (int32_t k = 0; k < 2; k++) {
                int32_t const value = (uint8_t)v->scratch.surface[i + k * VIEW_SIZE];
                if (round % 6 == 5)
                    v->f.pairs[i] = (uint16_t)(v->f.pairs[i] | value << 8 * k);
                wrong += (v->f.pairs[i] >> 8 * k & 255) != value;
            }
        toy_project(v->setup.geometry, TOY_LIMBS, &v->body, &v->cam, &v->f.map, &v->outline);
        isa_scalar()->surface_pose(&v->setup, &v->cam, &v->f.map, &v->body, &v->pose);
        for (int k = 0; k < isa_count(); k++) {
            guarded const g = guard_fill(memory, TOY_LIMBS * sizeof *v->pose.limb);
            isa_at(k)->surface_pose(&v->setup, &v->cam, &v->f.map, &v->body, (like_pose *)(void *)g.begin);
            differ += memcmp(g.begin, &v->pose, g.bytes) != 0;
            broken += !guard_whole(&g);
        }
        for (int32_t lane = 0; lane < BLOCK; lane++) {
            toy_draw(&v->outline, v->setup.geometry, TOY_LIMBS, lane, &v->drawn);
            isa_scalar()->surface_sample(&v->setup, &v->f, &v->pose, lane, &v->drawn, want);
            for (int32_t l = 0; l < TOY_LIMBS; l++)
                for (int32_t i = 0; i < LIKE_SAMPLES; i++) {
                    int32_t const at = (i - 2 * want[l].turn + LIKE_SAMPLES) % LIKE_SAMPLES;
                    int8_t const value = sample(l, i, lane);
                    missing += at >= LIKE_HALF && value != TEXTURE_HIDDEN;
                    if (at < LIKE_HALF && value != want[l].value[at]) {
                        bool const flip = value == TEXTURE_HIDDEN || want[l].value[at] == TEXTURE_HIDDEN;
                        flipped += flip;
                        rounded += !flip;
                        worst = i_max(worst, flip ? 0 : abs(value - want[l].value[at]));
                    }
                    seen += value != TEXTURE_HIDDEN;
                    hidden += value == TEXTURE_HIDDEN;
                }
            for (int k = 0; k < isa_count(); k++) {
                guarded const g = guard_fill(memory, TOY_LIMBS * sizeof *want);
                isa_at(k)->surface_sample(&v->setup, &v->f, &v->pose, lane, &v->drawn, (like_patch *)g.begin);
                differ += memcmp(g.begin, want, g.bytes) != 0;
                broken += !guard_whole(&g);
            }
        }
    }
    CHECK(seen > 20000 && hidden > 50000);
    CHECK(flipped * 200 < seen && rounded * 1000 < seen &&
          worst <= 1);   /* rounded otherwise; about to turn away */
    CHECK(missing == 0); /* no point of the other half would have been seen */
    CHECK(wrong == 0);
    CHECK(differ == 0);
    CHECK(broken == 0);
}

/* ---- comparison ---- */

/* Values near those of another patch, of any kind, or the extremes; some hidden. */
static void fill(like_patch *p, uint32_t round, uint32_t salt)
{
    for (uint32_t l = 0; l < LIMBS; l++) {
        p[l].turn = (uint8_t)(draw(l, 4 * round + salt) >> (round % 3 ? 6 : 0));
        for (uint32_t i = 0; i < LIKE_HALF; i++) {
            uint32_t const r = draw(l * LIKE_HALF + i, 4 * round + salt + 1);
            int32_t const value = round % 4 == 0   ? (int32_t)(r % 255) - 127
                                  : round % 4 == 1 ? (r & 1 ? 127 : -127)
                                                   : (int32_t)(r % 9);
            p[l].value[i] = (int8_t)(r >> 8 & (round % 5) ? value : TEXTURE_HIDDEN);
        }
    }
}

static void test_compare(void)
{
    static like_patch now[LIMBS], then[LIMBS];
    static int8_t known[LIMBS * LIKE_RING];
    static _Alignas(GAIT_ALIGN) unsigned char memory[sizeof(int32_t[LIMBS][BLOCK]) + 2 * GUARD];
    static unsigned char sums[sizeof(float[BLOCK]) + 2 * GUARD];
    int32_t differ = 0, broken = 0;
    for (uint32_t round = 0; round < 600; round++) {
        like_body const b = {.setup = &v->setup,
                             .outline = &v->outline,
                             .lane = (int32_t)(round % BLOCK),
                             .samples = now,
                             .ancestor = then,
                             .known = known};
        static int32_t want[LIMBS][BLOCK];
        float log[BLOCK];
        v->setup.limbs = (int32_t)(1 + round % LIMBS);
        size_t const bytes = (size_t)v->setup.limbs * sizeof *want;
        v->setup.paper = round & 1;
        fill(now, round, 0);
        fill(then, round, 2);
        for (uint32_t i = 0; i < sizeof known; i++)
            known[i] = (int8_t)draw(i, round);
        for (uint32_t l = 0; l < LIMBS; l++)
            for (uint32_t i = 0; i < BLOCK; i++)
                v->outline.limb[l].cos_tilt[i] = fabsf(uniform(l * BLOCK + i, round));
        memset(want, 0xa5, sizeof want); /* as guard_fill: other bodies' are left alone */
        isa_scalar()->texture_costs(&b, want);
        for (uint32_t i = 0; i < LIMBS * BLOCK; i++) /* theirs for the sums */
            want[i / BLOCK][i % BLOCK] =
                (int32_t)i % BLOCK == b.lane
                    ? want[i / BLOCK][i % BLOCK]
                    : (int32_t)(draw(i, round) % 17 * LIKE_COUNT_ONE + draw(i, round + 1) % 40000);
        isa_scalar()->texture_logs(&v->setup, &v->outline, (const int32_t (*)[BLOCK])want, log);
        int64_t const cost = isa_scalar()->template_cost(&b);
        for (int k = 0; k < isa_count(); k++) {
            guarded const g = guard_fill(memory, bytes), s = guard_fill(sums, sizeof log);
            int32_t (*const have)[BLOCK] = (int32_t (*)[BLOCK])(void *)g.begin;
            isa_at(k)->texture_costs(&b, have);
            for (int32_t l = 0; l < v->setup.limbs; l++)
                differ += have[l][b.lane] != want[l][b.lane];
            isa_at(k)->texture_logs(&v->setup, &v->outline, (const int32_t (*)[BLOCK])want,
                                    (float *)(void *)s.begin);
            differ += memcmp(s.begin, log, sizeof log) != 0;
            broken += !guard_whole(&g) || !guard_whole(&s);
            differ += isa_at(k)->template_cost(&b) != cost;
        }
    }
    CHECK(differ == 0);
    CHECK(broken == 0);
}

/* ---- edges ---- */

/* The points of one side. */
static void walk(const grid_mask *mask, const float from[2], const float to[2], const float mid[2], int32_t n,
                 like_edge_tally *t)
{
    float const dx = to[0] - from[0], dy = to[1] - from[1], len2 = dx * dx + dy * dy, turn = 64.0f / len2;
    if (!(len2 > 1.0f && len2 < 1e12f))
        return;
    int32_t const cos2 = (int32_t)((dy * dy - dx * dx) * turn), sin2 = (int32_t)(-2.0f * dx * dy * turn);
    for (int32_t i = 0; i < n; i++) {
        float const s = ((float)i + 0.5f) / (float)n, x = from[0] + s * dx, y = from[1] + s * dy;
        if (!(x > -1.0f && y > -1.0f && x < (float)VIEW_SIZE && y < (float)VIEW_SIZE))
            continue; /* a pixel beyond the border is the border's */
        float const c = 0.35f * x + mid[0], r = 0.35f * y + mid[1]; /* 0.3 of the way inside, cells */
        if (!(c < 1e6f && r < 1e6f && c > -1e6f && r > -1e6f && toy_cell(mask, (int32_t)c, (int32_t)r)))
            continue;
        edge_cell const e = v->f.edge[(int32_t)y * VIEW_SIZE + (int32_t)x];
        t->response += e.trace * 64 + e.xx_yy * cos2 + e.xy2 * sin2;
        t->chance += e.trace * 64;
        t->points++;
    }
}

static like_edge_tally walk_limbs(int32_t lane)
{
    like_edge_tally t = {0, 0, 0};
    for (int32_t l = 0; l < v->setup.limbs; l++) {
        bool const round = v->setup.geometry[l].shape == LIMB_ELLIPSOID;
        float at[8][2], mid[2] = {0};
        for (int32_t k = 0; k < 8; k++) {
            at[k][0] = v->outline.limb[l].x[k][lane];
            at[k][1] = v->outline.limb[l].y[k][lane];
        }
        for (int32_t a = 0; a < 2; a++) {
            int32_t const step = round ? 2 : 1;
            mid[a] = 0.0375f * ((at[0][a] + at[step][a]) + (at[2 * step][a] + at[3 * step][a]));
        }
        const grid_mask *const mask = &v->drawn.visible[l];
        if (!(v->outline.limb[l].depth[lane] > 0.0f))
            continue;
        for (int32_t k = 0; k < 8 && round; k++)
            walk(mask, at[k], at[(k + 1) & 7], mid, 2, &t);
        if (!round)
            walk(mask, at[0], at[1], mid, 8, &t);
        if (!round)
            walk(mask, at[3], at[2], mid, 8, &t);
    }
    return t;
}

/* Corners in the image, around it, far away, all in one place, or NaN. */
static float corner(uint32_t round, uint32_t at)
{
    static const float scale[] = {128.0f, 300.0f, 1e5f, 1e7f, 0.2f, 128.0f};
    static const float extreme[] = {NAN, INFINITY, -INFINITY, 256.0f, 0.0f, -0.0f};
    uint32_t const pick = draw(at, round + 9000);
    return round % 8 == 7 && pick % 5 == 0 ? extreme[pick / 5 % 6]
                                           : 128.0f + scale[round % 6] * uniform(at, round + 5000);
}

static void test_edges(void)
{
    static _Alignas(GAIT_ALIGN) unsigned char outlines[sizeof(like_outline) + 2 * GUARD];
    int32_t points = 0, differ = 0, wrong = 0, broken = 0;
    for (uint32_t round = 0; round < 300; round++) {
        int32_t const lane = (int32_t)(round % BLOCK);
        _Alignas(GAIT_ALIGN) unsigned char memory[sizeof(like_edge_tally) + 2 * GUARD];
        like_body const b = {
            .setup = &v->setup, .features = &v->f, .sides = &v->sides, .lane = lane, .layers = &v->drawn};
        like_edge_tally want = {-1, -1, -1};
        v->setup.limbs = (int32_t)(1 + round * 7 % LIMBS);
        for (uint32_t i = 0; i < VIEW_PIXELS && round % 20 == 0; i++) {
            int32_t const r = (int32_t)draw(i, round);
            v->f.edge[i] =
                (edge_cell){.trace = (int8_t)(r & 127), .xx_yy = (int8_t)(r >> 8), .xy2 = (int8_t)(r >> 16)};
            if (round % 40) /* the extremes */
                v->f.edge[i] = (edge_cell){
                    .trace = r & 1 ? 127 : 0, .xx_yy = r & 2 ? 127 : -128, .xy2 = r & 4 ? 127 : -128};
        }
        for (uint32_t l = 0; l < LIMBS; l++) {
            grid_mask *const mask = &v->drawn.visible[l];
            v->setup.geometry[l].shape = draw(l, round + 100) % 3 ? LIMB_CONE : LIMB_ELLIPSOID;
            v->outline.limb[l].depth[lane] = draw(l, round + 200) % 6 ? 3.0f : 0.0f;
            int32_t const first = (int32_t)(draw(l, round + 300) % 9 * LAYERS_BAND);
            grid_mask_frame(mask, first, first + (int32_t)(draw(l, round + 400) % 64),
                            round % 4 ? (int32_t)(draw(l, round + 500) % 8 * GRID_STEP) : 0,
                            round % 4 ? 64 : GRID_SIZE);
            for (uint32_t y = 0; y < GRID_SIZE; y++)
                for (uint32_t w = 0; w < GRID_WORDS; w++)
                    mask->word[w][y] = round % 3
                                           ? ~UINT64_C(0)
                                           : (uint64_t)draw(4 * y + w, l) << 32 | draw(4 * y + w + 2, l);
            for (uint32_t k = 0; k < 8; k++) {
                v->outline.limb[l].x[k][lane] = corner(round, 16 * l + k);
                v->outline.limb[l].y[k][lane] = corner(round, 16 * l + 8 + k);
            }
        }
        memset(&v->sides, 0xa5, sizeof v->sides); /* as guard_fill: cones leave some of it alone */
        isa_scalar()->edges_prepare(&v->outline, v->setup.geometry, v->setup.limbs, &v->sides);
        for (int k = 0; k < isa_count(); k++) {
            guarded const g = guard_fill(outlines, (size_t)v->setup.limbs * sizeof *v->sides.limb);
            isa_at(k)->edges_prepare(&v->outline, v->setup.geometry, v->setup.limbs,
                                     (like_outline *)(void *)g.begin);
            differ += memcmp(g.begin, &v->sides, g.bytes) != 0;
            broken += !guard_whole(&g);
        }
        like_edge_tally const reference = walk_limbs(lane);
        isa_scalar()->edges_count(&b, &want);
        wrong += memcmp(&want, &reference, sizeof want) != 0;
        points += want.points;
        for (int k = 0; k < isa_count(); k++) {
            guarded const g = guard_fill(memory, sizeof want);
            isa_at(k)->edges_count(&b, (like_edge_tally *)(void *)g.begin);
            differ += memcmp(g.begin, &want, sizeof want) != 0;
            broken += !guard_whole(&g);
        }
    }
    CHECK(points > 2000);
    CHECK(wrong == 0);
    CHECK(differ == 0);
    CHECK(broken == 0);
}

int main(void)
{
    v = toy_body_new(0, GAIT_MODE_DEFAULT);
    test_sample();
    test_compare();
    test_edges();
    return CHECK_DONE();
}
