using System;
using System.Collections.Generic;
using System.ComponentModel;
using System.Globalization;
using System.IO;
using System.Threading;
using Nep.Session;

namespace Nep
{
    /// <summary>Node with the names of the original library 0.0.0.5. New programs use <see cref="Node"/>.</summary>
    [EditorBrowsable(EditorBrowsableState.Never)]
    public sealed class NepNode : IDisposable
    {
        private readonly Node _node;
        private readonly List<NepCallback> _callbacks = new List<NepCallback>();
        private readonly List<IDisposable> _direct = new List<IDisposable>();

        /// <summary>Create a node.</summary>
        /// <param name="name">Name in the graph.</param>
        public NepNode(string name)
        {
            _node = new Node(name);
        }

        /// <summary>Configuration for a master on another computer.</summary>
        /// <param name="masterIp">Address of the master, <c>HOST</c> or <c>HOST:PORT</c>.</param>
        public NepConfiguration Hybrid(string masterIp = null)
        {
            return new NepConfiguration(masterIp);
        }

        /// <summary>Same as <see cref="Hybrid"/>.</summary>
        /// <param name="masterIp">Address of the master, <c>HOST</c> or <c>HOST:PORT</c>.</param>
        public NepConfiguration Master(string masterIp = null)
        {
            return new NepConfiguration(masterIp);
        }

        /// <summary>Configuration for a connection without a master: the publisher binds, subscribers connect.</summary>
        /// <param name="ip">Address of the publisher.</param>
        /// <param name="port">Port of the publisher.</param>
        /// <param name="mode"><c>one2many</c>, the only supported mode.</param>
        /// <exception cref="NotSupportedException">The mode is not supported.</exception>
        public NepConfiguration Direct(string ip = "127.0.0.1", string port = "9000", string mode = "one2many")
        {
            if (mode != "one2many")
            {
                throw new NotSupportedException("The C# client supports direct connections only in the mode 'one2many', not '" + mode + "'.");
            }
            return new NepConfiguration(ip, int.Parse(port, CultureInfo.InvariantCulture));
        }

        /// <summary>Same as <see cref="Direct(string, string, string)"/>.</summary>
        public NepConfiguration Direct(string ip, int port, string mode = "one2many")
        {
            return Direct(ip, port.ToString(CultureInfo.InvariantCulture), mode);
        }

        /// <summary>Same as <see cref="Direct(string, string, string)"/>.</summary>
        public NepConfiguration Manual(string ip = "127.0.0.1", string port = "9000", string mode = "one2many")
        {
            return Direct(ip, port, mode);
        }

        /// <summary>Same as <see cref="Direct(string, string, string)"/>.</summary>
        public NepConfiguration Manual(string ip, int port, string mode = "one2many")
        {
            return Direct(ip, port, mode);
        }

        /// <summary>Create a publisher.</summary>
        public NepPublisher NewPub(string topic, string msgType, NepConfiguration configuration = null)
        {
            if (configuration != null && configuration.Port > 0)
            {
                return Keep(new NepPublisher(new DirectPublisher(topic, configuration.Host, configuration.Port), msgType));
            }
            var options = new PublisherOptions { Master = NepConfiguration.MasterOf(configuration) };
            return new NepPublisher(_node.CreatePublisher(topic, msgType, options));
        }

        /// <summary>Create a subscriber.</summary>
        public NepSubscriber NewSub(string topic, string msgType, NepConfiguration configuration = null)
        {
            if (configuration != null && configuration.Port > 0)
            {
                var direct = new DirectSubscriber(topic, configuration.Host, configuration.Port);
                return Keep(new NepSubscriber(direct.Inbox, direct.Close));
            }
            var options = new SubscriberOptions { Master = NepConfiguration.MasterOf(configuration) };
            Subscriber subscriber = _node.CreateSubscriber(topic, msgType, options);
            return new NepSubscriber(subscriber.Socket.Inbox, subscriber.Close);
        }

        /// <summary>Subscribe; <see cref="Update"/> calls the function with the text of each message.</summary>
        public NepCallback NewCallback(string topic, Action<string> callback, string masterIp = null)
        {
            var made = new NepCallback(_node, topic, callback, masterIp);
            made.Start();
            lock (_callbacks)
            {
                _callbacks.Add(made);
            }
            return made;
        }

        /// <summary>Run the callbacks of all queued messages. Call it once per frame.</summary>
        public void Update()
        {
            List<NepCallback> all;
            lock (_callbacks)
            {
                all = new List<NepCallback>(_callbacks);
            }
            all.ForEach(each => each.UpdateMessage());
        }

        /// <summary>Close the node with all its publishers, subscribers and callbacks.</summary>
        public void Close()
        {
            List<IDisposable> direct;
            lock (_direct)
            {
                direct = new List<IDisposable>(_direct);
                _direct.Clear();
            }
            direct.ForEach(each => each.Dispose());
            _node.Close();
        }

        /// <summary>Same as <see cref="Close"/>.</summary>
        public void Dispose()
        {
            Close();
        }

        private T Keep<T>(T made) where T : IDisposable
        {
            lock (_direct)
            {
                _direct.Add(made);
            }
            return made;
        }
    }

