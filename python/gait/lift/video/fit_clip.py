"""Fit a clip, check the correlation of sensors and stick figure, and suggest corrections.

A clip has a segment every hop, each at the minimum of its energy.  A segment starts from the one before
(Leventon & Freeman 1998), whose estimate of the common frames is an additional observation.  By default all
segments are then solved together, with neighbours coupled where they overlap, so that a correction in one
helps the others.  In the paper's way (`Settings.joined` False) they are not, but each is moved in depth so
that it continues the one before. In either case they are blended linearly.

Where the figure is on the person, it explains most of the sensors' readings.  If it explains little, the
sensors read edges of the static scene, which hold the figure back, and it drifts further and further from the
person.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from gait.body.skeleton import JOINTS
from gait.lift.keypoints.suggestions import FramePosterior, Suggestion, suggest
from gait.lift.video.clip_segments import CORRELATED, ClipSegments
from gait.lift.video.descent import Link, Normal, descend, information, moves, normal
from gait.lift.video.energy import HEADING_COLUMN, PLACE_COLUMNS, Anchor, Energy

Floats = npt.NDArray[np.float64]

FOLLOWING_CORRELATION = 0.9  # fit correlation of figures that follow a person in front of a known background
CHANCE = 0.3  # fit correlation that a figure anywhere in a scene may have
#: Metres per second at twice the noise of `FOLLOWING_CORRELATION`; maximum likelihood without a background.
DRIFT_SD = 0.04
POOR_CORRELATION = 0.5  # below it, figures lost the person in half of the clips used to choose it


def fit_correlation(chain: Sequence[Energy], states: Floats) -> float:
    """Correlation between sensors and the figure's responses at states (B, n); NaN without sensors.

    It is over all frames, with each frame's means subtracted.
    """
    products = np.zeros(3)
    for energy, state in zip(chain, states, strict=True):
        if energy.reading is None:
            continue
        read = energy.reading.value
        given = read + energy.residuals(state).reshape(read.shape)
        read, given = (values - values.mean(axis=1, keepdims=True) for values in (read, given))
        products += (read * given).sum(), (read * read).sum(), (given * given).sum()
    both, one, other = products
    return float(both / np.sqrt(one * other)) if one > 0 and other > 0 else float("nan")


def drift(alike: float) -> float:
    """Return the sd of the drift [m/s] of a figure held back by the scene; 0 if it explains enough."""

    def noise(value: float) -> float:
        return float(
            np.sqrt(1 / max(value, CHANCE) ** 2 - 1)
        )  # standard deviation not explained over that explained

    return 0.0 if np.isnan(alike) else DRIFT_SD * max(0.0, noise(alike) / noise(FOLLOWING_CORRELATION) - 1)


Indices = npt.NDArray[np.intp]
Update = Callable[[int], None]
Settled = tuple[float, int, Floats]  # energy, component and state of a segment

PREVIOUS_SEGMENT_SD = 0.03  # statures; error of the segment before, when the next one starts from it
BEGINNINGS = 3  # explanations of the first segment that are continued through the clip
DIFFERENT = 0.03  # statures; mean distance of markers from which explanations are different
START_MODES, START_MODE_SD = 3, 1.5  # the first segment starts from the mean, and +- this sd of these modes
LEAST_BLEND_WEIGHT = 1e-3  # weight of a segment in the blend at its ends
SENSOR_PASSES = 2  # times that sensors are placed again around the figure found


@dataclass(frozen=True)
class ClipStates:
    """Components (B,) and states (B, k + 6) of a clip's segments, and their energy."""

    components: Indices
    states: Floats
    energy: float


@dataclass(frozen=True)
class ClipFit:
    """Estimate of a clip.

    Attributes
    ----------
    frame : (T,)
        Numbers of the video's frames.
    time : (T,)
        Seconds.
    places : (T, J, 3)
        Markers, metres.
    sd : (T, J, 3)
        Posterior standard deviations.
    sequence : ClipStates
    covariance : (B, k + 6, k + 6)
        Covariances of the segments' states.
    fit_correlation : float
        Correlation between sensors and the figure's responses; NaN without sensors.
    """

    frame: Indices
    time: Floats
    places: Floats
    sd: Floats
    sequence: ClipStates
    covariance: Floats
    fit_correlation: float


def fit_clip(clip: ClipSegments, known: ClipStates | None = None, update: Update | None = None) -> ClipFit:
    """Estimate the motion of a clip.

    Parameters
    ----------
    clip : ClipSegments
    known : ClipStates, optional
        Estimate with other corrections from which to start, which is faster.
    update : callable, optional
        Called with the number of segments done, of `work(clip)`.
    """
    chains = [known] if known is not None else _chains(clip, update)
    found = min(chains, key=lambda c: c.energy)
    if clip.settings.sensor_sd is None:
        clip = _with_noise(clip, found)
    if not clip.settings.joined:
        first = _first_segments(clip)[0]
        return _finished(clip, _continuous(clip, _one_after_the_other(clip, first, None)))
    starts = list(chains)
    if clip.corrections:  # without sensors it is nearly linear, with no false minima
        starts.append(_together(clip, found, looking=False))
    tried = [_together(clip, start) for start in starts]
    return _finished(clip, min(tried, key=lambda t: t.energy))


