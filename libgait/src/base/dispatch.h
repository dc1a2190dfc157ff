/* dispatch.h - inner loops (kernels) compiled once per instruction set (ISA). An object chooses its ISA when
 * it is initialised.
 *
 * A kernel is a plain C function KERNEL(name) in a file NAME_kernel.c, listed in KERNELS below. The Makefile
 * compiles the file once for each ISA. The `scalar` version, without any vector code, defines the result.
 * The others must give the same bits, so a kernel uses only + - * / and square roots per element, sums of
 * integers, and sums of floats in an order that the source fixes. A kernel file has no external names but
 * its kernels. The tables of all kernels are in api/kernels.c. */
#ifndef GAIT_BASE_DISPATCH_H
#define GAIT_BASE_DISPATCH_H
#include "base/base.h"

enum { BLOCK = 16 }; /* bodies or particles that a kernel works on at once, one per lane */

/* Running sums over particles, each of every SUM_LANES-th one, added up in order at the end. */
enum { SUM_LANES = 64 };

typedef float body_lanes[BLOCK];

/* Types of higher folders, whose headers the file of each kernel includes. */
struct dynamics_step;
struct edge_cell;
struct edge_rows;
struct features;
struct kin_body;
struct kin_channels;
struct kin_input;
struct layers;
struct layers_block;
struct like_body;
struct like_edge_tally;
struct like_outline;
struct like_patch;
struct like_pose;
struct like_setup;
struct limb_geometry;
struct outline_block;
struct grid_mask;
struct view_map;
struct view_planes;
struct particle_block;

/* Result, name, parameters. Every instruction set has a version of its own of these, in which a step spends its time. */
#define KERNELS_EACH(K)                                                                                      \
    /* Outlines of the limbs of a block of bodies in one camera's working image. */                          \
    K(void, outline_project,                                                                                 \
      (const struct limb_geometry *limbs, int32_t count, const struct kin_body *body,                        \
       const gait_camera *cam, const struct view_map *map, struct outline_block *out))                       \
    /* Outlines as lines in the grid, with the depth order of the limbs; then masks of one body. */          \
    K(void, layers_prepare,                                                                                  \
      (const struct outline_block *outline, const struct limb_geometry *limbs, int32_t count,                \
       struct layers_block *out))                                                                            \
    K(void, layers_draw, (const struct layers_block *block, int32_t lane, struct layers *out))               \
    K(void, silhouette_count,                                                                                \
      (const struct features *f, const struct grid_mask *whole, int32_t *area, int32_t *covered))            \
    /* Surface points of a block of bodies in a camera, samples of one body, and their comparison. */        \
    K(void, surface_pose,                                                                                    \
      (const struct like_setup *s, const gait_camera *cam, const struct view_map *map,                       \
       const struct kin_body *body, struct like_pose *out))                                                  \
    K(void, surface_sample,                                                                                  \
      (const struct like_setup *s, const struct features *f, const struct like_pose *pose, int32_t lane,     \
       const struct layers *drawn, struct like_patch *out))                                                  \
    K(void, edges_count, (const struct like_body *b, struct like_edge_tally *out))