    /// <summary>Master of a publisher or subscriber, or the endpoint of a direct connection.</summary>
    [EditorBrowsable(EditorBrowsableState.Never)]
    public sealed class NepConfiguration
    {
        private readonly string _master;

        internal NepConfiguration(string master)
        {
            _master = master;
        }

        internal NepConfiguration(string host, int port)
        {
            Host = host;
            Port = port;
        }

        internal string Host { get; private set; }

        /// <summary>Port of a direct connection; 0 for a connection through a master.</summary>
        internal int Port { get; private set; }

        internal static string MasterOf(NepConfiguration configuration)
        {
            return configuration == null ? null : configuration._master;
        }
    }

    /// <summary>Publisher of a <see cref="NepNode"/>.</summary>
    [EditorBrowsable(EditorBrowsableState.Never)]
    public sealed class NepPublisher : IDisposable
    {
        private const int LingerMs = 2000;

        private readonly Publisher _publisher;
        private readonly DirectPublisher _direct;
        private readonly string _type;

        internal NepPublisher(Publisher publisher)
        {
            _publisher = publisher;
            _type = publisher.Type;
        }

        internal NepPublisher(DirectPublisher direct, string type)
        {
            _direct = direct;
            _type = type;
        }

        /// <summary>Publish an object.</summary>
        public void Publish(object message)
        {
            if (_direct == null)
            {
                _publisher.Publish(message);
            }
            else if (_type == "string")
            {
                _direct.Send((string)message);
            }
            else
            {
                _direct.Send(Json.Serializer.Serialize(message));
            }
        }

        /// <summary>Publish text, or JSON text on a topic of type <c>json</c>.</summary>
        public void SendString(string message)
        {
            if (_direct != null)
            {
                _direct.Send(message);
            }
            else if (_type == "string")
            {
                _publisher.Publish(message);
            }
            else
            {
                _publisher.PublishJson(message);
            }
        }

        /// <summary>Publish a JPEG or PNG file on a topic of type <c>image</c>.</summary>
        public void SendImage(MemoryStream image)
        {
            SendImageBytes(image.ToArray());
        }

        /// <summary>Publish a JPEG or PNG file on a topic of type <c>image</c>.</summary>
        public void SendImageBytes(byte[] image)
        {
            if (_direct == null)
            {
                _publisher.PublishImage(image);
            }
            else
            {
                _direct.Send(Convert.ToBase64String(image));
            }
        }

        /// <summary>Close.</summary>
        public void Dispose()
        {
            if (_direct == null)
            {
                _publisher.Close();
            }
            else
            {
                _direct.Close(LingerMs);
            }
        }
    }

    /// <summary>Subscriber of a <see cref="NepNode"/>.</summary>
    [EditorBrowsable(EditorBrowsableState.Never)]
    public sealed class NepSubscriber : IDisposable
    {
        private readonly Inbox _inbox;
        private readonly Action _close;

        internal NepSubscriber(Inbox inbox, Action close)
        {
            _inbox = inbox;
            _close = close;
        }

        /// <summary>Take the next message without waiting; false if there is none, with an empty string.</summary>
        public bool Listen(out string message)
        {
            Message received = _inbox.Take(0);
            message = received == null ? "" : received.Text;
            return received != null;
        }

        /// <summary>Wait for the next message and return its JSON or text.</summary>
        public string BlockingListen()
        {
            Message received = _inbox.Take(-1);
            return received == null ? "" : received.Text;
        }

        /// <summary>Close the subscriber; a waiting <see cref="BlockingListen"/> returns an empty string.</summary>
        public void Dispose()
        {
            _close();
        }
    }

    /// <summary>Callback of a <see cref="NepNode"/>, called with every message in the thread that calls <see cref="UpdateMessage"/>.</summary>
    [EditorBrowsable(EditorBrowsableState.Never)]
    public sealed class NepCallback : IDisposable
    {
        private readonly Node _node;
        private readonly string _topic;
        private readonly Action<string> _callback;
        private readonly SubscriberOptions _options;
        private Subscription _subscription;

        internal NepCallback(Node node, string topic, Action<string> callback, string master)
        {
            _node = node;
            _topic = topic;
            _callback = callback;
            _options = new SubscriberOptions { Callbacks = CallbackMode.Update, Master = master };
        }

        /// <summary>Subscribe, unless already subscribed.</summary>
        public void Start()
        {
            if (_subscription == null)
            {
                _subscription = _node.Subscribe(_topic, message => _callback(message.Text), "json", _options);
            }
        }

        /// <summary>Unsubscribe.</summary>
        public void Stop()
        {
            Subscription subscription = Interlocked.Exchange(ref _subscription, null);
            if (subscription != null)
            {
                subscription.Dispose();
            }
        }

        /// <summary>Call the function for all queued messages.</summary>
        public void UpdateMessage()
        {
            Subscription subscription = _subscription;
            while (subscription != null && subscription.RunOne())
            {
            }
        }

        /// <summary>Same as <see cref="Stop"/>.</summary>
        public void Dispose()
        {
            Stop();
        }
    }
}
