using System;
using System.Threading;
using Nep;

/// <summary>Reads one message every ten milliseconds; prints its counters for each line on stdin.</summary>
internal static class SlowReader
{
    private static void Main()
    {
        using (var node = new Node("slow"))
        {
            var options = new SubscriberOptions { MaxMessages = 100 };
            Subscription subscription = node.Subscribe("fast", message => Thread.Sleep(10), "json", options);
            Console.WriteLine("ready");
            while (Console.ReadLine() != null)
            {
                Console.WriteLine(subscription.Subscriber.Received + " " + subscription.Subscriber.Lost);
            }
        }
    }
}
