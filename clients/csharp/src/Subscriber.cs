using System;
using System.Threading;
using System.Threading.Tasks;
using Nep.Session;

namespace Nep
{
    /// <summary>Subscriber of one topic, created by <see cref="Node.CreateSubscriber(string, string, SubscriberOptions)"/>. Thread-safe.</summary>
    /// <example>
    /// <code>
    /// using (var node = new Node("receiver"))
    /// using (Subscriber subscriber = node.CreateSubscriber("example"))
    /// {
    ///     Message message;
    ///     while (subscriber.TryReceive(TimeSpan.FromSeconds(10), out message))
    ///     {
    ///         Console.WriteLine(message.Text);
    ///     }
    /// }
    /// </code>
    /// </example>
    public sealed partial class Subscriber : IDisposable
    {
        private readonly Node _node;
        private readonly ISubscriberSocket _socket;

        internal Subscriber(Node node, ISubscriberSocket socket)
        {
            _node = node;
            _socket = socket;
        }

        /// <summary>Name of the topic, or the pattern.</summary>
        public string Topic
        {
            get { return _socket.Record.Topic; }
        }

        /// <summary>Number of received messages that were not dropped.</summary>
        public long Received
        {
            get { return _socket.Received; }
        }

        /// <summary>Number of messages that were sent and not received, or dropped because the inbox was full.</summary>
        public long Lost
        {
            get { return _socket.Lost; }
        }

        /// <summary>Number of malformed messages that were rejected.</summary>
        public long Rejected
        {
            get { return _socket.Rejected; }
        }

        internal ISubscriberSocket Socket
        {
            get { return _socket; }
        }

        /// <summary>Wait for the next message.</summary>
        /// <returns>The message, or null if the subscriber was closed.</returns>
        public Message Receive()
        {
            return _socket.Inbox.Take(-1);
        }

        /// <summary>Wait for the next message with a timeout.</summary>
        /// <param name="timeout">Maximum time to wait; <see cref="TimeSpan.Zero"/> doesn't wait, <see cref="Timeout.InfiniteTimeSpan"/> waits without a limit.</param>
        /// <param name="message">The message, or null.</param>
        /// <returns>True if a message was received.</returns>
        public bool TryReceive(TimeSpan timeout, out Message message)
        {
            message = _socket.Inbox.Take(Node.TimeoutMs(timeout));
            return message != null;
        }

        /// <summary>Wait for the next message without blocking the caller.</summary>
        /// <param name="cancellation">Ends the wait.</param>
        /// <returns>The message, or null if the subscriber was closed.</returns>
        /// <exception cref="OperationCanceledException">The wait was canceled.</exception>
        public Task<Message> ReceiveAsync(CancellationToken cancellation = default(CancellationToken))
        {
            return _socket.Inbox.TakeAsync(cancellation);
        }

        /// <summary>Close the subscriber; a waiting <see cref="Receive"/> returns null.</summary>
        public void Close()
        {
            _node.Close(_socket);
        }

        /// <summary>Same as <see cref="Close"/>.</summary>
        public void Dispose()
        {
            Close();
        }
    }
}
