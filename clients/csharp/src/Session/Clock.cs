using System;
using System.Diagnostics;

namespace Nep.Session
{
    /// <summary>This computer's time in nanoseconds since 1970, and seconds that only go forward.</summary>
    internal static class Clock
    {
        private static readonly long EpochTicks = new DateTime(1970, 1, 1, 0, 0, 0, DateTimeKind.Utc).Ticks;
        private static readonly Stopwatch Steady = Stopwatch.StartNew();

        public static double SteadyS
        {
            get { return Steady.Elapsed.TotalSeconds; }
        }

        public static ulong NowNs
        {
            get { return (ulong)(DateTime.UtcNow.Ticks - EpochTicks) * 100; }
        }

        public static DateTime ToDateTime(ulong ns)
        {
            long ticks = (long)Math.Min(ns / 100, (ulong)(DateTime.MaxValue.Ticks - EpochTicks));
            return new DateTime(EpochTicks + ticks, DateTimeKind.Utc);
        }
    }
}
