using System;
using System.Collections.Generic;
using Nep;

/// <summary>Prints the messages of the topic "counter" until Enter is pressed.</summary>
internal static class Listener
{
    private static void Main()
    {
        using (var node = new Node("csharp_listener"))
        using (Subscription subscription = node.Subscribe("counter", Print))
        {
            Console.WriteLine("Press Enter to end.");
            Console.ReadLine();
            Console.WriteLine(subscription.Subscriber.Received + " received, " + subscription.Subscriber.Lost + " lost");
        }
    }

    private static void Print(Message message)
    {
        var counter = message.As<Dictionary<string, object>>();
        Console.WriteLine(message.Sequence + ": " + counter["ticks"]);
    }
}
