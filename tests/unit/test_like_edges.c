/* The edge term on artificial fields of edges, where it depends only on the direction of the outline. */
#include "toy_body.h"

#include "check.h"

static toy_body *v;
static layers drawn;

/* The limbs' outlines as masks and sides. */
static void draw(int32_t lane)
{
    toy_draw(&v->outline, v->setup.geometry, v->setup.limbs, lane, &drawn);
    v->setup.run->edges_prepare(&v->outline, v->setup.geometry, v->setup.limbs, &v->sides);
}

/* One body of them as the term sees it. */
static like_body body(int32_t lane)
{
    return (like_body){.setup = &v->setup,
                       .features = &v->f,
                       .outline = &v->outline,
                       .sides = &v->sides,
                       .lane = lane,
                       .layers = &drawn};
}

/* One limb, the polygon with these corners, nothing before it. */
static like_body one_limb(int32_t shape, const float *x, const float *y)
{
    enum { LANE = 2 };
    v->setup.limbs = 1;
    v->setup.geometry[0].shape = shape;
    for (int32_t k = 0; k < outline_vertices(&v->setup.geometry[0]); k++) {
        v->outline.limb[0].x[k][LANE] = x[k];
        v->outline.limb[0].y[k][LANE] = y[k];
    }
    v->outline.limb[0].depth[LANE] = 3.0f;
    draw(LANE);
    return body(LANE);
}

/* Every pixel of the map has the tensor of an edge whose normal is at this angle; share of a full response. */
static void edge_field(double angle, double share, bool any_direction)
{
    edge_cell const e = {.trace = (int8_t)(EDGE_ONE * share),
                         .xx_yy = (int8_t)(any_direction ? 0 : EDGE_ONE * share * cos(2.0 * angle)),
                         .xy2 = (int8_t)(any_direction ? 0 : EDGE_ONE * share * sin(2.0 * angle))};
    for (int32_t i = 0; i < VIEW_PIXELS; i++)
        v->f.edge[i] = e;
}

/* A straight limb of width 24 and length 120 leaning at an angle, which is also that of its sides' normal. */
static like_body leaning(double angle)
{
    static const double along[4] = {-60, 60, 60, -60}, side[4] = {-12, -12, 12, 12};
    float x[4], y[4];
    for (int k = 0; k < 4; k++) {
        x[k] = (float)(128.0 - along[k] * sin(angle) + side[k] * cos(angle));
        y[k] = (float)(128.0 + along[k] * cos(angle) + side[k] * sin(angle));
    }
    return one_limb(LIMB_CONE, x, y);
}

static void test_direction(void)
{
    for (int k = 0; k < 12; k++) {
        double const angle = 3.14159265 * k / 12.0;
        like_body const b = leaning(angle);
        edge_field(angle, 1.0, false);
        CHECK_NEAR(like_edges.log_likelihood(&b), 0.0, 0.03);
        CHECK_NEAR(like_edges.support(&b), 0.45, 0.03);
        edge_field(angle + 1.570796327, 1.0, false);
        CHECK_NEAR(like_edges.log_likelihood(&b), -1.0, 0.03);
        CHECK(like_edges.support(&b) < -0.4f);
        edge_field(angle + 0.785398163, 1.0, false); /* cos^2 of 45 degrees */
        CHECK_NEAR(like_edges.log_likelihood(&b), -0.5, 0.03);
        edge_field(angle, 1.0, true); /* no direction: half, and no support */
        CHECK_NEAR(like_edges.log_likelihood(&b), -0.5, 0.03);
        CHECK_NEAR(like_edges.support(&b), -0.05, 0.01);
        edge_field(angle, 0.5, false);
        CHECK_NEAR(like_edges.log_likelihood(&b), -0.5, 0.03);
        edge_field(angle, 0.0, false);
        CHECK_NEAR(like_edges.log_likelihood(&b), -1.0, 1e-6);
        CHECK(like_edges.support(&b) < 0.0f); /* an image without edges shows no person */
    }
}

/* A round limb meets edges of every direction alike. */
static void test_round(void)
{
    float x[8], y[8];
    for (int k = 0; k < 8; k++) {
        x[k] = 100.0f + 30.0f * cosf(0.78539816f * (float)k);
        y[k] = 90.0f + 30.0f * sinf(0.78539816f * (float)k);
    }
    like_body const b = one_limb(LIMB_ELLIPSOID, x, y);
    for (int k = 0; k < 7; k++) {
        edge_field(0.3 * k, 1.0, false);
        CHECK_NEAR(like_edges.log_likelihood(&b), -0.5, 0.03);
    }
    for (int32_t i = 0; i < VIEW_PIXELS; i++) { /* edges all around the middle: perfect */
        double const angle = atan2(i / VIEW_SIZE - 90.0, i % VIEW_SIZE - 100.0);
        v->f.edge[i] = (edge_cell){.trace = EDGE_ONE,
                                   .xx_yy = (int8_t)(EDGE_ONE * cos(2.0 * angle)),
                                   .xy2 = (int8_t)(EDGE_ONE * sin(2.0 * angle))};
    }
    CHECK(like_edges.log_likelihood(&b) > -0.08f);
}

