#!/usr/bin/env python3
"""Change each equation of both papers once: some test that is about its meaning has to notice.

    make mutants

A mutant is one changed line in a copy of the sources.  The tests named beside it are built and run there;
they state what the equation means (golden digests are not among them, they notice every change).  The table
goes to tests/bench/results/mutants.md; exit code 1 if a mutant survives or does not build.
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import table
from facts import facts

from gait.progress import progress

ROOT = Path(__file__).resolve().parents[2]
LIMIT = 600  # seconds of a test; a mutant that never ends is caught


class Mutant(NamedTuple):
    """A change to a line of a file under libgait/src or python/gait, and the tests that should notice."""

    equation: str
    change: str
    file: str
    before: str
    after: str
    tests: str  #: C tests (test_x) or Python tests (test_x.py), separated by blanks


MUTANTS = (
    # ---- Ormoneit et al. 2000: learning ----
    Mutant(
        "O 1",
        "variance within phases has the wrong degrees of freedom",
        "python/gait/learn/cycles/period.py",
        "score = between / np.maximum(groups - 1, 1) * (self.total - groups) /",
        "score = between / np.maximum(groups - 1, 1) * self.total /",
        "test_learn_steady.py test_learn_fpca.py",
    ),
    Mutant(
        "O 1",
        "variance between phases has the wrong degrees of freedom",
        "python/gait/learn/cycles/period.py",
        "score = between / np.maximum(groups - 1, 1) *",
        "score = between / np.maximum(groups, 1) ** 0.5 *",
        "test_learn_steady.py test_learn_fpca.py",
    ),
    Mutant(
        "O 1",
        "phases with more observations do not count more",
        "python/gait/learn/cycles/period.py",
        "between = (sums**2 / np.maximum(counts, 1)[:, self.mask]).sum(axis=0)",
        "between = (sums**2 / np.maximum(counts, 1)[:, self.mask] ** 2).sum(axis=0)",
        "test_learn_steady.py test_learn_fpca.py",
    ),
    Mutant(
        "O 1",
        "the fold is the number of the cycle, as printed",
        "python/gait/learn/cycles/period.py",
        "self._anova(frames % period for",
        "self._anova(frames // period for",
        "test_learn_steady.py test_learn_fpca.py",
    ),
    Mutant(
        "O Fig. 3",
        "the offset runs the wrong way",
        "python/gait/learn/cycles/align.py",
        "return np.mod((self.time - offset) / self.period, 1.0)",
        "return np.mod((self.time + offset) / self.period, 1.0)",
        "test_learn_align.py",
    ),
    Mutant(
        "O Fig. 3",
        "the common phase is fixed by left minus right",
        "python/gait/learn/cycles/align.py",
        "first_harmonic(z[:, right] - z[:, left]",
        "first_harmonic(z[:, left] - z[:, right]",
        "test_learn_align.py",
    ),
    Mutant(
        "O Fig. 3",
        "the curve to which offsets are fitted is not periodic in its table",
        "python/gait/learn/cycles/align.py",
        "curve = table[low] * (1 - part) + table[(low + 1) % TABLE] * part",
        "curve = table[low] * part + table[(low + 1) % TABLE] * (1 - part)",
        "test_learn_align.py",
    ),
    Mutant(
        "O Fig. 5, 1",
        "cycles are cut one period late",
        "python/gait/learn/cycles/cutting.py",
        "/ period - (k - 1), float)",
        "/ period - k, float)",
        "test_learn_fpca.py",
    ),
    Mutant(
        "O Fig. 5, 1",
        "the ramp that closes a cycle is added",
        "python/gait/learn/cycles/cutting.py",
        "return values - (u - 0.5)[:, None] * ramp, ramp",
        "return values + (u - 0.5)[:, None] * ramp, ramp",
        "test_learn_fpca.py",
    ),
    Mutant(
        "O Fig. 5, 4",
        "the constant of the Fourier basis is not orthonormal",
        "python/gait/learn/cycles/fourier.py",
        "np.full((1, samples), 1 / np.sqrt(samples))",
        "np.full((1, samples), np.sqrt(2 / samples))",
        "test_learn_fpca.py",
    ),
    Mutant(
        "O 2, Fig. 5, 6",
        "components have the singular values as spread",
        "python/gait/learn/prior/components.py",
        "sd=singular[:components] / np.sqrt(max(rows - 1, 1)),",
        "sd=singular[:components] / np.sqrt(max(rows, 1)),",
        "test_learn_fpca.py",
    ),
    Mutant(
        "O 2, Fig. 5, 6",
        "scores are not taken about the mean",
        "python/gait/learn/prior/components.py",
        "(coded @ right[:components].T - mean @ right[:components].T) * sign",
        "(coded @ right[:components].T) * sign",
        "test_learn_fpca.py",
    ),
    Mutant(
        "O Fig. 5, 1",
        "the last cycle is left out",
        "python/gait/learn/cycles/cutting.py",
        "range(int(np.ceil((len(z) - offset) / period)) + 1):",
        "range(int(np.ceil((len(z) - offset) / period)) - 1):",
        "test_learn_fpca.py",
    ),
    Mutant(
        "O Fig. 5, 4",
        "20 harmonics instead of 20 coefficients",
        "python/gait/learn/cycles/fourier.py",
        "HARMONICS = 19",
        "HARMONICS = 20",
        "test_learn_iterated_svd.py",
    ),
    Mutant(
        "O Fig. 5, 5",
        "rows are not centred before the decomposition",
        "python/gait/learn/prior/iterated_svd.py",
        "np.linalg.svd(coded - mean, full_matrices=False)",
        "np.linalg.svd(coded, full_matrices=False)",
        "test_learn_iterated_svd.py",
    ),
    Mutant(
        "O Fig. 5, 8",
        "what was seen is replaced by the model, too",
        "python/gait/learn/prior/iterated_svd.py",
        "completed = np.where(mask, values, model)",
        "completed = model",
        "test_learn_iterated_svd.py",
    ),
    Mutant(
        "O Fig. 5, 8",
        "what was missing stays at the mean of its column",
        "python/gait/learn/prior/iterated_svd.py",
        "completed = np.where(mask, values, model)",
        "completed = np.where(mask, values, completed)",
        "test_learn_iterated_svd.py",
    ),
    Mutant(
        "O Fig. 5, 9",
        "the error counts what was filled as well",
        "python/gait/learn/prior/iterated_svd.py",
        "rest = (completed - model)[mask]",
        "rest = (completed - model)",
        "test_learn_iterated_svd.py",
    ),
    # ---- Ormoneit et al. 2000: tracking ----
    Mutant(
        "O 2, 3",
        "components are subtracted from the mean",
        "libgait/src/model/kinematics_simd.h",
        "float const c = k < 0 ? pace : k ? coef[(k - 1) * stride] : 1.0f,",
        "float const c = k < 0 ? pace : k ? -coef[(k - 1) * stride] : 1.0f,",
        "test_kinematics",
    ),
    Mutant(
        "O 2, 3",
        "angles are the mean's alone",
        "libgait/src/model/kinematics_simd.h",
        "k <= components; k++) {\n        const float *const curve",
        "k <= 0 * components; k++) {\n        const float *const curve",
        "test_kinematics",
    ),
    Mutant(
        "O 3",
        "curves are not interpolated between phases",
        "libgait/src/filter/dynamics_kernel.c",
        "w[lane] = at - (float)j;",
        "w[lane] = 0.0f;",
        "test_dynamics",
    ),
    Mutant(
        "O 5",
        "scores relax with the time constant of proportions",
        "libgait/src/filter/dynamics_kernel.c",
        "relax(k < s->proportion ? s->score",
        "relax(k < s->proportion ? s->shape",
        "test_dynamics",
    ),
    Mutant(
        "O 5",
        "scores have no noise",
        "libgait/src/filter/dynamics_kernel.c",
        "from->f[k], n[k], to->f[k]);",
        "from->f[k], from->f[k], to->f[k]);",
        "test_dynamics",
    ),
    Mutant(
        "O 6",
        "the phase stands still",
        "libgait/src/filter/dynamics_kernel.c",
        "turn[lane] = rate * s->phase_dt + s->phase_noise * n[0][lane];",
        "turn[lane] = s->phase_noise * n[0][lane];",
        "test_dynamics",
    ),
    Mutant(
        "O 6",
        "the phase advances by the new rate",
        "libgait/src/filter/dynamics_kernel.c",
        "turn[lane] = rate * s->phase_dt + s->phase_noise * n[0][lane];",
        "turn[lane] = (rate + s->rate.noise * n[1][lane]) * s->phase_dt + s->phase_noise * n[0][lane];",
        "test_dynamics",
    ),
    Mutant(
        "O 7",
        "the rate relaxes to zero",
        "libgait/src/filter/dynamics_kernel.c",
        "dynamics_reflect_rate(s->mean_rate + off)",
        "dynamics_reflect_rate(0.9f * s->mean_rate + off)",
        "test_dynamics",
    ),
    Mutant(
        "O 7",
        "the rate has no noise",
        "libgait/src/filter/dynamics_kernel.c",
        "+ s->rate.noise * n[1][lane];",
        "+ 0.0f * n[1][lane];",
        "test_dynamics",
    ),
    Mutant(
        "O 8",
        "the way is backwards",
        "libgait/src/filter/dynamics_kernel.c",
        "from->f[F_STATURE][lane] * speed[lane] * turn[lane] * s->travel +",
        "-from->f[F_STATURE][lane] * speed[lane] * turn[lane] * s->travel +",
        "test_dynamics",
    ),
    Mutant(
        "O 8",
        "the level of the ground has no noise",
        "libgait/src/filter/dynamics_kernel.c",
        "relax(s->level, from->f[F_Z], n[4], to->f[F_Z]);",
        "relax(s->tilt, from->f[F_Z], n[4], to->f[F_Z]);",
        "test_dynamics",
    ),
    Mutant(
        "O 9",
        "pitch stays as it is",
        "libgait/src/filter/dynamics_kernel.c",
        "relax(s->tilt, from->f[F_PITCH], n[6], to->f[F_PITCH]);",
        "relax(s->tilt, n[6], from->f[F_PITCH], to->f[F_PITCH]);",
        "test_dynamics",
    ),
    Mutant(
        "O 8",
        "sideways noise has the wrong sign along x",
        "libgait/src/filter/dynamics_kernel.c",
        "(ahead * cs - aside * sn)",
        "(ahead * cs + aside * sn)",
        "test_dynamics",
    ),
    Mutant(
        "O 8",
        "sideways noise has the wrong sign along y",
        "libgait/src/filter/dynamics_kernel.c",
        "(ahead * sn + aside * cs)",
        "(ahead * sn - aside * cs)",
        "test_dynamics",
    ),
    Mutant(
        "O 8",
        "the way does not grow with the stature",
        "libgait/src/filter/dynamics_kernel.c",
        "from->f[F_STATURE][lane] * speed[lane] * turn[lane] * s->travel",
        "1.75f * speed[lane] * turn[lane] * s->travel",
        "test_dynamics",
    ),
    Mutant(
        "O 8",
        "the paper's way follows the noise of the phase",
        "libgait/src/filter/dynamics_kernel.c",
        "turn[lane] = from->f[F_RATE][lane] * s->phase_dt;",
        "turn[lane] += 0.0f;",
        "test_dynamics",
    ),
    Mutant(
        "O 9",
        "roll has the noise of pitch",
        "libgait/src/filter/dynamics_kernel.c",
        "relax(s->tilt, from->f[F_ROLL], n[7], to->f[F_ROLL]);",
        "relax(s->tilt, from->f[F_ROLL], n[6], to->f[F_ROLL]);",
        "test_dynamics",
    ),
    Mutant(
        "O 9",
        "heading noise is left out",
        "libgait/src/filter/dynamics_kernel.c",
        "heading[lane] = from->f[F_HEADING][lane] + curve + s->heading_noise * n[5][lane];",
        "heading[lane] = from->f[F_HEADING][lane] + curve;",
        "test_dynamics",
    ),
    Mutant(
        "O 4",
        "weights before resampling are forgotten",
        "libgait/src/filter/pf.c",
        "double const l = p->log_weight[i] + (double)loglik[i] - top;",
        "double const l = (double)loglik[i] - top;",
        "test_pf test_pf_grid test_pf_kalman",
    ),
    Mutant(
        "O 4",
        "resampling favours light particles",
        "libgait/src/filter/pf.c",
        "total += (uint64_t)(int64_t)(weight[i] / top * 2147483648.0);",
        "total += (uint64_t)(int64_t)(weight[i] / top * weight[i] / top * 2147483648.0);",
        "test_pf_resample test_pf",
    ),
    Mutant(
        "O 4.4",
        "the expected value leaves weights out",
        "libgait/src/tracker/estimate_kernel.c",
        "wd = weight[i + lane] * d;",
        "wd = d / (double)n;",
        "test_estimate",
    ),
    Mutant(
        "O 10",
        "squared differences are not squared",
        "libgait/src/likelihood/likelihood.c",
        "cost_set(&s->square, d, d * d);",
        "cost_set(&s->square, d, d);",
        "test_like_texture test_likelihood",
    ),
    Mutant(
        "O 11",
        "the exponent lacks its factor of two",
        "libgait/src/likelihood/texture_kernel.c",
        "(float)squares / (2.0f * var * (float)i_max(both, 1));",
        "(float)squares / (var * (float)i_max(both, 1));",
        "test_like_texture",
    ),
    Mutant(
        "O 11",
        "the points count as many observations",
        "libgait/src/likelihood/texture_kernel.c",
        "(float)squares / (2.0f * var * (float)i_max(both, 1));",
        "(float)squares / (2.0f * var);",
        "test_like_texture",
    ),
    Mutant(
        "O 11",
        "sigma does not grow at narrow angles",
        "libgait/src/likelihood/texture_kernel.c",
        "s->surface_var * (1.0f + s->tilt * tan2);",
        "s->surface_var;",
        "test_like_texture",
    ),
    Mutant(
        "O 12",
        "visible and occluded are swapped",
        "libgait/src/likelihood/texture_kernel.c",
        "m_log(q * m_exp(f_clamp(d, -30.0f, 30.0f)) + (1.0f - q));",
        "m_log((1.0f - q) * m_exp(f_clamp(d, -30.0f, 30.0f)) + q);",
        "test_like_texture",
    ),
    Mutant(
        "O 12",
        "the angle of the limb does not count",
        "libgait/src/likelihood/texture_kernel.c",
        "mixture(cos_tilt[i] * share, visible[i], log_occluded)",
        "mixture(share, visible[i], log_occluded)",
        "test_like_texture",
    ),
    Mutant(
        "O 12",
        "p_occluded is not the setting's",
        "libgait/src/likelihood/likelihood.c",
        "s->paper ? m_log(cfg->occluded_density)",
        "s->paper ? m_log(0.0018f)",
        "test_like_texture",
    ),
    Mutant(
        "O 10",
        "fewer points are all at one height",
        "libgait/src/likelihood/likelihood.c",
        "int32_t const at = i ^ (i >> 2 & 1);",
        "int32_t const at = i;",
        "test_like_texture",
    ),
    Mutant(
        "O 13",
        "the product over limbs leaves out the last limb",
        "libgait/src/likelihood/texture_kernel.c",
        "for (int32_t l = 0; l < s->limbs; l++) {\n        const float *const cos_tilt",
        "for (int32_t l = 0; l < s->limbs - 1; l++) {\n        const float *const cos_tilt",
        "test_like_texture test_like_kernels",
    ),
    Mutant(
        "O Fig. 1",
        "shoulders and hips have a mirrored lateral axis",
        "libgait/src/likelihood/likelihood.c",
        "ra * c * g->lateral[k] + rb * s * g->sagittal[k];",
        "ra * c * g->lateral[k] - rb * s * g->sagittal[k];",
        "test_like_texture test_likelihood",
    ),
    Mutant(
        "O 13, lost",
        "where the surface stayed is compared with where it walked, the wrong way round",
        "libgait/src/tracker/walk_check.c",
        "w->nats >= -t->cfg.stayed_nats",
        "w->nats <= t->cfg.stayed_nats",
        "test_walk_check",
    ),
    Mutant(
        "O 13, lost",
        "the body does not walk on between the frames compared",
        "libgait/src/tracker/walk_check.c",
        "p.f[F_X] += way * cs;",
        "p.f[F_X] -= way * cs;",
        "test_walk_check",
    ),
    # ---- Leventon & Freeman 1998 ----
    Mutant(
        "L 1",
        "the mean of the prior is left out",
        "libgait/src/lift/segment_posterior.c",
        "x[i] = mean + moved[i] + growth * r->shape[i];",
        "x[i] = moved[i] + growth * r->shape[i];",
        "test_lift",
    ),
    Mutant(
        "L 1",
        "depth turns with the wrong sign",
        "libgait/src/lift/segment_posterior.c",
        "f->c * g[0] + f->s * g[1], f->c * g[1] - f->s * g[0], f->z * g[2]}",
        "f->c * g[0] - f->s * g[1], f->c * g[1] + f->s * g[0], f->z * g[2]}",
        "test_lift",
    ),
    Mutant(
        "L 3",
        "the prior of the scores has twice the precision",
        "libgait/src/lift/segment_posterior.c",
        "b->A[i * (t->ld + 1)] = i != t->n;",
        "b->A[i * (t->ld + 1)] = i != t->n ? 2.0 : 0.0;",
        "test_lift",
    ),
    Mutant(
        "L 4, 5",
        "residuals have the wrong sign",
        "libgait/src/lift/segment_posterior.c",
        "double rest = y - ((g[0] * base[0]",
        "double rest = -y - ((g[0] * base[0]",
        "test_lift",
    ),
    Mutant(
        "L 5",
        "the marker's own part beside the modes is left out",
        "libgait/src/lift/segment_posterior.c",
        "mean[i] += K[i][0] * left[0] + K[i][1] * left[1];",
        "mean[i] += 0.0 * (K[i][0] * left[0] + K[i][1] * left[1]);",
        "test_lift",
    ),
    Mutant(
        "L 6",
        "the covariance sums too few terms",
        "libgait/src/lift/uncertainty.c",
        "for (int32_t l = j; l < t->n; l++)",
        "for (int32_t l = j + 1; l < t->n; l++)",
        "test_lift",
    ),
    Mutant(
        "L 6",
        "the evidence counts the determinant twice",
        "libgait/src/lift/segment_posterior.c",
        "- cholesky_log_det(b->U, t->n, t->ld);",
        "- 2.0 * cholesky_log_det(b->U, t->n, t->ld);",
        "test_lift test_lifter.py",
    ),
    Mutant(
        "L Fig. 6",
        "the least certain displacements ignore the posterior",
        "libgait/src/lift/uncertainty.c",
        "cholesky_backward(b->U, n, ld, V + (size_t)i * (size_t)ld);",
        "(void)0;",
        "test_lift",
    ),
    Mutant(
        "L 7",
        "sensors count without their standard deviation",
        "python/gait/lift/video/energy.py",
        "return residual.ravel() / reading.sd, slope.reshape(-1, len(state)) / reading.sd",
        "return residual.ravel(), slope.reshape(-1, len(state))",
        "test_lift_video.py test_lift_images.py",
    ),
    Mutant(
        "L 7",
        "corrections pull the other way",
        "python/gait/lift/video/energy.py",
        "residual = (uv - corrections.uv) / corrections.sd[:, None]",
        "residual = (corrections.uv - uv) / corrections.sd[:, None]",
        "test_lift_video.py test_lift_images.py",
    ),
    Mutant(
        "L 7",
        "the prior of the scores does not count",
        "python/gait/lift/video/energy.py",
        "parts = [((state - self.mean) / self.sd, np.diag(1 / self.sd))]",
        "parts = [(0 * (state - self.mean) / self.sd, np.diag(1 / self.sd))]",
        "test_lift_video.py test_lift_images.py",
    ),
    Mutant(
        "L 7",
        "crossing sticks are seen twice",
        "python/gait/lift/video/energy.py",
        "left = np.exp(-value.sum(axis=2))",
        "left = 1 - value.sum(axis=2)",
        "test_lift_video.py test_lift_images.py",
    ),
    # ---- Leventon & Freeman 1998, as gait paper has it literally ----
    Mutant(
        "L 2",
        "the mean is not taken out before the decomposition",
        "python/gait/paper/leventon.py",
        "np.linalg.svd(rows - mean, full_matrices=False)",
        "np.linalg.svd(rows, full_matrices=False)",
        "test_paper_gaussian.py",
    ),
    Mutant(
        "L 2",
        "variances are singular values",
        "python/gait/paper/leventon.py",
        "spectrum = singular**2 / (len(rows) - 1)",
        "spectrum = singular / (len(rows) - 1) ** 0.5",
        "test_paper_gaussian.py",
    ),
    Mutant(
        "L 4",
        "turned copies are turned back again",
        "python/gait/paper/leventon.py",
        "axis_rotation(2, np.pi / 2).T",
        "axis_rotation(2, 2 * np.pi).T",
        "test_paper_gaussian.py",
    ),
    Mutant(
        "L 1",
        "the picture shows the depth",
        "python/gait/paper/leventon.py",
        "PICTURE = np.stack([VIEW[0], -VIEW[1]])",
        "PICTURE = np.stack([VIEW[0], VIEW[2]])",
        "test_paper_gaussian.py",
    ),
    Mutant(
        "L 5",
        "the view of the mean is not taken from what is seen",
        "python/gait/paper/leventon.py",
        "rest = (y - _view(self.segment(np.zeros(0)))).ravel() / noise",
        "rest = y.ravel() / noise",
        "test_paper_gaussian.py",
    ),
    Mutant(
        "L 6",
        "the prior counts by its variance instead of its precision",
        "python/gait/paper/leventon.py",
        "precision = np.diag(1 / self.variance) +",
        "precision = np.diag(self.variance) +",
        "test_paper_gaussian.py",
    ),
    Mutant(
        "L 6",
        "the volume is that of the prior over the posterior, as printed",
        "python/gait/paper/leventon.py",
        "volume = -0.5 * (after +",
        "volume = 0.5 * (after +",
        "test_paper_gaussian.py",
    ),
    Mutant(
        "L Fig. 5",
        "the view alone is explained by the prior, too",
        "python/gait/paper/leventon.py",
        "np.linalg.lstsq(self.visible, rest, rcond=None)[0]",
        "np.linalg.lstsq(self.visible, 0.5 * rest, rcond=None)[0]",
        "test_paper_gaussian.py",
    ),
    Mutant(
        "L Fig. 5",
        "segments do not continue the depth of those before",
        "python/gait/paper/leventon.py",
        "part = part + np.eye(3)[DEPTH] *",
        "part = part + 0 * np.eye(3)[DEPTH] *",
        "test_paper_gaussian.py",
    ),
    Mutant(
        "L Fig. 5",
        "overlapping segments have equal weights",
        "python/gait/paper/leventon.py",
        "ramp = np.minimum(np.arange(1, FRAMES + 1), np.arange(FRAMES, 0, -1)).astype(float)",
        "ramp = np.ones(FRAMES)",
        "test_paper_gaussian.py",
    ),
    Mutant(
        "L Fig. 6",
        "the most certain displacements are shown",
        "python/gait/paper/leventon.py",
        "modes = (gaussian.modes @ (vectors[:, ::-1][:, :count] * sd)).T",
        "modes = (gaussian.modes @ (vectors[:, :count] * sd)).T",
        "test_paper_gaussian.py",
    ),
)


class Copy:
    """A copy of the sources in a folder of its own, in which mutants are tried."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        shutil.rmtree(folder, ignore_errors=True)
        listed = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, check=True).stdout
        for name in filter(None, listed.decode().split("\0")):
            if (ROOT / name).is_file():
                (folder / name).parent.mkdir(parents=True, exist_ok=True)
                shutil.copy2(ROOT / name, folder / name)
        (folder / ".venv").symlink_to(ROOT / ".venv")

    def verdict(self, mutant: Mutant) -> tuple[str, str]:
        """Try a mutant: "caught" and the test that noticed, "survived", or "does not build"."""
        path = self.folder / mutant.file
        text = path.read_text()
        path.write_text(text.replace(mutant.before, mutant.after))
        try:
            for test in mutant.tests.split():
                c_test = not test.endswith(".py")
                target = f"unit/{test}" if c_test else "libgait.so"
                if not self._run("make", "--no-print-directory", f"build/release/{target}"):
                    return "does not build", test
                if not (self._run(f"build/release/unit/{test}") if c_test else self._pytest(test)):
                    return "caught", test
            return "survived", mutant.tests
        finally:
            path.write_text(text)

    def _pytest(self, test: str) -> bool:
        options = ["-q", "-x", "-c", "python/pyproject.toml", "--rootdir", ".", f"tests/python/{test}"]
        return self._run(sys.executable, "-m", "pytest", *options)

    def _run(self, *command: str) -> bool:
        env = {**os.environ, "PYTHONPATH": str(self.folder / "python")}
        try:
            done = subprocess.run(
                command, cwd=self.folder, env=env, capture_output=True, timeout=LIMIT, check=False
            )
        except subprocess.TimeoutExpired:
            return False
        return done.returncode == 0


