using System.Collections.Generic;
using Nep.Wire;

namespace Nep.Session
{
    /// <summary>Clock of a master, measured with renewals: docs/wire.md, "Clocks". Thread-safe.</summary>
    internal sealed class MasterClock
    {
        private static readonly long ResolutionNs = Clock.MeasureResolutionNs();
        private readonly ClockSamples _samples = new ClockSamples(() => (long)Clock.NowNs, () => Clock.SteadyNs, ResolutionNs);

        /// <summary>Return the current moment, for <see cref="Compare"/>.</summary>
        public Moment Now()
        {
            lock (_samples)
            {
                return _samples.Now();
            }
        }

        /// <summary>Return the field <c>clock</c> of a renewal: offset and uncertainty, or empty if unknown.</summary>
        public List<object> Field()
        {
            lock (_samples)
            {
                long offsetNs, uncertaintyNs;
                return _samples.TryGetOffset(out offsetNs, out uncertaintyNs) ? new List<object> { offsetNs, uncertaintyNs } : new List<object>();
            }
        }

        /// <summary>Add a sample from a renewal and its reply; return true if the offset was unknown before.</summary>
        /// <exception cref="WireException">The field <c>times</c> is not a list of integers.</exception>
        public bool Compare(Fields answer, Moment sent, Moment received)
        {
            List<long> times = answer.Integers("times");
            if (times.Count != 2)
            {
                return false; // the master has the same clock, or doesn't compare clocks
            }
            lock (_samples)
            {
                long ignored;
                bool wasKnown = _samples.TryGetOffset(out ignored, out ignored);
                return _samples.Add(sent, times[0], times[1], received) && !wasKnown;
            }
        }

        /// <summary>Discard all samples: another master may have another clock.</summary>
        public void Forget()
        {
            lock (_samples)
            {
                _samples.Forget();
            }
        }

        /// <summary>Return the clock differences to other nodes in the reply to a renewal; implausible ones are omitted.</summary>
        /// <exception cref="WireException">The field <c>clocks</c> is malformed.</exception>
        public static Dictionary<string, ClockDifference> DifferencesIn(Fields answer)
        {
            var differences = new Dictionary<string, ClockDifference>();
            foreach (KeyValuePair<string, List<long>> each in answer.IntegersByText("clocks"))
            {
                List<long> told = each.Value; // sums of the values of two clocks
                if (told.Count == 2 && ClockDifference.IsPossible(told[0] / 2, told[1] / 2))
                {
                    differences[each.Key] = new ClockDifference(told[0], told[1], Clock.SteadyNs);
                }
            }
            return differences;
        }
    }
}
