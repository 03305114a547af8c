using System;
using System.Collections.Generic;
using Nep;

/// <summary>Direct connections with the names of 0.0.0.5. Arguments: ports of its publisher, of its subscriber, of a server.</summary>
internal static class DirectNames
{
    private static void Main(string[] ports)
    {
        using (var node = new NepNode("direct_names"))
        {
            NepPublisher publisher = node.NewPub("out", "json", node.Direct("127.0.0.1", ports[0], "one2many"));
            NepSubscriber subscriber = node.NewSub("in", "json", node.Manual("127.0.0.1", int.Parse(ports[1])));
            Console.WriteLine("ready");
            string heard = subscriber.BlockingListen();
            while (Console.ReadLine() == "again") // until the other side has subscribed
            {
                publisher.SendString(heard);
                Console.WriteLine("sent");
            }
            var client = new NepClient("127.0.0.1", ports[2]);
            client.SendInfo(new Dictionary<string, int> { { "n", 1 } });
            Console.WriteLine(client.ListenInfo());
            client.SendInfo(new Dictionary<string, int> { { "n", 2 } });
            Console.WriteLine(client.ListenInfo());
            client.Close();
            try
            {
                node.Direct("127.0.0.1", "9000", "many2one");
            }
            catch (NotSupportedException)
            {
                Console.WriteLine("refused");
            }
        }
    }
}
