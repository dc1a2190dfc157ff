"""What a person never shows is bounded by what others do; everything else stays."""

import numpy as np

from gait.learn.prior.unseen import bounded, never_shown


def people(rng, odd):
    """Cycles (8, 16, 3) of four people, the last of whom never shows channel 2; it was filled `odd` away."""
    subject = np.repeat(np.arange(4), 2)
    cycles = rng.normal(size=(8, 16, 3))
    cycles[6:, :, 2] = odd * np.cos(np.arange(16))
    mask = np.ones(cycles.shape, bool)
    mask[6:, :, 2] = False
    return cycles, mask, subject


def test_who_shows_everything_is_not_touched():
    cycles, mask, subject = people(np.random.default_rng(1), 3.0)
    assert bounded(cycles, np.ones_like(mask), subject) is cycles
    nobody = mask.copy()
    nobody[..., 2] = False  # a channel that nobody shows
    assert bounded(cycles, nobody, subject) is cycles


def test_what_is_never_shown_deviates_as_people_do_at_most():
    cycles, mask, subject = people(np.random.default_rng(2), 50.0)
    found = bounded(cycles, mask, subject)
    assert np.array_equal(found[mask], cycles[mask])
    mean = cycles[:6, :, 2].mean(axis=0)
    usual = np.mean((cycles[:6, :, 2] - mean) ** 2)
    away = found[6:, :, 2] - mean
    np.testing.assert_allclose(np.mean(away**2), usual)
    whole = cycles[6:, :, 2] - mean
    np.testing.assert_allclose(away, whole * np.sqrt(usual / np.mean(whole**2)))


def test_a_modest_filling_stays():
    cycles, mask, subject = people(np.random.default_rng(3), 0.1)
    assert np.array_equal(bounded(cycles, mask, subject), cycles)


def test_who_never_shows_what_others_show_is_counted():
    _, mask, subject = people(np.random.default_rng(4), 0.1)
    people_lacking, channels = never_shown(mask, subject)
    assert people_lacking == 1 and channels.tolist() == [False, False, True]
    mask[..., 2] = False  # a channel that nobody shows is nobody's lack
    assert never_shown(mask, subject)[0] == 0