/* Edges count at the outline only, and only where the limb can be seen. */
static void test_where(void)
{
    like_body const b = leaning(0.0); /* sides at x = 116 and 140, y from 68 to 188 */
    edge_field(0.0, 0.0, false);
    for (int32_t y = 0; y < VIEW_SIZE; y++)
        v->f.edge[y * VIEW_SIZE + 128] = (edge_cell){.trace = EDGE_ONE, .xx_yy = EDGE_ONE};
    CHECK_NEAR(like_edges.log_likelihood(&b), -1.0, 1e-6); /* inside the limb */
    for (int32_t y = 0; y < VIEW_SIZE; y++)
        v->f.edge[y * VIEW_SIZE + 116] = (edge_cell){.trace = EDGE_ONE, .xx_yy = EDGE_ONE};
    CHECK_NEAR(like_edges.log_likelihood(&b), -0.5, 0.03); /* one of two sides */
    /* Hide a part of the limb: too few of its points are left to judge. */
    for (int32_t row = 0; row < 54; row++)
        drawn.visible[0].word[0][row] = drawn.visible[0].word[1][row] = 0;
    CHECK(like_edges.log_likelihood(&b) == -1.0f);
    CHECK(like_edges.support(&b) == -1.0f);
}

/* A hidden limb's points are left out of the average. */
static void test_hidden(void)
{
    enum { LANE = 2 };
    static const float x[2][4] = {{40, 40, 64, 64}, {150, 150, 174, 174}}, y[4] = {40, 200, 200, 40};
    static const float cover[4] = {110, 110, 210, 210};
    v->setup.limbs = 3;
    for (int32_t l = 0; l < 3; l++) {
        v->setup.geometry[l].shape = LIMB_CONE;
        for (int32_t k = 0; k < 4; k++) {
            v->outline.limb[l].x[k][LANE] = l < 2 ? x[l][k] : cover[k];
            v->outline.limb[l].y[k][LANE] = y[k];
        }
        v->outline.limb[l].depth[LANE] = l < 2 ? 4.0f : 2.0f; /* the third hides the second */
    }
    draw(LANE);
    like_body const b = body(LANE);
    edge_field(0.0, 0.0, false);
    static const int32_t column[] = {40, 64, 110, 210};
    for (int32_t i = 0; i < VIEW_SIZE; i++)
        for (int k = 0; k < 4; k++)
            v->f.edge[i * VIEW_SIZE + column[k]] = (edge_cell){.trace = EDGE_ONE, .xx_yy = EDGE_ONE};
    CHECK_NEAR(like_edges.log_likelihood(&b), 0.0, 0.03); /* all that is visible has an edge */
    v->outline.limb[2].depth[LANE] = 5.0f; /* now it is behind: the second is visible, without edges */
    draw(LANE);
    CHECK_NEAR(like_edges.log_likelihood(&b), -1.0 / 3.0, 0.03);
    v->outline.limb[1].depth[LANE] = 0.0f; /* behind the camera: no part of the average */
    draw(LANE);
    CHECK_NEAR(like_edges.log_likelihood(&b), 0.0, 0.03);
}

/* A limb partly or wholly outside the region: no point is read outside the map. */
static void test_border(void)
{
    static const float off[] = {-500.0f, -125.0f, 120.0f, 500.0f};
    edge_field(0.0, 1.0, false);
    for (size_t k = 0; k < 4; k++)
        for (int axis = 0; axis < 2; axis++) {
            float x[4] = {116, 116, 140, 140}, y[4] = {68, 188, 188, 68};
            for (int i = 0; i < 4; i++)
                *(axis ? &y[i] : &x[i]) += off[k];
            like_body const b = one_limb(LIMB_CONE, x, y);
            float const ll = like_edges.log_likelihood(&b);
            CHECK(ll <= 0.03f && ll >= -1.0f);
            CHECK(fabsf(off[k]) < 200.0f || ll == -1.0f);
        }
}

/* Points right of or below the map find no edges there, though a reader out of bounds would. */
static void test_beyond(void)
{
    static const float x[2][4] = {{234, 234, 258, 258}, {116, 116, 140, 140}};
    static const float y[2][4] = {{68, 188, 188, 68}, {148, 268, 268, 148}};
    edge_field(0.0, 0.0, false);
    memset(v->f.pairs, 0x7f, VIEW_PIXELS * sizeof *v->f.pairs); /* what lies behind the edges in memory */
    for (int32_t i = 0; i < VIEW_SIZE; i++)
        for (int32_t k = 0; k < 20; k++)
            v->f.edge[i * VIEW_SIZE + k] = (edge_cell){.trace = EDGE_ONE, .xx_yy = EDGE_ONE};
    for (int k = 0; k < 2; k++) {
        like_body b = one_limb(LIMB_CONE, x[k], y[k]);
        v->setup.limbs = 2; /* the same twice: points enough to judge */
        v->setup.geometry[1] = v->setup.geometry[0];
        for (int i = 0; i < 4; i++) {
            v->outline.limb[1].x[i][b.lane] = x[k][i] - 60.0f;
            v->outline.limb[1].y[i][b.lane] = y[k][i] - 20.0f;
        }
        v->outline.limb[1].depth[b.lane] = 3.0f;
        draw(b.lane);
        CHECK_NEAR(like_edges.support(&b), -0.005, 1e-6); /* enough points, no edges */
        CHECK(like_edges.log_likelihood(&b) == -1.0f);
    }
}

int main(void)
{
    v = toy_body_new(0, GAIT_MODE_DEFAULT);
    CHECK(like_edges.flag == GAIT_TERM_EDGES);
    test_direction();
    test_round();
    test_where();
    test_hidden();
    test_border();
    test_beyond();
    return CHECK_DONE();
}
