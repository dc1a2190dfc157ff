"""Channels that a person never shows, such as the arms of somebody measured from the hips down.

The filling draws what is missing from what is seen, linearly and without bound: whoever walks unlike all
others would get arms that nobody has, and they would count like a recording.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from gait.learn.spool import by_rows, release, stored

Floats = npt.NDArray[np.float64]
Groups = npt.NDArray[np.intp]
Mask = npt.NDArray[np.bool_]


def never_shown(mask: Mask, subject: Groups) -> tuple[int, Mask]:
    """How many people never show channels (M,) that others show, and which these are.

    mask : (R, T, M)
        What was recorded.
    subject : (R,)
        Person of each cycle.
    """
    shown = np.array([mask[subject == who].any(axis=(0, 1)) for who in np.unique(subject)])
    lacking = ~shown & shown.any(axis=0)
    return int(lacking.any(axis=1).sum()), np.asarray(lacking.any(axis=0))


def bounded(filled: Floats, mask: Mask, subject: Groups) -> Floats:
    """Completed cycles whose unseen channels are no further from the mean than people usually are.

    Parameters
    ----------
    filled : (R, T, M)
        Completed cycles; they may lie on disk.
    mask : (R, T, M)
        What was recorded.
    subject : (R,)
        Person of each cycle, from 0.

    Returns
    -------
    (R, T, M)
        On disk; `filled` itself if everybody shows every channel that anybody shows.
    """
    people = range(subject.max() + 1)
    shown = np.array([mask[subject == who].any(axis=(0, 1)) for who in people])
    if np.all(shown == shown.any(axis=0)):
        return filled
    share = shown / np.maximum(shown.sum(axis=0), 1)  # (people, M): all who show a channel count alike
    mean = sum(share[who] * _mean(filled, subject == who) for who in people)
    away = np.array([_mean(filled, subject == who, mean) for who in people])
    usual = np.sum(share * away, axis=0)
    # Nobody shows a channel: there is nothing to go by, and it stays as it is.
    held = ~shown & shown.any(axis=0)
    keep = np.where(held, np.sqrt(np.minimum(1.0, usual / np.maximum(away, 1e-300))), 1.0)
    nearer = (_drawn(filled[part], mean, keep[subject[part], None]) for part in by_rows(filled))
    return stored(nearer, filled.shape[1:])


def _drawn(cycles: Floats, mean: Floats, keep: Floats) -> Floats:
    """Cycles with `keep` of their distance from the mean; what keeps all of it stays bit for bit."""
    return np.where(keep < 1, mean + keep * (cycles - mean), cycles)


def _mean(filled: Floats, rows: Mask, about: Floats | None = None) -> Floats:
    """Mean cycle (T, M) of some rows, or their mean square (M,) about a cycle."""
    at = np.flatnonzero(rows)
    total: Floats = np.zeros(filled.shape[1:])
    for part in by_rows(at):
        values = filled[at[part]]
        total += np.sum(values if about is None else (values - about) ** 2, axis=0)
        release(filled)
    return total / len(at) if about is None else total.mean(axis=0) / len(at)