def stale(mutants: tuple[Mutant, ...] = MUTANTS) -> Iterator[Mutant]:
    """Mutants whose line is not in the sources exactly once, or whose tests are not there."""
    for mutant in mutants:
        once = (ROOT / mutant.file).read_text().count(mutant.before) == 1
        tests = ["python/" + t if t.endswith(".py") else f"unit/{t}.c" for t in mutant.tests.split()]
        if not once or not all((ROOT / "tests" / t).is_file() for t in tests):
            yield mutant


def main() -> int:
    """Try all mutants, or some; 1 if one survives, 2 if the list does not fit the sources."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--only", default="", help="mutants whose equation begins with this; records nothing")
    args = parser.parse_args()
    for mutant in stale():
        print(f"mutants: {mutant.file}: no single line {mutant.before!r}, or a test is gone", file=sys.stderr)
        return 2
    chosen = [m for m in MUTANTS if m.equation.startswith(args.only)]
    begun, copy, rows = time.perf_counter(), Copy(ROOT / "build" / "mutants"), []
    with progress("mutants", len(chosen)) as done:
        for mutant in chosen:
            verdict, test = copy.verdict(mutant)
            rows.append([mutant.equation, mutant.change, Path(mutant.file).name, verdict, test])
            done(len(rows))
    columns = ["equation", "change", "file", "verdict", "test"]
    note = (
        f"{facts('make mutants')} Took {time.perf_counter() - begun:.0f} s.\n\nEach equation of both papers "
        "(O: Ormoneit et al. 2000, L: Leventon & Freeman 1998) changed once, and the test that noticed. No "
        "golden digest is among the tests."
    )
    if args.only:
        table.show("Mutants", columns, rows)
    else:
        table.publish("mutants", "Mutants", columns, rows, note)
    return int(any(row[3] != "caught" for row in rows))


if __name__ == "__main__":
    sys.exit(main())