def work(clip: ClipSegments) -> int:
    """Largest number of segments that `fit_clip` reports to its `update`."""
    return len(clip.starts) * BEGINNINGS


def _chains(clip: ClipSegments, update: Update | None) -> list[ClipStates]:
    """Estimate sequences from different explanations of the first segment."""
    firsts = _first_segments(clip)[:BEGINNINGS]
    return [_one_after_the_other(clip, first, _part(update, k, clip)) for k, first in enumerate(firsts)]


def _part(update: Update | None, chain: int, clip: ClipSegments) -> Update:
    """Make the update function for one chain of several."""
    return lambda done: None if update is None else update(chain * len(clip.starts) + done)


def _first_segments(clip: ClipSegments) -> list[Settled]:
    """Find different explanations of the segment at the placement, least energy first."""
    tried = [
        _settled(clip, clip.origin, component, start, None)
        for component in range(len(clip.shapes))
        for start in _first_starts(clip, component)
    ]
    kept: list[Settled] = []
    places: list[Floats] = []
    for found in sorted(tried, key=lambda t: t[0]):
        body, _ = clip.shapes[found[1]].positions(found[2], np.eye(clip.prior.frames), slice(None))
        apart = [np.linalg.norm(body - other, axis=-1).mean() for other in places]
        if min(apart, default=np.inf) > DIFFERENT * clip.placement.stature:
            kept.append(found)
            places.append(body)
    return kept


def _one_after_the_other(clip: ClipSegments, first: Settled, update: Update | None) -> ClipStates:
    """Estimate segments forwards from a first one, then backwards, each started from its neighbour."""
    count, origin = len(clip.starts), clip.origin
    components, states = np.zeros(count, np.intp), np.zeros((count, clip.shapes[0].size))
    energy, components[origin], states[origin] = first
    for done, segment in enumerate([*range(origin + 1, count), *reversed(range(origin))], 1):
        step = 1 if segment > origin else -1
        old = segment - step
        tried = []
        for component in range(len(clip.shapes)):
            start, anchor = _continued(clip, component, int(components[old]), states[old], step)
            tried.append(_settled(clip, segment, component, start, anchor))
        cost, components[segment], states[segment] = min(tried, key=lambda t: t[0])
        energy += cost
        if update is not None:
            update(done)
    return ClipStates(components, states, energy)


def _first_starts(clip: ClipSegments, component: int) -> list[Floats]:
    """List starts for the first segment: the mean, and both ways along the first modes."""
    mean, sd = clip.first_modes(component)
    start = clip.mean_state()
    start[: len(mean)] = mean
    starts = [start]
    for mode in range(min(START_MODES, clip.prior.size)):
        for side in (-START_MODE_SD, START_MODE_SD):
            starts.append(start.copy())
            starts[-1][mode] += side * sd[mode]
    return starts


def _continued(
    clip: ClipSegments, component: int, old: int, state: Floats, step: int
) -> tuple[Floats, Anchor]:
    """Return a start for the segment after (step 1) or before (-1) a known one, and the anchor to it."""
    frames, hop = clip.prior.frames, clip.prior.hop
    places, _ = clip.shapes[old].positions(state, np.eye(frames), slice(None))
    sd = CORRELATED * np.hypot(clip.shapes[component].residual, PREVIOUS_SEGMENT_SD * clip.placement.stature)
    shared = slice(hop, None) if step > 0 else slice(frames - hop)
    there = slice(frames - hop) if step > 0 else slice(hop, None)
    anchor = Anchor(there, places[shared], sd)
    start = state.copy()
    start[: PLACE_COLUMNS.start] = 0.0
    pelvis = places[:, clip.prior.names.index("pelvis")]
    ahead = pelvis[min(hop, frames - 1), :2]
    start[PLACE_COLUMNS][:2] = ahead if step > 0 else 2 * pelvis[0, :2] - ahead
    blind = Energy(
        clip.shapes[component],
        clip.view,
        clip.sticks,
        np.zeros((0, frames)),
        start,
        _broad(clip),
        anchor=anchor,
    )
    return descend([blind], None, start[None])[0][0], anchor


def _broad(clip: ClipSegments) -> Floats:
    """Return standard deviations of a state of which only the shape is known."""
    sd = np.ones(clip.shapes[0].size)
    sd[PLACE_COLUMNS], sd[HEADING_COLUMN] = 1.0, 1.0
    return sd


