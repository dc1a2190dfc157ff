"""3-D motion from 2-D keypoints with the C library: one segment, many at once, or a stream.

After Leventon and Freeman (1998).  The prior is a `gait.bindings.segment_prior.SegmentPrior`; tests/reference
contains the same inference in numpy, against which the library is tested.
"""

from __future__ import annotations

import ctypes
import os
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gait.bindings import abi
from gait.bindings.abi import LiftFlag, TrackStatus
from gait.bindings.config import LiftConfig as LiftConfig
from gait.bindings.library import call, library, make
from gait.bindings.model import Model, load
from gait.camera.camera import Camera
from gait.errors import GaitError

Array = NDArray[np.float64]


@dataclass(frozen=True)
class LiftInfo:
    """Contents of a blob's segment prior; see ``gait_lift_info``."""

    markers: int
    frames: int
    hop: int
    headings: int
    components: int
    modes: int
    fps: float
    stature: float
    digest: int


@dataclass(frozen=True)
class Fit:
    """Result of fitting one segment.

    Attributes
    ----------
    log_evidence : float
        log p(observations), nats, of the best heading and component.
    log10_volume : float
        log10 of posterior over prior volume of all unknowns.
    chi2 : float
        Sum of squared residuals, each divided by its standard deviation.
    heading, heading_sd : float
        Radians about z; 0 = along +x.
    place : ndarray of shape (3,)
        Position of the pelvis in the first frame, with the height of the floor as z, metres.
    share : float
        Posterior probability of the component.
    component, observed, iterations : int
        Index of the Gaussian in the mixture; number of observed coordinates; iterations of the fit.
    converged : bool
        Whether the fit converged within the iterations allowed.
    """

    log_evidence: float
    log10_volume: float
    chi2: float
    heading: float
    heading_sd: float
    place: Array
    share: float
    component: int
    observed: int
    iterations: int
    converged: bool


@dataclass(frozen=True)
class LiftedFrame:
    """One frame of a stream.

    Attributes
    ----------
    utime : int
        Capture time, microseconds.
    frame : int
        Number of frames pushed before it since the start.
    status : TrackStatus
        TRACKING; AMBIGUOUS if the observations do not fit; INIT before the first whole segment.
    flags : LiftFlag
    heading : float
        Radians.
    chi2_per_observation : float
        Squared residual, in standard deviations, per observed coordinate.
    markers, sd : ndarray of shape (J, 3)
        Posterior mean and standard deviation, metres, world; 0 for those not in the config's `report`.
    """

    utime: int
    frame: int
    status: TrackStatus
    flags: LiftFlag
    heading: float
    chi2_per_observation: float
    markers: Array
    sd: Array


