/* Limbs in the image: against the projections of their ends and surfaces, and against known sizes. */
#include "raster/limb_polygon.h"

#include "toy_draw.h"
#include "toy_scene.h"

#include "check.h"

static const view_map whole = {.scale = 1.0f};

/* Looking along +y from the origin: image x is world x, image y is -z. */
static gait_camera front_camera(void)
{
    return (gait_camera){.width = 640,
                         .height = 480,
                         .fx = 500.0f,
                         .fy = 500.0f,
                         .cx = 320.0f,
                         .cy = 240.0f,
                         .R = {1, 0, 0, 0, 0, -1, 0, 1, 0}};
}

static const float upright[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};

/* Geometry of one limb alone: the toy model's first with another shape. */
static limb_geometry one_limb(int32_t shape, const float number[LIMB_SHAPE], float girth)
{
    static const int32_t frame_of_first = 1;
    limb_geometry all[MODEL_MAX_LIMBS];
    int32_t info[MODEL_MAX_LIMBS * LIMB_INFO] = {0};
    gait_model m = *toy_model();
    info[0] = frame_of_first;
    info[1] = shape;
    m.limbs = 1;
    m.limb_info = info;
    m.limb_shape = number;
    limb_geometry_init(&m, girth, all);
    CHECK(all[0].frame == frame_of_first && all[0].shape == shape);
    return all[0];
}

static double dot3(const float *a, const float *b)
{
    return (double)a[0] * (double)b[0] + (double)a[1] * (double)b[1] + (double)a[2] * (double)b[2];
}

/* ---- geometry ---- */
static void test_geometry(void)
{
    static const float numbers[][LIMB_SHAPE] = {{0, 0, 0, 0, 0, -0.2f, 0.05f, 0.04f, 0.03f, 0.02f},
                                                {0.1f, 0, 0, 0.3f, 0, 0, 0.05f, 0.04f, 0.03f, 0.02f},
                                                {0, 0, 0, 0, 0.4f, 0, 0.05f, 0.04f, 0.03f, 0.02f},
                                                {0, 0, 0, 0.01f, -0.4f, 0, 0.05f, 0.04f, 0.03f, 0.02f},
                                                {0, 0, 0, 0.2f, 0.2f, 0.3f, 0.05f, 0.04f, 0.03f, 0.02f}};
    for (size_t k = 0; k < sizeof numbers / sizeof *numbers; k++) {
        limb_geometry const g = one_limb(LIMB_CONE, numbers[k], 1.2f);
        float axis[3], cross[3];
        for (int i = 0; i < 3; i++)
            axis[i] = g.end[i] - g.start[i];
        double const length = sqrt(dot3(axis, axis));
        for (int i = 0; i < 3; i++)
            cross[i] =
                g.lateral[(i + 1) % 3] * axis[(i + 2) % 3] - g.lateral[(i + 2) % 3] * axis[(i + 1) % 3];
        CHECK_NEAR(dot3(g.lateral, g.lateral), 1.0, 1e-5);
        CHECK_NEAR(dot3(g.sagittal, g.sagittal), 1.0, 1e-5);
        CHECK_NEAR(dot3(g.lateral, axis), 0.0, 1e-6);
        CHECK_NEAR(dot3(g.sagittal, axis), 0.0, 1e-6);
        CHECK_NEAR(dot3(g.sagittal, cross), length, 1e-5);
        CHECK_NEAR(g.a0, 0.06, 1e-7);
        CHECK_NEAR(g.b0, 0.048, 1e-7);
        CHECK_NEAR(g.a1, 0.036, 1e-7);
        CHECK_NEAR(g.b1, 0.024, 1e-7);
        if (k < 2) /* where it can, radius a lies along the body's left */
            CHECK_NEAR(g.lateral[1], 1.0, 1e-6);
    }
}

/* ---- cones ---- */

/* Straight in front and parallel to the image: half widths are the radii across, and the ends reach out by 0.7 of
 * what is seen of their ellipses. */