def _settled(
    clip: ClipSegments, segment: int, component: int, state: Floats, anchor: Anchor | None
) -> Settled:
    """Minimise the energy of one segment, with sensors that follow it; return energy, component and state."""
    cost = np.inf
    for _ in range(SENSOR_PASSES):
        energy = clip.energy(segment, component, state, anchor=anchor)
        (state,), cost = descend([energy], None, state[None])
    return cost - 2 * float(np.log(clip.prior.weights[component])), component, state


def _with_noise(clip: ClipSegments, sequence: ClipStates) -> ClipSegments:
    """Return the clip with the sensors' standard deviation estimated from a sequence."""
    chain, _ = _chain(clip, sequence, looking=True)
    residuals = [energy.residuals(state) for energy, state in zip(chain, sequence.states, strict=True)]
    rms = float(np.sqrt(np.mean(np.concatenate(residuals) ** 2))) if any(map(len, residuals)) else np.inf
    return replace(clip, settings=replace(clip.settings, sensor_sd=CORRELATED * rms))


def _chain(clip: ClipSegments, sequence: ClipStates, looking: bool) -> tuple[list[Energy], Link]:
    """Make the energies of all segments around their states, and their link."""
    chain = [
        clip.energy(s, int(c), state, looking=looking)
        for s, (c, state) in enumerate(zip(sequence.components, sequence.states, strict=True))
    ]
    residual = np.sqrt(np.mean([clip.shapes[int(c)].residual ** 2 for c in sequence.components], axis=0))
    return chain, Link(clip.prior.hop, np.sqrt(2) * residual)


def _together(clip: ClipSegments, start: ClipStates, looking: bool = True) -> ClipStates:
    """Minimise the energy of all segments together near a start, coupled with their neighbours."""
    states, cost = start.states, np.inf
    for _ in range(SENSOR_PASSES if looking else 1):
        chain, link = _chain(clip, ClipStates(start.components, states, cost), looking)
        states, cost = descend(chain, link, states)
    return ClipStates(start.components, states, cost)


def _continuous(clip: ClipSegments, sequence: ClipStates) -> ClipStates:
    """Move each segment along the line of sight by its mean difference in depth from the one before."""
    hop, frames = clip.prior.hop, clip.prior.frames
    states = sequence.states.copy()
    for segment in [*range(clip.origin + 1, len(states)), *reversed(range(clip.origin))]:
        step = 1 if segment > clip.origin else -1
        pair = sorted((segment, segment - step))
        early, late = (
            clip.shapes[int(sequence.components[s])].positions(states[s], np.eye(frames), slice(None))[0]
            for s in pair
        )
        away = clip.view.away(states[segment][PLACE_COLUMNS])
        gap = step * float(((early[hop:] - late[: frames - hop]) @ away).mean())
        states[segment, PLACE_COLUMNS] += gap * away
    return ClipStates(sequence.components, states, sequence.energy)


def _share(clip: ClipSegments, segment: int) -> Floats:
    """Compute triangular weights (T,) of a segment's frames in the blend.

    The triangle is half a frame longer than the segment at both ends, since a segment that started with the
    full slope in one frame would cause a kink.
    """
    half = 0.5 / clip.prior.fps
    since = clip.film.times[clip.frames(segment)] - clip.starts[segment] + half
    return np.maximum(1 - np.abs(2 * since / (clip.span + 2 * half) - 1), LEAST_BLEND_WEIGHT)


def blended(clip: ClipSegments, sequence: ClipStates) -> Floats:
    """Blend segments linearly to positions (T, J, 3) of all markers, metres."""
    count = len(clip.film.times)
    places, total = np.zeros((count, len(clip.prior.names), 3)), np.zeros(count)
    for s, (component, state) in enumerate(zip(sequence.components, sequence.states, strict=True)):
        frames, share = clip.frames(s), _share(clip, s)
        found, _ = clip.shapes[int(component)].positions(state, clip.weights(s), slice(None))
        places[frames] += share[:, None, None] * found
        total[frames] += share
    return np.asarray(places / total[:, None, None])


def linearised(clip: ClipSegments, sequence: ClipStates) -> Normal:
    """Form the Gauss-Newton equations of all segments together at an estimate."""
    chain, link = _chain(_with_noise(clip, sequence), sequence, looking=True)
    return normal(chain, link if clip.settings.joined else None, sequence.states)


