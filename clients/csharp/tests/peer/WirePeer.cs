using System;
using System.Collections.Generic;
using System.Globalization;
using Nep.Session;
using Nep.Wire;
using Newtonsoft.Json.Linq;

/// <summary>Decodes and encodes the shared vectors, one per line. See tests/clients/test_csharp_vectors.py.</summary>
internal static class WirePeer
{
    private static int Main()
    {
        string line;
        while ((line = Console.In.ReadLine()) != null)
        {
            string[] words = line.Split(' ');
            JToken answer;
            try
            {
                answer = Answer(words);
            }
            catch (WireException exception)
            {
                answer = new JObject();
                answer["error"] = exception.Code;
            }
            catch (Nep.PayloadException exception)
            {
                answer = new JObject();
                answer["error"] = exception.Message;
            }
            Console.Out.WriteLine(answer.ToString(Newtonsoft.Json.Formatting.None));
            Console.Out.Flush();
        }
        return 0;
    }

    private static JToken Answer(string[] words)
    {
        switch (words[0])
        {
            case "message":
                var all = new JArray();
                foreach (WireMessage each in WireReader.Read(Parts(words)))
                {
                    all.Add(Show(each));
                }
                return all;
            case "filter":
                return ShowFilter(FromHex(words[1]));
            case "header":
                Header header = Header.Read(FromHex(words[1]), 0, words[1].Length / 2);
                var notice = new JObject();
                Show(header, notice);
                return notice;
            case "pack":
                return ToHex(MessagePackWriter.Write(MessagePackReader.ReadOnly(new ArraySegment<byte>(FromHex(words[1])))));
            case "id":
                string key = words[1] == "e9" ? "\u00e9" : words[1];
                return words.Length == 2 ? Ids.NodeId(key) : Ids.Id(key, long.Parse(words[2], CultureInfo.InvariantCulture)).ToString(CultureInfo.InvariantCulture);
            case "computer":
                return ComputerId.Get();
            case "clock":
                return Clocks(words);
            case "loss":
                return Losses(words);
            case "image":
                return JToken.FromObject(Nep.ImageHeader.Describe(FromHex(words[1])));
            default:
                throw new WireException("malformed");
        }
    }

    /// <summary>Applies steps to the losses of a new subscriber; returns what each step returned, then received and lost messages.</summary>
    private static JToken Losses(string[] words)
    {
        var sources = new HeardPublishers();
        var results = new JArray();
        for (int i = 1; i < words.Length; i++)
        {
            string[] step = words[i].Split(':');
            ulong publisher = ulong.Parse(step[1], CultureInfo.InvariantCulture);
            ulong number = ulong.Parse(step[2], CultureInfo.InvariantCulture);
            try
            {
                results.Add(Lose(sources, step[0], publisher, number));
            }
            catch (WireException exception)
            {
                results.Add(exception.Code);
            }
        }
        results.Add(sources.Received);
        results.Add(sources.Lost);
        return results;
    }

    /// <summary>Applies steps to samples of a clock that the steps set: wall, steady, and what a renewal said.</summary>
    private static JToken Clocks(string[] words)
    {
        long wall = 0, steady = 0;
        var samples = new ClockSamples(() => wall, () => steady, 1);
        Moment sent = samples.Now();
        var results = new JArray();
        for (int i = 1; i < words.Length; i++)
        {
            string[] step = words[i].Split(':');
            long first = long.Parse(step[1], CultureInfo.InvariantCulture), second = long.Parse(step[2], CultureInfo.InvariantCulture);
            switch (step[0])
            {
                case "now":
                    wall = first;
                    steady = second;
                    sent = samples.Now();
                    break;
                case "later":
                    wall = first;
                    steady = second;
                    break;
                case "add":
                    results.Add(samples.Add(sent, first, second, samples.Now()));
                    break;
                case "forget":
                    samples.Forget();
                    break;
            }
            long offsetNs, uncertaintyNs;
            results.Add(samples.TryGetOffset(out offsetNs, out uncertaintyNs) ? offsetNs + " " + uncertaintyNs : "");
        }
        return results;
    }