static void test_front_cone(void)
{
    static const float number[LIMB_SHAPE] = {0, 0, 0.25f, 0, 0, -0.25f, 0.10f, 0.06f, 0.05f, 0.03f};
    static const float quarter[9] = {0, -1, 0, 1, 0, 0, 0, 0, 1}; /* turned 90 degrees about the limb */
    static const view_map half = {.scale = 0.5f, .u0 = 100.0f, .v0 = 40.0f};
    static const double radius[2][4] = {{0.06, 0.03, 0.10, 0.05},
                                        {0.10, 0.05, 0.06, 0.03}}; /* across, away */
    limb_geometry const g = one_limb(LIMB_CONE, number, 1.0f);
    gait_camera const cam = front_camera();
    const float at[3] = {0, 4, 0};
    for (int turned = 0; turned < 2; turned++)
        for (int small = 0; small < 2; small++) {
            const double *const r = radius[turned];
            double const px = small ? 125.0 : 250.0; /* pixels per model length at 4 m for 2 m */
            double const u = small ? 110.0 : 320.0, v = small ? 100.0 : 240.0, slope = 0.5 / 4.0;
            limb_polygon p;
            outline_limb(&g, turned ? quarter : upright, at, 2.0f, &cam, small ? &half : &whole, &p);
            CHECK_NEAR(fabsf(p.x[0] - p.x[3]), 2.0 * px * r[0], 0.01);
            CHECK_NEAR(fabsf(p.x[1] - p.x[2]), 2.0 * px * r[1], 0.01);
            CHECK_NEAR(0.5f * (p.x[0] + p.x[3]), u, 0.01);
            CHECK_NEAR(0.5f * (p.x[1] + p.x[2]), u, 0.01);
            CHECK((p.x[0] < u) == (p.x[1] < u)); /* 0-1 and 3-2 are sides, not diagonals */
            for (int k = 0; k < 4; k++) {
                bool const low = k == 1 || k == 2;
                double const reach = px * (0.25 + 0.7 * slope * r[low ? 3 : 2]);
                CHECK_NEAR(p.y[k], low ? v + reach : v - reach, 0.01);
            }
            CHECK_NEAR(p.depth, 4.0, 1e-5);
            CHECK_NEAR(p.cos_tilt, 1.0, 1e-5);
        }
}

/* Pointing at the camera: only the ends are visible, and cos_tilt does not matter. */
static void test_pointing_cone(void)
{
    static const float number[LIMB_SHAPE] = {0, 0.2f, 0, 0, -0.2f, 0, 0.10f, 0.06f, 0.10f, 0.06f};
    limb_geometry const g = one_limb(LIMB_CONE, number, 1.0f);
    gait_camera const cam = front_camera();
    const float at[3] = {0, 4, 0};
    limb_polygon p;
    outline_limb(&g, upright, at, 1.0f, &cam, &whole, &p);
    CHECK_NEAR(p.cos_tilt, 0.0, 1e-3);
    CHECK_NEAR(p.depth, 4.0, 1e-5);
    for (int k = 0; k < 4; k++)
        CHECK(fabsf(p.x[k] - 320.0f) < 16.0f && fabsf(p.y[k] - 240.0f) < 16.0f && isfinite(p.x[k]));
}

/* ---- ellipsoids ---- */
static double polygon_area(const limb_polygon *p, int n)
{
    double sum = 0.0;
    for (int i = 0, j = n - 1; i < n; j = i++)
        sum += (double)p->x[j] * (double)p->y[i] - (double)p->x[i] * (double)p->y[j];
    return fabs(0.5 * sum);
}