class Lifter:
    """Lifts 2-D keypoints with fixed memory.

    Parameters
    ----------
    source : Model, path or bytes, optional
        Blob with a segment prior; the shipped model by default.
    view : Camera, or array_like of shape (2, 3)
        Calibrated camera, for keypoints in pixels; or the directions of u and v in the world, for an
        orthographic view with keypoints in metres.  Required: ``Lifter(view=camera)``.
    config : LiftConfig, optional
        Settings such as stature and lag; the library's defaults if left out.
    **settings
        Not accepted, only named in the error: settings belong in `config`.

    Attributes
    ----------
    info : LiftInfo
    names : tuple of str
        The J markers.
    memory_bytes : int
        Size of the only memory that lifting uses.

    Raises
    ------
    TypeError
        If the view is missing or invalid, or settings are not in the config.
    UserError
        If the file cannot be read.
    GaitError
        If the blob has no valid segment prior, or a setting is out of range; later, if a method is called
        before another whose result it needs.

    Notes
    -----
    Observations are arrays of doubles; a marker is missing if its `sd` is not a positive number or its `uv`
    is NaN.  The same input and configuration give the same bits.
    """

    def __init__(
        self,
        source: Model | str | os.PathLike[str] | bytes | None = None,
        view: Camera | ArrayLike | None = None,
        config: LiftConfig | None = None,
        **settings: object,
    ) -> None:
        if settings:
            name = next(iter(settings))
            raise TypeError(
                f"Lifter takes no {name!r}; settings, such as a person's stature, are in "
                "config=LiftConfig.default(stature=1.8, stature_sd=0.04, lag=5)"
            )
        if isinstance(source, Camera) or view is None:
            raise TypeError("a view is missing; write Lifter(view=camera), or Lifter(model, camera)")
        self._model = source._loaded if isinstance(source, Model) else load(source)
        self.config = config or LiftConfig.default()
        self._handle, self._memory = make("lift", self._model.handle, self.config.to_c(view))
        self.memory_bytes = self._memory.nbytes
        info = abi.LiftInfoC()
        call("gait_lift_get_info", self._model.handle, info)
        self.info = LiftInfo(**{item.name: getattr(info, item.name) for item in fields(LiftInfo)})
        name_of = library().gait_lift_marker_name
        self.names = tuple(
            name_of(self._handle, j).decode(errors="backslashreplace") for j in range(self.info.markers)
        )

    def _call(self, name: str, *arguments: object) -> None:
        call(f"gait_lift_{name}", self._handle, *arguments)

    def _observations(self, uv: ArrayLike, sd: ArrayLike | None, *shape: int) -> tuple[Array, Array | None]:
        """Convert observations to arrays of the right shapes (..., J, 2) and (..., J), or ValueError."""
        points = np.ascontiguousarray(uv, np.float64)
        if points.shape != (*shape, 2):
            raise ValueError(f"uv has shape {points.shape} instead of {(*shape, 2)}")
        if sd is None:
            return points, None
        return points, np.ascontiguousarray(np.broadcast_to(np.asarray(sd, np.float64), shape))

    @property
    def _shape(self) -> tuple[int, int]:
        return self.info.frames, self.info.markers

    def segment(self, uv: ArrayLike, sd: ArrayLike | None = None) -> Fit:
        """Fit one segment.

        Parameters
        ----------
        uv : array_like of shape (F, J, 2)
            Pixels, or metres in an orthographic view.
        sd : array_like that broadcasts to (F, J), optional
            Standard deviations in the same unit; by default the config's.
        """
        points, sds = self._observations(uv, sd, *self._shape)
        c = abi.LiftFitC()
        self._call("segment", points, sds, c)
        return _fit(c)

    def segment_robust(self, uv: ArrayLike, sd: ArrayLike | None = None) -> tuple[Fit, Array]:
        """Fit one segment as `segment` does, down-weighting outliers.

        Returns
        -------
        fit : Fit
        weighted : (F, J)
            Effective standard deviations: larger than `sd` for outliers.
        """
        points, sds = self._observations(uv, sd, *self._shape)
        c, weighted = abi.LiftFitC(), np.empty(self._shape)
        self._call("segment_robust", points, sds, weighted, c)
        return _fit(c), weighted

    def expect(self, place: ArrayLike, heading: float = 0.0, heading_sd: float = -1.0) -> None:
        """Set the expected position (3,) and heading of the person in later segments, replacing the config's.

        A `heading_sd` of -1 means that the heading is unknown; the config's must then be -1 too.
        """
        self._call("expect", np.ascontiguousarray(place, np.float64).reshape(3), heading, heading_sd)

    def positions(self) -> tuple[Array, Array]:
        """Return posterior mean and standard deviation (F, J, 3) of the last segment or of `fix`; metres."""
        mean, sd = np.empty((*self._shape, 3)), np.empty((*self._shape, 3))
        self._call("positions", mean, sd)
        return mean, sd

    def posterior(self) -> tuple[Array, Array]:
        """Return mean (n,), covariance (n, n) of modes, position, stature, heading; each N(0, 1) a priori."""
        count = library().gait_lift_unknowns(self._handle)
        mean, covariance = np.empty(count), np.empty((count, count))
        self._call("posterior", mean, covariance)
        return mean, covariance

    def scale(self) -> float:
        """Return a factor for the standard deviations of the last segment.

        Above 1 if its modes are larger than the prior expects, below 1 if they are smaller (the most probable
        scale of the modes' variances, with an inverse gamma prior).  In an orthographic view with known
        heading and size, errors divided by the scaled standard deviations follow approximately Student's t
        with ten degrees of freedom: 90 % are within 1.81.  With a camera, the standard deviations include the
        uncertainty of size and position, which does not shrink with the motion: do not multiply by less than
        1.  Takes milliseconds; GaitError after `fix`.
        """
        scale = ctypes.c_double()
        self._call("scale", scale)
        return scale.value

    def least_squares(self) -> Array:
        """Fit the last segment without the prior: least squares of minimum norm (F, J, 3)."""
        mean = np.empty((*self._shape, 3))
        self._call("least_squares", mean)
        return mean

    def uncertain(self, count: int = 3) -> tuple[Array, Array]:
        """Find the least certain displacements of the last segment.

        Returns
        -------
        sd : (count,)
            Their standard deviations over all markers and frames, metres, largest first.
        modes : (count, F, J, 3)
            The displacements, one standard deviation long.
        """
        most = library().gait_lift_unknowns(self._handle)
        if not 1 <= count <= most:
            raise ValueError(f"count is {count}; give one from 1 to {most}")
        sd, modes = np.empty(count), np.empty((count, *self._shape, 3))
        self._call("uncertain", count, modes, sd)
        return sd, modes

    def fix(self, sd: ArrayLike) -> None:
        """Compute the gain for standard deviations `sd` (F, J).

        The view must be orthographic and the config's `heading_sd` 0.
        """
        self._call("fix", np.ascontiguousarray(np.broadcast_to(sd, self._shape), np.float64))

    def batch(self, uv: ArrayLike) -> Array:
        """Lift segments (n, F, J, 2) with the gain of `fix`; return posterior means (n, F, J, 3)."""
        count = len(np.asarray(uv))
        points, _ = self._observations(uv, None, count, *self._shape)
        mean = np.empty((*points.shape[:-1], 3))
        self._call("batch", count, points, mean)
        return mean

    def push(self, utime: int, uv: ArrayLike, sd: ArrayLike | None = None) -> None:
        """Add one frame to the stream: uv (J, 2), sd (J,); `utime`, microseconds, must increase."""
        points, sds = self._observations(uv, sd, self.info.markers)
        self._call("push", utime, points, sds)

    def estimate(self) -> LiftedFrame | None:
        """Estimate the frame `lag` frames before the last one pushed; None while there are too few."""
        c = abi.LiftFrameC()
        try:
            self._call("estimate", c)
        except GaitError as exc:
            if exc.status == abi.Result.STATE:
                return None
            raise
        count = self.info.markers
        return LiftedFrame(
            utime=c.utime,
            frame=c.frame,
            status=TrackStatus(c.status),
            flags=LiftFlag(c.flags),
            heading=c.heading,
            chi2_per_observation=c.chi2_per_observation,
            markers=np.array(c.marker)[:count],
            sd=np.array(c.sd)[:count],
        )

    def reset(self) -> None:
        """Forget all frames of the stream."""
        library().gait_lift_reset(self._handle)


