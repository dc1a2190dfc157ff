"""The segments of a clip: the frames that each covers, and its energy."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt
from scipy.interpolate import make_interp_spline

from gait.bindings.segment_prior import SegmentPrior
from gait.lift.keypoints.corrections import Correction
from gait.lift.segment.explain import GROUND_SD
from gait.lift.video import sensors
from gait.lift.video.energy import (
    EXTRA,
    GAIN_COLUMN,
    HEADING_COLUMN,
    LEVEL_COLUMN,
    PLACE_COLUMNS,
    Anchor,
    Corrections,
    Energy,
    Reading,
    Shape,
    Sticks,
)
from gait.lift.video.placement import HEIGHT_SD, PhasePrior, Placement
from gait.lift.video.sensors import Film, View

Floats = npt.NDArray[np.float64]
Indices = npt.NDArray[np.intp]

ANY_HEADING_SD = 10.0  # radians; it may have any heading
CORRELATED = 6.0  # root of the number of sensors, or markers shared by segments, that count as one
CLOTHED_JOINT_SD = 0.01  # metres; error of a joint's position in a clothed body, constant in a segment
FIRST_SD = 1.0  # of a sensor, before it has been estimated


@dataclass(frozen=True)
class Settings:
    """How sensors are weighted and segments are joined.

    Attributes
    ----------
    sensor_sd : float, optional
        Standard deviation of a sensor; infinity disables sensors.  By default it is estimated from the clip:
        `CORRELATED` times the rms difference between sensors and figure, as neighbours in the grid and in
        time have similar errors.
    gain, level : (float, float)
        Mean and standard deviation of the logarithm of the figure's contribution to a sensor, and of the
        scene's contribution.
    joined : bool
        Whether segments are solved together, or one after the other, as in the paper.
    """

    sensor_sd: float | None = None
    gain: tuple[float, float] = (-0.2, 0.4)
    level: tuple[float, float] = (0.5, 1.0)
    joined: bool = True


@dataclass(frozen=True)
class ClipSegments:
    """Segments, one per hop, that cover a film; one of them (`origin`) starts at the placement's frame.

    Attributes
    ----------
    prior : SegmentPrior
    view : View
    film : Film
        Its frame times are used even if the sensors are not.
    placement : Placement
    corrections : sequence of Correction
    settings : Settings
    phase_prior : PhasePrior, optional
        Prior of the first segment from the phase of walking.
    """

    prior: SegmentPrior
    view: View
    film: Film
    placement: Placement
    corrections: Sequence[Correction]
    settings: Settings
    phase_prior: PhasePrior | None = None

    @cached_property
    def shapes(self) -> list[Shape]:
        """The prior's Gaussians for this person."""
        stature = self.placement.stature
        return [Shape.of(self.prior, c, stature) for c in range(self.prior.components)]

    @cached_property
    def sticks(self) -> Sticks:
        """Stick figure of the prior's markers."""
        return Sticks.of(self.prior.names)

    @cached_property
    def starts(self) -> Floats:
        """Start times (B,) of the segments, seconds."""
        film = self.film
        before = np.ceil((self.placed - film.times[0]) / self.hop - 1e-6)
        after = max(0.0, np.ceil((film.times[-1] - self.placed - self.span) / self.hop - 1e-6))
        return np.asarray(self.placed + self.hop * np.arange(-before, after + 1))

    @property
    def placed(self) -> float:
        """Time of the placement's frame."""
        return float(self.film.times[self.placement.frame - self.film.first])

    @property
    def hop(self) -> float:
        """Seconds from one segment to the next."""
        return self.prior.hop / self.prior.fps

    @property
    def span(self) -> float:
        """Duration of a segment, seconds."""
        return (self.prior.frames - 1) / self.prior.fps

    @property
    def origin(self) -> int:
        """Index of the segment that starts at the placement's frame."""
        return int(np.argmin(np.abs(self.starts - self.placed)))

    @property
    def sensor_sd(self) -> float:
        """Standard deviation of a sensor."""
        return FIRST_SD if self.settings.sensor_sd is None else self.settings.sensor_sd

    def frames(self, segment: int) -> Indices:
        """Find the frames of the film, counted from its first, within a segment."""
        since = self.film.times - self.starts[segment]
        return np.flatnonzero((since > -1e-6) & (since < max(self.span, self.hop) + 1e-6))

    def weights(self, segment: int) -> Floats:
        """Make weights (T, F) that interpolate a segment's frames at those of the film: cubic splines."""
        times = (self.film.times[self.frames(segment)] - self.starts[segment]) * self.prior.fps
        count = self.prior.frames
        if count == 1:
            return np.ones((len(times), 1))
        spline = make_interp_spline(np.arange(count), np.eye(count), k=min(3, count - 1))
        return np.asarray(spline(np.clip(times, 0, count - 1)))

    def mean_state(self) -> Floats:
        """State (k + 6,) from the placement and the prior's mean."""
        state = np.zeros(self.shapes[0].size)
        state[PLACE_COLUMNS] = [*self.placement.ground, 0.0]
        state[HEADING_COLUMN] = self.placement.heading if self.shapes[0].turning else 0.0
        state[[GAIN_COLUMN, LEVEL_COLUMN]] = self.settings.gain[0], self.settings.level[0]
        return state

    def first_modes(self, component: int) -> tuple[Floats, Floats]:
        """Return mean and standard deviations (k,) of the first segment's modes."""
        if self.phase_prior is None:
            return np.zeros(self.prior.size), np.ones(self.prior.size)
        return self.phase_prior.mean[component], self.phase_prior.sd[component]

    def energy(
        self,
        segment: int,
        component: int,
        near: Floats,
        *,
        anchor: Anchor | None = None,
        looking: bool = True,
    ) -> Energy:
        """Make the energy of a segment.

        Parameters
        ----------
        segment, component : int
        near : (k + 6,)
            State around which sensors are placed and the weights of corrections are computed.
        anchor : Anchor, optional
        looking : bool
            Whether there are sensors.
        """
        mean = self.mean_state()
        sd = np.ones(len(mean))
        placement, first = self.placement, segment == self.origin
        if first:
            mean[:-EXTRA], sd[:-EXTRA] = self.first_modes(component)
        sd[PLACE_COLUMNS] = [*[placement.ground_sd if first else GROUND_SD] * 2, HEIGHT_SD]
        sd[HEADING_COLUMN] = placement.heading_sd if first else ANY_HEADING_SD
        sd[[GAIN_COLUMN, LEVEL_COLUMN]] = self.settings.gain[1], self.settings.level[1]
        shape, weights = self.shapes[component], self.weights(segment)
        energy = Energy(shape, self.view, self.sticks, weights, mean, sd, anchor=anchor)
        reading = self._reading(segment, energy, near) if looking else None
        return replace(energy, reading=reading, corrections=self._corrections(segment, shape, near))

    def _reading(self, segment: int, energy: Energy, near: Floats) -> Reading | None:
        """Read the sensors around the figure of a state; None if it is behind the lens."""
        if not np.isfinite(self.sensor_sd) or not len(energy.weights) or not energy.visible(near):
            return None
        places, _ = energy.shape.positions(near, energy.weights, self.sticks.markers)
        uv, _ = self.view.project(places)
        middle = (uv.min(axis=1) + uv.max(axis=1)) / 2
        size = [self.placement.stature * self.view.scale(body.mean(axis=0)) for body in places]
        grid = sensors.grid(middle, np.array(size))
        value = self.film.read(self.frames(segment), grid)
        return Reading(value, grid, np.full(len(grid), self.film.blur), self.sensor_sd)

    def _corrections(self, segment: int, shape: Shape, near: Floats) -> Corrections | None:
        """Collect the corrections in a segment's frames, with standard deviations.

        These include the part of the marker's position that the prior does not explain.  It hardly changes
        within a segment, and `gamma` inflates its variance for that in every frame.  A correction has only
        one frame's share of the variance, and several corrections of a marker together count as one.
        """
        frames = (self.frames(segment) + self.film.first).tolist()
        held = [c for c in self.corrections if c.frame in frames]
        if not held:
            return None
        marker = self.prior.index([c.joint for c in held])
        lasting = CLOTHED_JOINT_SD**2 + shape.residual[marker] ** 2 / self.prior.frames
        skin = self.view.scale(near[PLACE_COLUMNS]) * np.sqrt(np.bincount(marker)[marker] * lasting)
        return Corrections(
            frame=np.array([frames.index(c.frame) for c in held], np.intp),
            marker=marker,
            uv=np.array([c.uv for c in held]),
            sd=np.hypot([c.sd_px for c in held], skin),
        )
