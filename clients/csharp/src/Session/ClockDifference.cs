using System;

namespace Nep.Session
{
    /// <summary>Offset from another computer's clock to this one's, with its uncertainty. Immutable.</summary>
    internal sealed class ClockDifference
    {
        /// <summary>Maximum valid offset: 146 years.</summary>
        public const long MaxOffsetNs = 1L << 62;

        /// <summary>Maximum uncertainty, 10 s; beyond it the offset counts as unknown.</summary>
        public const long MaxUncertaintyNs = 10000000000L;

        public static readonly ClockDifference Same = new ClockDifference(0, 0, null);

        private const long DriftParts = 20000; // 50 microseconds a second
        private readonly long _uncertaintyNs;
        private readonly long? _knownAtNs;

        /// <param name="addNs">Offset that converts times of the other clock to this one.</param>
        /// <param name="uncertaintyNs">Maximum error of the offset.</param>
        /// <param name="knownAtNs"><see cref="Clock.SteadyNs"/> at the time of the measurement; null if both are the same clock.</param>
        public ClockDifference(long addNs, long uncertaintyNs, long? knownAtNs)
        {
            AddNs = addNs;
            _uncertaintyNs = uncertaintyNs;
            _knownAtNs = knownAtNs;
        }

        public long AddNs { get; private set; }

        /// <summary>Current uncertainty, which grows because clocks drift.</summary>
        public long UncertaintyNs
        {
            get { return _uncertaintyNs + (_knownAtNs == null ? 0 : DriftNs(Clock.SteadyNs - _knownAtNs.Value)); }
        }

        /// <summary>Return the maximum drift between two clocks after a time.</summary>
        public static long DriftNs(long elapsedNs)
        {
            return Math.Max(0, elapsedNs) / DriftParts;
        }

        /// <summary>Return true if an offset and its uncertainty are within the valid range.</summary>
        public static bool IsPossible(long offsetNs, long uncertaintyNs)
        {
            return offsetNs >= -MaxOffsetNs && offsetNs <= MaxOffsetNs && uncertaintyNs >= 0 && uncertaintyNs <= MaxUncertaintyNs;
        }
    }

    /// <summary>Clock of one publisher, shared by its messages and updated while they are stored.</summary>
    internal sealed class PublisherClock
    {
        private volatile ClockDifference _difference;

        /// <summary>Difference to this computer's clock; null while unknown.</summary>
        public ClockDifference Difference
        {
            get { return _difference; }
            set { _difference = value; }
        }
    }
}