    private static JToken Lose(HeardPublishers sources, string step, ulong publisher, ulong number)
    {
        switch (step)
        {
            case "listed":
                var record = new PublisherRecord { Id = publisher, History = (int)number };
                sources.Listed(new RemotePublisher { Publisher = record });
                return null;
            case "expect":
                sources.ExpectAllOf(publisher);
                return null;
            case "arrived":
                return sources.Arrived(publisher, number, false);
            case "alone":
                return sources.Arrived(publisher, number, true);
            case "early":
                return sources.IsEarly(publisher);
            case "reached":
                return sources.Reached(publisher, number);
            case "promised":
                sources.PromisedBy(publisher, number);
                return null;
            case "closing":
                sources.Closing(publisher, number);
                return null;
            case "lapsed":
                sources.Lapsed(publisher, number);
                return null;
            case "settle":
                sources.Settle(publisher);
                return null;
            case "dropped":
                sources.Dropped((int)number);
                return null;
            default:
                sources.Remove(publisher);
                return null;
        }
    }

    private static byte[][] Parts(string[] words)
    {
        var parts = new byte[words.Length - 1][];
        for (int i = 1; i < words.Length; i++)
        {
            parts[i - 1] = FromHex(words[i].Substring(1)); // after a mark, because a part may be empty
        }
        return parts;
    }

    private static JObject Show(WireMessage message)
    {
        var shown = new JObject();
        shown["topic"] = message.Topic;
        Show(message.Header, shown);
        var payload = new byte[message.Payload.Count];
        Buffer.BlockCopy(message.Payload.Array, message.Payload.Offset, payload, 0, payload.Length);
        shown["payload"] = ToHex(payload);
        shown["extension"] = message.Extension == null ? "" : ToHex(MessagePackWriter.Write(message.Extension));
        shown["header"] = ToHex(message.Header.ToBytes());
        shown["first"] = ToHex(Names.TopicPart(message.Topic));
        return shown;
    }

    private static void Show(Header header, JObject shown)
    {
        shown["codec"] = header.Codec;
        shown["flags"] = header.Flags;
        shown["size"] = header.PayloadSize;
        shown["seq"] = header.Seq.ToString(CultureInfo.InvariantCulture);
        shown["stamp_ns"] = header.StampNs.ToString(CultureInfo.InvariantCulture);
        shown["publisher"] = header.Publisher.ToString(CultureInfo.InvariantCulture);
        shown["header"] = ToHex(header.ToBytes());
    }

    private static JObject ShowFilter(byte[] filter)
    {
        var shown = new JObject();
        Hello hello;
        ReadAnswer read;
        if (Filters.TryParseHello(filter, out hello))
        {
            shown["kind"] = "hello";
            shown["subscriber"] = hello.Subscriber.ToString(CultureInfo.InvariantCulture);
            shown["topic"] = hello.Topic;
            shown["level"] = hello.Level;
            shown["again"] = ToHex(Filters.Hello(hello.Subscriber, hello.Topic, hello.Level));
        }
        else if (Filters.TryParseRead(filter, out read))
        {
            shown["kind"] = "read";
            shown["subscriber"] = read.Subscriber.ToString(CultureInfo.InvariantCulture);
            shown["publisher"] = read.Publisher.ToString(CultureInfo.InvariantCulture);
            shown["seq"] = read.Seq.ToString(CultureInfo.InvariantCulture);
            shown["again"] = ToHex(Filters.Read(read));
        }
        else if (Filters.IsShares(filter))
        {
            shown["kind"] = "shares";
        }
        else if (filter[0] == 0xFF)
        {
            throw new WireException("filter");
        }
        else
        {
            shown["kind"] = "topic";
            shown["topic"] = Names.ReadTopicPart(filter, filter.Length);
        }
        return shown;
    }

    private static byte[] FromHex(string text)
    {
        var bytes = new byte[text.Length / 2];
        for (int i = 0; i < bytes.Length; i++)
        {
            bytes[i] = byte.Parse(text.Substring(2 * i, 2), NumberStyles.HexNumber, CultureInfo.InvariantCulture);
        }
        return bytes;
    }

    private static string ToHex(byte[] bytes)
    {
        return BitConverter.ToString(bytes).Replace("-", "").ToLowerInvariant();
    }
}
