/* gait_lift.h - 3-D motion from 2-D keypoints, by a prior over segments of motion (Leventon and Freeman 1998).
 *
 * A segment is F frames of J markers: stature x (mean + sum_i alpha_i mode_i), rotated by a heading about z and placed
 * on the ground; alpha ~ N(0, I), learnt from motion capture (gait learn --segments).  The visible markers and their
 * noise may change from frame to frame.  Arrays are doubles, [F][J][...] by frame.  The rules of gait.h on memory,
 * threads, errors and tables apply. */
#ifndef GAIT_LIFT_H
#define GAIT_LIFT_H
#include "gait.h"

#define GAIT_MAX_MARKERS 64
#define GAIT_MAX_SEGMENT_FRAMES 64
#define GAIT_MAX_MODES 120  /* of a segment prior */
#define GAIT_MAX_MIXTURE 16 /* Gaussians of a segment prior */

#ifdef __cplusplus
extern "C" {
#endif

/* ---- lifters ----------------------------------------------------------------------------------------- */
typedef struct gait_lift gait_lift;
typedef GAIT_ENUM(gait_projection) { GAIT_LIFT_PERSPECTIVE = 0, GAIT_LIFT_ORTHOGRAPHIC = 1 } gait_projection;

/* Contents of a model's segment prior. */
#define GAIT_LIFT_INFO_FIELDS(FIELD)                                                                                  \
    FIELD("Markers, J.",                                                                                              \
          int32_t, markers, , "")                                                                                     \
    FIELD("Frames of a segment, F.",                                                                                  \
          int32_t, frames, , "frames")                                                                                \
    FIELD("Frames from one segment to the next.",                                                                     \
          int32_t, hop, , "frames")                                                                                   \
    FIELD("0: heading is unknown; 2, 8: number of rotated copies learnt, axes are the world's.",                      \
          int32_t, headings, , "")                                                                                    \
    FIELD("Gaussians of the mixture.",                                                                                \
          int32_t, components, , "")                                                                                  \
    FIELD("Modes of each Gaussian.",                                                                                  \
          int32_t, modes, , "")                                                                                       \
    FIELD("Frame rate of a segment.",                                                                                 \
          float, fps, , "frames per second")                                                                          \
    FIELD("Mean stature of the training data.",                                                                       \
          float, stature, , "metres")                                                                                 \
    FIELD("Hash of the model's blob.",                                                                                \
          uint64_t, digest, , "")

typedef struct gait_lift_info { GAIT_LIFT_INFO_FIELDS(GAIT_DECLARE) } gait_lift_info;

/* Settings of a lifter.  gait_lift_default() fills them; change what you need. */
#define GAIT_LIFT_CONFIG_FIELDS(SETTING, FIELD)                                                                       \
    FIELD("Size of this struct in the caller's header, set by gait_lift_default().",                                  \
          uint32_t, struct_size, , "bytes")                                                                           \
    FIELD("View: `camera` and keypoints in pixels (default), or orthographic: `axis` and keypoints in metres.",       \
          gait_projection, projection, , "")                                                                          \
    SETTING("Stature; 0: the mean of the training data.",                                                             \
          double, stature, , "metres", 0, 0, 10)                                                                      \
    SETTING("Its standard deviation; 0: exact; -1: 0.04, or 0.09 if stature is 0.",                                   \
          double, stature_sd, , "metres", -1, -1, 1)                                                                  \
    SETTING("Standard deviation of an observation if none is given.",                                                 \
          double, sd, , "pixels or metres", 3, 1e-9, 1e9)                                                             \
    SETTING("Expected position of the pelvis in the first frame; z: of the floor.",                                   \
          double, place, [3], "metres", GAIT_VALUES(0, 0, 0), -1e6, 1e6)                                              \
    SETTING("Its standard deviation; 0: exact.",                                                                      \
          double, place_sd, [3], "metres", GAIT_VALUES(10, 10, 0.03), 0, 1e6)                                         \
    SETTING("Expected heading of the body in the first frame about z; 0: along +x.",                                  \
          double, heading, , "radians", 0, -100, 100)                                                                 \
    SETTING("Its standard deviation; 0: exact; -1: unknown, or 0 for priors with rotated copies.",                    \
          double, heading_sd, , "radians", -1, -1, 10)                                                                \
    SETTING("Orthographic view: directions of u and v in the world, orthonormal.",                                    \
          double, axis, [2][3], "", GAIT_VALUES({1, 0, 0}, {0, 0, 1}), NAN, NAN)                                      \
    FIELD("Perspective view: the camera, its t within 1e4 metres along each axis.",                                   \
          gait_camera, camera, , "")                                                                                  \
    SETTING("Stream: number of later frames that an estimate waits for; -1: no stream.",                              \
          int32_t, lag, , "frames", 5, -1, 64)                                                                        \
    /* ---- advanced settings ---- */                                                                                 \
    SETTING("Stream: bit j: marker j is estimated.",                                                                  \
          uint64_t, report, , "mask", UINT64_MAX, NAN, NAN)                                                           \
    SETTING("Factor of the variance outside the modes; -1: the prior's; 0: none, as in the paper.",                   \
          double, residual, , "", -1, -1, 1e4)                                                                        \
    SETTING("Standard deviation of the change of heading from segment to segment.",                                   \
          double, turn_sd, , "radians", 0.3, 1e-6, 10)                                                                \
    SETTING("Stream: a segment with a larger chi-square per observation is ambiguous and, if its heading is unknown," \
            " searched again; 0: never.",                                                                             \
          double, fit_threshold, , "", 9, 0, 1e9)                                                                     \
    SETTING("Stream: highest frame rate, for which memory is reserved.",                                              \
          double, max_rate, , "frames per second", 60, 1, 1000)                                                       \
    SETTING("Stream: longest pause; after a longer one it restarts.",                                                 \
          double, max_gap, , "seconds", 0.5, 1e-3, 60)                                                                \
    SETTING("Iteration ends when no unknown changes by more.",                                                        \
          double, tolerance, , "standard deviations", 1e-9, 0, 1)                                                     \
    SETTING("Most iterations of a fit.",                                                                              \
          int32_t, max_iterations, , "", 30, 1, 100)                                                                  \
    SETTING("Instruction sets that may be used, GAIT_CPU_*; 0: scalar code.  Results do not depend on it.",           \
          uint32_t, cpu_mask, , "mask", ~0u, NAN, NAN)

typedef struct gait_lift_config { GAIT_LIFT_CONFIG_FIELDS(GAIT_DECLARE, GAIT_DECLARE) } gait_lift_config;

/* GAIT_ERR_ARG: the model has no segment prior. */
GAIT_API gait_result gait_lift_get_info(const gait_model *m, gait_lift_info *out, gait_error *err);
/* Fill the first cfg_bytes of a config with the defaults; called by gait_lift_default(), which knows the size. */
GAIT_API void gait_lift_fill(gait_lift_config *cfg, size_t cfg_bytes);
static inline void gait_lift_default(gait_lift_config *cfg)
{
    gait_lift_fill(cfg, sizeof *cfg);
}

/* The model must outlive the lifter.  A config from an older, shorter gait_lift.h is accepted. */
GAIT_API gait_result gait_lift_bytes(const gait_model *m, const gait_lift_config *cfg, size_t *bytes, gait_error *err);
GAIT_API gait_result gait_lift_init(void *mem, size_t mem_bytes, const gait_model *m, const gait_lift_config *cfg,
                                    gait_lift **out, gait_error *err);
GAIT_API const char *gait_lift_marker_name(const gait_lift *l, int32_t marker); /* NULL: out of range */

/* ---- one segment ------------------------------------------------------------------------------------- */
/* Result of fitting one segment. */
#define GAIT_LIFT_FIT_FIELDS(FIELD)                                                                                   \
    FIELD("log p(observations), of the best heading and component.",                                                  \
          double, log_evidence, , "nats")                                                                             \
    FIELD("log10 of posterior over prior volume of all unknowns, sqrt(det Q / det Lambda).",                          \
          double, log10_volume, , "")                                                                                 \
    FIELD("Chi-square: sum of squared residuals in standard deviations.",                                             \
          double, chi2, , "")                                                                                         \
    FIELD("Heading of the body in the first frame.",                                                                  \
          double, heading, , "radians")                                                                               \
    FIELD("Its standard deviation.",                                                                                  \
          double, heading_sd, , "radians")                                                                            \
    FIELD("Position of the pelvis in the first frame; z: of the floor.",                                              \
          double, place, [3], "metres")                                                                               \
    FIELD("Posterior probability of the component in (0, 1].",                                                        \
          double, share, , "")                                                                                        \
    FIELD("Gaussian of the mixture.",                                                                                 \
          int32_t, component, , "")                                                                                   \
    FIELD("Numbers observed: 2 per visible marker.",                                                                  \
          int32_t, observed, , "")                                                                                    \
    FIELD("Iterations taken.",                                                                                        \
          int32_t, iterations, , "")                                                                                  \
    FIELD("1: converged; 0: stopped at max_iterations.",                                                              \
          int32_t, converged, , "")

typedef struct gait_lift_fit { GAIT_LIFT_FIT_FIELDS(GAIT_DECLARE) } gait_lift_fit;

/* Fit one segment.  uv [F][J][2]; sd [F][J] or NULL (config sd).  A marker is unobserved if its sd is infinite, NaN or
 * not positive, or its uv is NaN, beyond 1e6 or, in perspective, exactly (0, 0) or (-1, -1), as detectors write it. */
GAIT_API gait_result gait_lift_segment(gait_lift *l, const double *uv, const double *sd, gait_lift_fit *out,
                                       gait_error *err);
/* Fit one segment with outliers down-weighted: a point more than four standard deviations from the fit has little
 * influence.  weighted [F][J] receives the effective standard deviations, above `sd` for outliers.  If outliers may
 * have misled the search, it is repeated with all points down-weighted at first. */
GAIT_API gait_result gait_lift_segment_robust(gait_lift *l, const double *uv, const double *sd, double *weighted,
                                              gait_lift_fit *out, gait_error *err);
/* Expect the person of the following segments at this position and heading instead of the config's; heading_sd as
 * there.  GAIT_ERR_STATE: the lifter was not initialised for an unknown heading. */
GAIT_API gait_result gait_lift_expect(gait_lift *l, const double place[3], double heading, double heading_sd,
                                      gait_error *err);
/* The rest of this section is about the last gait_lift_segment(); GAIT_ERR_STATE: there is none.
 * Posterior mean [F][J][3] and standard deviation [F][J][3] (may be NULL), metres, world.  GAIT_ERR_NUMERIC: they are
 * not finite, because an observation or the config is absurd. */
GAIT_API gait_result gait_lift_positions(gait_lift *l, double *mean, double *sd, gait_error *err);
/* The unknowns [n], n = gait_lift_unknowns(), each with prior N(0, 1): modes, position x y z, and stature and heading
 * if unknown; and their covariance [n][n] (may be NULL). */
GAIT_API int32_t     gait_lift_unknowns(const gait_lift *l);
GAIT_API gait_result gait_lift_posterior(gait_lift *l, double *mean, double *covariance, gait_error *err);
/* Factor for the standard deviations of this motion: above 1 if its modes are larger than the prior expects, below 1
 * if they are smaller.  In an orthographic view with known heading and size, errors in scaled standard deviations
 * follow approximately Student's t with ten degrees of freedom: 90 % are within 1.81.  Takes milliseconds. */
GAIT_API gait_result gait_lift_scale(gait_lift *l, double *scale, gait_error *err);
/* Estimate from the observations only: least-squares fit of minimum norm [F][J][3] (fig. 5c). */
GAIT_API gait_result gait_lift_least_squares(gait_lift *l, double *mean, gait_error *err);
/* The `count` most uncertain displacements [count][F][J][3], one standard deviation long, metres, and their standard
 * deviations [count] over all markers (fig. 6). */
GAIT_API gait_result gait_lift_uncertain(gait_lift *l, int32_t count, double *mode, double *sd, gait_error *err);

/* ---- a stream of frames ------------------------------------------------------------------------------ */
#define GAIT_LIFT_UNOBSERVED 0x1u /* no observation in the segments of this estimate: it is the prior's */
#define GAIT_LIFT_POOR_FIT   0x2u /* a segment of it exceeds fit_threshold (the first: half) or was refitted */

/* Estimate of one frame of a stream, `lag` frames ago. */
#define GAIT_LIFT_FRAME_FIELDS(FIELD)                                                                                 \
    FIELD("Capture time.",                                                                                            \
          int64_t, utime, , "microseconds")                                                                           \
    FIELD("Frames pushed before it since the start.",                                                                 \
          uint64_t, frame, , "")                                                                                      \
    FIELD("Heading of the body.",                                                                                     \
          double, heading, , "radians")                                                                               \
    FIELD("Chi-square per observation of its segments.",                                                              \
          double, chi2_per_observation, , "")                                                                         \
    FIELD("TRACKING; AMBIGUOUS with GAIT_LIFT_POOR_FIT; INIT before the first whole segment, when all below is 0.",   \
          gait_track_status, status, , "")                                                                            \
    FIELD("GAIT_LIFT_UNOBSERVED, GAIT_LIFT_POOR_FIT.",                                                                \
          uint32_t, flags, , "mask")                                                                                  \
    FIELD("Posterior mean of the markers in the world; 0 for those not in config report.",                            \
          double, marker, [GAIT_MAX_MARKERS][3], "metres")                                                            \
    FIELD("Standard deviation, times the root of a chi2_per_observation above 1.",                                    \
          double, sd, [GAIT_MAX_MARKERS][3], "metres")

typedef struct gait_lift_frame { GAIT_LIFT_FRAME_FIELDS(GAIT_DECLARE) } gait_lift_frame;

/* Add one frame: uv [J][2], sd [J] or NULL; utime must increase.  Segments begin every hop / fps seconds from the
 * first frame on; each frame is added, at its own time (linear between their frames), to the segments that contain
 * it.  Points far from their prediction are down-weighted. */
GAIT_API gait_result gait_lift_push(gait_lift *l, int64_t utime, const double *uv, const double *sd, gait_error *err);
/* Estimate of the frame `lag` frames before the last one pushed.  GAIT_ERR_STATE: fewer frames since the start;
 * GAIT_ERR_NUMERIC: as of gait_lift_positions(). */
GAIT_API gait_result gait_lift_estimate(gait_lift *l, gait_lift_frame *out, gait_error *err);
/* Forget the stream. */
GAIT_API void        gait_lift_reset(gait_lift *l);

/* ---- advanced: many segments with the same visibility ------------------------------------------------ */
/* Orthographic view, known heading, component 0.  gait_lift_fix() computes the gain for sd [F][J]; gait_lift_batch()
 * then maps uv [count][F][J][2] to mean [count][F][J][3]; standard deviations are those of gait_lift_positions(). */
GAIT_API gait_result gait_lift_fix(gait_lift *l, const double *sd, gait_error *err);
GAIT_API gait_result gait_lift_batch(gait_lift *l, int32_t count, const double *uv, double *mean, gait_error *err);

/* ---- advanced: outliers in sequences of 2-D points ---------------------------------------------------- */
/* Tools for sequences of 2-D points, without a lifter.  Both return how many points they found.  Spikes: points far
 * from the line through the same point's neighbours in time, relative to its noise and acceleration; their sd
 * [frames][points] becomes -1.  time [frames] increases; uv [frames][points][2]; scratch [2 frames]. */
GAIT_API int32_t gait_lift_remove_spikes(int32_t frames, int32_t points, const double *time, const double *uv, double *sd,
                                         double *scratch);
/* Outliers: points of one frame whose squared distance from their prediction, in standard deviations, is above 16 and
 * above 9 times the frame's median; sd [points] grows with it, so that their influence falls with the third power of
 * the distance.  scratch [points]. */
GAIT_API int32_t gait_lift_weight_outliers(int32_t points, const double *square, double *sd, double *scratch);

#ifdef __cplusplus
}
#endif
#endif
