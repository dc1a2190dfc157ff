"""Verdicts of the page, each derived from numbers; the first words are its kind."""

from __future__ import annotations

from collections.abc import Sequence

FIRST_PAPER_ANGLES = 19  # of the first paper
THEIR_MOTIONS, THEIR_LENGTHS, THEIR_MODES = 10, (120, 240), 50  # of the second
ALIKE = 0.1  # share of a cycle within which offsets agree
NEAR_ORIGINAL = (
    1 - 0.91
) ** 0.5  # distance from the original over distance from the mean, with the paper's own modes (rms)
FAR_BETTER = 0.6  # remaining error over that of the view alone, below which Bayes is far better
SHRUNK = 10 ** (-2 * 14 / 50)  # posterior over prior variance: the mean that the paper's volume implies
HUMAN = 0.2  # relative difference in length, from the training data, of the limbs of a plausible body
NARROW = 0.8  # coverage of 90 % intervals below which they are too narrow
MOSTLY = 0.9  # of the runs
CLEARLY = 0.8  # of the energy of a displacement
SERVES = 0.75  # error over that of the mean alone, below which components are useful
JUMP = 2.0  # step from the end of a cycle to its start, over the largest step within it


KINDS = "reproduced", "reproduced in part", "not reproduced", "no counterpart"
"""First words of a verdict; the last kind is for what the paper does not report."""


def kind(verdict: str) -> str:
    """Return the one of KINDS with which a verdict begins."""
    return max((each for each in KINDS if verdict.startswith(each)), key=len)


def body(angles: int) -> str:
    """Fig. 1 of the first paper: how many relative angles move."""
    return "reproduced" if angles == FIRST_PAPER_ANGLES else f"not reproduced: {angles} angles move"


def periods(flat: bool, agreeing: float, failed: int, long_failed: bool) -> str:
    """Fig. 2.

    flat : whether the ratio of white noise does not depend on the period.
    agreeing : share of walks whose cycle is found with whole frames.
    failed : number of the other walks.
    long_failed : whether whole frames fail on a long walk.
    """
    fails = [f"on {failed} walks"] if failed else []
    fails += ["on a long walk whose cycle is not a whole number of frames"] if long_failed else []
    if agreeing < MOSTLY:
        words = f"not reproduced: the cycle of {100 * agreeing:.0f} % of the walks is found"
    else:
        words = "reproduced" if flat else "reproduced in part: the ratio of white noise depends on the period"
    return words + (f"; whole periods fail {' and '.join(fails)}" if fails else "")


def offsets(falling: bool, apart: float) -> str:
    """Figs. 3 and 4: whether the error falls, and the largest difference from our offsets, in cycles."""
    if not falling:
        return "not reproduced: the error rises in some pass"
    return "reproduced" if apart < ALIKE else "reproduced in part: it converges, but not to our offsets"


def passes(falling: bool, filled: float, mean: float) -> str:
    """Fig. 5: whether the error falls, and errors of removed blocks, filled in and replaced by the mean."""
    better = f"it fills gaps {'better' if filled < mean else 'no better'} than the mean"
    if falling and filled < mean:
        return f"reproduced: the error falls pass by pass, and {better}"
    part = falling or filled < mean
    course = "the error falls pass by pass" if falling else "the error rises in some pass"
    return f"{'reproduced in part' if part else 'not reproduced'}: {course}, and {better}"


def components(step: float, others: tuple[float, float] | None) -> str:
    """Components.

    step : step from the end of a cycle to its start, over the largest step within it.
    others : errors for people left out, degrees, with five components and with the mean alone; None if there
        are too few people.
    """
    if step >= JUMP:
        return "not reproduced: curves that do not close"
    if others is None:
        return "reproduced in part: smooth periodic curves, but too few people to leave one out"
    five, mean = others
    fit = "fit" if five < SERVES * mean else "do not fit"
    words = (
        f"smooth periodic curves, which {fit} people left out: error {five:.1f} degrees, {mean:.1f} with the "
        "mean alone"
    )
    return f"{'reproduced' if five < SERVES * mean else 'not reproduced'}: {words}"


def tracking(held: Sequence[int], seeds: int, ratio: float, unnoticed: Sequence[int]) -> str:
    """Fig. 6.

    held : number of runs that follow the person to the end, literal and ours.
    ratio : error of the paper's filter over ours.
    unnoticed : number of the other runs whose status is tracking at the end.
    """
    literal, ours = held
    part = "reproduced in part" if literal > 0.5 * seeds else "not reproduced"
    words = "reproduced" if literal >= MOSTLY * seeds else part
    left = [
        f"{of} {missed} of {seeds - stayed} that left"
        for of, missed, stayed in zip(("of the paper's", "of ours"), unnoticed, held, strict=True)
        if stayed < seeds
    ]
    return (
        f"{words}: the paper's filter stays on the person in {literal} of {seeds} runs, ours in {ours}; its "
        f"error is {ratio:.1f} times ours" + (f"; not reported as lost: {', '.join(left)}" if left else "")
    )


def without_image(paper: float, ours: float) -> str:
    """Ladder: by how much the images reduce the error of the paper's filter and of ours, mm."""
    return (
        "no counterpart: compared with its own mean cycle running free from the exact truth, without any "
        f"image, the paper's likelihood {_gains(paper)} and the default {_gains(ours)} (median of the views)"
    )


