"""A latency budget: old frames are dropped and counted, and the particles follow if they may."""

import time

import lcm_rig as rig
import pytest

from gait.lcm.link import gaitmsg, now, private_url
from gait.lcm.messages import command_message, image_message

STATUS = gaitmsg.status_t


@pytest.fixture
def url():
    rig.need_multicast()
    return private_url()


def armed(listener, at=0):
    """Camera, empty scene and a start that the next frame meets."""
    listener.ask(
        rig.opening()[:2], lambda s: s.state == STATUS.READY and s.background_mask == 1, "the camera"
    )
    start = rig.start(0, at=at)
    listener.ask([("GAIT_COMMAND", start)], lambda s: s.command_id == start.id, "the START")


def send(listener, number, utime):
    listener.send([("GAIT_IMAGE_0", image_message(rig.picture(number % 30), utime, number))])


def test_frames_older_than_the_budget_are_dropped_and_counted(url):
    with rig.daemon(url, "--budget-ms", 400, "--max-gap", 60) as (listener, finish):
        armed(listener)
        send(listener, 0, now())
        listener.until(lambda: len(listener.estimates) == 1, "the first estimate")
        for number in (1, 2, 3):
            send(listener, number, now() - 700_000)
            listener.until(lambda: listener.last.dropped == number, "the dropped frame")  # noqa: B023
        assert "budget of 400.0 ms" in listener.last.text
        send(listener, 4, now())
        listener.until(lambda: len(listener.estimates) == 2, "the frame in time")
        outcome = finish()
    assert [e.frame for e in listener.estimates] == [0, 4]
    assert listener.estimates[-1].dropped == 3
    assert (outcome.frames, outcome.dropped) == (2, 3)
    assert " late 3 over_budget 0 particles 64 slow_steps 0 " in outcome.printed
    assert "more than the budget" not in outcome.words
    assert outcome.words.count("frames too old for a budget") == 1


def test_frames_sent_twice_are_not_dropped(url):
    """Whichever of the two frames is tracked."""
    with rig.daemon(url, "--max-gap", 60) as (listener, finish):
        armed(listener)
        for number in range(8):
            stamp = now()
            send(listener, number, stamp)
            send(listener, number, stamp)
            listener.until(lambda: len(listener.estimates) == number + 1, "an estimate")  # noqa: B023
        outcome = finish()
    assert (outcome.frames, outcome.dropped) == (8, 0)


def test_a_source_with_another_clock_counts_from_arrival(url):
    with rig.daemon(url, "--budget-ms", 2000) as (listener, finish):
        armed(listener)
        for number in range(3):  # stamped in 1970
            send(listener, number, rig.utime(number))
            listener.until(lambda: len(listener.estimates) == number + 1, "an estimate")  # noqa: B023
        assert finish().dropped == 0


def test_particles_follow_the_budget_only_if_asked(url):
    many, low = 40_000, 1000
    with rig.daemon(url, "-n", many, "--budget-ms", 20, "--adapt-particles", low) as (listener, finish):
        armed(listener)
        deadline, number = time.monotonic() + rig.PATIENCE, 0
        while listener.last.particles == many:
            assert time.monotonic() < deadline, "the number stays"
            send(listener, number, rig.utime(number))
            number += 1
            shown = len(listener.statuses)
            listener.until(lambda: len(listener.statuses) > shown or listener.estimates, "a sign")  # noqa: B023
            listener.estimates.clear()
        assert low <= listener.last.particles < many
        reset = ("GAIT_COMMAND", command_message(gaitmsg.command_t.RESET))
        listener.ask([reset], lambda s: s.frames == 0, "the RESET")
        assert listener.last.particles == many, "as at the program's start"
        outcome = finish()
    assert "particles instead of 40000: a step took" in outcome.words
    with rig.daemon(url, "-n", 3000, "--budget-ms", 1) as (listener, finish):
        armed(listener)
        for number in range(20):
            send(listener, number, rig.utime(number))
        listener.until(lambda: listener.last.dropped + listener.last.frames >= 19, "the frames")
        assert " particles 3000 " in finish().printed


def test_a_step_longer_than_the_budget_is_reported_once(url):
    with rig.daemon(url, "-n", 40_000, "--budget-ms", 10) as (listener, finish):
        armed(listener)
        number = 0
        while len(listener.estimates) < 10:  # on a busy machine some are too old when they come
            send(listener, number, rig.utime(number))
            number += 1
            listener.until(lambda: len(listener.estimates) + listener.last.dropped >= number, "a sign")  # noqa: B023
        outcome = finish()
    assert outcome.words.count("more than the budget of 10.0: use fewer --particles") == 1
    assert f" slow_steps {outcome.frames} " in outcome.printed


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--adapt-particles", 100], "needs --budget-ms"),
        (["--adapt-particles", 100, "--budget-ms", 30], "at most the 64 of --particles"),
        (["--budget-ms", 30, "--url", "file://x.log"], "played without dropping frames"),
        (["--budget-ms", 0.5], "--budget-ms"),
    ],
)
def test_options_that_do_not_fit_are_refused(options, words):
    outcome = rig.run(*rig.command(*options)[1:])
    assert outcome.code == 2 and words in outcome.words
