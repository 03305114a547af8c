using System;
using System.Text;
using System.Threading;
using Nep;

/// <summary>Publishes on a topic and exits, or prints a number of messages of each topic, with the calls of listings 9 and 10.</summary>
internal static class Directions
{
    private static readonly object Output = new object();

    private sealed class Msg
    {
        public int number { get; set; }
        public string message { get; set; }
    }

    private static void Main(string[] args)
    {
        Console.OutputEncoding = new UTF8Encoding(false);
        int count = int.Parse(args[1]);
        if (args[0] == "talk")
        {
            Talk(args[2], count);
            return;
        }
        Nep.Node node = new Nep.Node("csharp_receiver");
        var threads = new Thread[args.Length - 2];
        for (int i = 0; i < threads.Length; i++)
        {
            string topic = args[i + 2];
            Nep.Subscriber sub = node.new_sub(topic);
            threads[i] = new Thread(() => Listen(sub, topic, count));
            threads[i].Start();
        }
        foreach (Thread thread in threads)
        {
            thread.Join();
        }
    }

    private static void Talk(string topic, int count)
    {
        Nep.Node node = new Nep.Node("csharp_sender");
        Nep.Publisher pub = node.new_pub(topic, "json");
        for (int number = 0; number < count; number++)
        {
            Msg msg = new Msg();
            msg.number = number;
            msg.message = new string('x', number * 2000) + "grüß\n\"🤖\"";
            pub.publish(msg);
        }
    }

    private static void Listen(Nep.Subscriber sub, string topic, int count)
    {
        for (int number = 0; number < count; number++)
        {
            string msg = sub.listen();
            lock (Output)
            {
                Console.WriteLine("[\"" + topic + "\"," + msg + "]");
            }
        }
    }
}