def _gains(gain: float) -> str:
    return f"{'gains' if gain > 0 else 'loses'} {abs(gain):.0f} mm"


def held(runs: Sequence[int], seeds: int, errors: Sequence[float], none: Sequence[float]) -> str:
    """Eqs. 10 to 13, by view.

    runs : number of runs, of `seeds`, that follow the person to the end.
    errors, none : errors of the runs, and of the mean cycle running free without any image, mm.
    """
    stays = [count >= MOSTLY * seeds for count in runs]
    nearer = [error < free for error, free in zip(errors, none, strict=True)]
    both = sum(a and b for a, b in zip(stays, nearer, strict=True))
    if both == len(runs):
        return "reproduced: in every view the person is followed, more accurately than without any image"
    words = (
        f"the person is followed in {sum(stays)} of {len(runs)} views, and the error is smaller than without "
        f"any image in {sum(nearer)}; both in {both}"
    )
    return f"{'reproduced in part' if both else 'not reproduced'}: {words}"


def at_rest(gains: Sequence[Sequence[float]]) -> str:
    """Eqs. 10 to 13: nats by which a body at rest scores better than the true one, by likelihood and view."""
    names = "the paper's likelihood", "the default's"
    wins = [f"{sum(gain > 0 for gain in each)} of {len(each)} views" for each in gains]
    each = zip(names, wins, strict=True)
    return "; ".join(f"{name} prefers a body at rest beside the person in {count}" for name, count in each)


def training(count: int, shortest: int, longest: int) -> str:
    """Fig. 1 of the second paper: number of sequences and frames of them."""
    low, high = THEIR_LENGTHS
    differs = ["fewer sequences"] if count < THEIR_MOTIONS else []
    differs += ["shorter ones"] if shortest < low else []
    differs += ["longer ones"] if longest > high else []
    words = f"in part: the same kind of data, but {' and '.join(differs)}" if differs else ""
    return f"reproduced {words}" if words else "reproduced: the same kind of data"


def synthesis(left: float, needed: int) -> str:
    """Fig. 2.

    left : distance from the original over distance from the mean.
    needed : number of modes that explain as much variance as the paper's.
    """
    words = "reproduced" if left < NEAR_ORIGINAL else "not reproduced: the synthesis is far from the original"
    if needed == THEIR_MODES:
        return f"{words}; as many modes are needed as in the paper"
    return f"{words}; {'fewer' if needed < THEIR_MODES else 'more'} modes are needed than in the paper"


def spectrum(ratios: Sequence[float]) -> str:
    """Fig. 3: posterior over prior variance of each mode."""
    count = sum(ratio < SHRUNK for ratio in ratios)
    words = f"{count} of {len(ratios)} variances shrink below {SHRUNK:.2f}, the paper's mean ratio"
    return f"{'reproduced' if count > 0.5 * len(ratios) else 'not reproduced'}: {words}"


def draws(limbs: float, learnt: float) -> str:
    """Fig. 4: relative differences of limb lengths from their mean, in draws and in the training data."""
    how = f"limb lengths vary by {100 * limbs:.0f} %, in the training data by {100 * learnt:.0f} %"
    return f"reproduced{': draws are bodies' if limbs < HUMAN else ' in part: draws are no bodies'}: {how}"


def estimates(pairs: Sequence[tuple[float, float]], covered: float) -> str:
    """Fig. 5: errors of the likelihood alone and of Bayes, by noise; coverage of 90 % intervals of depth."""
    left = [bayes / alone for alone, bayes in pairs]
    shares = ", ".join(f"{100 * share:.0f} %" for share in left)
    words = f"Bayes leaves {shares} of the error of the view alone"
    if max(left) >= 1:
        words = f"not reproduced: {words}"
    else:
        words = f"reproduced{'' if max(left) < FAR_BETTER else ' in part'}: {words}"
    return f"{words}; the paper's intervals {'are too narrow' if covered < NARROW else 'cover the truth'}"


def uncertain(along: Sequence[float], rigid: Sequence[float]) -> str:
    """Fig. 6: by mode, the shares of its energy along the depth and in a translation of the whole body."""
    if min(along) <= CLEARLY:
        return "not reproduced: not only motions in depth"
    moved = [k for k, share in enumerate(rigid, 1) if share > CLEARLY]
    if not moved:
        return "reproduced in part: they are motions in depth, none of them a translation of the whole body"
    return f"reproduced: they are motions in depth, mode {moved[0]} a translation"


def volume(ratios: Sequence[float], same: float, tried: Sequence[float]) -> str:
    """Volume: its logarithm for each of the `tried` noises, and the noise that gives the paper's, metres."""
    if any(later <= earlier for earlier, later in zip(ratios, ratios[1:], strict=False)):
        return "not reproduced: the volume does not grow with the noise"
    if not tried[0] <= same <= tried[-1]:
        return "not reproduced: no likely noise has the paper's volume"
    return f"reproduced at a noise of {1000 * same:.0f} mm; the paper does not state its own"


def sequence(off: Sequence[float], height: float, share: float) -> str:
    """Fig. 7: distances from clicks that were left out, literal and ours, and the person's height, pixels."""
    literal, ours = (each / height for each in off)
    words = (
        "reproduced: the person is followed"
        if literal < share
        else "not reproduced: the figure leaves the person"
    )
    return (
        f"{words}; the error at clicks that were left out is {100 * literal:.0f} % of the person's height, "
        f"ours {100 * ours:.0f} %"
    )
