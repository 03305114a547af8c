using System.Collections.Generic;
using System.Threading;

namespace Nep.Session
{
    /// <summary>Messages that wait to be read. Drops the oldest when it is full. Thread-safe.</summary>
    internal sealed class Inbox
    {
        private readonly object _lock = new object();
        private readonly Queue<Message> _messages = new Queue<Message>();
        private readonly SubscriberOptions _options;
        private long _bytes;
        private bool _isClosed;

        public Inbox(SubscriberOptions options)
        {
            _options = options;
        }

        /// <summary>Add a message and return how many others were dropped for it. Replacing the latest is no drop.</summary>
        public int Put(Message message)
        {
            lock (_lock)
            {
                if (_isClosed)
                {
                    return 0;
                }
                if (_options.KeepLatest)
                {
                    _messages.Clear();
                    _bytes = 0;
                }
                _messages.Enqueue(message);
                _bytes += message.Size;
                int dropped = 0;
                // The newest stays even when it alone is larger than the bound.
                while (_messages.Count > 1 && (_messages.Count > _options.MaxMessages || _bytes > _options.MaxBytes))
                {
                    _bytes -= _messages.Dequeue().Size;
                    dropped++;
                }
                Monitor.PulseAll(_lock);
                return dropped;
            }
        }

        /// <summary>Next message, waited for; null after the timeout (-1: none) or when it was closed.</summary>
        public Message Take(int timeoutMs, CancellationToken cancellation)
        {
            var deadline = new Deadline(timeoutMs);
            lock (_lock)
            {
                while (_messages.Count == 0)
                {
                    if (_isClosed || deadline.IsOver || cancellation.IsCancellationRequested)
                    {
                        return null;
                    }
                    deadline.Wait(_lock);
                }
                Message message = _messages.Dequeue();
                _bytes -= message.Size;
                return message;
            }
        }

        /// <summary>Let those who wait look again.</summary>
        public void Wake()
        {
            lock (_lock)
            {
                Monitor.PulseAll(_lock);
            }
        }

        /// <summary>Forget what was not read.</summary>
        public void Close()
        {
            lock (_lock)
            {
                _isClosed = true;
                _messages.Clear();
                Monitor.PulseAll(_lock);
            }
        }
    }
}
