using System;
using System.Collections.Generic;
using System.Diagnostics;
using System.Net;
using System.Threading;
using Nep.Session;
using Nep.Wire;

namespace Nep
{
    /// <summary>Participant in a NEP network. Thread-safe.</summary>
    /// <remarks>
    /// All threads of a node are background threads. Nodes that are open when the process exits are closed, so that published
    /// messages are delivered.
    /// </remarks>
    public sealed partial class Node : IDisposable
    {
        private const int HandshakeMs = 500;
        private const int LeaveMs = 300;
        private const int ExitMs = 1000;
        internal const string ServicePrefix = "nep.service:";
        private static readonly HashSet<Node> Open = new HashSet<Node>();
        private static bool _closesAtExit;

        private readonly object _lock = new object();
        private readonly NodeOptions _options;
        private readonly NodeRecord _record;
        private readonly Dictionary<string, MasterSession> _sessions = new Dictionary<string, MasterSession>();
        private readonly Dictionary<ISessionPublisher, MasterSession> _publishers = new Dictionary<ISessionPublisher, MasterSession>();
        private readonly Dictionary<ISessionSubscriber, MasterSession> _subscribers = new Dictionary<ISessionSubscriber, MasterSession>();
        private readonly List<Subscription> _subscriptions = new List<Subscription>();
        private long _numbers;
        private bool _isClosed;

        /// <summary>Create a node. It registers with the master when its first publisher or subscriber is created.</summary>
        /// <param name="name">Name in the graph, 1 to 200 bytes of UTF-8 without control characters.</param>
        /// <exception cref="ArgumentException">The name is invalid.</exception>
        public Node(string name) : this(name, new NodeOptions())
        {
        }

        /// <summary>Create a node with options.</summary>
        /// <param name="name">Name in the graph, 1 to 200 bytes of UTF-8 without control characters.</param>
        /// <param name="options">Options, which must not be changed afterwards.</param>
        /// <exception cref="ArgumentException">The name is invalid.</exception>
        public Node(string name, NodeOptions options)
        {
            if (!Names.IsNodeName(name))
            {
                throw new ArgumentException("The name of a node must have 1 to 200 bytes and no control characters.", "name");
            }
            _options = options;
            string key = Ids.NewKey();
            _record = new NodeRecord
            {
                Id = Ids.NodeId(key),
                Name = name,
                Host = HostName(),
                Pid = ProcessId(),
                SinceNs = Clock.NowNs,
                Key = key,
            };
            lock (Open)
            {
                Open.Add(this);
                if (!_closesAtExit)
                {
                    _closesAtExit = true;
                    AppDomain.CurrentDomain.ProcessExit += OnExit;
                    AppDomain.CurrentDomain.DomainUnload += OnExit;
                }
            }
        }

        /// <summary>Raised when a callback has thrown an exception, in the thread of the callback.</summary>
        public event EventHandler<UnhandledExceptionEventArgs> CallbackFailed;

        /// <summary>Name in the graph.</summary>
        public string Name
        {
            get { return _record.Name; }
        }

        /// <summary>Create a publisher. Its first message reaches every subscriber that was created before.</summary>
        /// <param name="topic">Topic, 1 to 200 bytes of UTF-8 without white space, control characters or <c>{</c>.</param>
        /// <param name="type"><c>json</c>, <c>string</c>, <c>bytes</c>, <c>msgpack</c>, <c>image</c>, or the name of a type that is encoded as JSON.</param>
        /// <param name="options">Options, or null for the defaults.</param>
        /// <exception cref="ArgumentException">The topic is invalid.</exception>
        /// <exception cref="MasterUnreachableException">No master replied before the timeout.</exception>
        /// <exception cref="ObjectDisposedException">The node is closed.</exception>
        public Publisher CreatePublisher(string topic, string type = "json", PublisherOptions options = null)
        {
            CheckTopic(topic);
            options = options ?? new PublisherOptions();
            if (options.History < 0 || options.History > 10000)
            {
                throw new ArgumentException("The history must be 0 to 10 000 messages.", "options");
            }
            Codec codec = Codec.For(type);
            PublisherRecord record = PublisherRecordOf(topic, type, codec.Name);
            record.IsLatched = options.Latched || options.History > 0;
            record.History = options.History;
            MasterSession session = SessionOf(options.Master);
            var socket = new PublisherSocket(record, codec.Number);
            List<ExpectedSubscriber> missing = socket.WaitFor(Register(socket, session), HandshakeMs);
            if (missing.Count > 0)
            {
                session.ReportMissing(record.Id, missing.ConvertAll(each => each.Id));
            }
            return new Publisher(this, socket, codec, missing.ConvertAll(each => each.NodeName));
        }