static void test_ellipsoid(void)
{
    static const float ball[LIMB_SHAPE] = {0, 0, 0.1f, 0, 0, -0.1f, 0.1f, 0.1f, 0.1f, 0.1f};
    static const float egg[LIMB_SHAPE] = {0, 0, 0.2f, 0, 0, -0.2f, 0.05f, 0.1f, 0.05f, 0.1f};
    gait_camera const cam = front_camera();
    const float at[3] = {0, 5, 0};
    limb_polygon p;
    limb_geometry g = one_limb(LIMB_ELLIPSOID, ball, 1.0f);
    CHECK(outline_vertices(&g) == 8);
    outline_limb(&g, upright, at, 2.0f, &cam, &whole, &p);
    double sum[2] = {0.0, 0.0};
    for (int k = 0; k < 8; k++) {
        CHECK_NEAR(hypot((double)p.x[k] - 320.0, (double)p.y[k] - 240.0), 20.0 * 1.054, 0.05);
        sum[0] += (double)p.x[k] / 8.0;
        sum[1] += (double)p.y[k] / 8.0;
    }
    CHECK_NEAR(polygon_area(&p, 8), 3.14159265 * 20.0 * 20.0, 3.0);
    CHECK_NEAR(sum[0], 320.0, 0.01);
    CHECK_NEAR(sum[1], 240.0, 0.01);
    CHECK_NEAR(p.depth, 5.0, 1e-5);
    CHECK(p.cos_tilt == 1.0f);
    /* Off the axis a ball is wider than high by the slope of its ray. */
    const float aside[3] = {2.5f, 5, 0};
    double most = 0.0;
    outline_limb(&g, upright, aside, 2.0f, &cam, &whole, &p);
    for (int k = 0; k < 8; k++)
        most = fmax(most, (double)p.x[k] - 570.0);
    CHECK_NEAR(most, 20.0 * 1.054 * sqrt(1.25), 0.05);
    /* Half length 0.2 x 2 m x 100 px, half width radius b (sagittal, along x), leaning to the right by 3-4-5. */
    static const float leaning[9] = {0.8f, 0, 0.6f, 0, 1, 0, -0.6f, 0, 0.8f};
    g = one_limb(LIMB_ELLIPSOID, egg, 1.0f);
    for (int lean = 0; lean < 2; lean++) {
        double const c = lean ? 0.8 : 1.0, s = lean ? 0.6 : 0.0;
        outline_limb(&g, lean ? leaning : upright, at, 2.0f, &cam, &whole, &p);
        for (int k = 0; k < 8; k++) {
            double const dx = (double)p.x[k] - 320.0, dy = 240.0 - (double)p.y[k];
            CHECK_NEAR(hypot((c * dx - s * dy) / 20.0, (s * dx + c * dy) / 40.0), 1.054, 0.01);
        }
        CHECK_NEAR(polygon_area(&p, 8), 3.14159265 * 20.0 * 40.0, 5.0);
    }
}

/* ---- behind the camera ---- */
static void test_behind(void)
{
    static const float number[LIMB_SHAPE] = {0, 0.3f, 0, 0, -0.3f, 0, 0.05f, 0.05f, 0.05f, 0.05f};
    gait_camera const cam = front_camera();
    static const float away[] = {5.0f, 0.32f, 0.3f, 0.2f, 0.0f, -0.2f, -5.0f};
    for (size_t k = 0; k < sizeof away / sizeof *away; k++)
        for (int32_t shape = LIMB_CONE; shape <= LIMB_ELLIPSOID; shape++) {
            limb_geometry const g = one_limb(shape, number, 1.0f);
            const float at[3] = {0.1f, away[k], 0};
            limb_polygon p;
            int finite = 1;
            outline_limb(&g, upright, at, 1.0f, &cam, &whole, &p);
            for (int v = 0; v < outline_vertices(&g); v++)
                finite &= isfinite(p.x[v]) && isfinite(p.y[v]);
            CHECK(finite);
            bool const front = shape == LIMB_CONE ? away[k] > 0.3f + CAMERA_NEAR : away[k] > CAMERA_NEAR;
            CHECK(front ? p.depth == away[k] : p.depth == 0.0f); /* a cone needs both of its ends */
        }
}

/* ---- the toy person in many poses, against its projected ends and surface ---- */
typedef struct view_of_limb {
    const float *R, *o;
    float scale;
    const gait_camera *cam;
} view_of_limb;

static void image_of(const view_of_limb *v, const float p[3], float uv[2])
{
    float world[3];
    for (int k = 0; k < 3; k++)
        world[k] =
            v->o[k] + v->scale * (v->R[3 * k] * p[0] + v->R[3 * k + 1] * p[1] + v->R[3 * k + 2] * p[2]);
    if (!(camera_project(v->cam, world, uv) > 1.0f))
        check_that(0, "in front of the camera", __FILE__, __LINE__);
}

