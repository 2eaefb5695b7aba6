"""The person's yes to a plan, typed on a pipe."""

import io
import os
from unittest.mock import Mock

import pytest

from rebound_cli.live.console import Console
from rebound_cli.live.realtime import AskPerson


def planned():
    """A companion with a plan that is ready."""
    return Mock(plan_is_ready=Mock(return_value=True), plan_text=lambda: "the plan")


@pytest.fixture
def typed():
    reads, writes = os.pipe()
    yield reads, lambda text: os.write(writes, text)
    for descriptor in (reads, writes):
        os.close(descriptor)


def test_a_plan_that_is_made_anew_is_asked_for_anew_whatever_was_typed_meanwhile(typed):
    reads, types = typed
    companion = planned()
    shown = io.StringIO()
    console = Console(shown)
    person = AskPerson(console, reads)
    # Given a question
    person.poll(companion)
    assert shown.getvalue().count("Fly this plan?") == 1 and console.live_is_held
    # When the vehicle is away, and yes is typed
    companion.plan_is_ready.return_value = False
    types(b"y\n")
    person.poll(companion)
    assert not console.live_is_held
    # Then the next plan is asked for, and that yes says nothing of it
    companion.plan_is_ready.return_value = True
    for _ in range(3):
        person.poll(companion)
    assert shown.getvalue().count("the plan") == 2 and not companion.confirm_plan.called
    # And a yes to that one does
    types(b"yes\n")
    person.poll(companion)
    assert companion.confirm_plan.called and not companion.stop.called


# The last one is the end of input.
@pytest.mark.parametrize("line", [b"n\n", b"\n", b"yessir\n", None])
def test_all_but_a_yes_is_a_no(line):
    reads, writes = os.pipe()
    companion = planned()
    person = AskPerson(Console(io.StringIO()), reads)
    if line is not None:
        os.write(writes, line)
    os.close(writes)
    for _ in range(2):
        person.poll(companion)
    os.close(reads)
    companion.stop.assert_called_once_with("the plan was not confirmed")
    assert not companion.confirm_plan.called
