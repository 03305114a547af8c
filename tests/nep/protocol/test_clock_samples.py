"""Tests of clock comparison, with clocks that the test moves and with every reply that a master may send."""

from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from nep.messages.clocks import MAX_OFFSET_NS, SAME_CLOCK, ClockDifference, PublisherClock, drift_ns
from nep.protocol.clock_samples import ClockSamples, Moment

MS = 1_000_000
S = 1_000_000_000
BEGIN_NS = 1_700_000_000 * S


class Pair:
    """Two computers; `samples` belong to the one whose clock is `apart_ns` ahead of the master's."""

    def __init__(self, apart_ns: int) -> None:
        self.apart_ns = apart_ns
        self.steady_ns = 5 * S
        self.samples = ClockSamples(lambda: self.wall_ns, lambda: self.steady_ns, 1e-9)

    @property
    def wall_ns(self) -> int:
        return self.master_ns + self.apart_ns

    @property
    def master_ns(self) -> int:
        return BEGIN_NS + self.steady_ns

    def renew(self, there_ns: int, back_ns: int, *, worked_ns: int = 0) -> bool:
        """Renew at the master with the given delays of the request, the master's work and the reply."""
        sent = self.samples.now()
        self.steady_ns += there_ns
        received_ns = self.master_ns
        self.steady_ns += worked_ns
        answered_ns = self.master_ns
        self.steady_ns += back_ns
        return self.samples.add(sent, received_ns, answered_ns)

    def check(self) -> int:
        """Check that the true offset lies within the uncertainty, and return the uncertainty in ns."""
        known = self.samples.offset()
        assert known is not None
        offset_ns, uncertainty_ns = known
        assert abs(offset_ns + self.apart_ns) <= uncertainty_ns
        return uncertainty_ns


@settings(deadline=None)
@given(
    st.integers(-(2**60), 2**60),
    st.lists(st.tuples(*[st.integers(0, 200 * MS)] * 4), min_size=1, max_size=12),
)
def test_clock_offset_error_is_within_the_uncertainty(
    apart_ns: int, ways: list[tuple[int, int, int, int]]
) -> None:
    pair = Pair(apart_ns)
    halves: list[int] = []
    for there_ns, worked_ns, back_ns, pause_ns in ways:
        assert pair.renew(there_ns, back_ns, worked_ns=worked_ns)
        halves.append((there_ns + back_ns) // 2)
        assert pair.check() >= min(halves[-8:]), "no more is claimed than the ways allow"
        pair.steady_ns += pause_ns
    assert pair.samples.steps == 0


def test_sample_with_the_shortest_round_trip_is_used() -> None:
    pair = Pair(3 * S)
    assert pair.renew(40 * MS, 2 * MS)
    assert pair.check() == pytest.approx(21 * MS, abs=1000)
    assert pair.renew(1 * MS, 1 * MS)
    assert pair.check() == pytest.approx(1 * MS, abs=1000)
    assert pair.renew(90 * MS, 5 * MS)
    assert pair.check() == pytest.approx(1 * MS + drift_ns(95 * MS), abs=1000)


def test_clock_offset_uses_only_the_latest_renewals() -> None:
    pair = Pair(0)
    assert pair.renew(0, 0)
    for _ in range(8):
        assert pair.renew(100 * MS, 0)
    assert pair.check() >= 50 * MS


def test_clock_uncertainty_grows_over_time() -> None:
    pair = Pair(S)
    pair.renew(MS, MS)
    before = pair.check()
    pair.steady_ns += 100 * S
    assert pair.check() - before == 5 * MS
    pair.steady_ns += 10**6 * S
    assert pair.samples.offset() is None, "beyond ten seconds it is not known"


@pytest.mark.parametrize("step_ns", [MS, -MS, 3600 * S, -3600 * S])
def test_step_of_the_local_clock_resets_the_samples(step_ns: int) -> None:
    pair = Pair(0)
    pair.renew(2 * MS, 0)
    pair.apart_ns += step_ns
    assert pair.samples.offset() is None
    assert pair.samples.steps == 1
    pair.renew(2 * MS, 0)
    pair.check()


@pytest.mark.parametrize("step_ns", [60 * MS, -60 * MS, 3600 * S, -3600 * S])
def test_step_of_the_master_clock_resets_the_samples(step_ns: int) -> None:
    pair = Pair(0)
    pair.renew(MS, MS)
    sent = pair.samples.now()
    assert pair.samples.add(sent, pair.master_ns + step_ns, pair.master_ns + step_ns)
    assert pair.samples.steps == 1
    known = pair.samples.offset()
    assert known is not None
    assert known[0] == pytest.approx(step_ns, abs=1000)


def test_clock_step_during_a_request_discards_its_sample() -> None:
    pair = Pair(0)
    sent = pair.samples.now()
    pair.apart_ns += S
    assert not pair.samples.add(sent, BEGIN_NS, BEGIN_NS)
    assert pair.samples.offset() is None


def test_slewed_clock_is_not_a_step() -> None:
    pair = Pair(0)
    pair.renew(MS, MS)
    for _ in range(100):
        pair.steady_ns += S
        pair.apart_ns += 40_000
        pair.renew(MS, MS)
        pair.check()
    assert pair.samples.steps == 0


@pytest.mark.parametrize(
    ("received_ns", "answered_ns"),
    [
        (BEGIN_NS + S, BEGIN_NS),
        (0, BEGIN_NS),
        (-(2**70), -(2**70)),
        (2**64 - 1, 2**64 - 1),
        (2**63, 2**63),
        (BEGIN_NS, BEGIN_NS + 3600 * S),
    ],
)
def test_implausible_clock_samples_are_discarded(received_ns: int, answered_ns: int) -> None:
    pair = Pair(0)
    sent = pair.samples.now()
    pair.steady_ns += MS
    assert not pair.samples.add(sent, received_ns, answered_ns)
    assert pair.samples.offset() is None


def test_clock_sample_with_a_round_trip_of_a_minute_is_discarded() -> None:
    pair = Pair(0)
    assert not pair.renew(60 * S, 0)


def test_coarse_clock_resolution_increases_the_uncertainty() -> None:
    moment = Moment(BEGIN_NS, S, 1)
    samples = ClockSamples(lambda: BEGIN_NS, lambda: S, 0.0156)
    assert samples.add(moment, BEGIN_NS, BEGIN_NS)
    known = samples.offset(moment)
    assert known is not None
    assert known[1] >= 15_600_000


def test_cleared_clock_samples_have_no_offset_and_no_steps() -> None:
    pair = Pair(0)
    pair.renew(0, 0)
    pair.samples.clear()
    assert pair.samples.offset() is None
    assert pair.samples.steps == 0


def test_clock_uncertainty_grows_only_between_different_clocks() -> None:
    difference = ClockDifference(5, 1000, measured_at_ns=0)
    assert difference.uncertainty_at(20_000) == 1001
    assert difference.uncertainty_at(-(10**12)) == 1000
    assert SAME_CLOCK.uncertainty_at(10**18) == 0
    assert PublisherClock().difference_s() is None
    assert PublisherClock(SAME_CLOCK).difference_s() == (0.0, 0.0)
    assert MAX_OFFSET_NS > 10 * 365 * 86_400 * S
