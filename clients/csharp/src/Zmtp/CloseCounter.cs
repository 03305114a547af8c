using System.Collections.Generic;

namespace Nep.Zmtp
{
    /// <summary>Counter of connections closed because of protocol errors or limits, by reason. Thread-safe.</summary>
    internal sealed class CloseCounter
    {
        private readonly Dictionary<string, long> _byReason = new Dictionary<string, long>();

        public long Total { get; private set; }

        public void Add(string reason)
        {
            lock (_byReason)
            {
                long count;
                _byReason.TryGetValue(reason, out count);
                _byReason[reason] = count + 1;
                Total++;
            }
        }

        public long Of(string reason)
        {
            lock (_byReason)
            {
                long count;
                _byReason.TryGetValue(reason, out count);
                return count;
            }
        }

        public Dictionary<string, long> Snapshot()
        {
            lock (_byReason)
            {
                return new Dictionary<string, long>(_byReason);
            }
        }
    }
}
