using System;

namespace Nep
{
    /// <summary>Subscriber with a callback, created by <see cref="Node.Subscribe(string, Action{Message}, string, SubscriberOptions)"/>.</summary>
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

        /// <summary>Subscriber, with its counters.</summary>
        public Subscriber Subscriber { get; private set; }

        /// <summary>Close the subscription; queued messages are discarded.</summary>
        public void Dispose()
        {
            _node.Forget(this);
            Subscriber.Close();
        }

        /// <summary>Call the callback for one queued message; return false if there is none, or if a thread calls it.</summary>
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
            catch (Exception exception) // continues with the next message
            {
                _node.OnCallbackError(exception);
            }
        }
    }
}
