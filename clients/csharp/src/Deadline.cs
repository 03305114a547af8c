using System;
using System.Diagnostics;
using System.Threading;

namespace Nep
{
    /// <summary>Deadline of a wait that starts when the instance is created.</summary>
    internal struct Deadline
    {
        private readonly Stopwatch _watch;
        private readonly int _timeoutMs;

        /// <param name="timeoutMs">Milliseconds from now; negative for no deadline.</param>
        public Deadline(int timeoutMs)
        {
            _watch = Stopwatch.StartNew();
            _timeoutMs = timeoutMs;
        }

        /// <summary>Remaining milliseconds, 0 after the deadline, <see cref="Timeout.Infinite"/> without one.</summary>
        public int LeftMs
        {
            get { return _timeoutMs < 0 ? Timeout.Infinite : (int)Math.Max(0, _timeoutMs - _watch.ElapsedMilliseconds); }
        }

        public bool IsOver
        {
            get { return LeftMs == 0; }
        }

        /// <summary>Release a lock held by the caller and wait until it is pulsed or the deadline has passed.</summary>
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