/* Distance of a point from the polygon, positive outside (convex, either way round). */
static double outside(const limb_polygon *p, int n, const float at[2])
{
    double worst = -1e9, turn = 0.0;
    for (int i = 0, j = n - 1; i < n; j = i++)
        turn += (double)p->x[j] * (double)p->y[i] - (double)p->x[i] * (double)p->y[j];
    for (int i = 0, j = n - 1; i < n; j = i++) {
        double const ex = (double)p->x[i] - (double)p->x[j], ey = (double)p->y[i] - (double)p->y[j];
        double const px = (double)at[0] - (double)p->x[j], py = (double)at[1] - (double)p->y[j];
        double const left = (ex * py - ey * px) / fmax(hypot(ex, ey), 1e-9);
        worst = fmax(worst, turn > 0.0 ? -left : left);
    }
    return worst;
}

typedef struct fit { /* how well polygons cover their limbs */
    double out, beyond, off_axis;
    int points;
} fit;

/* The ends are on the polygon's axis, the surface is inside it, and it is no wider than necessary. */
static void check_limb(const limb_geometry *g, const view_of_limb *v, const limb_polygon *p, fit *f)
{
    int const n = outline_vertices(g);
    float end[2][2];
    image_of(v, g->start, end[0]);
    image_of(v, g->end, end[1]);
    double const dx = (double)end[1][0] - (double)end[0][0], dy = (double)end[1][1] - (double)end[0][1];
    double const length = hypot(dx, dy), size = sqrt(polygon_area(p, n));
    if (g->shape == LIMB_CONE && length > 2.0)
        for (int k = 0; k < 2; k++) {
            double const mx = 0.5 * ((double)p->x[k] + (double)p->x[3 - k]) - (double)end[k][0];
            double const my = 0.5 * ((double)p->y[k] + (double)p->y[3 - k]) - (double)end[k][1];
            f->off_axis = fmax(f->off_axis, fabs(mx * dy - my * dx) / length);
            CHECK((mx * dx + my * dy) * (k ? 1.0 : -1.0) > -0.02); /* the ends reach outwards */
        }
    double touch = -1e9;
    for (int row = 0; row <= 8; row++)
        for (int a = 0; a < 16; a++) {
            float const z = (float)row / 8.0f, u = 6.2831853f * (float)a / 16.0f;
            float const round = sqrtf(f_max(1.0f - (2.0f * z - 1.0f) * (2.0f * z - 1.0f), 0.0f));
            float const ra = g->shape == LIMB_CONE ? g->a0 + z * (g->a1 - g->a0) : g->a0 * round;
            float const rb = g->shape == LIMB_CONE ? g->b0 + z * (g->b1 - g->b0) : g->b0 * round;
            float q[3], uv[2];
            for (int k = 0; k < 3; k++)
                q[k] = g->start[k] + z * (g->end[k] - g->start[k]) + ra * cosf(u) * g->lateral[k] +
                       rb * sinf(u) * g->sagittal[k];
            image_of(v, q, uv);
            double const d = outside(p, n, uv);
            touch = fmax(touch, d);
            f->points++;
        }
    f->out = fmax(f->out, touch / size);
    f->beyond = fmax(f->beyond, -touch / size);
}