/* SSE4 has those of the base: its own would be no faster. */
#define KERNELS_AVX(K)                                                                                          \
    /* Every channel at each lane's phase from the first `components` scores (Ormoneit et al., eq. 3). */       \
    K(void, kin_curves,                                                                                         \
      (const struct gait_model *m, const struct kin_input *in, int32_t components,                              \
       struct kin_channels *out))                                                                               \
    /* Every frame in the world; the first `proportions` scores of limb lengths apply. */                       \
    K(void, kin_pose,                                                                                           \
      (const struct gait_model *m, const struct kin_channels *ch, const struct kin_input *in,                   \
       int32_t proportions, struct kin_body *out))                                                              \
    K(void, texture_costs, (const struct like_body *b, int32_t (*cost)[16]))                                    \
    K(void, texture_logs,                                                                                       \
      (const struct like_setup *s, const struct outline_block *outline, const int32_t (*cost)[16],              \
       float *restrict log))                                                                                    \
    K(int64_t, template_cost, (const struct like_body *b))                                                      \
    /* Sides of the limbs of a block of bodies, and the gradient along those of one body. */                    \
    K(void, edges_prepare,                                                                                      \
      (const struct outline_block *outline, const struct limb_geometry *limbs, int32_t count,                   \
       struct like_outline *out))                                                                               \
    /* Upper triangle of A += W'W, A and W of ld columns (base/cholesky.h) */                                   \
    K(void, cholesky_rank, (double *A, int32_t ld, const double *W, int32_t rows))                              \
    /* A = U'U, n rows, U may be A; column n becomes U^-T b and the residual; false: not definite */            \
    K(bool, cholesky_factor, (const double *A, double *U, int32_t n, int32_t ld))                               \
    /* Z = U^-T Z, `width` columns (a multiple of CHOLESKY_LANES), cholesky_padded(n) rows of ldz */            \
    K(void, cholesky_forward,                                                                                   \
      (const double *U, int32_t n, int32_t ld, double *Z, int32_t ldz, int32_t width))                          \
    /* V = U^-T V with floats, ld x width (of CHOLESKY_FLOATS), followed by ld x ld floats of scratch */        \
    K(void, cholesky_forward_float, (const double *U, int32_t n, int32_t ld, float *V, int32_t width))          \
    /* x[j] += sum_i theta[i] mode[i * stride + j], j < width */                                                \
    K(void, lift_sum,                                                                                           \
      (double *x, int32_t width, const float *mode, size_t stride, const double *theta, int32_t modes))         \
    /* A marker's modes between two frames, out = w0 s0 + w1 s1 (3 x lanes); moved: it, by modes times theta */ \
    K(void, lift_shape,                                                                                         \
      (double *out, const float *s0, const float *s1, double w0, double w1, int32_t lanes,                      \
       const double *theta, int32_t modes, double moved[3]))                                                    \
    /* w[i] = g . shape[.][i], i < lanes */                                                                     \
    K(void, lift_row, (double *w, const double *shape, int32_t lanes, const double g[3]))                       \
    /* The same for one coordinate of eight markers, out: modes x 8 */                                          \
    K(void, lift_eight,                                                                                         \
      (double *out, const float *s0, const float *s1, double w0, double w1, const double *theta,                \
       int32_t modes, double moved[8]))                                                                         \
    /* v[i * stride + a * apart + r] = M[a][.][r] . shape[.][i][r], a < 3, i < modes, r < 8 */                  \
    K(void, lift_turn,                                                                                          \
      (float *v, size_t stride, size_t apart, const double *shape, int32_t modes, double M[9][8]))              \
    /* x[j] += sum_i Z[i * stride + j]^2, j < width, of CHOLESKY_LANES */                                       \
    K(void, lift_squares, (double *x, int32_t width, const float *Z, size_t stride, int32_t rows))              \
    /* A block of particles over one interval. */                                                               \
    K(void, dynamics_move,                                                                                      \
      (const struct dynamics_step *s, int32_t first, const struct particle_block *from,                         \
       struct particle_block *to))