        /// <summary>Create a subscriber. It receives the next message of every registered publisher.</summary>
        /// <param name="topic">
        /// Topic, 1 to 200 bytes of UTF-8 without white space, control characters or <c>{</c>; or a pattern with levels <c>*</c> (any one
        /// level) or <c>**</c> (any number of levels), such as <c>robot/*/camera</c>.
        /// </param>
        /// <param name="type">Expected type. Messages are decoded by their own codec.</param>
        /// <param name="options">Options, or null for the defaults.</param>
        /// <exception cref="ArgumentException">The topic is invalid.</exception>
        /// <exception cref="MasterUnreachableException">No master replied before the timeout.</exception>
        /// <exception cref="ObjectDisposedException">The node is closed.</exception>
        public Subscriber CreateSubscriber(string topic, string type = "json", SubscriberOptions options = null)
        {
            CheckTopic(topic);
            options = options ?? new SubscriberOptions();
            if (options.MaxMessages < 1 || options.MaxBytes < 1)
            {
                throw new ArgumentException("The inbox must hold at least one message.", "options");
            }
            SubscriberRecord record = SubscriberRecordOf(topic, type);
            record.IsPattern = options.Wildcards && TopicPattern.IsPattern(topic);
            MasterSession session = SessionOf(options.Master);
            ISubscriberSocket socket = record.IsPattern
                ? (ISubscriberSocket)new PatternSocket(record, options)
                : new SubscriberSocket(record, new Inbox(options), true);
            Register(socket, session);
            socket.WaitForEchoes(HandshakeMs);
            return new Subscriber(this, socket);
        }

        /// <summary>Call a function with each message of a topic.</summary>
        /// <param name="topic">Topic, as for <see cref="CreateSubscriber"/>.</param>
        /// <param name="callback">Function to call; its exceptions raise <see cref="CallbackFailed"/>.</param>
        /// <param name="type">Expected type.</param>
        /// <param name="options">Options, or null for the defaults; <see cref="SubscriberOptions.Callbacks"/> selects the thread of the callback.</param>
        /// <exception cref="ArgumentException">The topic is invalid.</exception>
        /// <exception cref="MasterUnreachableException">No master replied before the timeout.</exception>
        /// <exception cref="ObjectDisposedException">The node is closed.</exception>
        public Subscription Subscribe(string topic, Action<Message> callback, string type = "json", SubscriberOptions options = null)
        {
            if (callback == null)
            {
                throw new ArgumentNullException("callback");
            }
            options = options ?? new SubscriberOptions();
            var made = new Subscription(this, CreateSubscriber(topic, type, options), callback, options.Callbacks);
            lock (_lock)
            {
                _subscriptions.Add(made);
            }
            return made;
        }

        /// <summary>Handle the calls of a service.</summary>
        /// <typeparam name="TRequest">Type of requests, as for <see cref="Message.As{T}"/>; <c>object</c> accepts all.</typeparam>
        /// <typeparam name="TAnswer">Type of replies.</typeparam>
        /// <param name="service">Name of the service, 1 to 188 bytes of UTF-8 without white space, control characters or <c>{</c>.</param>
        /// <param name="callback">Called in a background thread of the server; its exceptions are passed to the client.</param>
        /// <param name="threads">Number of threads that handle calls, at least 1.</param>
        /// <exception cref="ArgumentException">The name is invalid.</exception>
        /// <exception cref="MasterUnreachableException">No master replied before the timeout.</exception>
        /// <exception cref="ObjectDisposedException">The node is closed.</exception>
        public Server CreateServer<TRequest, TAnswer>(string service, Func<TRequest, TAnswer> callback, int threads = 1)
        {
            CheckTopic(ServicePrefix + service);
            if (callback == null || threads < 1)
            {
                throw new ArgumentException("A server needs a callback and at least one thread.");
            }
            MasterSession session = SessionOf(null);
            var socket = new ServerSocket(PublisherRecordOf(ServicePrefix + service, "service", "service"));
            Register(socket, session);
            return new Server(this, socket, (payload, codec) => Answer(callback, payload, codec), threads);
        }

