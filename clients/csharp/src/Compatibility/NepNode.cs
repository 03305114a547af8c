using System;
using System.Collections.Generic;
using System.ComponentModel;
using System.IO;
using System.Threading;

namespace Nep
{
    /// <summary>Node with the names of the original library 0.0.0.5. New programs use <see cref="Node"/>.</summary>
    [EditorBrowsable(EditorBrowsableState.Never)]
    public sealed class NepNode : IDisposable
    {
        private readonly Node _node;
        private readonly List<NepCallback> _callbacks = new List<NepCallback>();

        /// <summary>Create a node.</summary>
        /// <param name="name">Name in the graph.</param>
        public NepNode(string name)
        {
            _node = new Node(name);
        }

        /// <summary>Configuration for a master on another computer.</summary>
        /// <param name="masterIp">Its address, <c>HOST</c> or <c>HOST:PORT</c>.</param>
        public NepConfiguration Hybrid(string masterIp = null)
        {
            return new NepConfiguration(masterIp);
        }

        /// <summary>Same as <see cref="Hybrid"/>.</summary>
        /// <param name="masterIp">Its address, <c>HOST</c> or <c>HOST:PORT</c>.</param>
        public NepConfiguration Master(string masterIp = null)
        {
            return new NepConfiguration(masterIp);
        }

        /// <summary>Create a publisher.</summary>
        public NepPublisher NewPub(string topic, string msgType, NepConfiguration configuration = null)
        {
            var options = new PublisherOptions { Master = NepConfiguration.MasterOf(configuration) };
            return new NepPublisher(_node.CreatePublisher(topic, msgType, options));
        }

        /// <summary>Create a subscriber.</summary>
        public NepSubscriber NewSub(string topic, string msgType, NepConfiguration configuration = null)
        {
            var options = new SubscriberOptions { Master = NepConfiguration.MasterOf(configuration) };
            return new NepSubscriber(_node.CreateSubscriber(topic, msgType, options));
        }

        /// <summary>Call a function with the text of each message, in <see cref="Update"/>.</summary>
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

        /// <summary>Run the callbacks of all messages that wait. Call it once a frame.</summary>
        public void Update()
        {
            List<NepCallback> all;
            lock (_callbacks)
            {
                all = new List<NepCallback>(_callbacks);
            }
            all.ForEach(each => each.UpdateMessage());
        }

        /// <summary>Close with all publishers, subscribers and callbacks.</summary>
        public void Close()
        {
            _node.Close();
        }

        /// <summary>Same as <see cref="Close"/>.</summary>
        public void Dispose()
        {
            Close();
        }
    }

    /// <summary>Which master a publisher or subscriber registers with.</summary>
    [EditorBrowsable(EditorBrowsableState.Never)]
    public sealed class NepConfiguration
    {
        private readonly string _master;

        internal NepConfiguration(string master)
        {
            _master = master;
        }

        internal static string MasterOf(NepConfiguration configuration)
        {
            return configuration == null ? null : configuration._master;
        }
    }

    /// <summary>Publisher of a <see cref="NepNode"/>.</summary>
    [EditorBrowsable(EditorBrowsableState.Never)]
    public sealed class NepPublisher : IDisposable
    {
        private readonly Publisher _publisher;

        internal NepPublisher(Publisher publisher)
        {
            _publisher = publisher;
        }

        /// <summary>Publish an object.</summary>
        public void Publish(object message)
        {
            _publisher.Publish(message);
        }

        /// <summary>Publish text, or JSON text on a topic of type <c>json</c>.</summary>
        public void SendString(string message)
        {
            if (_publisher.Type == "string")
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
            _publisher.PublishImage(image.ToArray());
        }

        /// <summary>Publish a JPEG or PNG file on a topic of type <c>image</c>.</summary>
        public void SendImageBytes(byte[] image)
        {
            _publisher.PublishImage(image);
        }

        /// <summary>Close.</summary>
        public void Dispose()
        {
            _publisher.Close();
        }
    }

    /// <summary>Subscriber of a <see cref="NepNode"/>.</summary>
    [EditorBrowsable(EditorBrowsableState.Never)]
    public sealed class NepSubscriber : IDisposable
    {
        private readonly Subscriber _subscriber;

        internal NepSubscriber(Subscriber subscriber)
        {
            _subscriber = subscriber;
        }

        /// <summary>Return whether a message is there, and its JSON or text (empty when there is none).</summary>
        public bool Listen(out string message)
        {
            message = "";
            return _subscriber.listenNB(ref message);
        }

        /// <summary>Wait for the next message and return its JSON or text.</summary>
        public string BlockingListen()
        {
            return _subscriber.listen();
        }

        /// <summary>Close; a waiting <see cref="BlockingListen"/> returns an empty text.</summary>
        public void Dispose()
        {
            _subscriber.Close();
        }
    }

    /// <summary>Callback of a <see cref="NepNode"/>; every message is delivered, in the thread that calls <see cref="UpdateMessage"/>.</summary>
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

        /// <summary>Subscribe, unless it has already.</summary>
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

        /// <summary>Call the function for all messages that wait.</summary>
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