def _finished(clip: ClipSegments, sequence: ClipStates) -> ClipFit:
    """Blend the segments linearly, with standard deviations from their common information matrix."""
    chain, link = _chain(clip, sequence, looking=True)
    factor = information(chain, link if clip.settings.joined else None, sequence.states)
    overlap = clip.prior.frames / clip.prior.hop  # number of segments that contain each frame
    alike = fit_correlation(chain, sequence.states)
    drifted = drift(alike) * (clip.starts + 0.5 * clip.span - clip.placed)
    pulled = moves(chain, factor, sequence.states, drifted)
    covariance = overlap * factor.covariance()[0] + pulled @ pulled.swapaxes(1, 2)
    count, markers = len(clip.film.times), len(clip.prior.names)
    variance, total = np.zeros((count, markers, 3)), np.zeros(count)
    for s, energy in enumerate(chain):
        frames = clip.frames(s)
        share = _share(clip, s)
        _, slope = energy.shape.positions(sequence.states[s], energy.weights, slice(None))
        sds = np.einsum("tjin,nm,tjim->tji", slope, covariance[s], slope, optimize=True)
        variance[frames] += share[:, None, None] * (sds + energy.shape.residual[:, None] ** 2)
        total[frames] += share
    frame, places = clip.film.first + np.arange(count), blended(clip, sequence)
    size = clip.placement.stature_sd / clip.placement.stature * clip.view.growth(places)
    return ClipFit(
        frame=frame,
        time=clip.film.times,
        places=places,
        sd=np.sqrt(variance / total[:, None, None] + size**2),
        sequence=sequence,
        covariance=covariance,
        fit_correlation=alike,
    )


KNOWN_JOINT_SD = 0.03  # statures; joints known this well in the picture need no correction
MOST_CORRECTIONS_PER_FRAME = 2.0  # most corrections suggested per frame


def suggestions(clip: ClipSegments, fit: ClipFit) -> list[Suggestion]:
    """Suggest corrections, most useful first, until every joint is known within `KNOWN_JOINT_SD` statures.

    At most `MOST_CORRECTIONS_PER_FRAME`.  A correction is counted for the segment whose middle is nearest to
    its frame.
    """
    joints = [j for j in JOINTS if j in clip.prior.names]
    near = 0.5 * clip.hop / float(np.median(np.diff(clip.film.times))) if len(clip.film.times) > 1 else 1.0
    scale = float(np.median([clip.view.scale(body.mean(axis=0)) for body in fit.places]))
    enough = KNOWN_JOINT_SD * clip.placement.stature * scale
    posteriors = _posteriors(clip, fit, clip.prior.index(joints))
    return suggest(posteriors, joints, near, enough, int(MOST_CORRECTIONS_PER_FRAME * len(fit.frame)))


def picture_sd(clip: ClipSegments, fit: ClipFit, joints: Indices) -> Floats:
    """Return standard deviations (T, J) of joints along an axis of the picture, pixels."""
    found = np.zeros((len(fit.frame), len(joints)))
    for posterior in _posteriors(clip, fit, joints):
        found[posterior.frame - clip.film.first] = posterior.off / np.sqrt(2)
    return found


def joint_covariances(clip: ClipSegments, fit: ClipFit, joints: Indices) -> Floats:
    """Compute covariances (T, 3 J, 3 J) of the coordinates of each frame's joints, square metres."""
    found = np.zeros((len(fit.frame), 3 * len(joints), 3 * len(joints)))
    for segment, rows, frames in _middles(clip):
        shape = clip.shapes[int(fit.sequence.components[segment])]
        _, slope = shape.positions(fit.sequence.states[segment], clip.weights(segment)[rows], joints)
        flat = slope.reshape(len(slope), -1, slope.shape[-1])
        found[frames] = flat @ fit.covariance[segment] @ flat.swapaxes(1, 2)
        found[frames] += np.diag(np.repeat(shape.residual[joints] ** 2, 3))
    return found


def _posteriors(clip: ClipSegments, fit: ClipFit, joints: Indices) -> list[FramePosterior]:
    """Make a posterior for each segment, of the frames nearest to its middle."""
    found = []
    for segment, rows, frames in _middles(clip):
        shape = clip.shapes[int(fit.sequence.components[segment])]
        weights = clip.weights(segment)[rows]
        places, by_state = shape.positions(fit.sequence.states[segment], weights, joints)
        _, by_place = clip.view.project(places)
        found.append(FramePosterior(clip.film.first + frames, by_place @ by_state, fit.covariance[segment]))
    return found


def _middles(clip: ClipSegments) -> list[tuple[int, npt.NDArray[np.bool_], Indices]]:
    """Yield each segment with the frames nearest to its middle: which of its own, and their indices."""
    owner = np.argmin(np.abs(clip.film.times[:, None] - (clip.starts + 0.5 * clip.span)), axis=1)
    found = []
    for segment in np.unique(owner).tolist():
        own = clip.frames(segment)
        rows = np.isin(own, np.flatnonzero(owner == segment))
        if rows.any():
            found.append((segment, rows, own[rows]))
    return found
