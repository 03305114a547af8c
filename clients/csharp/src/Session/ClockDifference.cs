using System;

namespace Nep.Session
{
    /// <summary>How another computer's clock differs from this one's. Immutable.</summary>
    internal sealed class ClockDifference
    {
        /// <summary>No clock is wrong by more: 146 years.</summary>
        public const long MaxOffsetNs = 1L << 62;

        /// <summary>What is known less surely than to 10 s counts as unknown.</summary>
        public const long MaxUncertaintyNs = 10000000000L;

        public static readonly ClockDifference Same = new ClockDifference(0, 0, null);

        private const long DriftParts = 20000; // 50 microseconds a second
        private readonly long _uncertaintyNs;
        private readonly long? _knownAtNs;

        /// <param name="addNs">Added to a time of the other clock, it gives a time of this one.</param>
        /// <param name="uncertaintyNs">How far that may be wrong to either side.</param>
        /// <param name="knownAtNs"><see cref="Clock.SteadyNs"/> when it was known; null: both are the same clock.</param>
        public ClockDifference(long addNs, long uncertaintyNs, long? knownAtNs)
        {
            AddNs = addNs;
            _uncertaintyNs = uncertaintyNs;
            _knownAtNs = knownAtNs;
        }

        public long AddNs { get; private set; }

        /// <summary>Uncertainty now; it grows because clocks drift.</summary>
        public long UncertaintyNs
        {
            get { return _uncertaintyNs + (_knownAtNs == null ? 0 : DriftNs(Clock.SteadyNs - _knownAtNs.Value)); }
        }

        /// <summary>How far two clocks may have drifted apart.</summary>
        public static long DriftNs(long elapsedNs)
        {
            return Math.Max(0, elapsedNs) / DriftParts;
        }

        /// <summary>Whether a clock can differ so much, and be known so surely.</summary>
        public static bool IsPossible(long offsetNs, long uncertaintyNs)
        {
            return offsetNs >= -MaxOffsetNs && offsetNs <= MaxOffsetNs && uncertaintyNs >= 0 && uncertaintyNs <= MaxUncertaintyNs;
        }
    }

    /// <summary>Clock of one publisher, as its messages ask for it; it is compared again while they are kept.</summary>
    internal sealed class PublisherClock
    {
        private volatile ClockDifference _difference;

        /// <summary>Null when nobody has compared it with this computer's.</summary>
        public ClockDifference Difference
        {
            get { return _difference; }
            set { _difference = value; }
        }
    }
}