        /// <summary>Create a client of a service; no server needs to exist yet.</summary>
        /// <param name="service">Name of the service, as for <see cref="CreateServer{TRequest, TAnswer}"/>.</param>
        /// <param name="type"><c>json</c> or <c>msgpack</c>.</param>
        /// <exception cref="ArgumentException">The name is invalid.</exception>
        /// <exception cref="MasterUnreachableException">No master replied before the timeout.</exception>
        /// <exception cref="ObjectDisposedException">The node is closed.</exception>
        public Client CreateClient(string service, string type = "json")
        {
            CheckTopic(ServicePrefix + service);
            Codec codec = Codec.For(type);
            MasterSession session = SessionOf(null);
            var socket = new ClientSocket(SubscriberRecordOf(ServicePrefix + service, "service"), service);
            Register(socket, session);
            return new Client(this, socket, codec);
        }

        /// <summary>Run pending callbacks of subscriptions with <see cref="CallbackMode.Update"/> in the calling thread.</summary>
        /// <param name="budget">Time after which no further callback is started.</param>
        /// <returns>Number of callbacks that were called.</returns>
        public int Update(TimeSpan budget)
        {
            Stopwatch watch = Stopwatch.StartNew();
            List<Subscription> subscriptions;
            lock (_lock)
            {
                subscriptions = new List<Subscription>(_subscriptions);
            }
            int count = 0;
            bool hasMore = true;
            while (hasMore)
            {
                hasMore = false;
                foreach (Subscription each in subscriptions) // in turn, so that a busy topic doesn't block the others
                {
                    if (count > 0 && watch.Elapsed >= budget)
                    {
                        return count;
                    }
                    if (each.RunOne())
                    {
                        count++;
                        hasMore = true;
                    }
                }
            }
            return count;
        }

        /// <summary>Close the node with all its publishers and subscribers, in at most <see cref="NodeOptions.CloseTimeout"/> plus 0.3 s.</summary>
        public void Close()
        {
            List<MasterSession> sessions;
            List<ISessionPublisher> publishers;
            List<ISessionSubscriber> subscribers;
            lock (_lock)
            {
                if (_isClosed)
                {
                    return;
                }
                _isClosed = true;
                sessions = new List<MasterSession>(_sessions.Values);
                publishers = new List<ISessionPublisher>(_publishers.Keys);
                subscribers = new List<ISessionSubscriber>(_subscribers.Keys);
            }
            lock (Open)
            {
                Open.Remove(this);
            }
            var deadline = new Deadline(TimeoutMs(_options.CloseTimeout));
            sessions.ForEach(each => each.BeginLeave());
            publishers.ForEach(each => each.BeginClose());
            sessions.ForEach(each => each.Close(LeaveMs));
            subscribers.ForEach(each => each.Close());
            publishers.ForEach(each => each.Finish(deadline.LeftMs));
        }

        /// <summary>Same as <see cref="Close()"/>.</summary>
        public void Dispose()
        {
            Close();
        }

        /// <summary>Close a publisher or a server.</summary>
        internal void Close(ISessionPublisher publisher)
        {
            MasterSession session;
            if (TryRemove(_publishers, publisher, out session))
            {
                session.RemovePublisher(publisher.Record.Id, publisher.LastSeq);
                publisher.BeginClose();
                publisher.Finish(TimeoutMs(_options.CloseTimeout));
            }
        }

        /// <summary>Close a subscriber or a client.</summary>
        internal void Close(ISessionSubscriber subscriber)
        {
            MasterSession session;
            if (TryRemove(_subscribers, subscriber, out session))
            {
                session.RemoveSubscriber(subscriber.Record.Id);
                subscriber.Close();
            }
        }

        internal void Forget(Subscription subscription)
        {
            lock (_lock)
            {
                _subscriptions.Remove(subscription);
            }
        }

        internal void OnCallbackError(Exception exception)
        {
            EventHandler<UnhandledExceptionEventArgs> handler = CallbackFailed;
            if (handler != null)
            {
                handler(this, new UnhandledExceptionEventArgs(exception, false));
            }
            else
            {
                Log.Warning("A callback failed: " + exception);
            }
        }

