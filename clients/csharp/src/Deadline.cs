using System;
using System.Diagnostics;
using System.Threading;

namespace Nep
{
    /// <summary>End of a wait that began when this was created.</summary>
    internal struct Deadline
    {
        private readonly Stopwatch _watch;
        private readonly int _timeoutMs;

        /// <param name="timeoutMs">Milliseconds from now; negative: never.</param>
        public Deadline(int timeoutMs)
        {
            _watch = Stopwatch.StartNew();
            _timeoutMs = timeoutMs;
        }

        /// <summary>Milliseconds until the end, 0 when it is over, <see cref="Timeout.Infinite"/> when there is none.</summary>
        public int LeftMs
        {
            get { return _timeoutMs < 0 ? Timeout.Infinite : (int)Math.Max(0, _timeoutMs - _watch.ElapsedMilliseconds); }
        }

        public bool IsOver
        {
            get { return LeftMs == 0; }
        }

        /// <summary>Release a lock that the caller holds and wait until it is pulsed or the time is over.</summary>
        public void Wait(object heldLock)
        {
            int leftMs = LeftMs;
            if (leftMs != 0)
            {
                Monitor.Wait(heldLock, leftMs);
            }
        }
    }
}