static void test_person(void)
{
    const gait_model *const m = toy_model();
    limb_geometry limbs[MODEL_MAX_LIMBS];
    limb_geometry_init(m, 1.0f, limbs);
    fit f = {0};
    for (int n = 0; n < 40; n++) {
        gait_camera cam = toy_camera(n % 2);
        cam.fx = 1.4f * cam.fy;
        gait_state s = toy_walk(0.07f * (float)n);
        s.heading = 0.7f * (float)(n / 2);
        kin_frames at;
        CHECK(model_place_state(m, &s, &at) == GAIT_OK);
        for (int32_t l = 0; l < m->limbs; l++) {
            view_of_limb const v = {at.R + 9 * limbs[l].frame, at.o + 3 * limbs[l].frame, s.stature, &cam};
            limb_polygon p;
            outline_limb(&limbs[l], v.R, v.o, v.scale, &cam, &whole, &p);
            check_limb(&limbs[l], &v, &p, &f);
            float const *const R9 = cam.R;
            float mid[3], axis[3], c[3], d[3];
            for (int k = 0; k < 3; k++) {
                mid[k] = 0.5f * (limbs[l].start[k] + limbs[l].end[k]);
                axis[k] = limbs[l].end[k] - limbs[l].start[k];
            }
            for (int k = 0; k < 3; k++) {
                d[k] = (float)dot3(v.R + 3 * k, axis);
                c[k] = v.o[k] + s.stature * (float)dot3(v.R + 3 * k, mid);
            }
            float const depth = (float)dot3(R9 + 6, c) + cam.t[2];
            CHECK_NEAR(p.depth, depth, 1e-4);
            float projection[3] = {0}; /* from the camera to the limb, world axes */
            for (int k = 0; k < 3; k++)
                for (int i = 0; i < 3; i++)
                    projection[k] += R9[3 * i + k] * ((float)dot3(R9 + 3 * i, c) + cam.t[i]);
            double const sine = dot3(projection, d) / sqrt(dot3(projection, projection) * dot3(d, d));
            if (limbs[l].shape == LIMB_CONE)
                CHECK_NEAR(p.cos_tilt, sqrt(1.0 - sine * sine), 1e-3);
        }
    }
    CHECK(f.points > 70000);
    CHECK(f.off_axis < 0.05); /* pixels */
    CHECK(f.out < 0.2);       /* of the size: a foreshortened end's ellipse is cut */
    CHECK(f.beyond < 0.01);   /* the surface touches the outline */
}

/* Every lane of a block has the polygon of its own body. */
static void test_lanes(void)
{
    const gait_model *const m = toy_model();
    static kin_body body;
    static outline_block block;
    limb_geometry limbs[MODEL_MAX_LIMBS];
    gait_camera const cam = toy_camera(1);
    view_map const map = {.scale = 1.3f, .u0 = 33.0f, .v0 = 21.0f};
    static kin_frames at[BLOCK];
    limb_geometry_init(m, 1.1f, limbs);
    for (int lane = 0; lane < BLOCK; lane++) {
        gait_state s = toy_walk(0.1f * (float)lane);
        s.stature = 1.5f + 0.02f * (float)lane;
        s.proportion[0] = 1.0f - 0.1f * (float)lane;
        CHECK(model_place_state(m, &s, &at[lane]) == GAIT_OK);
        for (int f = 0; f < m->frames; f++) {
            body.scale[f][lane] = at[lane].scale[f];
            for (int k = 0; k < 9; k++)
                body.R[f][k][lane] = at[lane].R[9 * f + k];
            for (int k = 0; k < 3; k++)
                body.o[f][k][lane] = at[lane].o[3 * f + k];
        }
    }
    toy_project(limbs, m->limbs, &body, &cam, &map, &block);
    int wrong = 0;
    for (int lane = 0; lane < BLOCK; lane++)
        for (int32_t l = 0; l < m->limbs; l++) {
            int32_t const f = limbs[l].frame;
            limb_polygon p;
            outline_limb(&limbs[l], at[lane].R + 9 * f, at[lane].o + 3 * f, at[lane].scale[f], &cam, &map,
                         &p);
            const outline_lanes *const q = &block.limb[l];
            for (int32_t k = 0; k < outline_vertices(&limbs[l]); k++)
                wrong += q->x[k][lane] != p.x[k] || q->y[k][lane] != p.y[k];
            wrong += q->depth[lane] != p.depth || q->cos_tilt[lane] != p.cos_tilt;
        }
    CHECK(wrong == 0);
}

int main(void)
{
    test_geometry();
    test_front_cone();
    test_pointing_cone();
    test_ellipsoid();
    test_behind();
    test_person();
    test_lanes();
    return CHECK_DONE();
}
