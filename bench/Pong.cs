using System;
using System.Collections.Generic;
using System.Text;
using System.Threading;
using Nep;
using Newtonsoft.Json;
using Newtonsoft.Json.Linq;

/// <summary>Pong of the row "nep with C#" (bench/paper_ends.py): decodes each message and publishes it again.</summary>
internal static class Pong
{
    private static readonly TimeSpan Timeout = TimeSpan.FromSeconds(20);
    private static readonly object Gate = new object();
    private static readonly Dictionary<string, int> Echoed = new Dictionary<string, int>();

    private static int Main(string[] args)
    {
        var types = JsonConvert.DeserializeObject<Dictionary<string, string>>(args[0]);
        Console.OutputEncoding = new UTF8Encoding(false);
        Write("{\"end\": \"\"}");
        string master = JsonConvert.DeserializeObject<string>(Console.ReadLine());
        using (var node = new Node("pong", new NodeOptions { Master = master }))
        {
            foreach (KeyValuePair<string, string> each in types)
            {
                Connect(node, each.Key, each.Value);
            }
            Write("{\"ready\": true}");
            string line;
            while ((line = Console.ReadLine()) != null)
            {
                JArray request = JArray.Parse(line);
                if (!WaitForEchoes((string)request[0], (int)request[2]))
                {
                    Write("{\"not run\": \"a message was not received\"}");
                    return 1;
                }
                Write("{\"taken\": []}");
            }
        }
        return 0;
    }

    private static void Connect(Node node, string kind, string type)
    {
        Echoed[kind] = 0;
        Publisher publisher = node.CreatePublisher("pong_" + kind, type);
        node.Subscribe("ping_" + kind, message => Echo(publisher, kind, message), type);
    }

    private static void Echo(Publisher publisher, string kind, Message message)
    {
        publisher.Publish(message.Value);
        lock (Gate)
        {
            Echoed[kind] += 1;
            Monitor.PulseAll(Gate);
        }
    }

    private static bool WaitForEchoes(string kind, int count)
    {
        lock (Gate)
        {
            while (Echoed[kind] < count)
            {
                if (!Monitor.Wait(Gate, Timeout))
                {
                    return false;
                }
            }
            Echoed[kind] -= count;
            return true;
        }
    }

    private static void Write(string line)
    {
        Console.WriteLine(line);
        Console.Out.Flush();
    }
}