        private static byte[] Answer<TRequest, TAnswer>(Func<TRequest, TAnswer> callback, byte[] payload, Codec codec)
        {
            TRequest request;
            if (codec == null)
            {
                throw new RequestRefusedException("the call has an unknown codec");
            }
            try
            {
                request = codec.Decode<TRequest>(payload);
            }
            catch (PayloadException exception)
            {
                throw new RequestRefusedException(exception.Message);
            }
            return codec.Encode(callback(request));
        }

        private static void OnExit(object sender, EventArgs arguments)
        {
            CloseAll();
            BackgroundThread.JoinAll(ExitMs);
        }

        /// <summary>Close all nodes of this process.</summary>
        internal static void CloseAll()
        {
            List<Node> open;
            lock (Open)
            {
                open = new List<Node>(Open);
            }
            open.ForEach(each => each.Close());
        }

        private static void CheckTopic(string topic)
        {
            if (!Names.IsTopic(topic))
            {
                throw new ArgumentException("A topic must have 1 to 200 bytes without white space, control characters or '{'.", "topic");
            }
        }

        internal static int TimeoutMs(TimeSpan timeout)
        {
            return timeout < TimeSpan.Zero ? -1 : (int)Math.Min(int.MaxValue, timeout.TotalMilliseconds);
        }

        private static string HostName()
        {
            try
            {
                return Dns.GetHostName();
            }
            catch (Exception) // not available on some platforms of Unity
            {
                return "unknown";
            }
        }

        private static int? ProcessId()
        {
            try
            {
                return Process.GetCurrentProcess().Id;
            }
            catch (Exception) // not available with IL2CPP
            {
                return null;
            }
        }

        private PublisherRecord PublisherRecordOf(string topic, string type, string codec)
        {
            long number = Interlocked.Increment(ref _numbers);
            return new PublisherRecord { Id = Ids.Id(_record.Key, number), Number = number, Topic = topic, MsgType = type, Codec = codec };
        }

        private SubscriberRecord SubscriberRecordOf(string topic, string type)
        {
            long number = Interlocked.Increment(ref _numbers);
            return new SubscriberRecord { Id = Ids.Id(_record.Key, number), Number = number, Topic = topic, MsgType = type };
        }

        /// <summary>Bind a publisher or a server and register it, or close it on failure; return the expected subscribers.</summary>
        private List<ExpectedSubscriber> Register(ISessionPublisher socket, MasterSession session)
        {
            try
            {
                if (!socket.Move(session.Hosts()))
                {
                    throw new NepException("No port could be bound for '" + socket.Record.Topic + "'.");
                }
                List<ExpectedSubscriber> expected = session.AddPublisher(socket, TimeoutMs(_options.MasterTimeout));
                Keep(_publishers, socket, session);
                return expected;
            }
            catch
            {
                socket.Finish(0);
                throw;
            }
        }

        /// <summary>Register a subscriber or a client, or close it on failure.</summary>
        private void Register(ISessionSubscriber socket, MasterSession session)
        {
            try
            {
                session.AddSubscriber(socket, TimeoutMs(_options.MasterTimeout));
                Keep(_subscribers, socket, session);
            }
            catch
            {
                socket.Close();
                throw;
            }
        }

        private void Keep<T>(Dictionary<T, MasterSession> owned, T made, MasterSession session)
        {
            lock (_lock)
            {
                if (_isClosed)
                {
                    throw new ObjectDisposedException("Node"); // closed meanwhile
                }
                owned[made] = session;
            }
        }

        /// <summary>Remove an object before it is closed; return false if it was removed before.</summary>
        private bool TryRemove<T>(Dictionary<T, MasterSession> owned, T closing, out MasterSession session)
        {
            lock (_lock)
            {
                session = null;
                return !_isClosed && owned.TryGetValue(closing, out session) && owned.Remove(closing);
            }
        }

        private MasterSession SessionOf(string master)
        {
            MasterAddress address = MasterAddress.Parse(master ?? _options.Master);
            lock (_lock)
            {
                if (_isClosed)
                {
                    throw new ObjectDisposedException("Node");
                }
                MasterSession session;
                if (!_sessions.TryGetValue(address.ToString(), out session))
                {
                    _sessions[address.ToString()] = session = new MasterSession(_record, address);
                }
                return session;
            }
        }
    }
}
