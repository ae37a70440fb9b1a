"""Work beside the moves: done in its order, whoever does it, and its failures are the plan's."""

from __future__ import annotations

from functools import partial

import pytest

from planners.meanwhile import Meanwhile


def test_the_plan_does_what_nobody_did_while_the_finger_moved_in_the_order_in_which_it_came():
    meanwhile, done = Meanwhile(), list[int]()
    for number in range(4):
        meanwhile.later(partial(done.append, number))
    assert meanwhile.waiting and not done
    meanwhile.work()
    meanwhile.work()
    assert done == [0, 1]
    meanwhile.finish()
    assert done == [0, 1, 2, 3] and not meanwhile.waiting


def test_what_goes_wrong_beside_a_move_is_told_where_the_plan_needs_it_and_nothing_is_done_after_it():
    meanwhile, done = Meanwhile(), list[int]()
    meanwhile.later(lambda: done.append(1 // len(done)))
    meanwhile.later(partial(done.append, 2))
    meanwhile.work()
    assert not meanwhile.waiting
    meanwhile.work()
    with pytest.raises(ZeroDivisionError):
        meanwhile.finish()
    assert not done
    meanwhile.finish()  # it is told once