def _fit(c: abi.LiftFitC) -> Fit:
    values = {item.name: getattr(c, item.name) for item in fields(Fit)}
    return Fit(**(values | {"place": np.array(c.place), "converged": bool(c.converged)}))


def remove_spikes(time: ArrayLike, uv: ArrayLike, sd: ArrayLike) -> Array:
    """Mark points that are far from the line through the same point in neighbouring frames.

    Parameters
    ----------
    time : (T,)
    uv : (T, P, 2)
        NaN where a point was not seen.
    sd : (T, P)

    Returns
    -------
    (T, P)
        `sd` with -1 for spikes.
    """
    at, points = np.ascontiguousarray(time, np.float64), np.ascontiguousarray(uv, np.float64)
    kept, scratch = np.array(np.broadcast_to(sd, points.shape[:2]), np.float64), np.empty(2 * len(at))
    library().gait_lift_remove_spikes(*points.shape[:2], at, points, kept, scratch)
    return kept


def weight_outliers(square: ArrayLike, sd: ArrayLike) -> Array:
    """Enlarge the standard deviations (P,) of points far from their prediction, so that they count little.

    Parameters
    ----------
    square : (P,)
        Squared distances of one frame's points from their prediction, in standard deviations.
    """
    distances, weighted = np.ascontiguousarray(square, np.float64), np.array(sd, np.float64)
    library().gait_lift_weight_outliers(len(distances), distances, weighted, np.empty(len(distances)))
    return weighted