/* So has SSE4 of these, and AVX-512 has those of AVX2: they take little of a step. */
#define KERNELS_FRAME(K)                                                                                        \
    /* A captured frame resampled to the working image, and its feature maps. */                                \
    K(void, view_rows,                                                                                          \
      (const struct view_map *map, const gait_camera *cam, const gait_image *im, int32_t begin, int32_t end,    \
       const struct view_planes *out))                                                                          \
    K(void, view_inside, (const struct view_map *map, const gait_camera *cam, uint64_t (*inside)[2]))           \
    K(void, view_grey, (const struct view_planes *in, int32_t begin, int32_t end, uint8_t *grey))               \
    K(void, features_foreground,                                                                                \
      (struct features * f, const struct view_planes *im, const struct view_planes *plate))                     \
    K(void, features_edges, (const uint8_t *grey, struct edge_cell *out, struct edge_rows *s))                  \
    K(void, features_contrast, (const uint8_t *grey, int8_t *out))                                              \
    K(void, features_pairs, (const int8_t *surface, uint16_t *pairs))                                           \
    /* Weighted sums over particles.  dominant: 1 for particles of the dominant hypothesis. */                  \
    /* With d = v - about, add d, d^2, and d over the dominant hypothesis to SUM_LANES running sums of each. */ \
    /* Only the last of several calls may have an n that is no multiple of SUM_LANES. */                        \
    K(void, estimate_moments,                                                                                   \
      (const float *v, const double *weight, const uint8_t *dominant, int32_t n, double about,                  \
       double (*sum)[SUM_LANES]))                                                                               \
    /* Of cosine and sine, over all and over the dominant hypothesis */                                         \
    K(void, estimate_resultant,                                                                                 \
      (const float *angle, float turn, const double *weight, const uint8_t *dominant, int32_t n,                \
       double out[4]))                                                                                          \
    /* Mark the particles near the best one; returns their weight */                                            \
    K(double, estimate_dominant,                                                                                \
      (const float *phase, const float *heading, const double *weight, int32_t n, int32_t best,                 \
       uint8_t *dominant))                                                                                      \
    /* Outer products of the quaternions, over the dominant hypothesis */                                       \
    K(void, estimate_rotations,                                                                                 \
      (const float *heading, const float *pitch, const float *roll, const double *weight,                       \
       const uint8_t *dominant, int32_t n, double out[16]))                                                     \
    /* hidden[i] = log(exp(visible[i]) + exp(base + hidden[i])) */                                              \
    K(void, track_loss_join, (const float *visible, float base, int32_t n, float *hidden))

#define KERNELS(K) KERNELS_EACH(K) KERNELS_AVX(K) KERNELS_FRAME(K)

/* The instruction sets of this build, best last, each with the bit that a CPU mask must have. */
#if defined(__x86_64__)
#define KERNEL_ISAS(S)                                                                                       \
    S(scalar, 0)                                                                                             \
    S(base, GAIT_CPU_BASE) S(sse4, GAIT_CPU_SSE4) S(avx2, GAIT_CPU_AVX2) S(avx512, GAIT_CPU_AVX512)
#else
#define KERNEL_ISAS(S) S(scalar, 0) S(base, GAIT_CPU_BASE)
#endif

#define KERNEL_MEMBER(result, name, parameters) result(*name) parameters;
typedef struct kernels {
    const char *isa; /* "scalar", "base", "sse4", "avx2" or "avx512" */
    KERNELS(KERNEL_MEMBER)
} kernels;

/* Put before a loop whose iterations do not depend on each other where the compiler cannot see that. */
#if defined(KERNEL_SCALAR)
#define KERNEL_LANES
#elif defined(__clang__)
#define KERNEL_LANES _Pragma("clang loop vectorize(assume_safety)")
#elif defined(__GNUC__)
#define KERNEL_LANES _Pragma("GCC ivdep")
#else
#define KERNEL_LANES
#endif

#ifdef KERNEL_ISA /* in a kernel file: the ISA that it is compiled for */
/* A loop over one row, kept out of the enclosing loops: compilers do not vectorise some nested loops. */
#define KERNEL_ROW                                 static __attribute__((noinline))
#define KERNEL_JOIN(name, isa)                     name##_##isa
#define KERNEL_NAME(name, isa)                     KERNEL_JOIN(name, isa)
#define KERNEL(name)                               KERNEL_NAME(name, KERNEL_ISA)
#define KERNEL_PROTOTYPE(result, name, parameters) result KERNEL(name) parameters;
KERNELS(KERNEL_PROTOTYPE)
#endif
#endif
