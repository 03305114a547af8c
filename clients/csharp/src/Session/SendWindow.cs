using System.Collections.Generic;

namespace Nep.Session
{
    /// <summary>Bytes sent to one subscriber and not yet acknowledged. Not thread-safe; guarded by the publisher's lock.</summary>
    internal sealed class SendWindow
    {
        public const long MaxBytes = 192L << 20;
        public const long MinBytes = 24L << 20;
        public const long StepBytes = 12L << 20;
        private const long EntryBytes = 1L << 20;
        private const double AskAgainS = 0.5;

        private readonly LinkedList<KeyValuePair<ulong, long>> _sent = new LinkedList<KeyValuePair<ulong, long>>();
        private long _bound = MaxBytes;
        private long _unasked;
        private double _askedAtS = double.NegativeInfinity;
        private bool _hasMissed;

        public long UnderWay { get; private set; }

        /// <summary>Return true if a message of this size may be sent; one larger than the window waits until a step is free.</summary>
        public bool HasRoom(long size)
        {
            return UnderWay <= StepBytes || UnderWay + size <= _bound;
        }

        public void Sent(ulong seq, long size)
        {
            LinkedListNode<KeyValuePair<ulong, long>> last = _sent.Last;
            if (last != null && last.Value.Value + size <= EntryBytes)
            {
                last.Value = new KeyValuePair<ulong, long>(seq, last.Value.Value + size); // small messages share an entry
            }
            else
            {
                _sent.AddLast(new KeyValuePair<ulong, long>(seq, size));
            }
            UnderWay += size;
            _unasked += size;
        }

        public void Missed()
        {
            _hasMissed = true;
        }

        /// <summary>Return true once when there is room again after a drop; the caller then notifies the subscriber.</summary>
        public bool IsToTell()
        {
            if (!_hasMissed || UnderWay > StepBytes)
            {
                return false;
            }
            _hasMissed = false;
            return true;
        }

        /// <summary>Handle an acknowledgement of all messages up to a seq, with the window that the subscriber requests.</summary>
        public void Read(ulong seq, ulong boundBytes)
        {
            _bound = boundBytes > (ulong)MaxBytes ? MaxBytes : boundBytes < (ulong)MinBytes ? MinBytes : (long)boundBytes;
            while (_sent.First != null && _sent.First.Value.Key <= seq)
            {
                UnderWay -= _sent.First.Value.Value;
                _sent.RemoveFirst();
            }
        }

        /// <summary>Return true if an acknowledgement should be requested now; the request is then counted as sent.</summary>
        public bool IsToAsk(double nowS, bool hasRoom)
        {
            if (_unasked < StepBytes && (hasRoom || nowS < _askedAtS + AskAgainS))
            {
                return false;
            }
            _unasked = 0;
            _askedAtS = nowS;
            return true;
        }
    }
}
