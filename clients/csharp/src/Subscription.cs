using System;

namespace Nep
{
    /// <summary>A subscriber whose messages go to a callback. Created by <see cref="Node.Subscribe(string, Action{Message}, string, SubscriberOptions)"/>.</summary>
    public sealed class Subscription : IDisposable
    {
        private readonly Node _node;
        private readonly Action<Message> _callback;
        private readonly bool _hasThread;

        internal Subscription(Node node, Subscriber subscriber, Action<Message> callback, CallbackMode mode)
        {
            _node = node;
            _callback = callback;
            Subscriber = subscriber;
            _hasThread = mode == CallbackMode.Thread;
            if (_hasThread)
            {
                BackgroundThread.Start("callback " + subscriber.Topic, Run, 0);
            }
        }

        /// <summary>The subscriber behind it, with its counters.</summary>
        public Subscriber Subscriber { get; private set; }

        /// <summary>Close; the callback is not called for messages that still wait.</summary>
        public void Dispose()
        {
            _node.Forget(this);
            Subscriber.Close();
        }

        /// <summary>Call the callback for one waiting message; false when there is none, or a thread does it.</summary>
        internal bool RunOne()
        {
            Message message = _hasThread ? null : Subscriber.Socket.Inbox.Take(0);
            if (message == null)
            {
                return false;
            }
            Call(message);
            return true;
        }

        private void Run()
        {
            for (Message message = Subscriber.Receive(); message != null; message = Subscriber.Receive())
            {
                Call(message);
            }
        }

        private void Call(Message message)
        {
            try
            {
                _callback(message);
            }
            catch (Exception exception) // the next message comes all the same
            {
                _node.OnCallbackError(exception);
            }
        }
    }
}
