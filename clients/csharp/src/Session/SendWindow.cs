using System.Collections.Generic;

namespace Nep.Session
{
    /// <summary>Bytes that were sent to one subscriber and are not known to be read. It lives under its publisher's lock.</summary>
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

        /// <summary>Whether a message of this size may follow; one larger than the window waits for a step.</summary>
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

        /// <summary>Whether it has room again and does not know yet what it missed; true counts as telling.</summary>
        public bool IsToTell()
        {
            if (!_hasMissed || UnderWay > StepBytes)
            {
                return false;
            }
            _hasMissed = false;
            return true;
        }

        /// <summary>The subscriber has read everything up to a message and wants so much under way at most.</summary>
        public void Read(ulong seq, ulong boundBytes)
        {
            _bound = boundBytes > (ulong)MaxBytes ? MaxBytes : boundBytes < (ulong)MinBytes ? MinBytes : (long)boundBytes;
            while (_sent.First != null && _sent.First.Value.Key <= seq)
            {
                UnderWay -= _sent.First.Value.Value;
                _sent.RemoveFirst();
            }
        }

        /// <summary>Whether to ask it now what it has read; true counts as asking.</summary>
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
