using System;
using System.Collections.Generic;
using Nep.Wire;
using Nep.Zmtp;

namespace Nep.Session
{
    /// <summary>Record of a node, sent to the master.</summary>
    internal sealed class NodeRecord
    {
        public string Id;
        public string Name;
        public string Host;
        public int? Pid;
        public ulong SinceNs;
        public string Key;

        public Dictionary<object, object> ToMap()
        {
            return new Dictionary<object, object>
            {
                { "id", Id }, { "name", Name }, { "host", Host }, { "pid", Pid }, { "language", "C#" }, { "since_ns", SinceNs }, { "key", Key },
                { "computer", ComputerId.Get() },
            };
        }
    }

    /// <summary>Record of a publisher.</summary>
    internal sealed class PublisherRecord
    {
        public ulong Id;
        public string Topic;
        public string MsgType;
        public string Codec;
        public List<string> Endpoints = new List<string>();
        public bool IsLatched;
        public long Number;
        public int History;

        public Dictionary<object, object> ToMap()
        {
            var map = new Dictionary<object, object>
            {
                { "id", Id }, { "topic", Topic }, { "msg_type", MsgType }, { "codec", Codec }, { "endpoints", Endpoints }, { "number", Number },
            };
            if (IsLatched)
            {
                map["latched"] = true;
            }
            if (History > 0)
            {
                map["history"] = History;
            }
            return map;
        }

        public static PublisherRecord Read(Fields fields)
        {
            var record = new PublisherRecord();
            record.Id = fields.Unsigned("id", 0);
            record.Topic = fields.Text("topic", null);
            record.MsgType = fields.Text("msg_type", null);
            record.Codec = fields.Text("codec", null);
            record.Endpoints = fields.Texts("endpoints");
            record.IsLatched = fields.Flag("latched");
            record.History = (int)Math.Min(int.MaxValue, fields.Unsigned("history", 0));
            return record;
        }
    }

    /// <summary>Record of a subscriber.</summary>
    internal sealed class SubscriberRecord
    {
        public ulong Id;
        public string Topic;
        public string MsgType;
        public long Number;
        public bool IsPattern;

        public Dictionary<object, object> ToMap()
        {
            var map = new Dictionary<object, object> { { "id", Id }, { "topic", Topic }, { "msg_type", MsgType }, { "number", Number } };
            if (IsPattern)
            {
                map["pattern"] = true;
            }
            return map;
        }
    }

    /// <summary>Publisher with its node and the endpoint at which this node reaches it.</summary>
    internal sealed class RemotePublisher
    {
        public PublisherRecord Publisher;
        public string NodeId;
        public string NodeName;

        /// <summary>True if the publisher is on this computer, with the same clock.</summary>
        public bool IsHere;

        /// <summary>Endpoint to connect to, or null if this node can't reach any.</summary>
        public string Endpoint;

        public static RemotePublisher Read(Fields fields, MasterAddress master)
        {
            var remote = new RemotePublisher();
            remote.Publisher = PublisherRecord.Read(fields.Map("publisher"));
            remote.NodeId = fields.Text("node_id", "");
            remote.NodeName = fields.Text("node_name", null);
            remote.IsHere = IsOnThisComputer(fields.Text("computer", ""), remote.Publisher.Endpoints);
            remote.Endpoint = Nearest(remote.Publisher.Endpoints, master);
            return remote;
        }

        private static bool IsOnThisComputer(string computer, List<string> endpoints)
        {
            ZmtpEndpoint first;
            if (computer.Length > 0 && ComputerId.Get().Length > 0)
            {
                return computer == ComputerId.Get();
            }
            return endpoints.Count > 0 && ZmtpEndpoint.TryParse(endpoints[0], out first) && first.IsLoopback; // an older program
        }

        private static string Nearest(List<string> endpoints, MasterAddress master)
        {
            foreach (string each in endpoints)
            {
                ZmtpEndpoint endpoint;
                if (!ZmtpEndpoint.TryParse(each, out endpoint))
                {
                    continue; // another transport, or invalid
                }
                if (master.IsNear ? endpoint.Host == MasterAddress.Loopback : !endpoint.IsLoopback)
                {
                    return endpoint.Host == "0.0.0.0" ? ZmtpEndpoint.Format(master.Host, endpoint.Port) : each;
                }
            }
            ZmtpEndpoint first;
            return master.IsNear && endpoints.Count > 0 && ZmtpEndpoint.TryParse(endpoints[0], out first) ? endpoints[0] : null;
        }
    }

    /// <summary>Subscriber for whose connection a new publisher waits.</summary>
    internal sealed class ExpectedSubscriber
    {
        public ulong Id;
        public string NodeName;

        public static List<ExpectedSubscriber> ReadAll(List<object> list)
        {
            var all = new List<ExpectedSubscriber>();
            foreach (object each in list)
            {
                var fields = new Fields(each);
                all.Add(new ExpectedSubscriber { Id = fields.Unsigned("id", 0), NodeName = fields.Text("node_name", null) });
            }
            return all;
        }
    }
}
