using System.Collections.Generic;
using System.Threading;
using System.Threading.Tasks;

namespace Nep.Session
{
    /// <summary>Queue of unread messages, which drops the oldest when it is full. Thread-safe.</summary>
    internal sealed class Inbox
    {
        private readonly object _lock = new object();
        private readonly Queue<Message> _messages = new Queue<Message>();
        private readonly Queue<TaskCompletionSource<Message>> _awaiting = new Queue<TaskCompletionSource<Message>>();
        private readonly SubscriberOptions _options;
        private long _bytes;
        private bool _isClosed;

        public Inbox(SubscriberOptions options)
        {
            _options = options;
        }

        /// <summary>Add a message; return the number of messages dropped for it, without those replaced by <c>KeepLatest</c>.</summary>
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
                if (HandOver(message))
                {
                    return 0;
                }
                _messages.Enqueue(message);
                _bytes += message.Size;
                int dropped = 0;
                // The newest message is kept even if it exceeds the limit.
                while (_messages.Count > 1 && (_messages.Count > _options.MaxMessages || _bytes > _options.MaxBytes))
                {
                    _bytes -= _messages.Dequeue().Size;
                    dropped++;
                }
                Monitor.PulseAll(_lock);
                return dropped;
            }
        }

        /// <summary>Wait for the next message; null after the timeout (-1 for none), or if the inbox is closed.</summary>
        public Message Take(int timeoutMs)
        {
            var deadline = new Deadline(timeoutMs);
            lock (_lock)
            {
                while (_messages.Count == 0)
                {
                    if (_isClosed || deadline.IsOver)
                    {
                        return null;
                    }
                    deadline.Wait(_lock);
                }
                return TakeFirst();
            }
        }

        /// <summary>Wait for the next message without blocking a thread; null if the inbox is closed.</summary>
        /// <exception cref="OperationCanceledException">The wait was canceled.</exception>
        public async Task<Message> TakeAsync(CancellationToken cancellation)
        {
            cancellation.ThrowIfCancellationRequested();
            var awaiting = new TaskCompletionSource<Message>(TaskCreationOptions.RunContinuationsAsynchronously);
            lock (_lock)
            {
                if (_isClosed || _messages.Count > 0)
                {
                    return _isClosed ? null : TakeFirst();
                }
                while (_awaiting.Count > 0 && _awaiting.Peek().Task.IsCompleted)
                {
                    _awaiting.Dequeue(); // canceled
                }
                _awaiting.Enqueue(awaiting);
            }
            using (cancellation.Register(() => awaiting.TrySetCanceled(cancellation)))
            {
                return await awaiting.Task.ConfigureAwait(false);
            }
        }

        private Message TakeFirst()
        {
            Message message = _messages.Dequeue();
            _bytes -= message.Size;
            return message;
        }

        /// <summary>Pass a message to the first waiting task; return false if there is none.</summary>
        private bool HandOver(Message message)
        {
            while (_awaiting.Count > 0)
            {
                if (_awaiting.Dequeue().TrySetResult(message))
                {
                    return true;
                }
            }
            return false; // all waits were canceled
        }

        /// <summary>Close the inbox and discard unread messages.</summary>
        public void Close()
        {
            lock (_lock)
            {
                _isClosed = true;
                _messages.Clear();
                while (_awaiting.Count > 0)
                {
                    _awaiting.Dequeue().TrySetResult(null);
                }
                Monitor.PulseAll(_lock);
            }
        }
    }
}
