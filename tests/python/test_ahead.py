"""Reading ahead in another thread."""

import threading

import pytest

from gait import UserError
from gait.ahead import ahead


def test_work_ahead_keeps_order_and_raises_at_its_place():
    def source():
        yield from range(5)
        raise UserError("broken")

    items = ahead(source(), 2)
    assert [next(items) for _ in range(5)] == list(range(5))
    with pytest.raises(UserError, match="broken"):
        next(items)


def test_work_ahead_stops_when_no_more_is_wanted():
    drawn = []

    def source():
        for i in range(1000):
            drawn.append(i)
            yield i

    items = ahead(source(), 3)
    assert next(items) == 0
    items.close()
    assert len(drawn) <= 6 and not any(t.name == "ahead" for t in threading.enumerate())
