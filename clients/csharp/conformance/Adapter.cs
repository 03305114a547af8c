using System;
using System.Collections.Generic;
using System.Globalization;
using System.Text;
using Nep;
using Newtonsoft.Json.Linq;

/// <summary>Adapter for <c>nep wire check</c>: carries out requests from stdin, replies on stdout; one JSON object per line.</summary>
internal static class Adapter
{
    private static readonly object Output = new object();
    private static readonly Dictionary<long, Publisher> Publishers = new Dictionary<long, Publisher>();
    private static readonly Dictionary<long, Subscriber> Subscribers = new Dictionary<long, Subscriber>();
    private static Node _node;
    private static long _last;

    private static int Main()
    {
        Console.InputEncoding = new UTF8Encoding(false);
        Console.OutputEncoding = new UTF8Encoding(false);
        string line;
        while ((line = Console.In.ReadLine()) != null)
        {
            JObject request = JObject.Parse(line);
            JObject answer;
            try
            {
                answer = Do(request);
            }
            catch (Exception exception)
            {
                answer = new JObject();
                answer["error"] = exception.Message;
            }
            answer["re"] = request["id"];
            Say(answer);
            if ((string)request["do"] == "close")
            {
                return 0;
            }
        }
        if (_node != null)
        {
            _node.Close();
        }
        return 0;
    }

    private static JObject Do(JObject request)
    {
        var answer = new JObject();
        switch ((string)request["do"])
        {
            case "features":
                answer["language"] = "C#";
                answer["version"] = "0.1.0";
                answer["features"] = new JArray("hello1", "hello2", "hello3", "losses", "latched", "history", "latest", "statistics", "keys", "services", "patterns");
                break;
            case "node":
                _node = new Node((string)request["name"]);
                break;
            case "publisher":
                AddPublisher(request, answer);
                break;
            case "publish":
                Publish(request);
                break;
            case "subscriber":
                AddSubscriber(request, answer);
                break;
            case "counts":
                Count(request, answer);
                break;
            case "close_publisher":
                Publishers[(long)request["pub"]].Close();
                break;
            case "close_subscriber":
                Subscribers[(long)request["sub"]].Close();
                break;
            case "serve":
                _node.CreateServer<JToken, JToken>((string)request["service"], value => value);
                break;
            case "call":
                using (Client client = _node.CreateClient((string)request["service"]))
                {
                    answer["value"] = client.Call<JToken>(request["value"], TimeSpan.FromSeconds((double)request["timeout_s"]));
                }
                break;
            case "close":
                _node.Close();
                break;
            default:
                throw new NotSupportedException("unknown request '" + (string)request["do"] + "'");
        }
        return answer;
    }

    private static void AddPublisher(JObject request, JObject answer)
    {
        var options = new PublisherOptions { Latched = (bool?)request["latched"] ?? false, History = (int?)request["history"] ?? 0 };
        Publisher made = _node.CreatePublisher((string)request["topic"], (string)request["type"], options);
        Publishers[++_last] = made;
        answer["pub"] = _last;
        answer["missing"] = new JArray(made.UnconnectedSubscribers);
    }

    private static void AddSubscriber(JObject request, JObject answer)
    {
        long number = ++_last;
        var options = new SubscriberOptions { KeepLatest = (bool?)request["latest"] ?? false, Wildcards = (bool?)request["pattern"] ?? false };
        Subscription made = _node.Subscribe((string)request["topic"], message => Report(number, message), (string)request["type"], options);
        Subscribers[number] = made.Subscriber;
        answer["sub"] = number;
    }

    private static void Publish(JObject request)
    {
        Publisher publisher = Publishers[(long)request["pub"]];
        int count = (int?)request["count"] ?? 1;
        for (int i = 1; i <= count; i++)
        {
            if (request["text"] != null)
            {
                publisher.Publish((string)request["text"]);
            }
            else if (request["bytes"] != null)
            {
                publisher.Publish(Convert.FromBase64String((string)request["bytes"]));
            }
            else
            {
                var map = request["value"] as JObject;
                if (map != null && request["count"] != null)
                {
                    map["n"] = i;
                }
                publisher.Publish(publisher.Type == "msgpack" ? Plain(request["value"]) : request["value"]);
            }
        }
    }

    private static void Count(JObject request, JObject answer)
    {
        if (request["sub"] != null)
        {
            Subscriber subscriber = Subscribers[(long)request["sub"]];
            answer["received"] = subscriber.Received.ToString(CultureInfo.InvariantCulture);
            answer["lost"] = subscriber.Lost.ToString(CultureInfo.InvariantCulture);
        }
        else
        {
            Publisher publisher = Publishers[(long)request["pub"]];
            answer["sent"] = publisher.Count.ToString(CultureInfo.InvariantCulture);
            answer["subscribers"] = publisher.SubscriberCount;
        }
    }

    private static void Report(long number, Message message)
    {
        var line = new JObject();
        line["event"] = "message";
        line["sub"] = number;
        line["topic"] = message.Topic;
        line["codec"] = message.Codec;
        line["seq"] = message.Sequence.ToString(CultureInfo.InvariantCulture);
        line["stamp_ns"] = message.StampNanoseconds.ToString(CultureInfo.InvariantCulture);
        line["publisher"] = message.PublisherId.ToString(CultureInfo.InvariantCulture);
        line["latency_s"] = message.Latency.TotalSeconds;
        line["latency_uncertainty_s"] = message.LatencyUncertainty == null ? null : (double?)message.LatencyUncertainty.Value.TotalSeconds;
        line["payload"] = Convert.ToBase64String(message.Payload);
        if (message.Codec == "json")
        {
            line["value"] = message.As<JToken>();
        }
        else if (message.Codec == "string")
        {
            line["value"] = message.Text;
        }
        else if (message.Codec == "msgpack")
        {
            try
            {
                line["value"] = Token(message.Value);
            }
            catch (NotSupportedException)
            {
                // not representable in JSON
            }
        }
        Say(line);
    }

    private static object Plain(JToken token)
    {
        if (token is JObject)
        {
            var map = new Dictionary<object, object>();
            foreach (KeyValuePair<string, JToken> each in (JObject)token)
            {
                map[each.Key] = Plain(each.Value);
            }
            return map;
        }
        if (token is JArray)
        {
            var list = new List<object>();
            foreach (JToken each in (JArray)token)
            {
                list.Add(Plain(each));
            }
            return list;
        }
        return ((JValue)token).Value;
    }

    private static JToken Token(object value)
    {
        if (value is Dictionary<object, object>)
        {
            var map = new JObject();
            foreach (KeyValuePair<object, object> each in (Dictionary<object, object>)value)
            {
                var name = each.Key as string;
                if (name == null)
                {
                    throw new NotSupportedException();
                }
                map[name] = Token(each.Value);
            }
            return map;
        }
        if (value is List<object>)
        {
            var list = new JArray();
            foreach (object each in (List<object>)value)
            {
                list.Add(Token(each));
            }
            return list;
        }
        bool isPlain = value == null || value is string || value is bool || value is long || value is ulong || value is double;
        if (!isPlain)
        {
            throw new NotSupportedException();
        }
        return new JValue(value);
    }

    private static void Say(JObject line)
    {
        lock (Output)
        {
            Console.Out.WriteLine(line.ToString(Newtonsoft.Json.Formatting.None));
            Console.Out.Flush();
        }
    }
}
